"""The experiment with joint limits: what must hold, and the tools around it. Figures: docs/limits.md."""

from __future__ import annotations

import csv
import functools
import json

import numpy as np
import pytest

import sigmaik as sk
from sigmaik_lab.csv_file import save_rows
from sigmaik_lab.limits import experiment as ex
from sigmaik_lab.limits.files import save_traces
from sigmaik_lab.limits.summary import summarize_limits
from sigmaik_lab.limits.trials import BEYOND_LIMIT, SATURATION, LimitsSettings, Phase, Trial
from sigmaik_lab.reach.methods import parse_method

SHORT = LimitsSettings(rate=500.0, trials=2, seconds=4.0, pace=0.2)
ROBOTS = ("ufactory_xarm7", "franka_panda", "ur10")


@functools.cache
def load(robot: str = "ufactory_xarm7", **changes: float) -> ex.LimitsExperiment:
    return ex.load_limits(robot, LimitsSettings(**{**SHORT.__dict__, **changes}))


@functools.cache
def drive(robot: str, scenario: str, variant: str, **changes: float) -> list[ex.Trace]:
    experiment = load(robot, **changes)
    return [ex.drive(experiment, scenario, trial, variant) for trial in experiment.trials[scenario]]


@pytest.mark.parametrize("robot", ROBOTS)
@pytest.mark.parametrize("scenario", ex.SCENARIOS)
@pytest.mark.parametrize("variant", ["redistribute", "position first", "scale"])
def test_no_limit_is_broken(robot, scenario, variant):
    """By differences of the commands, independently of the way in which the commands were limited."""
    for trace in drive(robot, scenario, variant):
        limits = trace.experiment.chain.limits
        rate = trace.experiment.settings.rate
        speed = np.diff(trace.q, axis=0) * rate
        assert np.all(np.isfinite(trace.q))
        assert np.all(trace.q >= limits.lower)
        assert np.all(trace.q <= limits.upper)
        assert np.all(np.abs(speed) <= limits.velocity * (1 + 1e-9))
        acceleration = np.diff(trace.qdot, axis=0, prepend=0.0) * rate
        assert np.all(np.abs(acceleration) <= limits.acceleration * (1 + 1e-9))
    summary = summarize_limits(drive(robot, scenario, variant))
    assert summary.non_finite == 0
    assert (summary.position_broken, summary.speed_broken, summary.acceleration_broken) == (0, 0, 0)
    assert summary.speed_worst <= 1 + 1e-9


def test_jerk_limits_hold_where_they_are_given():
    for scenario in ex.SCENARIOS:
        summary = summarize_limits(drive("ufactory_xarm7", scenario, "redistribute", jerk=2000.0))
        assert summary.jerk_broken == 0
        assert 0.9 < summary.jerk_worst <= 1 + 1e-6
        assert summary.acceleration_broken == 0


def test_without_limits_and_clamped_they_are():
    none = summarize_limits(drive("ufactory_xarm7", "beyond limits", "none"))
    assert none.position_broken > 0
    assert none.position_excess == pytest.approx(BEYOND_LIMIT, abs=0.1)
    assert none.limited == none.taken_over == 0.0
    assert none.achieved == pytest.approx(1.0)
    clamp = summarize_limits(drive("ufactory_xarm7", "beyond limits", "clamp"))
    assert clamp.position_broken == clamp.speed_broken == 0
    assert clamp.acceleration_broken > 0
    assert clamp.limited > 0.0


def test_redistribution_reaches_what_scaling_does_not():
    """With one of seven joints at its limit, the other joints can reach the pose."""
    chosen = ("joint2 upper", "joint3 lower", "joint5 upper", "joint7 upper")
    experiment = load(pace=0.7)
    for trial in experiment.trials["beyond limits"]:
        if trial.name not in chosen:
            continue
        held = trial.phase("hold").stop - 1
        errors = [
            np.linalg.norm(ex.drive(experiment, "beyond limits", trial, variant).error[held])
            for variant in ("redistribute", "scale")
        ]
        assert errors[0] < 2e-3
        assert errors[1] > 0.05


def test_the_rule_alone_is_what_the_servo_does_without_limits():
    """The reference for all measurements, computed independently of the servo's own report."""
    for scenario in ex.SCENARIOS:
        for trace in drive("ufactory_xarm7", scenario, "none"):
            np.testing.assert_allclose(trace.achieved, trace.rule, rtol=0, atol=1e-9 * (1 + np.abs(trace.rule).max()))
            assert not trace.limited.any()
            np.testing.assert_allclose(trace.q[1:], trace.q[:-1] + trace.qdot / SHORT.rate, rtol=0, atol=1e-12)


def test_limited_is_where_the_tool_misses_the_rules_twist():
    for trace in drive("franka_panda", "teleoperation", "redistribute"):
        missed = np.linalg.norm(trace.achieved - trace.rule, axis=1)
        small = missed <= 1e-3 * np.linalg.norm(trace.rule, axis=1)
        np.testing.assert_array_equal(trace.limited, trace.held & ~small)
        assert np.all(small[~trace.held])
        assert 0.0 < trace.held.mean() < 1.0


