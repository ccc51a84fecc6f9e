"""Recordings: on disk while they go on, read back whatever ended the program, and refused where they are malformed."""

import io
import json
import os
import re
import resource
import signal
import subprocess
import sys
import time
import types
import zipfile

import numpy as np
import pytest

import sigmaik as sk
from sigmaik.teleop import Episode, Session, Settings, journal


def until(condition, seconds=20.0):
    """Waits for the condition; machines may be busy."""
    deadline = time.monotonic() + seconds
    while not condition():
        assert time.monotonic() < deadline, "it did not happen in time"
        time.sleep(0.01)


def record(file=None, cycles=200):
    with Session("ur10", rate=500.0) as session:
        until(lambda: len(session.read()))
        session.start_recording(file)
        session.twist([0.0, 0.0, 0.05, 0.0, 0.0, 0.0])
        until(lambda: (session.read(), session.recorded >= cycles)[1])
        session.configure(gain_linear=7.0)
        until(lambda: (session.read(), session.latest["configuration"] == session._from + 1)[1])
        return session.stop_recording()


@pytest.fixture(scope="module")
def episode():
    return record()


def changed(episode, **parts):
    """The episode with other samples of some fields, or another dt."""
    samples = episode.samples.copy()
    dt = parts.pop("dt", episode.dt)
    for name, value in parts.items():
        samples[name] = value
    return Episode(samples, episode.arm, dt, episode.settings, episode.before)


def same(a, b):
    """Whether two arrays of samples are the same, to the bit."""
    return a.dtype == b.dtype and a.tobytes() == b.tobytes()


def arrays_of(episode, tmp_path):
    with np.load(episode.save(tmp_path / "whole.npz")) as data:
        return {name: data[name] for name in data.files}


def refused(arrays, tmp_path, words):
    np.savez_compressed(tmp_path / "changed.npz", **arrays)
    with pytest.raises(sk.Error, match=words):
        Episode.load(tmp_path / "changed.npz")


# --- malformed and hostile files


@pytest.mark.parametrize(
    ("field", "value", "words"),
    [
        ("status", 99, "status 99 in row 0 is none of OK"),
        ("status", -1, "status -1"),
        ("command", 17, "command 17"),
        ("guide", 55, "guide 55"),
        ("state", 77, "state 77"),
        ("q", np.nan, "q has .* rows that are not finite"),
        ("qdot", np.inf, "qdot has"),
        ("pose", np.nan, "pose has"),
        ("pose", 0.0, "pose in row 0 is no pose"),
        ("target", 2.0, "target in row 0 is no pose"),
        ("time", np.nan, "time has"),
        ("time", -np.arange(1e6), "clock goes back"),
        ("cycle", 5, "cycles do not grow"),
        ("configuration", 1234, "no settings of configuration 1234"),
        ("singular_values", -1.0, "singular_values"),
        ("home", np.nan, "home must be 6 finite numbers"),
        ("before", np.inf, "before must be 6 finite numbers"),
        ("velocity", np.nan, "velocity"),
        ("lower", 10.0, "lower = 10 is above upper"),
    ],
)
def test_a_recording_with_wrong_numbers_is_refused_with_the_field(episode, tmp_path, field, value, words):
    arrays = arrays_of(episode, tmp_path)
    value = value[: len(arrays[field])] if np.ndim(value) else value
    refused({**arrays, field: np.full_like(arrays[field], value)}, tmp_path, words)


@pytest.mark.parametrize("name", ["q", "status", "time", "urdf", "meta", "before", "home", "lower", "joint_names"])
def test_a_recording_without_an_array_is_refused_with_its_name(episode, tmp_path, name):
    arrays = arrays_of(episode, tmp_path)
    del arrays[name]
    refused(arrays, tmp_path, f"has no {name}")


