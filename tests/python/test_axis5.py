"""The axis-5 experiments of Schreiber, Otter and Hirzinger: what must come out, and the command."""

from __future__ import annotations

import csv
import functools
import json
import math
import pathlib

import numpy as np
import pytest

import sigmaik as sk
from sigmaik_lab.__main__ import main
from sigmaik_lab.axis5 import experiment as axis5
from sigmaik_lab.axis5.summary import Summary, summarize

OTHERS = [variant for variant in axis5.VARIANTS if variant != "closed"]


@functools.cache
def motion(example: int, **changes: float) -> axis5.Motion:
    return axis5.motion(example, **changes)


@functools.cache
def track(example: int, variant: str, dt: float = 4e-3, **changes: float) -> axis5.Track:
    return axis5.run(motion(example, **changes), variant, axis5.Axis5Settings(dt=dt))


def summary(*args: object, **changes: float) -> Summary:
    return summarize(track(*args, **changes))


# --- the motions


@pytest.mark.parametrize("example", axis5.EXAMPLES)
def test_target_is_a_line_at_rest_at_its_ends(example):
    m = motion(example)
    np.testing.assert_allclose(m.chain.pose(m.start), m.target(0.0), atol=1e-12)
    length = np.linalg.norm(m.target(m.duration)[:3, 3] - m.pose[:3, 3])
    assert length == pytest.approx(m.distance, rel=1e-12)
    end = m.target(m.total)[:3, 3]
    np.testing.assert_allclose(end, m.pose[:3, 3] if m.back else m.target(m.duration)[:3, 3], atol=1e-15)
    np.testing.assert_array_equal(m.target(m.total + 1.0), m.target(m.total))
    for t in (0.0, m.duration, m.total):
        assert np.linalg.norm(m.target(t + 1e-4)[:3, 3] - m.target(t)[:3, 3]) < 1e-9
    for t in np.linspace(0.0, m.total, 9):
        np.testing.assert_array_equal(m.target(t)[:3, :3], m.pose[:3, :3])


def test_example_1_passes_the_singularity_by_the_offset_with_axis_1_at_rest():
    closed = track(1, "closed")
    assert np.degrees(np.abs(closed.q[:, 4]).min()) == pytest.approx(1.0, abs=0.01)
    assert np.abs(closed.q[:, 0]).max() < 1e-12
    # Axes 4 and 6 turn by nearly half a turn there, and back.
    assert np.degrees(np.ptp(closed.q[:, 3])) > 165.0
    np.testing.assert_allclose(closed.q[-1], closed.q[0], atol=1e-9)


def test_example_2_starts_in_the_singularity_and_moves_where_it_lost_a_direction():
    m = motion(2)
    u, sigma, _ = np.linalg.svd(m.chain.jacobian(m.start))
    assert sigma[-1] < 1e-12
    # To keep the orientation while axis 1 turns takes a rotation about z, and the arm has lost a part of this rotation.
    lost = u[:, -1]
    assert abs(lost[5]) == pytest.approx(math.cos(math.radians(20.0)) * np.linalg.norm(lost[3:]), rel=1e-9)


# --- what must come out


def test_closed_form_breaks_speed_and_acceleration_limits_of_axes_4_and_6_only():
    row = summary(1, "closed")
    for j in (3, 5):
        assert row.speed_ratio[j] > 2.0
        assert row.acceleration_ratio[j] > 1.5
    assert max(row.speed_ratio[j] for j in (0, 1, 2, 4)) < 0.1
    assert max(row.acceleration_ratio[j] for j in (0, 1, 2, 4)) < 0.1
    assert row.speed_beyond > 50
    assert row.acceleration_beyond > 50
    assert row.max_position_error < 1e-12
    assert row.max_orientation_error < 1e-9
    assert row.optimised == 0.0
    assert math.isnan(row.first_switch)