def test_a_figure_by_hand():
    """One joint that turns at 1 rad/s for two cycles and stops."""
    chain = sk.Chain.from_urdf(
        '<robot name="one"><link name="a"/><link name="b"/><joint name="j" type="revolute"><parent link="a"/>'
        '<child link="b"/><axis xyz="0 0 1"/><limit lower="-1" upper="0.015" velocity="0.5" effort="1"/>'
        "</joint></robot>"
    ).with_limits(acceleration=10.0)
    settings = LimitsSettings(rate=100.0)
    trial = Trial("t", np.zeros(1), np.zeros((4, 6)), (Phase("drive", 0, 4),))
    experiment = ex.LimitsExperiment("one", chain, parse_method("jparse"), settings, {"teleoperation": (trial,)})
    qdot = np.array([[1.0], [1.0], [0.0], [0.0]])
    q = np.array([[0.0], [0.01], [0.02], [0.02], [0.02]])
    rule = np.tile([0.0, 0.0, 0.0, 0.0, 0.0, 1.0], (4, 1))
    held = np.array([False, False, True, True])
    trace = ex.Trace(
        experiment, "teleoperation", trial, "none", q, qdot, np.zeros((4, 6)), np.zeros((4, 3)), rule, held
    )
    summary = summarize_limits([trace])
    assert summary.position_broken == 3
    assert summary.position_excess == pytest.approx(0.005)
    assert (summary.speed_broken, summary.speed_worst) == (2, pytest.approx(2.0))
    assert (summary.acceleration_broken, summary.acceleration_worst) == (2, pytest.approx(10.0))
    assert summary.limited == pytest.approx(0.5)
    assert summary.achieved == pytest.approx(0.5)
    assert summary.acceleration_peak == pytest.approx(100.0)
    assert np.isnan(summary.rest_speed)
    assert summary.trials == 0


def test_seeds_decide():
    for scenario in ex.SCENARIOS:
        one, same, other = (load(seed=seed, trials=trials) for seed, trials in ((0, 2), (0, 2), (1, 2)))
        for a, b in zip(one.trials[scenario], same.trials[scenario], strict=True):
            np.testing.assert_array_equal(a.commands, b.commands)
        assert any(
            not np.array_equal(a.commands, b.commands)
            for a, b in zip(one.trials[scenario], other.trials[scenario], strict=True)
        )


def test_twists_saturate():
    twists = load().trials["teleoperation"][0].commands
    for rows, longest in zip((slice(0, 3), slice(3, 6)), SATURATION, strict=True):
        length = np.linalg.norm(twists[:, rows], axis=1)
        assert length.max() == pytest.approx(longest)
        assert np.mean(length > 0.999 * longest) > 0.1


def test_targets_are_where_they_are_said_to_be():
    experiment = load()
    limits = experiment.chain.limits
    for trial in experiment.trials["beyond limits"]:
        assert np.all(trial.start >= limits.lower)
        assert np.all(trial.start <= limits.upper)
    chain = experiment.chain
    reach = max(np.linalg.norm(chain.pose(chain.random_configuration(i))[:3, 3]) for i in range(500))
    for trial in experiment.trials["beyond reach"]:
        hold = trial.commands[trial.phase("hold")]
        assert np.linalg.norm(hold[0, :3, 3]) > reach + 0.4
        np.testing.assert_array_equal(trial.commands[-1], trial.commands[0])


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"rate": 0.0}, "rate"),
        ({"seconds": np.nan}, "seconds"),
        ({"pace": np.inf}, "pace"),
        ({"trials": 0}, "trials"),
        ({"seed": -1}, "seed"),
        ({"acceleration": -1.0}, "acceleration"),
        ({"jerk": np.nan}, "jerk"),
    ],
)
def test_wrong_settings(changes, message):
    with pytest.raises(ValueError, match=message):
        ex.load_limits("ufactory_xarm7", LimitsSettings(**changes))


def test_wrong_names():
    with pytest.raises(ValueError, match="no shipped arm"):
        ex.load_limits("nobody")
    with pytest.raises(ValueError, match="unknown method"):
        ex.load_limits("ur10", SHORT, "magic")
    experiment = load()
    with pytest.raises(ValueError, match="no variant 'hope'"):
        ex.drive(experiment, "teleoperation", experiment.trials["teleoperation"][0], "hope")


def test_files(tmp_path):
    traces = drive("ufactory_xarm7", "beyond limits", "scale")
    rows = [summarize_limits(traces)]
    with save_rows(rows, tmp_path / "a.csv").open(newline="") as stream:
        table = list(csv.DictReader(stream))
    assert table[0]["variant"] == "scale"
    assert float(table[0]["limited"]) == rows[0].limited
    with np.load(save_traces(traces, tmp_path / "a.npz")) as data:
        np.testing.assert_array_equal(data["q_3"], traces[3].q)
        assert data["trials"].tolist() == [trace.trial.name for trace in traces]
        assert json.loads(str(data["phases"]))[0][0] == ["hold", 0, 300]
        assert data["limits"].shape == (5, 7)


def test_pictures(tmp_path):
    figures = pytest.importorskip("sigmaik_lab.limits.figure")
    from sigmaik._plotting import save_figure

    for robot, scenario in (("ufactory_xarm7", "beyond reach"), ("ur10", "teleoperation")):
        traces = [drive(robot, scenario, variant)[0] for variant in ("redistribute", "none")]
        figure = figures.limits_figure(traces, (0.0, 2.0) if scenario == "teleoperation" else None)
        assert len(figure.axes) == 8
        file = save_figure(figure, tmp_path / "a.png")
        assert file.read_bytes().startswith(b"\x89PNG")
    with pytest.raises(ValueError, match="no trace"):
        figures.limits_figure([])
