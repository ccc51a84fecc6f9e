"""The singular directions that a cycle reports: the rule's, as twists in base axes, for every method and task."""

import time

import numpy as np
import pytest

import sigmaik as sk

NO_LIMITS = dict.fromkeys(("position_limits", "velocity_limits", "acceleration_limits", "jerk_limits"), False)
METHODS = [
    sk.PseudoInverse(1e-3),
    sk.DampedLeastSquares(),
    *(
        sk.AdaptiveDampedLeastSquares(rule)
        for rule in ("numerical_filtering", "manipulability", "smallest_singular_value")
    ),
    sk.SelectivelyDampedLeastSquares(),
    sk.JParse(0.3, adaptive=False),
    sk.JParse(singular_posture=True, adaptive=False),
    sk.JParse(0.3),
    sk.JParse(singular_posture=True),
    sk.JacobianProjection(0.3),
    sk.JacobianSafety(),
    sk.JacobianSafetyProjection(0.2),
]
every_method = pytest.mark.parametrize("method", METHODS, ids=repr)


def tasks(rng, count):
    """Arm, q, length scale, mask and frame; half of the arms are stretched out, or nearly so."""
    names = ("ufactory_xarm7", "franka_panda", "ur10", "kuka_lbr_iiwa_14_r820")
    for k in range(count):
        arm = sk.robots.load(names[k % len(names)])
        q = arm.random_configuration(int(rng.integers(1 << 30)))
        if k % 2 == 0:
            q = q * (rng.random(arm.dof) < 0.5) + 1e-3 * rng.normal(size=arm.dof)
        if k % 5 == 0:
            q = np.zeros(arm.dof)  # exactly singular, all four
        mask = np.ones(6, dtype=bool) if rng.random() < 0.3 else rng.random(6) < 0.6
        mask[rng.integers(6)] = True
        yield arm, q, float(rng.uniform(0.1, 2.0)), mask, ("base", "tool")[int(rng.integers(2))]


def rows(mask, frame, length_scale, pose):
    """(m', 6): from a twist in base axes to the weighted rows of the task."""
    turn = np.eye(6)
    if frame == "tool":
        turn[:3, :3] = turn[3:, 3:] = pose[:3, :3].T
    return (np.diag([1, 1, 1, length_scale, length_scale, length_scale]) @ turn)[mask]


def adaptive(method):
    return isinstance(method, sk.JParse) and method.adaptive


@every_method
def test_they_are_those_of_the_rule_in_base_axes(method):
    rng = np.random.default_rng(5)
    seen = 0
    for arm, q, length_scale, mask, frame in tasks(rng, 60):
        servo = sk.Servo(arm, method, **NO_LIMITS, length_scale=length_scale, mask=mask, frame=frame)
        servo.reset(q)
        pose, jacobian, twist = servo.pose, arm.jacobian(q), rng.normal(size=6)
        step = servo.update_twist(twist)
        directions = step.singular_directions
        k = int(step.singular.sum())
        seen += k
        assert directions.shape == (6, k)

        # To the task's rows and back, and nothing in the rows that the mask leaves out.
        to_rows = rows(mask, frame, length_scale, pose)
        others = rows(~mask, frame, length_scale, pose)
        solution = sk.VelocitySolver(method, length_scale, mask, frame).solve(jacobian, twist, rotation=pose[:3, :3])
        if adaptive(method):  # the threshold is γσ_max at the most
            assert not np.any(step.singular & ~solution.singular)
        else:
            np.testing.assert_array_equal(step.singular, solution.singular)
        same = step.singular[solution.singular]
        np.testing.assert_allclose(to_rows @ directions, solution.singular_directions[:, same], atol=1e-12)
        np.testing.assert_allclose(others @ directions, 0.0, atol=1e-12)
        scaled = directions * np.array([[1.0]] * 3 + [[length_scale]] * 3)
        np.testing.assert_allclose(scaled.T @ scaled, np.eye(k), atol=1e-12)

        # The directions span the same space as numpy's, where the singular values are well apart.
        u, sigma, _ = np.linalg.svd(to_rows @ jacobian)
        sigma = np.pad(sigma, (0, len(u) - len(sigma)))
        inside, outside = sigma[step.singular], sigma[~step.singular]
        if k and (len(outside) == 0 or np.abs(inside[:, None] - outside).min() > 1e-6 * sigma[0]):
            mine = to_rows @ directions
            ours = u[:, step.singular]
            np.testing.assert_allclose(mine @ mine.T, ours @ ours.T, atol=1e-8)
    assert seen > 5