@pytest.mark.parametrize("dt", [1e-3, 4e-3, 12e-3])
def test_closed_form_jumps_by_a_quarter_turn_in_the_first_sample(dt):
    first = np.degrees(np.abs(np.diff(track(2, "closed", dt).q[:3], axis=0)))
    assert first[0, 3] == pytest.approx(90.0, abs=0.1)
    assert first[0, 5] == pytest.approx(90.0, abs=0.1)
    assert first[0, [0, 1, 2, 4]].max() < 0.1
    row = summary(2, "closed", dt)
    assert min(row.speed_ratio[3], row.speed_ratio[5]) > 10.0
    assert min(row.acceleration_ratio[3], row.acceleration_ratio[5]) > 10.0


@pytest.mark.parametrize("dt", [1e-3, 4e-3, 12e-3])
@pytest.mark.parametrize("example", axis5.EXAMPLES)
@pytest.mark.parametrize("variant", OTHERS)
def test_limits_are_reached_and_never_broken(example, variant, dt):
    t = track(example, variant, dt)
    row = summarize(t)
    assert row.speed_beyond == row.acceleration_beyond == 0
    assert max(row.speed_ratio) <= 1.0 + 1e-9
    assert max(row.acceleration_ratio) <= 1.0 + 1e-9
    limits = t.motion.chain.limits
    assert np.all((t.q >= limits.lower) & (t.q <= limits.upper))
    assert row.speed_ratio[3] > 1.0 - 1e-9
    if variant != "scaled-exact":
        assert row.acceleration_ratio[3] > 1.0 - 1e-9
        assert row.at_limit > 0.2


@pytest.mark.parametrize("example", axis5.EXAMPLES)
@pytest.mark.parametrize("variant", ["constrained", "no-beta", "scaled"])
def test_position_error_stays_zero(example, variant):
    # The error that two linearisations leave grows about with dt⁴.
    for dt, least in ((1e-3, 2e-9), (4e-3, 2e-7), (12e-3, 5e-6)):
        row = summary(example, variant, dt)
        assert row.max_position_error < least
        assert row.exact_missed == 0


@pytest.mark.parametrize("dt", [1e-3, 4e-3, 12e-3])
@pytest.mark.parametrize("example", axis5.EXAMPLES)
def test_orientation_error_stays_within_3_degrees_and_goes_away(example, dt):
    row = summary(example, "constrained", dt)
    assert math.radians(1.0) < row.max_orientation_error < math.radians(3.0)
    assert row.last_orientation_error < 1e-6
    assert row.error_active == 0


def test_the_deviation_is_a_motion_of_axis_1():
    assert np.degrees(np.abs(track(1, "constrained").q[:, 0]).max()) == pytest.approx(0.27, abs=0.1)


@pytest.mark.parametrize("example", axis5.EXAMPLES)
def test_without_beta_the_joints_oscillate(example):
    damped, free = summary(example, "constrained"), summary(example, "no-beta")
    for j in (3, 5):
        assert damped.speed_variation[j] < 0.4 * free.speed_variation[j]
        assert damped.rms_jerk[j] < 0.5 * free.rms_jerk[j]
        assert damped.reversals[j] < 0.6 * free.reversals[j]
    # The speed rises to its limit and falls again once there and once back: axis 4 does not oscillate.
    if example == 1:
        speed = motion(1).chain.limits.velocity[3]
        assert damped.speed_variation[3] == pytest.approx(4.0 * speed, rel=0.1)


def test_oscillation_without_beta_grows_with_the_rate():
    variation = [summary(1, "no-beta", dt).speed_variation[3] for dt in (1e-3, 4e-3, 12e-3)]
    assert variation[0] > 2.0 * variation[1] > 4.0 * variation[2]


def test_back_to_the_closed_form_without_a_jerk():
    t = track(1, "constrained")
    row = summarize(t)
    assert not t.optimised[1]
    assert not t.optimised[-1]
    assert 0.1 < row.optimised < 0.4
    assert row.switches == 4  # out and in, there and back
    assert 0.9 < row.first_switch < 1.0
    assert 3.2 < row.last_switch < 3.7
    assert max(row.acceleration_ratio[j] for j in (1, 2, 4)) < 0.1


