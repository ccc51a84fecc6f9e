"""A moving target, its camera, and the arm that follows; streams from Python."""

import csv

import numpy as np
import pytest

import sigmaik as sk
from sigmaik_lab.__main__ import main
from sigmaik_lab.reach.methods import parse_method
from sigmaik_lab.track import experiment as track
from sigmaik_lab.track import summary
from sigmaik_lab.track.camera import Camera
from sigmaik_lab.track.target import TARGETS, read_recording


@pytest.fixture(scope="module")
def experiment():
    return track.load_track("ufactory_xarm7", "eight", track.TrackSettings(duration=12.0))


def run(e, mode, feed, outliers=True, method="jparse"):
    return track.follow(e, track.Variant(parse_method(method), mode, feed, outliers))


# --- the stream, and feed-forward


def test_stream_predicts_and_holds():
    stream = sk.TargetStream()
    assert stream.at(0.0).status == sk.StreamStatus.WAITING
    pose = np.eye(4)
    for k in range(1001):
        now = 1e-3 * k
        if k % 25 == 0:
            pose[:3, 3] = [0.2 * (now - 0.03), 0.0, 0.5]
            assert stream.push(now - 0.03, pose) == sk.SampleStatus.ACCEPTED
        target = stream.at(now)
    assert target.status == sk.StreamStatus.TRACKING
    np.testing.assert_allclose(target.pose[:3, 3], [0.2, 0.0, 0.5], atol=1e-5)
    np.testing.assert_allclose(target.twist, [0.2, 0, 0, 0, 0, 0], atol=1e-4)
    wrong = pose.copy()
    wrong[1, 3] += 1.0
    assert stream.push(0.995, wrong) == sk.SampleStatus.OUTLIER
    assert stream.push(0.9, pose) == sk.SampleStatus.OUT_OF_ORDER
    assert stream.counts.outliers == stream.counts.out_of_order == 1
    for k in range(1001, 3000):
        target = stream.at(1e-3 * k)
    assert target.status == sk.StreamStatus.STALE
    np.testing.assert_allclose(target.twist, 0.0, atol=1e-9)
    assert "outliers=1" in repr(stream.counts)
    assert "stale" in repr(target)


def test_stream_starts_from_where_the_arm_is():
    start, there = np.eye(4), np.eye(4)
    there[0, 3] = 0.5
    stream = sk.TargetStream("hold", max_speed=1.0)
    stream.reset(start)
    stream.push(0.0, there)
    np.testing.assert_array_equal(stream.at(0.0).pose, start)
    x = [stream.at(1e-3 * k).pose[0, 3] for k in range(1, 2000)]
    assert np.all(np.diff(x) <= 1e-3 + 1e-12)
    assert x[-1] == pytest.approx(0.5, abs=1e-9)


@pytest.mark.parametrize(
    ("options", "text"),
    [
        ({"mode": "guess"}, "mode = 'guess'"),
        ({"max_speed": 0.0}, "max_speed"),
        ({"timeout": 0.05}, "timeout"),
        ({"noise_linear": float("nan")}, "noise_linear"),
        ({"relocate": 0}, "relocate"),
    ],
)
def test_stream_refuses(options, text):
    with pytest.raises(sk.Error, match=text):
        sk.TargetStream(**options)


def test_stream_refuses_samples_that_are_none():
    stream = sk.TargetStream()
    with pytest.raises(sk.Error, match="pose"):
        stream.push(0.0, np.full((4, 4), 1.0))
    with pytest.raises(sk.Error, match="time"):
        stream.push(float("nan"), np.eye(4))
    with pytest.raises(sk.Error, match="time"):
        stream.at(float("inf"))


def test_servo_refuses_feedforward_that_is_none():
    servo = sk.Servo(sk.robots.load("ur10"), sk.JParse())
    servo.reset(sk.robots.home("ur10"))
    pose = servo.pose
    with pytest.raises(sk.Error, match="feedforward"):
        servo.update(pose, [0, 0, 0, 0, 0, float("nan")])
    with pytest.raises(sk.Error, match="feedforward"):
        servo.update(pose, feedforward=[0, 0, 0])
    servo.update(pose, np.zeros(6))


# --- the experiment


def test_targets_start_and_end_at_home_and_at_rest():
    for target in TARGETS:
        e = track.load_track("ur10", target, track.TrackSettings(duration=8.0, rate=200.0))
        assert len(e.poses) == round(8.0 / e.pace * 200.0)
        home = e.chain.pose(sk.robots.home("ur10"))
        np.testing.assert_allclose(e.poses[[0, -1]], [home, home], atol=2e-3)
        speed = np.linalg.norm(e.twists[:, :3], axis=1)
        assert speed[0] < 0.01
        assert speed[-1] < 0.01
        assert speed.max() > 0.1
        assert e.reachable.all() == (target not in ("marker", "out-and-back")), target
        # The twists take each pose to the next, and jump nowhere.
        assert np.abs(np.diff(e.twists[:, :3], axis=0)).max() * 200.0 < 10.0