@pytest.mark.parametrize(
    "method", [sk.JParse(0.2, adaptive=False), sk.JacobianProjection(0.2), sk.JacobianSafety(0.2)], ids=repr
)
def test_j_parse_says_which_by_its_threshold(method):
    for arm, q, length_scale, mask, frame in tasks(np.random.default_rng(6), 40):
        servo = sk.Servo(arm, method, **NO_LIMITS, length_scale=length_scale, mask=mask, frame=frame)
        servo.reset(q)
        sigma = np.linalg.svd(rows(mask, frame, length_scale, servo.pose) @ arm.jacobian(q), compute_uv=False)
        step = servo.update_twist(np.ones(6))
        clear = np.abs(sigma - 0.2 * sigma[0]) > 1e-9
        np.testing.assert_array_equal(step.singular[: len(sigma)][clear], (sigma <= 0.2 * sigma[0])[clear])


def test_the_adaptive_threshold_grows_with_the_command():
    """A small command has a small threshold, and no command has more than γσ_max."""
    counts = np.zeros(3, dtype=int)
    for arm, q, length_scale, mask, frame in tasks(np.random.default_rng(6), 40):
        servo = sk.Servo(arm, sk.JParse(0.2), position_limits=False, length_scale=length_scale, mask=mask, frame=frame)
        jacobian = None
        before = None
        for i, size in enumerate((1e-4, 0.1, 100.0)):
            servo.reset(q)
            if jacobian is None:
                jacobian = rows(mask, frame, length_scale, servo.pose) @ arm.jacobian(q)
            sigma = np.linalg.svd(jacobian, compute_uv=False)
            singular = servo.update_twist(size * np.ones(6)).singular
            counts[i] += singular.sum()
            assert not np.any(singular[: len(sigma)] & (sigma > 0.2 * sigma[0] + 1e-9))
            if before is not None:
                assert not np.any(before & ~singular)
            before = singular
    assert counts[0] < counts[1] < counts[2]


def test_a_stretched_arm_cannot_move_along_them():
    arm = sk.robots.load("franka_panda")
    servo = sk.Servo(arm, sk.JParse())
    servo.reset(np.zeros(7))
    jacobian = arm.jacobian(np.zeros(7))
    step = servo.update_twist([0.1, 0.0, 0.0, 0.0, 0.0, 0.0])
    assert step.singular_directions.shape[1] >= 1
    for direction in step.singular_directions.T:
        assert np.linalg.norm(direction @ jacobian) < 0.1 * step.singular_values[0]


def test_there_are_none_while_holding():
    arm = sk.robots.load("franka_panda")
    servo = sk.Servo(arm, sk.JParse())
    servo.reset(np.zeros(7))
    assert servo.hold().singular_directions.shape == (6, 0)


def test_a_loops_samples_hold_them():
    arm = sk.robots.load("franka_panda")
    servo = sk.Servo(arm, sk.JParse(adaptive=False), mask=[1, 1, 1, 1, 1, 0], frame="tool", length_scale=0.3)
    servo.reset(np.zeros(7))
    twin = sk.Servo(arm, sk.JParse(adaptive=False), mask=[1, 1, 1, 1, 1, 0], frame="tool", length_scale=0.3)
    twin.reset(np.zeros(7))
    with sk.ServoLoop(servo) as loop:
        loop.follow_twist([0.0, 0.0, -0.05, 0.0, 0.0, 0.0], 60.0)
        while loop.statistics.cycles < 30:
            time.sleep(0.01)
    samples = loop.read()
    assert samples["singular_directions"].shape == (len(samples), 6, 6)
    singular = 0
    for sample in samples:
        twist = sample["command"] == sk.LoopCommand.TWIST
        step = twin.update_twist(sample["asked_twist"]) if twist else twin.hold()
        k = step.singular_directions.shape[1]
        singular += k
        np.testing.assert_array_equal(sample["singular_directions"][:, :k], step.singular_directions)
        assert np.isnan(sample["singular_directions"][:, k:]).all()
    assert singular > 0