def test_time_scaling_trades_time_for_orientation():
    for example in axis5.EXAMPLES:
        fixed, scaled = summary(example, "constrained"), summary(example, "scaled")
        assert fixed.max_time_scale == 0.0
        assert 0.5 < scaled.max_time_scale < 0.9
        assert scaled.max_orientation_error < 0.4 * fixed.max_orientation_error
        assert 1.03 * fixed.duration < scaled.duration < 1.3 * fixed.duration
    t = track(1, "scaled")
    assert t.time_scale[t.t < 0.9].max() < 1e-6  # only near the singularity
    assert np.all(np.diff(t.clock) >= 0.0)
    assert np.all(np.diff(t.clock) <= t.settings.dt * (1.0 + 1e-9))


def test_all_exact_keeps_the_path_by_slowing_down():
    t = track(1, "scaled-exact")
    row = summarize(t)
    assert row.finished
    assert row.max_position_error < 2e-6
    assert row.max_orientation_error < 1e-5
    assert row.exact_missed < 10  # ϑ does not look ahead: where braking begins, limits can be too tight
    assert 0.65 < row.max_time_scale < 0.8
    assert row.duration > 1.05 * summary(1, "constrained").duration
    # The joints are where the closed form is, at another time.
    closed = track(1, "closed")
    reference = np.interp(t.clock, closed.t, closed.q[:, 3])
    assert np.abs(t.q[:, 3] - reference).max() < 0.02


def test_all_exact_starts_across_the_singularity_too():
    row = summary(2, "scaled-exact")
    assert row.finished
    assert 0.5 < row.duration < 1.0  # [s], where the closed form without limits takes 0.5
    assert row.max_position_error < 1e-6
    assert summary(2, "scaled-exact", offset=math.radians(2.0)).finished


def test_runs_repeat_exactly():
    once, again = (axis5.run(motion(2), "scaled", axis5.Axis5Settings()) for _ in range(2))
    for name in ("q", "error", "clock"):
        np.testing.assert_array_equal(getattr(once, name), getattr(again, name))


