"""A recording: every cycle of a servo, with everything that a replay needs.

A recording as an npz file (numpy.load reads the file, without pickles) has an array of N rows for each field of
`ServoLoop.read`:

    cycle, time [s], command (0 hold, 1 pose, 2 twist, 3 stale), configuration, state (sigmaik.LoopState; -1
    in recordings of before), restarted, status (sigmaik.Status),
    q (N, n), qdot (N, n), target (N, 4, 4), pose (N, 4, 4), pose_error (N, 6), asked_twist (N, 6),
    achieved_twist (N, 6), singular_values (N, min(6, n)), singular (bits), singular_directions (N, 6, 6),
    limiting_joints (bits), scale, guide (sigmaik.GuideState), guide_joints (bits)

and joint_names, lower, upper, velocity, acceleration (n,) (the limits that the servo held), home (n,), before (2, n)
(q and q̇ before the first cycle), urdf (the arm's text), and meta: JSON with robot, base, tip, dt, settings (a
configuration's number to its settings) and version.

A recording that goes on is a file `.part`, written by `sigmaik.teleop.journal`; `Episode.load` reads such a file, too.
"""

from __future__ import annotations

import dataclasses
import json
import pathlib
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, BinaryIO

import numpy as np
from numpy.typing import NDArray

import sigmaik as sk
from sigmaik._types import Array
from sigmaik.files import write_atomically

from .archive import MAGIC, largest_unpacked, read_npz, read_parts
from .checks import check_motion, check_samples, fit_samples, sample_dtype
from .settings import Settings

__all__ = ["Arm", "Episode", "Gap"]
Samples = NDArray[np.void]

_LIMITS = ("lower", "upper", "velocity", "acceleration")
_NOTES = {*_LIMITS, "before", "joint_names", "home", "urdf", "meta"}
#: [cycles] A longer time between two cycles is a gap.
_GAP = 1.5


@dataclass(frozen=True)
class Arm:
    """The arm of a recording."""

    name: str
    urdf: str  #: text
    chain: sk.Chain  #: with the limits that the servo kept
    home: Array  #: (n,) the posture [rad or m]


@dataclass(frozen=True)
class Gap:
    """Time without a cycle."""

    row: int  #: of the first cycle after the gap
    seconds: float  #: [s] beyond one cycle
    lost: int  #: cycles that ran and were not recorded; 0: the loop left cycles out


