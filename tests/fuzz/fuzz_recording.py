"""Mutated recordings: `Episode.load` refuses each with a sigmaik.Error, or reads it, and then all of its methods work.

    python tests/fuzz/fuzz_recording.py [--seconds S] [--mutations N] [--seed K] [--found FOLDER] [FILE…]

FILE: mutated recordings of another run, to be tried again. The exit code is 1 where a property is broken; the file that
broke the property is in FOLDER.
"""

import argparse
import io
import json
import pathlib
import random
import struct
import sys
import tempfile
import time
import zipfile

import numpy as np

import sigmaik as sk
from sigmaik.teleop import Episode, Settings
from sigmaik.teleop.archive import MAGIC
from sigmaik.teleop.checks import sample_dtype
from sigmaik.teleop.episode import Arm

#: Values that break a careless reader.
HOSTILE = [0, 1, -1, 2**31, 2**63 - 1, float("nan"), float("inf"), -float("inf"), 1e308, -1e308, 5e-324, 1e9]


def recording(cycles=20):
    """An episode of a servo, without a loop's thread."""
    chain = sk.robots.load("ur10")
    home = sk.robots.home("ur10")
    settings = Settings()
    servo = settings.servo(chain, 1e-3, home)
    servo.reset(home)
    samples = np.zeros(cycles, sample_dtype(chain))
    before = (np.array(home, dtype=float), np.zeros(chain.dof))
    for k in range(cycles):
        step = servo.update_twist([0.0, 0.0, 0.05, 0.0, 0.0, 0.0])
        row = samples[k]
        row["cycle"], row["time"], row["command"] = k, 1e-3 * k, int(sk.LoopCommand.TWIST)
        row["status"], row["state"] = int(step.status), int(sk.LoopState.FOLLOWING)
        row["q"], row["qdot"], row["scale"] = step.q, step.qdot, 1.0
        row["pose"] = row["target"] = chain.pose(step.q)
        row["asked_twist"], row["achieved_twist"] = step.asked_twist, step.achieved_twist
    urdf = sk.robots.path("ur10").read_text(encoding="utf-8")
    return Episode(samples, Arm("ur10", urdf, chain, np.array(home, dtype=float)), 1e-3, {0: settings}, before)


def packed(arrays):
    stream = io.BytesIO()
    np.savez_compressed(stream, **arrays)
    return stream.getvalue()


def flipped(data, rng):
    """Bytes are changed, cut out, or cut off."""
    out = bytearray(data)
    for _ in range(rng.randint(1, 8)):
        at = rng.randrange(len(out))
        kind = rng.randrange(4)
        if kind == 0:
            out[at] = rng.randrange(256)
        elif kind == 1:
            del out[at : at + rng.randint(1, 64)]
        elif kind == 2:
            out[at:at] = bytes(rng.randrange(256) for _ in range(rng.randint(1, 16)))
        else:
            out[at : at + 8] = struct.pack("<q", rng.choice([0, -1, 1 << 40, 1 << 62]))
        if not out:
            return b"\0"
    return bytes(out[: rng.randrange(len(out))]) if rng.random() < 0.1 else bytes(out)


def changed_array(values, rng):
    """An array with other numbers, another type or another shape."""
    kind = rng.randrange(6)
    values = np.array(values)
    if kind == 0 and values.dtype.kind in "fiub" and values.size:
        flat = values.reshape(-1)
        with np.errstate(all="ignore"):
            flat[rng.randrange(flat.size)] = np.array(rng.choice(HOSTILE)).astype(values.dtype)
        return values
    if kind == 1:
        return values[: rng.randrange(len(values) + 1)] if values.ndim else np.array([])
    if kind == 2 and values.dtype.kind in "fiub":
        with np.errstate(all="ignore"):
            return values.astype(rng.choice(["f4", "f8", "i1", "i8", "u2", "?", "c16"]))
    if kind == 3:
        return values.T.copy()
    if kind == 4:
        return np.zeros(rng.choice([(), (0,), (3, 0, 2), (1, 1, 1, 1), (20,)]))
    return np.array(rng.choice(["", "<", "/etc/hostname", "{}", "[]", "null", "<robot name='r'/>", "\ud800", "NaN"]))


def changed_text(values, rng):
    """A text with characters changed: a damaged URDF, or damaged notes."""
    text = list(str(values))
    for _ in range(rng.randint(1, 4)):
        at = rng.randrange(len(text))
        text[at : at + rng.randint(0, 3)] = rng.choice(
            ['"', "{", "}", "0", "-1", "1e999", "null", "<", ">", "NaN", "\n", "é"]
        )
    return np.array("".join(text))


