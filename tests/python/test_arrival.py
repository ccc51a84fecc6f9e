"""Arriving: targets that rest are reached, at rest and inside all limits; `sigmaik arrival`; measured joints."""

import csv
import math

import numpy as np
import pytest

import sigmaik as sk
from sigmaik_lab.__main__ import main
from sigmaik_lab.arrival import experiment as arrival
from sigmaik_lab.arrival.judge import Motion, departure, held_limits, judge
from sigmaik_lab.arrival.servos import SERVOS
from sigmaik_lab.arrival.summary import summarize_arrivals


def excess(servo, q, qdot, dt, start=None):
    """The largest excess over the limits that the servo holds: parts of the limit, rad for positions."""
    velocity, acceleration, jerk = held_limits(servo.chain)
    first = np.zeros(servo.chain.dof) if start is None else start
    change = np.diff(qdot, axis=0, prepend=first[None]) / dt
    worst = [(q - servo.chain.limits.upper).max(), (servo.chain.limits.lower - q).max()]
    worst += [(np.abs(qdot) / velocity).max() - 1.0, (np.abs(change) / acceleration).max() - 1.0]
    worst.append((np.abs(np.diff(change, axis=0)) / dt / jerk).max() - 1.0)
    return max(worst)


# --- the study


@pytest.mark.parametrize("robot", ["ufactory_xarm7", "ur10", "puma560"])
@pytest.mark.parametrize("jerk", [None, 100.0])
def test_near_targets_are_all_reached_at_rest_and_inside_the_limits(robot, jerk):
    settings = arrival.ArrivalSettings(trials=12, rate=500.0, seed=3, jerk=jerk, time=4.0)
    chain = settings.with_limits(sk.robots.load(robot))
    row = summarize_arrivals(robot, "near", "default", _driven(chain, settings, "default"))
    assert row.arrived == 1.0
    assert row.at_rest == 1.0
    assert row.excess == 0.0
    assert row.median_time <= (0.8 if jerk is None else 1.6)


def _driven(chain, settings, servo):
    return arrival.drive(chain, arrival.draw_trials(chain, settings), servo, settings)


@pytest.mark.parametrize("targets", ["random", "beyond"])
def test_far_targets_hold_the_limits(targets):
    settings = arrival.ArrivalSettings(targets=targets, trials=4, time=6.0, rate=250.0, seed=1)
    chain = sk.robots.load("franka_panda")
    done = _driven(chain, settings, "default")
    assert np.all(done.excess == 0.0)
    if targets == "beyond":
        assert not np.isfinite(done.time).any()
        assert done.position.min() > 0.1


def test_trials_are_inside_the_limits_and_the_same_each_time():
    chain = sk.robots.load("puma560")
    for targets in arrival.TARGETS:
        settings = arrival.ArrivalSettings(targets=targets, trials=20)
        trials, again = (arrival.draw_trials(chain, settings) for _ in range(2))
        for a, b in zip(trials, again, strict=True):
            np.testing.assert_array_equal(a.start, b.start)
            np.testing.assert_array_equal(a.target, b.target)
            assert np.all((a.start > chain.limits.lower) & (a.start < chain.limits.upper))
            sk.pose_error(a.target, a.target)  # a pose
    other = arrival.draw_trials(chain, arrival.ArrivalSettings(trials=20, seed=1))
    assert not np.array_equal(other[0].start, arrival.draw_trials(chain, arrival.ArrivalSettings(trials=1))[0].start)


def test_what_counts_as_arrived_and_what_as_an_excess():
    chain, home = sk.robots.load("ur10"), sk.robots.home("ur10")
    goal = chain.pose(home)
    q, qdot = np.tile(home, (6, 1)), np.zeros((5, 6))

    def judged(**other):
        return judge(chain, Motion(**{"q": q, "qdot": qdot, "start_qdot": np.zeros(6), **other}), goal, 100.0)

    still = judged()
    assert (still["time"], still["position"], still["rest"], still["speed"]) == (0.0, 0.0, True, 0.0)
    assert (still["excess"], still["over"], still["jump"], still["departure"]) == (0.0, 0.0, 0.0, 0.0)
    q[3, 0] += 0.01  # it leaves again
    assert judged()["time"] == pytest.approx(0.04)
    assert judged(failed=True)["time"] == math.inf
    q[5, 5] += math.radians(0.6)  # turns the tool alone
    assert judged()["time"] == math.inf
    assert judged()["angle"] == pytest.approx(math.radians(0.6))
    q[5, 5] -= math.radians(0.2)
    assert judged()["time"] == pytest.approx(0.04)
    moving = qdot.copy()
    moving[4, 2] = 0.01
    assert not judged(qdot=moving)["rest"]
    moving[4, 2] = 0.11  # in a cycle of 10 ms: 11 rad/s², and 10 are assumed
    found = judged(qdot=moving)
    assert (found["excess"], found["jump"], found["over"]) == (pytest.approx(0.1), pytest.approx(1.1), 0.0)
    moving[:] = 2.0 * chain.limits.velocity
    assert judged(qdot=moving, start_qdot=moving[0])["over"] == pytest.approx(1.0)
    q[2, 0] = chain.limits.upper[0] + 0.2
    assert judged()["over"] == pytest.approx(0.2)