@dataclass(frozen=True)
class Episode:
    """A recording of a `Session`."""

    samples: Samples  #: (N,) as `ServoLoop.read` gives them
    arm: Arm
    dt: float  #: [s]
    settings: Mapping[int, Settings]  #: of each configuration in `samples`
    before: tuple[Array, Array]  #: q and q̇ (n,) before the first cycle

    def __len__(self) -> int:
        return len(self.samples)

    def __getitem__(self, field: str) -> NDArray[Any]:
        """A field of all samples."""
        values: NDArray[Any] = self.samples[field]
        return values

    @property
    def duration(self) -> float:
        """[s] of the loop's clock, from the first cycle to the end of the last."""
        time = self["time"]
        return float(time[-1] - time[0]) + self.dt if len(self) else 0.0

    @property
    def gaps(self) -> list[Gap]:
        """Where the loop's clock went on by more than 1.5 cycles from one cycle to the next, or cycles are missing."""
        time, cycle = np.diff(self["time"]), np.diff(self["cycle"])
        rows = np.flatnonzero((time > _GAP * self.dt) | (cycle != 1))
        return [Gap(int(k) + 1, float(time[k]) - self.dt, int(cycle[k]) - 1) for k in rows]

    def check(self) -> None:
        """Error where the recording can be neither judged nor drawn nor replayed, with the field and the row."""
        check_samples(self.samples, self.dt, self.settings, self.arm.home, self.before)

    @property
    def runs(self) -> list[slice]:
        """Spans without a missing cycle and without a restart of the arm at another place."""
        cuts = np.flatnonzero((np.diff(self["cycle"]) != 1) | self["restarted"][1:]) + 1
        edges = [0, *cuts.tolist(), len(self)]
        return [slice(a, b) for a, b in zip(edges[:-1], edges[1:], strict=True)]

    def broken_limits(self) -> dict[str, int]:
        """The number of joints times cycles beyond a limit by more than rounding, while limits were on.

        The keys are position, velocity and acceleration. The first cycles after a start outside the limits count, too.
        Error where limits cannot be judged: no cycle, NaN, dt ≤ 0, a configuration without settings.
        """
        check_motion(self.samples, self.dt, self.settings)
        limits = self.arm.chain.limits
        settings = [self.settings[number] for number in self["configuration"].tolist()]
        on = np.array([s.limits for s in settings], dtype=bool)
        assumed = np.array([s.assumed_acceleration for s in settings])[:, None]
        acceleration = np.where(np.isfinite(limits.acceleration), limits.acceleration, assumed)
        q, qdot = self["q"], self["qdot"]
        beyond = (q < limits.lower - 1e-9) | (q > limits.upper + 1e-9)
        fast = np.abs(qdot) > limits.velocity * (1.0 + 1e-9)
        count = {"position": int(beyond[on].sum()), "velocity": int(fast[on].sum()), "acceleration": 0}
        for run in self.runs:
            change = np.abs(np.diff(qdot[run], axis=0)) / self.dt
            hard = change > acceleration[run][1:] * (1.0 + 1e-6)
            # The velocity before the limits were switched on is not bounded by them.
            count["acceleration"] += int(hard[on[run][1:] & on[run][:-1]].sum())
        return count

    def play(self) -> Array:
        """(N, n) the positions that a fresh servo commands for the same commands, cycle by cycle.

        On the machine that made the recording these positions equal the recorded positions, to the bit. Error
        where cycles are missing, or the recording is malformed.
        """
        self.check()
        out = np.empty_like(self["q"])
        servo: sk.Servo | None = None
        active, next_cycle = -1, int(self["cycle"][0])
        for k, sample in enumerate(self.samples):
            if sample["cycle"] != next_cycle:
                raise sk.Error(f"cycles {next_cycle} to {sample['cycle'] - 1} are missing")
            next_cycle += 1
            number = int(sample["configuration"])
            if number != active:
                fresh = self.settings[number].servo(self.arm.chain, self.dt, self.arm.home)
                if sample["restarted"]:
                    fresh.reset(sample["q"] - self.dt * sample["qdot"])
                elif servo is None:
                    fresh.reset(*self.before)
                else:
                    fresh.continue_from(servo)
                servo, active = fresh, number
            assert servo is not None
            command = sk.LoopCommand(int(sample["command"]))
            if command is sk.LoopCommand.POSE:
                step = servo.update(sample["target"])
            elif command is sk.LoopCommand.TWIST:
                step = servo.update_twist(sample["asked_twist"])
            else:
                step = servo.hold()
            out[k] = step.q
        return out

    # --- files

    def save(self, file: str | pathlib.Path) -> pathlib.Path:
        """Writes an npz file, whole or not at all. Returns its path."""
        return write_atomically(pathlib.Path(file), self._npz)

    @staticmethod
    def load(file: str | pathlib.Path, largest: int | None = None) -> Episode:
        """Reads an npz file, or the file of a recording that was cut off (`.part`).

        largest: [bytes] to which an npz file may unpack; None: 200 times its size, and 64 MiB in any case.
        Error where the file is no recording, is malformed or unpacks to more, with the reason. OSError where the file
        cannot be read.
        """
        path = pathlib.Path(file)
        try:
            with path.open("rb") as stream:
                cut_off = stream.read(len(MAGIC)) == MAGIC
            episode = _from_parts(path) if cut_off else _from_npz(path, largest)
            episode.check()
            return episode
        except (OSError, MemoryError):
            raise
        except Exception as error:  # a hostile file makes zipfile, json and numpy raise nearly anything
            raise sk.Error(f"{path}: not a recording of sigmaik: {' '.join(str(error).split())}") from None

    def _meta(self) -> str:
        return json.dumps(
            {
                "robot": self.arm.name,
                "base": self.arm.chain.base,
                "tip": self.arm.chain.tip,
                "dt": self.dt,
                "settings": {str(k): dataclasses.asdict(s) for k, s in self.settings.items()},
                "version": sk.__version__,
            }
        )

    def _npz(self, stream: BinaryIO) -> None:
        assert self.samples.dtype.names is not None
        limits = self.arm.chain.limits
        arrays: dict[str, Any] = {name: self.samples[name] for name in self.samples.dtype.names}
        arrays |= {name: getattr(limits, name) for name in _LIMITS}
        arrays |= {
            "before": np.stack(self.before),
            "joint_names": np.array(self.arm.chain.joint_names),
            "home": self.arm.home,
            "urdf": np.array(self.arm.urdf),
            "meta": np.array(self._meta()),
        }
        np.savez_compressed(stream, **arrays)
        # `load` refuses what is packed more densely.
        if sum(np.asarray(a).nbytes for a in arrays.values()) > 0.9 * largest_unpacked(stream.tell()):
            stream.seek(0)
            stream.truncate()
            np.savez(stream, **arrays)