def test_track_is_consistent():
    t = track(1, "scaled")
    n = len(t.t)
    assert t.q.shape == t.qdot.shape == t.qddot.shape == t.error.shape == (n, 6)
    np.testing.assert_array_equal(t.q[0], t.motion.start)
    np.testing.assert_allclose(np.cumsum(t.qdot, axis=0) * t.settings.dt + t.q[0], t.q, atol=1e-12)
    for k in (0, n // 4, n - 1):
        pose = t.motion.chain.pose(t.q[k])
        line = pose[:3, 3] - t.motion.pose[:3, 3]
        off = line - (line @ t.motion.direction) * t.motion.direction
        assert np.linalg.norm(off) < 1e-7  # the path is straight, whatever the clock says


def test_the_line_may_pass_through_the_singularity():
    track = axis5.run(axis5.motion(1, offset=0.0), "constrained", axis5.Axis5Settings())
    assert track.finished
    assert np.isfinite(track.qdot).all()


def test_refuses():
    for changes, message in (
        ({"distance": 0.0}, "distance must be positive"),
        ({"distance": 3.0}, "leaves the arm's reach"),
        ({"duration": -1.0}, "duration must be positive"),
        ({"offset": -0.1}, "offset must be from"),
        ({"offset": math.nan}, "offset must be from"),
    ):
        with pytest.raises(ValueError, match=message):
            axis5.motion(1, **changes)
    with pytest.raises(ValueError, match="example must be 1 or 2"):
        axis5.motion(3)
    for variant, settings, message in (
        ("magic", axis5.Axis5Settings(), "no variant 'magic'"),
        ("closed", axis5.Axis5Settings(dt=0.0), "dt must be positive"),
        ("closed", axis5.Axis5Settings(dt=1e-6), "samples are too many"),
        ("constrained", axis5.Axis5Settings(beta=-1.0), "beta"),
        ("scaled", axis5.Axis5Settings(gamma=0.0), "gamma"),
        ("constrained", axis5.Axis5Settings(max_error=0.0), "max_error"),
        ("constrained", axis5.Axis5Settings(iterations=0), "iterations"),
    ):
        with pytest.raises(ValueError, match=message):
            axis5.run(motion(1), variant, settings)


# --- the command


def test_command(capsys, tmp_path, monkeypatch):
    figure = pytest.importorskip("matplotlib.figure")
    from sigmaik_lab.axis5 import figure as axis5_figure

    draw = axis5_figure.axis_figure  # one figure is enough: each figure takes a second
    monkeypatch.setattr(axis5_figure, "axis_figure", lambda t, j: draw(t, j) if j == 3 else figure.Figure())
    assert main(["axis5", "--example", "2", "--out", str(tmp_path)]) == 0
    printed = capsys.readouterr().out.splitlines()
    assert pathlib.Path(printed[-1]) == tmp_path / "axis5-example2.png"
    assert max(map(len, printed[:-4])) <= 80
    assert sum("time scaling" in line for line in printed) == 2
    names = [f"axis{j + 1}" for j in range(6)] + ["error"]
    for file in [tmp_path / "axis5-example2.png", *(tmp_path / f"axis5-example2-{n}.png" for n in names)]:
        assert file.read_bytes().startswith(b"\x89PNG")
    with (tmp_path / "axis5-example2.csv").open(newline="") as stream:
        table = list(csv.DictReader(stream))
    assert [row["variant"] for row in table] == list(axis5.VARIANTS)
    assert float(table[0]["speed_ratio_4"]) > 50.0
    with np.load(tmp_path / "axis5-example2-constrained.npz") as data:
        np.testing.assert_array_equal(data["q"], track(2, "constrained").q)
        np.testing.assert_array_equal(data["qddot"], track(2, "constrained").qddot)
        assert str(data["variant"]) == "constrained"
        assert json.loads(str(data["settings"]))["dt"] == 4e-3
        assert str(data["version"]) == sk.__version__


def test_command_with_every_option(capsys, tmp_path):
    arguments = "--dt 0.01 --distance 0.1 --duration 1 --offset 2 --beta 2 --gamma 0.01 --max-error inf"
    arguments += " --iterations 3 --format csv --no-plot"
    assert main(["axis5", "--example", "1", "--out", str(tmp_path), *arguments.split()]) == 0
    out = capsys.readouterr().out
    assert "0.1 m in 1 s, axis 5 2° from zero, dt = 10 ms" in out
    assert "β = 2, γ = 0.01, orientation error any" in out
    assert out.splitlines()[-1] == str(tmp_path / "axis5-example1.csv")
    assert not list(tmp_path.glob("*.png"))
    lines = (tmp_path / "axis5-example1-closed.csv").read_text().splitlines()
    assert lines[0].startswith("t,clock,q_joint_a1")
    assert len(lines) == 1 + 231


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["--dt", "0"], "dt must be positive"),
        (["--dt", "nan"], "dt must be positive"),
        (["--distance", "5"], "leaves the arm's reach"),
        (["--duration", "-1"], "duration must be positive"),
        (["--offset", "90"], "offset must be from"),
        (["--beta", "-1"], "beta"),
        (["--gamma", "0"], "gamma"),
        (["--max-error", "-3"], "max_error"),
        (["--iterations", "0"], "iterations"),
    ],
)
def test_command_refuses(capsys, tmp_path, arguments, message):
    command = [
        "axis5",
        "--example",
        "1",
        "--no-plot",
        "--format",
        "none",
        "--out",
        str(tmp_path),
        *arguments,
    ]
    assert main(command) == 2
    captured = capsys.readouterr()
    assert captured.out == ""
    assert message in captured.err
    assert captured.err.count("\n") == 1
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("arguments", [[], ["--example", "3"], ["--example", "1", "--dt", "fast"]])
def test_command_needs_an_example(capsys, arguments):
    with pytest.raises(SystemExit) as exit_:
        main(["axis5", *arguments])
    assert exit_.value.code == 2
    assert "usage: sigmaik axis5" in capsys.readouterr().err