def test_the_departure_is_the_distance_from_the_line_and_not_from_its_prolongation():
    path = np.array([[0.0, 0.0, 0.0], [0.5, 0.0, 0.02], [1.0, 0.0, 0.0]])
    goal = np.array([1.0, 0.0, 0.0])
    assert departure(path, goal) == pytest.approx(0.02)
    assert departure(np.vstack([path, [1.3, 0.4, 0.0]]), goal) == pytest.approx(0.5)  # overshoot counts
    assert departure(path, path[0]) == pytest.approx(1.0)  # a target where the tool is
    rng = np.random.default_rng(5)
    for _ in range(20):  # invariant under rigid motions; and no point is farther than the densest search says
        turn, shift = sk.rotation_exp(rng.normal(size=3)), rng.normal(size=3)
        points, end = rng.normal(size=(7, 3)), rng.normal(size=3)
        found = departure(points, end)
        assert departure(points @ turn.T + shift, turn @ end + shift) == pytest.approx(found)
        line = points[0] + np.linspace(0.0, 1.0, 20001)[:, None] * (end - points[0])
        nearest = [np.linalg.norm(line - point, axis=1).min() for point in points]
        assert found == pytest.approx(max(nearest), abs=1e-6)


def test_command(tmp_path, capsys):
    arguments = ["arrival", "--robot", "ur10,puma560", "--trials", "2", "--time", "2", "--rate", "250", "--jerk", "200"]
    assert main([*arguments, "--out", str(tmp_path)]) == 0
    out = capsys.readouterr().out
    assert out.strip().splitlines()[-1] == str(tmp_path / "arms-arrival-near.png")
    assert (tmp_path / "arms-arrival-near.png").stat().st_size > 5_000
    with (tmp_path / "arms-arrival-near.csv").open() as stream:
        rows = list(csv.DictReader(stream))
    assert [(row["robot"], row["servo"]) for row in rows] == [(r, s) for r in ("ur10", "puma560") for s in SERVOS]
    assert all(float(row["excess"]) == 0.0 for row in rows)


@pytest.mark.parametrize(
    ("bad", "text"),
    [
        (["--trials", "0"], "trials"),
        (["--time", "0"], "time"),
        (["--jerk", "-1"], "jerk"),
        (["--acceleration", "inf"], "acceleration"),
        (["--seed", "-1"], "seed"),
        (["--servo", "magic"], "no servo 'magic'"),
        (["--robot", "nobody"], "nobody"),
    ],
)
def test_command_refuses(bad, text, tmp_path, capsys):
    assert main(["arrival", "--no-plot", "--out", str(tmp_path), *bad]) == 2
    assert text in capsys.readouterr().err


# --- the servo


def test_a_servo_needs_no_number():
    for robot in sk.robots.names():
        arm = sk.robots.load(robot)
        servo = sk.Servo(arm)
        assert servo.method == sk.JParse()
        assert servo.length_scale == arm.characteristic_length
        assert servo.settling_time > 3.0
        options = servo.options
        assert options["length_scale"] is None
        assert options["max_linear_error"] is None
        assert (options["gain_linear"], options["gain_angular"], options["assumed_acceleration"]) == (10.0, 10.0, 10.0)
    assert sk.Servo(arm, length_scale=0.3).length_scale == 0.3


MEASURED_START = np.array([0.0, -1.2, 1.5, -1.2, -1.57, 0.0])


def arrive(measure, dt=2e-3, seconds=3.0):
    arm = sk.robots.load("ur10")
    servo = sk.Servo(arm, dt=dt)
    servo.reset(MEASURED_START)
    target = servo.pose
    target[0, 3] -= 0.1
    q, qdot = [MEASURED_START], []
    for _ in range(round(seconds / dt)):
        measure(servo, q)
        step = servo.update(target)
        q.append(step.q)
        qdot.append(step.qdot)
        assert not step.not_settling
    return servo, target, np.array(q), np.array(qdot)


def arrival_time(arm, target, q, dt, tolerance):
    error = np.array([sk.pose_error(arm.pose(x), target) for x in q])
    away = np.flatnonzero(
        (np.linalg.norm(error[:, :3], axis=1) > tolerance) | (np.linalg.norm(error[:, 3:], axis=1) > 0.01)
    )
    return (away[-1] + 1) * dt if len(away) else 0.0


