"""print() of a public object is short and informative."""

import enum
import inspect
import time

import numpy as np
import pytest

import sigmaik as sk

ARM = "ufactory_xarm7"


def shown() -> list[object]:
    """One object of each public class that a user makes, or gets as an answer, with a servo's arm."""
    arm = sk.robots.load(ARM)
    q = sk.robots.home(ARM)
    servo = sk.Servo(arm, sk.JParse())
    before = repr(servo)
    assert "q=" not in before  # not reset yet
    servo.reset(q)
    ik = sk.ConstrainedIk(arm)
    ik.reset(q)
    stream = sk.TargetStream("predict")
    stream.push(0.0, servo.pose)
    chunks = sk.ActionChunks(0.1)
    chunks.push(0.0, [servo.pose])
    solver = sk.VelocitySolver(sk.DampedLeastSquares())
    spectrum = sk.Spectrum()
    spectrum.decompose(arm.jacobian(q))
    torque = sk.ComputedTorque(arm)
    loop = sk.ServoLoop(servo, measure_timeout=1e-6)  # a fault in the first cycle
    with loop:
        while loop.fault is None:
            time.sleep(1e-3)
    puma = sk.AnalyticIk(sk.robots.load("puma560"))
    position = sk.PositionIk(arm)
    plan = sk.planning.time_optimal(arm, q, q + 0.1)
    collisions = sk.Collisions(arm, [sk.Obstacle.sphere([1.0, 0.0, 0.5], 0.1)])
    return [
        arm,
        arm.limits,
        arm.segments[0],
        sk.Inertia(1.0),
        servo,
        servo.update(servo.pose),
        ik,
        ik.step(ik.pose),
        stream,
        stream.counts,
        stream.at(0.1),
        sk.ServoBatch(arm, None, 1e-3, 4),
        chunks,
        chunks.counts,
        chunks.at(0.1),
        solver,
        solver.solve(arm.jacobian(q), np.ones(6)),
        spectrum,
        sk.Dynamics(arm),
        torque,
        torque.update(q, 0 * q, q, 0 * q, 0 * q),
        loop,
        loop.fault,
        loop.take("test"),
        loop.statistics,
        puma,
        puma.branches(sk.robots.load("puma560").pose(sk.robots.home("puma560")))[0],
        position,
        position.solve(servo.pose, q),
        position.branches(servo.pose)[0],
        sk.least_squares(np.eye(2), np.ones(2)),
        sk.singularities.of(sk.robots.load("franka_panda")),
        plan,
        plan.clearance,
        collisions,
        collisions.obstacles[0],
        collisions.capsules[0],
        collisions.capsules[0].capsule,
    ]


def test_every_object_says_what_it_is():
    for thing in shown():
        text = repr(thing)
        assert text.startswith(type(thing).__name__), text
        assert "0x" not in text, text
        assert len(text) < 800, text
        assert len(text) > len(type(thing).__name__) + 4, text


def test_no_public_class_was_forgotten():
    made = {type(thing) for thing in shown()}
    for name in sk.__all__:
        public = getattr(sk, name)
        if not inspect.isclass(public) or issubclass(public, enum.Enum | BaseException):
            continue
        assert public.__repr__ is not object.__repr__, name
        assert "pybind11_object" not in repr(public.__repr__), name
        assert public in made or name in METHODS, name


METHODS = {
    name for name in sk.__all__ if name.endswith(("Squares", "Inverse", "Parse", "Projection", "Safety", "Method"))
}


@pytest.mark.parametrize("name", sk.robots.names())
def test_limits_are_shown_with_their_names(name):
    text = repr(sk.robots.load(name).limits)
    for word in ("lower=[", "upper=[", "velocity=[", "acceleration=[", "jerk=[", "effort=["):
        assert word in text