@pytest.mark.parametrize(
    ("name", "make", "words"),
    [
        ("q", lambda a: a[:, :5], "q has shape"),
        ("q", lambda a: a[:-1], "q has shape"),
        ("pose", lambda a: a[:, :3], "pose has shape"),
        ("cycle", lambda a: a.astype(float), "type float64"),
        ("q", lambda a: a.astype(complex), "type complex128"),
        ("status", lambda a: a.astype(np.int64) + 256, "status has a number that is no int8"),
        ("cycle", lambda a: a[0], "shape"),
        ("before", lambda a: a[0], "before has shape"),
        ("joint_names", lambda a: a[::-1], "joint_names"),
        ("meta", lambda a: np.array("{"), "recording"),
        ("meta", lambda a: np.array("[]"), "recording"),
        ("meta", lambda a: np.array("[" * 100_000), "recording"),
    ],
)
def test_a_recording_with_other_shapes_and_types_is_refused(episode, tmp_path, name, make, words):
    arrays = arrays_of(episode, tmp_path)
    refused({**arrays, name: make(arrays[name])}, tmp_path, words)


@pytest.mark.parametrize(
    ("key", "value", "words"),
    [
        ("dt", -1.0, "dt = -1"),
        ("dt", 0.0, "dt = 0"),
        ("dt", float("nan"), "dt = nan"),
        ("dt", 1e9, "dt = 1e"),
        ("settings", {}, "no settings of configuration"),
        ("settings", {"1": {"mask": [True] * 6, "gamma": float("nan")}}, "gamma"),
        ("settings", {"1": {"mask": [True] * 6, "colour": 1}}, "colour"),
        ("base", "nowhere", "nowhere"),
    ],
)
def test_a_recording_with_wrong_notes_is_refused(episode, tmp_path, key, value, words):
    arrays = arrays_of(episode, tmp_path)
    meta = {**json.loads(str(arrays["meta"])), key: value}
    refused({**arrays, "meta": np.array(json.dumps(meta))}, tmp_path, words)


@pytest.mark.parametrize("path", ["{robot}", "/etc/passwd", " /dev/zero", "file:///etc/passwd", ""])
def test_a_recording_whose_urdf_is_a_path_opens_no_file(episode, tmp_path, path):
    arrays = arrays_of(episode, tmp_path)
    path = path.format(robot=sk.robots.path("ur10"))
    refused({**arrays, "urdf": np.array(path)}, tmp_path, "urdf is not the text")


def bomb(file, name, megabytes, whole=()):
    """A zip with an array of zeros that unpacks to many megabytes."""
    header = io.BytesIO()
    np.lib.format.write_array_header_1_0(
        header, {"descr": "<f8", "fortran_order": False, "shape": (megabytes * 131072,)}
    )
    with zipfile.ZipFile(file, "w", zipfile.ZIP_DEFLATED) as archive:
        for other, values in dict(whole).items():
            with archive.open(f"{other}.npy", "w") as stream:
                np.save(stream, values)
        with archive.open(f"{name}.npy", "w") as stream:
            stream.write(header.getvalue())
            for _ in range(megabytes):
                stream.write(bytes(1 << 20))


@pytest.mark.parametrize("name", ["q", "urdf", "unknown"])
def test_a_file_that_unpacks_to_much_more_is_refused_before_it_is_unpacked(episode, tmp_path, name):
    whole = arrays_of(episode, tmp_path)
    whole.pop(name, None)
    bomb(tmp_path / "bomb.npz", name, 120, whole)
    used = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    with pytest.raises(sk.Error, match=r"MB that unpack to 12\d MB, where 67 MB are allowed; .*largest"):
        Episode.load(tmp_path / "bomb.npz")
    assert resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - used < 40_000  # kB


@pytest.mark.parametrize("shape", ["(1000000000000,)", "(1000000, 1000000)", "(-5,)"])
def test_a_header_that_promises_more_than_the_file_has_takes_no_memory(episode, tmp_path, shape):
    arrays_of(episode, tmp_path)
    text = f"{{'descr': '<f8', 'fortran_order': False, 'shape': {shape}, }}".ljust(117) + "\n"
    with (
        zipfile.ZipFile(tmp_path / "whole.npz") as whole,
        zipfile.ZipFile(tmp_path / "huge.npz", "w") as huge,
    ):
        for member in whole.namelist():
            data = whole.read(member)
            if member == "q.npy":
                data = b"\x93NUMPY\x01\x00" + len(text).to_bytes(2, "little") + text.encode() + bytes(80)
            huge.writestr(member, data)
    with pytest.raises(sk.Error, match="'q'"):
        Episode.load(tmp_path / "huge.npz")


