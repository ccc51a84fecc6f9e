"""Clocks: the time of each cycle of a servo, and clocks that step behind a TargetStream; the largest tool speed."""

import math

import numpy as np
import pytest

import sigmaik as sk


@pytest.fixture
def servo():
    arm = sk.robots.load("ur10")
    servo = sk.Servo(arm)
    servo.reset(sk.robots.home("ur10"))
    return servo


@pytest.mark.parametrize("loop", ["lost packets", "without real time"])
def test_the_limits_hold_against_the_clock(servo, loop):
    random = np.random.default_rng(0)
    limits = servo.chain.limits
    acceleration = np.where(np.isfinite(limits.acceleration), limits.acceleration, 10.0)
    q, qdot, last, worst = servo.q, np.zeros(6), 1e-3, 0.0
    twist = np.zeros(6)
    for cycle in range(3000):
        if cycle % 300 == 0:
            twist = random.uniform(-0.5, 0.5, 6)
        dt = 1e-3 * (1 + (random.random() < 0.02)) if loop == "lost packets" else random.uniform(0.7e-3, 1.6e-3)
        step = servo.update_twist(twist, dt=dt)
        velocity = (step.q - q) / dt
        np.testing.assert_allclose(velocity, step.qdot, atol=1e-9)
        for time in (dt, 0.5 * (dt + last)):
            worst = max(worst, np.max(np.abs(step.qdot - qdot) / time / acceleration))
        q, qdot, last = step.q, step.qdot, dt
    assert 0.99 < worst <= 1.0 + 1e-9


def test_a_time_outside_the_range_raises_and_leaves_the_servo_as_it_is(servo):
    servo.update_twist([0.1, 0, 0, 0, 0, 0])
    q = servo.q
    for dt in (0.0, -1e-3, 0.9e-4, 20.1e-3, math.nan, math.inf):
        for call in (
            lambda dt=dt: servo.update(servo.pose, dt=dt),
            lambda dt=dt: servo.update_twist(np.zeros(6), dt=dt),
            lambda dt=dt: servo.hold(dt=dt),
        ):
            with pytest.raises(sk.Error, match="dt = .* must be from 0.0001 to 0.02 s"):
                call()
    np.testing.assert_array_equal(servo.q, q)
    assert servo.update(servo.pose, None, 2e-3).status != sk.Status.BAD_INPUT
    assert servo.hold(2e-3).status == sk.Status.HOLDING


def test_no_point_is_faster_than_the_tool_speed():
    arm = sk.robots.load("ur10")
    servo = sk.Servo(arm, max_tool_speed=0.25, speed_points=[[0.0, 0.0, 0.2]])
    servo.reset(sk.robots.home("ur10"))
    before, fastest = servo.pose, 0.0
    for _ in range(500):
        step = servo.update_twist([1.0, 0, 0.3, 0.5, 0, 0])
        pose = servo.pose
        for point in (np.array([0, 0, 0, 1.0]), np.array([0, 0, 0.2, 1.0])):
            fastest = max(fastest, np.linalg.norm((pose - before) @ point) / 1e-3)
        before = pose
    assert 0.2 < fastest <= 0.25 * (1 + 1e-9)
    assert step.tool_speed_limits
    assert step.tool_speed == pytest.approx(0.25, rel=1e-3)
    for points in ([0.0, 0.0, 0.2], np.zeros((9, 3)), "tip"):
        with pytest.raises(sk.Error, match="speed_points"):
            sk.Servo(arm, speed_points=points)
    with pytest.raises(sk.Error, match="max_tool_speed"):
        sk.Servo(arm, max_tool_speed=0.0)


@pytest.mark.parametrize("step", [-10.0, -0.5, 3.0, 1e6])
def test_a_clock_that_steps_makes_the_target_stale_at_once_and_tracked_again(step):
    stream = sk.TargetStream("predict")
    pose, clock, back = np.eye(4), 0.0, None
    for cycle in range(2000):
        now = 100.0 + 1e-3 * cycle
        if cycle == 1000:
            clock = step
        pose[0, 3] = 0.1 * math.sin(6.0 * now)
        if cycle % 20 == 0:
            stream.push(now + clock, pose)
        target = stream.at(now + clock)
        assert target.age >= 0.0
        if cycle == 1000:
            assert target.status == sk.StreamStatus.STALE
            assert not target.twist.any()
        elif cycle > 1000 and back is None and target.status == sk.StreamStatus.TRACKING:
            back = cycle - 1000
    assert back is not None
    assert back <= 300
    assert stream.counts.clock_steps == 1
    assert abs(target.pose[0, 3] - pose[0, 3]) < 0.05