@pytest.mark.parametrize("robot", ["kinova_gen3_7dof", "ur10"])
def test_the_hand_asks_no_more_than_the_arms_speed(robot):
    """A slow arm gets a slow hand, which takes the same way."""
    settings = {"duration": 12.0, "rate": 100.0, "seed": 2}
    e = track.load_track(robot, "marker", track.TrackSettings(**settings))
    full = track.load_track(robot, "marker", track.TrackSettings(**settings, pace=1.0))
    assert e.asked_speed <= 1.0 + 1e-12
    if full.asked_speed > 1.0:
        assert e.asked_speed == pytest.approx(1.0)
        assert e.pace == pytest.approx(1.0 / full.asked_speed)
    else:
        assert (e.pace, e.asked_speed) == (1.0, full.asked_speed)
    assert (robot == "kinova_gen3_7dof") == (e.pace < 1.0)
    assert len(e.poses) == pytest.approx(len(full.poses) / e.pace, abs=1.0)
    there = e.poses[np.round(full.t[:-1] / e.pace * 100.0).astype(int), :3, 3]
    np.testing.assert_allclose(there, full.poses[:-1, :3, 3], atol=5e-3)
    # Half as fast asks for half the speed.
    slow = track.load_track(robot, "marker", track.TrackSettings(**settings, pace=0.5 * e.pace))
    assert slow.asked_speed == pytest.approx(0.5 * e.asked_speed, rel=0.1)


def test_camera_sees_what_it_is_told_to(experiment):
    e, c = experiment, experiment.camera
    assert all(f.arrival - f.stamp == pytest.approx(c.delay) for f in e.frames)
    assert not any(e.gap[0] <= f.stamp < e.gap[1] for f in e.frames)
    seen = (12.0 - 1.5) * c.rate
    assert 0.8 * seen < len(e.frames) < 0.98 * seen
    good = [sk.pose_error(e.poses[round(f.stamp * 1e3)], f.pose) for f in e.frames if not f.outlier]
    angular = np.std([x[3:] for x in good])
    linear = np.std([x[:3] for x in good], axis=0)
    assert angular == pytest.approx(c.rotation_noise, rel=0.15)
    # Two axes have the lever from the marker, one has not.
    lever = np.hypot(c.noise, c.offset * c.rotation_noise)
    assert np.sum(linear**2) == pytest.approx(2 * lever**2 + c.noise**2, rel=0.2)


def test_modes_rank_as_they_must(experiment):
    rows = {
        (mode, feed): summary.summarize_track(run(experiment, mode, feed))
        for mode, feed in (("true", True), ("true", False), ("predict", True), ("interpolate", True), ("raw", False))
    }
    for row in rows.values():
        assert row.broken == 0
        assert max(row.speed, row.acceleration, row.jerk) <= 1.0 + summary.TOLERANCE
    # An exactly known twist, fed forward, leaves no lag; without feed-forward the lag is 1/gain.
    assert abs(rows["true", True].delay) < 0.02
    assert rows["true", False].delay == pytest.approx(0.1, abs=0.025)
    # Prediction compensates the camera's delay, interpolation adds a delay of its own, and raw samples lag most.
    assert (
        rows["true", True].delay
        < rows["predict", True].delay
        < rows["interpolate", True].delay
        < rows["raw", False].delay
    )
    order = [
        rows[key].position_mean for key in (("true", True), ("predict", True), ("interpolate", True), ("raw", False))
    ]
    assert order == sorted(order)
    # The raw samples' outliers went to the servo, the stream's did not.
    assert rows["predict", True].refused >= rows["predict", True].wrong > 0
    assert rows["raw", False].refused == 0


def test_outliers_and_stops(experiment):
    for mode, feed in (("predict", True), ("interpolate", False), ("hold", False)):
        followed = run(experiment, mode, feed)
        row = summary.summarize_track(followed, run(experiment, mode, feed, outliers=False))
        assert row.moved_by_outliers < 1e-9
        assert row.drift < 5e-3
        stale = experiment.t[followed.stale]
        assert stale.min() > experiment.gap[0]
        assert stale.max() < experiment.gap[1] + 0.2
    raw = summary.summarize_track(run(experiment, "raw", False), run(experiment, "raw", False, outliers=False))
    assert raw.moved_by_outliers > 5e-3


def test_it_is_the_same_each_time(experiment):
    a, b = (run(experiment, "predict", True) for _ in range(2))
    np.testing.assert_array_equal(a.q, b.q)
    one, two = (
        track.load_track("ur10", settings=track.TrackSettings(duration=8.0, pace=1.0, seed=seed)) for seed in (0, 1)
    )
    assert np.abs(one.poses - two.poses).max() > 0.01
    assert not np.array_equal(one.frames[0].pose, two.frames[0].pose)