def test_objects_are_never_unpickled(episode, tmp_path):
    arrays = arrays_of(episode, tmp_path)

    class Evil:
        def __reduce__(self):
            return os.mkdir, (str(tmp_path / "made"),)

    refused({**arrays, "q": np.array([Evil()], dtype=object)}, tmp_path, "Python objects")
    assert not (tmp_path / "made").exists()


def test_a_file_with_a_broken_byte_is_refused(episode, tmp_path):
    whole = (episode.save(tmp_path / "whole.npz")).read_bytes()
    generator = np.random.default_rng(5)
    for at in generator.integers(0, len(whole), 40):
        broken = bytearray(whole)
        broken[at] ^= 0x5A
        (tmp_path / "broken.npz").write_bytes(broken)
        try:
            loaded = Episode.load(tmp_path / "broken.npz")
        except sk.Error:
            continue
        np.testing.assert_array_equal(loaded["q"], episode["q"])  # a byte that nothing depends on
    for length in (0, 10, len(whole) // 2, len(whole) - 1):
        (tmp_path / "short.npz").write_bytes(whole[:length])
        with pytest.raises(sk.Error):
            Episode.load(tmp_path / "short.npz")


def test_limits_that_cannot_be_judged_are_refused(episode):
    half = episode.samples["q"].copy()
    half[len(half) // 2, 0] = np.nan
    for wrong, words in (
        ({"q": np.nan, "dt": -1.0}, "dt"),
        ({"q": np.nan}, "q has"),
        ({"q": half}, "1 rows .* first is row"),
        ({"qdot": -np.inf}, "qdot has"),
        ({"dt": 0.0}, "dt = 0"),
        ({"dt": np.nan}, "dt = nan"),
        ({"configuration": 777}, "configuration 777"),
    ):
        with pytest.raises(sk.Error, match=words):
            changed(episode, **wrong).broken_limits()
        with pytest.raises(sk.Error, match=words):
            changed(episode, **wrong).play()
    empty = Episode(episode.samples[:0], episode.arm, episode.dt, episode.settings, episode.before)
    with pytest.raises(sk.Error, match="no cycle"):
        empty.broken_limits()
    assert empty.duration == 0.0


def test_a_dense_recording_is_saved_so_that_it_loads(episode, tmp_path, monkeypatch):
    from sigmaik.teleop import archive

    monkeypatch.setattr(archive, "ALWAYS_READ", 1 << 10)
    monkeypatch.setattr(archive, "DENSEST", 2)
    samples = np.repeat(episode.samples[:1], 4000)
    samples["cycle"] = np.arange(4000)
    resting = Episode(samples, episode.arm, episode.dt, episode.settings, episode.before)
    assert len(Episode.load(resting.save(tmp_path / "resting.npz"))) == 4000


# --- the clock


def test_gaps_of_the_loops_clock_are_seen(episode):
    clock = episode["time"][0] + episode.dt * np.arange(len(episode))
    clock[50:] += 0.25  # the loop left out cycles
    clock[120:] += 12.0
    cycle = episode["cycle"].copy()
    cycle[80:] += 30  # cycles that nobody read
    clock[80:] += 30 * episode.dt
    late = changed(episode, time=clock, cycle=cycle)
    assert [gap.row for gap in late.gaps] == [50, 80, 120]
    assert [gap.lost for gap in late.gaps] == [0, 30, 0]
    np.testing.assert_allclose([gap.seconds for gap in late.gaps], [0.25, 30 * episode.dt, 12.0])
    assert late.duration == pytest.approx(clock[-1] - clock[0] + episode.dt)


# --- on disk as it goes


def test_a_recording_is_on_disk_while_it_goes_on(tmp_path):
    file = tmp_path / "e.part"
    with Session("ur10", rate=500.0) as session:
        until(lambda: len(session.read()))
        session.start_recording(file)
        session.twist([0.0, 0.0, 0.05, 0.0, 0.0, 0.0])
        until(lambda: (session.read(), session.recorded >= 100)[1])
        until(lambda: len(load_part(file)) >= 100)
        assert journal.cut_off(tmp_path) == []  # somebody writes
        with pytest.raises(sk.Error, match="recording already"):
            session.start_recording(tmp_path / "f.part")
        session.configure(method="dls:damping=0.05")
        until(lambda: (session.read(), session.recorded >= 200)[1])
        episode = session.stop_recording()
    assert journal.cut_off(tmp_path) == [file]
    loaded = Episode.load(file)
    assert same(loaded.samples, episode.samples)
    assert dict(loaded.settings) == dict(episode.settings)
    np.testing.assert_array_equal(loaded.before, episode.before)
    np.testing.assert_array_equal(loaded.play(), episode["q"])
    with Session("ur10") as session, pytest.raises(sk.Error, match="exists already"):
        session.start_recording(file)


def load_part(file):
    try:
        return Episode.load(file)
    except sk.Error:
        return ()


def test_a_part_that_was_cut_off_is_left_out(tmp_path):
    file = tmp_path / "e.part"
    episode = record(file)
    whole = file.read_bytes()
    lengths = []
    for length in (len(whole), len(whole) - 1, len(whole) - 40_000):
        file.write_bytes(whole[:length])
        loaded = Episode.load(file)
        assert same(loaded.samples, episode.samples[: len(loaded)])
        lengths.append(len(loaded))
    assert lengths[0] == len(episode) > lengths[1] > lengths[2] > 0
    file.write_bytes(whole + bytes(5000))  # blocks that were allocated and never written
    assert len(Episode.load(file)) == len(episode)
    file.write_bytes(whole[:200])
    with pytest.raises(sk.Error, match="before the first cycle"):
        Episode.load(file)


PROGRAM = """
import sys, time
from sigmaik.teleop import Session
session = Session("ur10", rate=500.0)
session.__enter__()
session.start_recording(sys.argv[1])
while True:
    session.read()
    if session.recorded > 100:
        print("recording", flush=True)
    time.sleep(0.02)
"""


@pytest.mark.parametrize("end", [signal.SIGKILL, signal.SIGINT, signal.SIGTERM])
def test_a_recording_survives_the_end_of_its_program(tmp_path, end):
    file = tmp_path / "e.part"
    program = subprocess.Popen([sys.executable, "-c", PROGRAM, file], stdout=subprocess.PIPE, stderr=subprocess.DEVNULL)
    assert program.stdout.readline() == b"recording\n"
    program.send_signal(end)
    program.wait(20.0)
    program.stdout.close()
    assert journal.cut_off(tmp_path) == [file]
    loaded = Episode.load(file)
    assert len(loaded) > 50
    np.testing.assert_array_equal(loaded.play(), loaded["q"])


def test_a_full_disk_is_told_and_the_recording_goes_on_in_memory(tmp_path, full_disk):
    file = tmp_path / "e.part"
    with Session("ur10", rate=500.0) as session:
        until(lambda: len(session.read()))
        session.start_recording(file)
        assert session.recording_trouble == ""
        full_disk(100_000)
        until(lambda: (session.read(), session.recording_trouble)[1])
        assert re.search("e.part: File too large", session.recording_trouble)
        told = session.recorded
        until(lambda: (session.read(), session.recorded > told + 100)[1])
        episode = session.stop_recording()
    assert len(episode) > told
    kept = Episode.load(file)  # as far as there was space
    assert 0 < len(kept) < len(episode)
    assert same(kept.samples, episode.samples[: len(kept)])
    full_disk(5_000)
    with pytest.raises(OSError, match="File too large"):
        episode.save(tmp_path / "e.npz")
    assert sorted(path.name for path in tmp_path.iterdir()) == ["e.part"]
    full_disk(100_000_000)
    assert len(Episode.load(episode.save(tmp_path / "elsewhere" / "e.npz"))) == len(episode)


def test_a_recording_ends_with_its_session(tmp_path):
    file = tmp_path / "e.part"
    session = Session("ur10", rate=500.0)
    with session:
        session.start_recording(file)
        until(lambda: (session.read(), session.recorded > 50)[1])
    assert len(load_part(file)) > 50  # closed
    with session:
        until(lambda: len(session.read()))
        episode = session.stop_recording()
    assert (np.diff(episode["cycle"]) == 1).all()
    assert same(episode.samples, Episode.load(file).samples)


# --- sessions


def at_rest(session):
    session.read()
    return session.latest is not None and not session.latest["qdot"].any()


@pytest.mark.parametrize("command", ["pose", "twist", "pose repeated"])
def test_a_session_that_is_entered_again_does_not_move(command):
    session = Session("ur10", rate=500.0, pose_timeout=60.0, twist_timeout=60.0)
    with session:
        until(lambda: (session.read(), session.latest is not None)[1])
        target = session.latest["pose"].copy()
        target[2, 3] += 0.3
        session.twist([0.0, 0.0, 0.2, 0.0, 0.0, 0.0]) if command == "twist" else session.follow(target)
        until(lambda: (session.read(), np.abs(session.latest["qdot"]).max() > 0.01)[1])
    with session:
        if command == "pose repeated":
            session.refresh()
        time.sleep(0.2)
        samples = session.read()
        assert len(samples) > 10
        assert not samples["qdot"].any()
        assert set(samples["command"]) == {sk.LoopCommand.HOLD}
        assert session.goal is None
        session.twist([0.0, 0.0, 0.1, 0.0, 0.0, 0.0])
        until(lambda: (session.read(), session.latest["qdot"].any())[1])


def test_a_stop_is_latched_until_it_is_released():
    with Session("ur10", rate=500.0) as session:
        until(lambda: (session.read(), session.latest is not None)[1])
        target = session.latest["pose"].copy()
        target[2, 3] += 0.3
        session.follow(target)
        until(lambda: (session.read(), np.abs(session.latest["qdot"]).max() > 0.01)[1])
        session.stop("the operator said so")
        for command in (
            lambda: session.follow(target),
            lambda: session.twist([0.0, 0.0, 0.1, 0.0, 0.0, 0.0]),
            session.restart,
        ):
            with pytest.raises(sk.Error, match=r"stopped \(the operator said so\): release"):
                command()
        session.refresh()
        session.hold("something else")  # is no release
        assert session.stopped == session.why_it_holds == "the operator said so"
        until(lambda: at_rest(session))
        time.sleep(0.1)
        assert not session.read()["qdot"].any()
        session.release()
        assert not session.stopped
        time.sleep(0.1)
        assert not session.read()["qdot"].any()  # the release is no command
        session.follow(target)
        until(lambda: (session.read(), np.abs(session.latest["qdot"]).max() > 0.01)[1])


class FaultyLoop:
    """A loop with a fault until the fault is acknowledged and the loop released."""

    def __init__(self, loop):
        self.loop, self.calls = loop, []
        self.fault = types.SimpleNamespace(text="3000 cycles were left out")

    def acknowledge(self):
        self.calls.append("acknowledge")
        self.fault = None

    def release(self):
        self.calls.append("release")

    def __getattr__(self, name):
        return getattr(self.loop, name)


def test_a_fault_of_the_loop_is_a_stop_that_is_released():
    with Session("ur10", rate=500.0) as session:
        session._loop = FaultyLoop(session._loop)
        assert session.stopped == session.why_it_holds == "fault: 3000 cycles were left out"
        with pytest.raises(sk.Error, match="stopped .fault: 3000 cycles were left out.: release"):
            session.twist([0.0] * 6)
        session.release()
        assert session._loop.calls == ["acknowledge", "release"]
        assert not session.stopped
        session.twist([0.0] * 6)
        session._loop = session._loop.loop


def test_a_session_says_why_it_holds():
    with Session("ur10", rate=500.0, settings=Settings(guided=False)) as session:
        assert session.why_it_holds == "no command yet"
        session.twist([0.0, 0.0, 0.1, 0.0, 0.0, 0.0])
        until(lambda: (session.read(), session.latest is not None and session.latest["command"] == 3)[1])
        assert session.why_it_holds == "the twist was not repeated"
        session.hold("a test holds")
        assert session.why_it_holds == "a test holds"
    assert session.why_it_holds == "the session has ended"