def _from_npz(path: pathlib.Path, largest: int | None) -> Episode:
    names = set(sample_dtype(sk.robots.load("ur10")).names or ())  # the same for every arm
    data = read_npz(path, names | _NOTES, largest)
    missing = sorted(_NOTES - data.keys())
    if missing:
        raise sk.Error(f"it has no {', '.join(missing)}")
    meta = json.loads(str(data["meta"]))
    limits = {name: data[name] for name in _LIMITS}
    arm = _arm(meta, str(data["urdf"]), data["joint_names"].tolist(), limits, data["home"])
    arrays = {name: values for name, values in data.items() if name in names}
    return _episode(arm, meta, fit_samples(arrays, arm.chain), data["before"])


def _from_parts(path: pathlib.Path) -> Episode:
    notes, chunks = read_parts(path)
    limits = {name: np.array(notes["limits"][name], dtype=np.float64) for name in _LIMITS}
    arm = _arm(notes, notes["urdf"], notes["joint_names"], limits, np.array(notes["home"], dtype=np.float64))
    samples = np.concatenate(chunks)
    arrays = {name: samples[name] for name in samples.dtype.names or ()}
    if not arrays:
        raise sk.Error("its samples have no fields")
    return _episode(arm, notes, fit_samples(arrays, arm.chain), np.array(notes["before"], dtype=np.float64))


def _arm(meta: Mapping[str, Any], urdf: str, joints: list[str], limits: dict[str, Array], home: Array) -> Arm:
    if not urdf.lstrip().startswith("<"):
        raise sk.Error("urdf is not the text of a URDF")  # a path would be opened
    chain = sk.Chain.from_urdf(urdf, base=meta["base"], tip=meta["tip"]).with_limits(**limits)
    if tuple(joints) != tuple(chain.joint_names):
        raise sk.Error(f"joint_names are not those of its URDF, {', '.join(chain.joint_names)}")
    return Arm(str(meta["robot"]), urdf, chain, home)


def _episode(arm: Arm, meta: Mapping[str, Any], samples: Samples, before: Array) -> Episode:
    # A recording that says nothing of a guide is older than the guide: its servo had none.
    settings = {
        int(number): Settings(**{"guided": False, **values, "mask": tuple(values["mask"])})
        for number, values in meta["settings"].items()
    }
    if before.shape != (2, arm.chain.dof):
        raise sk.Error(f"before has shape {before.shape}, not {(2, arm.chain.dof)}")
    return Episode(samples, arm, float(meta["dt"]), settings, (before[0], before[1]))