def mutated(arrays, whole, rng):
    """The bytes of a file, whose zip directory is sound in most cases."""
    if rng.random() < 0.25:
        return flipped(whole, rng)
    out = dict(arrays)
    for _ in range(rng.randint(1, 3)):
        name = rng.choice(sorted(out))
        if rng.random() < 0.1 and len(out) > 1:
            del out[name]
        elif out[name].dtype.kind == "U" and rng.random() < 0.7:
            out[name] = changed_text(out[name], rng)
        else:
            out[name] = changed_array(out[name], rng)
    if rng.random() < 0.1:  # a member with damaged bytes and a right check sum
        stream = io.BytesIO()
        with zipfile.ZipFile(io.BytesIO(packed(out))) as source, zipfile.ZipFile(stream, "w") as target:
            for member in source.namelist():
                data = source.read(member)
                target.writestr(member, flipped(data, rng) if rng.random() < 0.2 else data)
        return stream.getvalue()
    return packed(out)


def npy(values):
    stream = io.BytesIO()
    np.save(stream, values)
    return stream.getvalue()


def part_file(episode, rng):
    """The bytes of a recording that was cut off, with notes and samples changed."""
    limits = episode.arm.chain.limits
    note = {
        **json.loads(episode._meta()),
        "limits": {name: getattr(limits, name).tolist() for name in ("lower", "upper", "velocity", "acceleration")},
        "urdf": episode.arm.urdf,
        "joint_names": list(episode.arm.chain.joint_names),
        "home": episode.arm.home.tolist(),
        "before": np.stack(episode.before).tolist(),
    }
    for _ in range(rng.randint(0, 2)):
        note[rng.choice(sorted(note))] = rng.choice([None, 0, -1, "", [], {}, [[]], {"lower": 1}, 1e999, "<robot/>"])
    samples = episode.samples.copy()
    for _ in range(rng.randint(0, 2)):
        name = rng.choice(samples.dtype.names)
        values = changed_array(samples[name], rng)
        if values.shape == samples[name].shape and values.dtype.kind in "fiub":
            samples[name] = values
    text = npy(np.frombuffer(json.dumps(note).encode(), np.uint8))
    if rng.random() < 0.2:
        text = flipped(text, rng)
    data = npy(samples)
    if rng.random() < 0.3:
        data = flipped(data, rng)
    return MAGIC + b"".join(
        rng.choice([[text, data], [text, data, data], [data, text], [text, data, text, data], [text]])
    )


def broken(file):
    """Why the property is broken; None where the property holds."""
    try:
        episode = Episode.load(file)
    except (sk.Error, OSError):
        return None
    except BaseException as error:
        return f"load raised {type(error).__name__}: {error}"
    for method in (
        episode.broken_limits,
        episode.play,
        episode.check,
        lambda: (episode.gaps, episode.runs, episode.duration),
    ):
        try:
            method()
        except sk.Error:
            pass
        except BaseException as error:
            return f"{getattr(method, '__name__', 'a property')} raised {type(error).__name__}: {error}"
    return None


def run(seed=1, mutations=None, seconds=None, found=None):
    """How many files were tried, and the first fault: (count, reason or None)."""
    rng = random.Random(seed)
    episode = recording()
    with tempfile.TemporaryDirectory() as folder:
        file = pathlib.Path(folder) / "mutated.npz"
        episode.save(file)
        whole = file.read_bytes()
        with np.load(file) as data:
            arrays = dict(data)
        assert broken(file) is None
        start, count = time.monotonic(), 0
        while count != mutations and (seconds is None or time.monotonic() - start < seconds):
            with np.errstate(all="ignore"):
                file.write_bytes(part_file(episode, rng) if rng.random() < 0.25 else mutated(arrays, whole, rng))
            count += 1
            if reason := broken(file):
                if found is not None:
                    kept = pathlib.Path(found) / f"recording-{seed}-{count}.npz"
                    kept.parent.mkdir(parents=True, exist_ok=True)
                    kept.write_bytes(file.read_bytes())
                    reason = f"{kept}: {reason}"
                return count, reason
    return count, None


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("files", nargs="*", metavar="FILE")
    parser.add_argument("--seconds", type=float)
    parser.add_argument("--mutations", type=int)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--found", default="build/fuzz/found")
    args = parser.parse_args()
    if args.files:
        reasons = [f"{file}: {reason}" for file in args.files if (reason := broken(pathlib.Path(file)))]
        print("\n".join(reasons) or "every property holds")
        sys.exit(bool(reasons))
    if args.seconds is None and args.mutations is None:
        args.mutations = 1000
    count, reason = run(args.seed, args.mutations, args.seconds, args.found)
    print(f"{count} mutated recordings: {reason or 'every property holds'}")
    sys.exit(reason is not None)


if __name__ == "__main__":
    main()