# --- recordings


def recording(tmp_path, form):
    t = np.linspace(0.0, 4.0, 81)
    home = sk.robots.load("ur10").pose(sk.robots.home("ur10"))
    poses = np.tile(home, (len(t), 1, 1))
    poses[:, 1, 3] += 0.05 * np.sin(1.5 * t)
    file = tmp_path / f"hand.{form}"
    if form == "npz":
        np.savez(file, t=t + 100.0, pose=poses)
    else:
        r = home[:3, :3]
        rpy = np.arctan2(r[2, 1], r[2, 2]), -np.arcsin(r[2, 0]), np.arctan2(r[1, 0], r[0, 0])
        lines = ["# a hand", "t, x, y, z, roll, pitch, yaw"]
        lines += [", ".join(f"{x:.12g}" for x in (s, *p[:3, 3], *rpy)) for s, p in zip(t, poses, strict=True)]
        file.write_text("\n".join(lines))
    return file, t, poses


@pytest.mark.parametrize("form", ["npz", "csv"])
def test_recordings(tmp_path, form):
    file, t, poses = recording(tmp_path, form)
    e = track.load_track("ur10", str(file), camera=Camera(gap=None, outliers=0.0))
    assert (e.target, len(e.poses)) == ("hand", 4000)
    np.testing.assert_allclose(e.poses[::50], poses[:-1], atol=1e-9)
    np.testing.assert_allclose(e.poses[:, 1, 3] - poses[0, 1, 3], 0.05 * np.sin(1.5 * e.t), atol=1e-4)
    assert e.reachable.all()


@pytest.mark.parametrize(
    ("text", "match"),
    [
        ("t,x,y,z,roll,pitch\n0,0,0,0,0,0\n", "yaw"),
        ("t,x,y,z,roll,pitch,yaw\n0,0,0,0,0,0,0\n", "two times"),
        ("t,x,y,z,roll,pitch,yaw\n0,0,0,0,0,0,0\n0,0,0,0,0,0,0\n", "rising"),
        ("t,x,y,z,roll,pitch,yaw\n0,0,0,0,0,0,0\n1,x,0,0,0,0,0\n", "could not convert"),
        ("t,x,y,z,roll,pitch,yaw\n0,0,0,0,0,0,0\n1,nan,0,0,0,0,0\n", "sample 2"),
    ],
)
def test_recordings_refused(tmp_path, text, match):
    file = tmp_path / "bad.csv"
    file.write_text(text)
    with pytest.raises(ValueError, match=match):
        read_recording(file)


# --- the command


def test_command(tmp_path, capsys):
    arguments = ["track", "--robot", "ur10", "--method", "jparse,dls", "--duration", "8", "--out", str(tmp_path)]
    assert main(arguments) == 0
    lines = capsys.readouterr().out.strip().splitlines()
    assert lines[-1] == str(tmp_path / "ur10-marker-events.png")
    for name in ("rules", "modes", "path", "events"):
        assert (tmp_path / f"ur10-marker-{name}.png").stat().st_size > 10_000
    with (tmp_path / "ur10-marker.csv").open() as stream:
        rows = list(csv.DictReader(stream))
    assert {(row["method"], row["mode"]) for row in rows} == {("jparse", m) for m in track.MODES} | {("dls", "predict")}
    assert all(row["broken"] == "0" for row in rows)
    with np.load(tmp_path / "ur10-marker-jparse-predict-feedforward.npz") as arrays:
        assert arrays["q"].shape == (8001, 6)
        assert arrays["target"].shape == (8000, 4, 4)
        assert len(arrays["stamp"]) == len(arrays["seen"]) == len(arrays["outlier"])


def test_command_without_pictures(tmp_path, capsys):
    file, _, _ = recording(tmp_path, "npz")
    arguments = [
        "track",
        "--robot",
        "ur10",
        "--target",
        str(file),
        "--method",
        "sdls",
        "--mode",
        "hold",
        "--feedforward",
        "off",
    ]
    arguments += ["--outliers", "0", "--no-gap", "--format", "none", "--no-plot", "--out", str(tmp_path)]
    assert main(arguments) == 0
    assert capsys.readouterr().out.strip().splitlines()[-1] == str(tmp_path / "ur10-hand.csv")


@pytest.mark.parametrize(
    "bad",
    [
        ["--mode", "magic"],
        ["--target", "nowhere"],
        ["--dropout", "1"],
        ["--camera-rate", "0"],
        ["--duration", "1"],
        ["--pace", "0"],
        ["--jerk", "-1"],
        ["--seed", "-1"],
        ["--method", "magic"],
    ],
)
def test_command_refuses(bad, tmp_path, capsys):
    assert main(["track", "--no-plot", "--out", str(tmp_path), *bad]) == 2
    assert capsys.readouterr().err.startswith("sigmaik: ")