@pytest.mark.parametrize("with_velocity", [False, True])
def test_measured_joints_arrive_as_the_open_loop_does(with_velocity):
    """Joints that lag by 20 ms, and noise of 1e-4 rad: the reference arrives as without measurements."""
    rng, dt = np.random.default_rng(7), 2e-3
    lag = round(0.02 / dt)

    def measure(servo, q):
        at = q[max(0, len(q) - 1 - lag)] + 1e-4 * rng.normal(size=6)
        before = q[max(0, len(q) - 2 - lag)]
        servo.measure(at, (q[max(0, len(q) - 1 - lag)] - before) / dt if with_velocity else None)

    servo, target, q, qdot = arrive(measure)
    open_servo, _, open_q, open_qdot = arrive(lambda servo, q: None)
    arm = servo.chain
    for done, x, v in ((servo, q, qdot), (open_servo, open_q, open_qdot)):
        assert excess(done, x, v, dt) < 1e-9
    assert np.linalg.norm(sk.pose_error(arm.pose(open_q[-1]), target)) < 1e-6
    # The noise of the filter, 1e-4 rad / √(2 · 0.1 s / 2 ms), at the end of an arm of 1.3 m.
    assert np.linalg.norm(sk.pose_error(arm.pose(q[-1]), target)[:3]) < 2e-4
    times = [arrival_time(arm, target, x, dt, 1e-3) for x in (open_q, q)]
    assert times[1] <= times[0] + 0.15
    assert np.abs(qdot[-1]).max() < 5e-3
    assert np.abs(servo.following_error).max() < 1e-4
    np.testing.assert_array_equal(open_servo.following_error, 0.0)


def test_a_following_error_that_stays_is_made_up_for():
    """An arm that stands 5 mrad beside its reference in each joint: the arm arrives, and not the reference."""
    offset = np.array([5e-3, -5e-3, 5e-3, -5e-3, 5e-3, -5e-3])
    servo, target, q, qdot = arrive(lambda servo, q: servo.measure(q[-1] + offset))
    assert excess(servo, q, qdot, 2e-3) < 1e-9
    arm = servo.chain
    np.testing.assert_allclose(servo.following_error, offset, atol=1e-6)
    assert np.linalg.norm(sk.pose_error(arm.pose(q[-1] + offset), target)[:3]) < 1e-5
    assert np.linalg.norm(sk.pose_error(arm.pose(q[-1]), target)[:3]) > 1e-3
    servo.reset(MEASURED_START)
    np.testing.assert_array_equal(servo.following_error, 0.0)


def test_a_start_in_motion_with_an_acceleration():
    """From q̇ and q̈ the command goes on inside acceleration and jerk limits."""
    arm = sk.robots.load("franka_panda").with_limits(acceleration=10.0, jerk=500.0)
    home = sk.robots.home("franka_panda")
    qdot, qddot = np.full(7, 0.3), np.array([5.0, -5.0, 3.0, 0.0, -8.0, 8.0, 1.0])
    servo = sk.Servo(arm)
    servo.reset(home, qdot, qddot)
    target = arm.pose(home + 0.1)
    last, change = qdot, qddot
    for _ in range(2500):
        step = servo.update(target)
        now = (step.qdot - last) / servo.dt
        assert np.all(np.abs(now) <= 10.0 * (1 + 1e-9))
        assert np.all(np.abs(now - change) / servo.dt <= 500.0 * (1 + 1e-6))
        last, change = step.qdot, now
    assert np.linalg.norm(step.pose_error) < 1e-4
    # Told its own state in each cycle, the servo goes on as if nothing had been told.
    told, untold = sk.Servo(arm), sk.Servo(arm)
    told.reset(home)
    untold.reset(home)
    for _ in range(300):
        a, b = told.update_twist([0.0, 0.0, 0.0, 0.0, 0.0, 3.0]), untold.update_twist([0.0, 0.0, 0.0, 0.0, 0.0, 3.0])
        assert np.all(a.q >= arm.limits.lower)
        assert np.all(a.q <= arm.limits.upper)
        told.reset(a.q, a.qdot)
    assert np.abs(b.qdot).max() > 0.1


@pytest.mark.parametrize("wrong", [np.zeros(5), np.zeros((6, 1)), np.full(6, np.nan), "x", None])
def test_measurements_of_a_wrong_shape_are_refused_and_change_nothing(wrong):
    arm, home = sk.robots.load("ur10"), sk.robots.home("ur10")
    servo, untouched = sk.Servo(arm), sk.Servo(arm)
    for each in (servo, untouched):
        each.reset(home)
    with pytest.raises(sk.Error, match="q"):
        servo.measure(wrong)
    if wrong is not None:
        with pytest.raises(sk.Error, match="qdot"):
            servo.measure(home, wrong)
        with pytest.raises(sk.Error, match="qddot"):
            servo.reset(home, np.zeros(6), wrong)
    target = arm.pose(home + 0.1)
    np.testing.assert_array_equal(servo.update(target).qdot, untouched.update(target).qdot)


def test_what_is_measured_needs_a_start():
    with pytest.raises(sk.Error, match="reset"):
        sk.Servo(sk.robots.load("ur10")).measure(np.zeros(6))
