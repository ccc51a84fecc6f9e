"""The servo from Python: arms that reach, limits that hold, arguments that are refused.

tests/cpp/test_servo.cpp has more.
"""

import numpy as np
import pytest
from all_methods import METHODS
from scipy.spatial.transform import Rotation

import sigmaik as sk

ARMS = sk.robots.names()


@pytest.fixture(params=ARMS)
def arm(request):
    return sk.robots.load(request.param), sk.robots.home(request.param)


def offset(pose, translation=(0, 0, 0), rotvec=(0, 0, 0)):
    out = pose.copy()
    out[:3, 3] += translation
    out[:3, :3] = Rotation.from_rotvec(rotvec).as_matrix() @ out[:3, :3]
    return out


def fixed(method):
    """The method with a threshold that does not depend on the limits."""
    if not isinstance(method, sk.JParse):
        return method
    names = ("gamma", "gain_linear", "gain_angular", "continuous", "singular_posture")
    return sk.JParse(**{name: getattr(method, name) for name in names}, adaptive=False)


# Only the rule.
NO_LIMITS = {f"{kind}_limits": False for kind in ("position", "velocity", "acceleration", "jerk")}


def check_step(step, chain, before, dt, last=None):
    """A step from inside the limits at q = before, with q̇ = last where the servo holds accelerations."""
    limits = chain.limits
    assert np.all(np.abs(step.qdot) <= limits.velocity)
    assert np.all(step.q >= limits.lower)
    assert np.all(step.q <= limits.upper)
    if last is not None:
        assert np.all(np.abs(step.qdot - last) <= limits.acceleration * dt * (1 + 1e-9))
    # To a position limit the last step is rounded.
    np.testing.assert_allclose(step.q, before + dt * step.qdot, rtol=0, atol=1e-11)
    assert 0 <= step.scale <= 1
    if step.status != sk.Status.LIMITED:
        assert step.scale == 1


def test_from_home_to_around_home(arm):
    chain, home = arm
    rng = np.random.default_rng(1)
    for _ in range(3):
        dt = 0.005
        servo = sk.Servo(chain, sk.JParse(), dt=dt)
        servo.reset(home)
        target = chain.pose(home + rng.uniform(-0.2, 0.2, chain.dof))
        before, last = home, np.zeros(chain.dof)
        for _ in range(1500):
            step = servo.update(target)
            check_step(step, chain, before, dt, last)
            before, last = step.q, step.qdot
        np.testing.assert_allclose(servo.pose, target, atol=1e-6)
        np.testing.assert_allclose(servo.pose, chain.pose(step.q), atol=1e-14)
        np.testing.assert_array_equal(servo.q, step.q)


def test_pose_error_is_scipys(arm):
    chain, home = arm
    rng = np.random.default_rng(2)
    for _ in range(50):
        servo = sk.Servo(chain, sk.JParse())
        q = home + rng.normal(size=chain.dof)
        servo.reset(q)
        translation, rotvec = rng.normal(size=3), rng.normal(size=3)
        rotvec *= rng.uniform(0, 3.1) / np.linalg.norm(rotvec)
        step = servo.update(offset(chain.pose(q), translation, rotvec))
        np.testing.assert_allclose(step.pose_error, [*translation, *rotvec], rtol=0, atol=1e-12)


#: Rules whose answer does not depend on the limits.
FIXED = [fixed(method) for method in METHODS]


def test_scaling_keeps_the_direction(arm):
    chain, home = arm
    rng = np.random.default_rng(3)
    slow = chain.with_limits(velocity=rng.uniform(0.05, 0.5, chain.dof))
    limited = 0
    for method in FIXED:
        for _ in range(10):
            free = sk.Servo(slow, method, **NO_LIMITS)
            held = sk.Servo(slow, method, **{**NO_LIMITS, "velocity_limits": True}, on_limit="scale")
            for servo in (free, held):
                servo.reset(home)
            twist = rng.normal(size=6)
            asked, step = free.update_twist(twist), held.update_twist(twist)
            assert asked.scale == 1
            assert asked.limiting_joints == ()
            assert asked.status <= sk.Status.DAMPED
            check_step(step, slow, home, 1e-3)
            ratio = np.abs(asked.qdot) / slow.limits.velocity
            if ratio.max() > 1:
                limited += 1
                np.testing.assert_allclose(step.qdot, asked.qdot / ratio.max(), rtol=1e-12, atol=1e-15)
                assert step.status == sk.Status.LIMITED
                assert step.scale == pytest.approx(1 / ratio.max())
                assert step.limiting_joints == tuple(np.flatnonzero(ratio > ratio.max() * (1 - 1e-12)))
            else:
                np.testing.assert_array_equal(step.qdot, asked.qdot)
                assert step.status == asked.status
                assert step.limiting_joints == ()
    assert limited > 50


def test_velocity_limits_keep_the_direction_of_the_adaptive_rule(arm):
    """A command that is too fast, and the same command three times as fast, give the same motion."""
    chain, home = arm
    rng = np.random.default_rng(4)
    slow = chain.with_limits(velocity=rng.uniform(0.05, 0.5, chain.dof))
    limited = 0
    stretched = np.clip(0.05 * home, chain.limits.lower + 0.01, chain.limits.upper - 0.01)  # some arms nearly are
    for q in (home, home, stretched):
        for _ in range(10):
            twist, steps = rng.normal(size=6), []
            for factor in (1.0, 3.0):
                servo = sk.Servo(slow, **{**NO_LIMITS, "velocity_limits": True}, on_limit="scale")
                servo.reset(q)
                steps.append(servo.update_twist(factor * twist))
                check_step(steps[-1], slow, q, 1e-3)
            assert steps[1].limiting_joints
            if steps[0].limiting_joints:
                limited += 1
                np.testing.assert_allclose(steps[1].qdot, steps[0].qdot, rtol=1e-9, atol=1e-12)
    assert limited > 10


def test_redistribution_says_what_it_misses(arm):
    """LIMITED where the tool misses more than a ten-thousandth of the rule's twist; else other joints took over."""
    chain, home = arm
    rng = np.random.default_rng(13)
    slow = chain.with_limits(velocity=rng.uniform(0.05, 0.5, chain.dof))
    statuses = set()
    for _ in range(100):
        twist = rng.normal(size=6) * rng.choice([0.05, 0.2, 1.0])
        steps = []
        for on_limit in (None, "redistribute", "scale"):
            options = {**NO_LIMITS, "velocity_limits": on_limit is not None}
            servo = sk.Servo(slow, sk.JParse(adaptive=False), **options, on_limit=on_limit or "scale")
            servo.reset(home)
            steps.append(servo.update_twist(twist))
        free, held, scaled = steps
        check_step(held, slow, home, 1e-3)
        whole = np.linalg.norm(free.achieved_twist)
        missed = np.linalg.norm(held.achieved_twist - free.achieved_twist) / whole
        statuses.add(held.status)
        if held.status == sk.Status.LIMITED:
            assert missed > 0.99e-4
            assert held.limiting_joints
        else:
            assert missed <= 1.01e-4
            assert held.status == free.status
        if np.all(np.abs(free.qdot) <= slow.limits.velocity):
            np.testing.assert_array_equal(held.qdot, free.qdot)
            assert held.limiting_joints == ()
        else:
            assert held.limiting_joints
        for joint in held.limiting_joints:
            assert abs(held.qdot[joint]) == pytest.approx(slow.limits.velocity[joint])
        if free.singular_values[-1] > 0.1 * free.singular_values[0]:  # all directions count
            assert missed <= np.linalg.norm(scaled.achieved_twist - free.achieved_twist) / whole + 1e-6
    assert sk.Status.LIMITED in statuses


POSITION_FIRST = [1, 1, 1, 0, 0, 0]


def first_steps(chain, q, twist, **options):
    """The first step without a priority, and with the position first."""
    steps = []
    for exact in (None, POSITION_FIRST):
        servo = sk.Servo(chain, exact=exact, acceleration_limits=False, **options)
        servo.reset(q)
        steps.append(servo.update_twist(twist))
    return steps


def test_what_comes_first_is_exact_where_position_limits_block():
    chain, home = sk.robots.load("franka_panda"), sk.robots.home("franka_panda")
    room = np.array([1.0, 1.0, 1.0, 1.0, 0.0, 0.0, 0.0]) + 1e-12  # the wrist is blocked on both sides
    blocked = chain.with_limits(lower=home - room, upper=home + room)
    twist = [0.1, 0.05, -0.1, 0.4, 0.4, -0.4]
    level, first = first_steps(blocked, home, twist)
    assert np.linalg.norm(level.achieved_twist[:3] - twist[:3]) > 1e-2
    np.testing.assert_allclose(first.achieved_twist[:3], twist[:3], atol=1e-5)
    assert np.linalg.norm(first.achieved_twist[3:] - twist[3:]) > 1e-2
    assert first.status == sk.Status.LIMITED
    with pytest.raises(sk.Error, match="exact"):
        sk.Servo(chain, mask=[1, 1, 1, 1, 1, 0], exact=[0, 0, 0, 0, 0, 1])


def test_what_comes_first_is_exact_where_nothing_is_limited():
    """Five joints cannot turn the tool about every axis: the position is exact, and without a priority it is not."""
    chain = sk.robots.load("ur10").with_limits(lower=[*[-7.0] * 5, -1e-12], upper=[*[7.0] * 5, 1e-12])
    q = np.array([0.0, -1.2, 1.5, -1.2, -1.57, 0.0])
    stretched = np.array([0.0, -1.2, 0.02, -1.2, -1.57, 0.0])
    for here in (q, stretched):
        level, first = first_steps(chain, here, [0.02, 0.01, -0.02, 0.0, 0.0, 0.3])
        assert np.linalg.norm(level.achieved_twist[:3] - [0.02, 0.01, -0.02]) > 1e-3
        if here is q:
            np.testing.assert_allclose(first.achieved_twist[:3], [0.02, 0.01, -0.02], atol=1e-5)


def test_velocity_limits_slow_the_motion_down_and_leave_what_comes_first_exact():
    chain, home = sk.robots.load("franka_panda"), sk.robots.home("franka_panda")
    slow = chain.with_limits(velocity=[2.0, 2.0, 2.0, 2.0, 0.1, 0.1, 0.1])
    twist = np.array([0.1, 0.05, -0.1, 0.8, 0.8, -0.8])
    level, first = first_steps(slow, home, twist)
    part = np.linalg.norm(level.achieved_twist) / np.linalg.norm(twist)
    assert 0.1 < part < 0.2
    np.testing.assert_allclose(level.achieved_twist, part * twist, atol=1e-5)
    assert level.scale == pytest.approx(part, rel=1e-3)
    np.testing.assert_allclose(first.achieved_twist[:3], twist[:3], atol=1e-5)
    for step in (level, first):
        assert step.status == sk.Status.LIMITED
        assert np.abs(step.qdot / slow.limits.velocity).max() == pytest.approx(1.0)


def test_a_start_outside_comes_back_by_itself(arm):
    chain, home = arm
    limits = chain.limits
    for i in np.flatnonzero(np.isfinite(limits.upper)):
        q = home.copy()
        q[i] = limits.upper[i] + 0.05
        servo = sk.Servo(chain, sk.JParse(), dt=0.002)
        servo.reset(q)
        last = np.zeros(chain.dof)
        for _ in range(2000):
            step = servo.update_twist(np.zeros(6))
            assert np.all(np.abs(step.qdot) <= limits.velocity)
            assert np.all(np.abs(step.qdot - last) <= 0.002 * limits.acceleration * (1 + 1e-9))
            last = step.qdot
        assert np.all(servo.q <= limits.upper)
        assert np.all(servo.q >= limits.lower)


def test_no_kick_at_the_start(arm):
    chain, home = arm
    for method in METHODS:
        servo = sk.Servo(chain, method, posture_gain=5.0)
        servo.reset(home)
        for _ in range(20):
            step = servo.update(chain.pose(home))
            np.testing.assert_allclose(step.qdot, 0, atol=1e-12)
        servo = sk.Servo(chain, method)
        servo.reset(home)
        first = servo.update(offset(chain.pose(home), (0.3, 0.2, -0.3), (1, 1, 1)))
        hard = sk.Servo(chain, method, soft_start=0.0, **NO_LIMITS)
        hard.reset(home)
        full = hard.update(offset(chain.pose(home), (0.3, 0.2, -0.3), (1, 1, 1)))
        assert np.linalg.norm(first.qdot) <= 0.0101 * np.linalg.norm(full.qdot)


def test_from_an_exact_singularity(arm):
    """At q = 0, in all twelve directions: the servo does every motion that the arm can do, and calls others damped.

    (q = 0 is outside the position limits of some arms.)
    """
    chain, _ = arm
    zero = np.zeros(chain.dof)
    U, sigma, _ = np.linalg.svd(chain.jacobian(zero))
    can = U[:, : sigma.size][:, sigma > 1e-9 * sigma[0]]
    for axis in range(6):
        for sign in (1, -1):
            direction = sign * np.eye(6)[axis]
            servo = sk.Servo(chain, sk.JParse(), position_limits=False)
            servo.reset(zero)
            progress, statuses = 0.0, set()
            for _ in range(50):
                step = servo.update_twist(0.05 * direction)
                progress += 1e-3 * direction @ step.achieved_twist
                statuses.add(step.status)
            if np.linalg.norm(can.T @ direction) > 1e-3:
                assert progress > 1e-8
            else:
                assert statuses == {sk.Status.DAMPED}
                np.testing.assert_allclose(servo.q, 0, atol=1e-9)


def test_it_leaves_the_singularity_that_it_started_in(arm):
    """From q = 0 to a pose well inside the workspace."""
    chain, home = arm
    target = chain.pose(home)
    servo = sk.Servo(chain, sk.JParse(), dt=0.01)
    servo.reset(np.zeros(chain.dof))
    errors = []
    for _ in range(6000):
        errors.append(np.linalg.norm(servo.update(target).pose_error))
    assert np.isfinite(errors).all()
    assert errors[-1] < errors[0]
    assert np.all(np.diff(errors[50:]) < 2e-2)


@pytest.mark.parametrize("method", METHODS, ids=repr)
def test_targets_that_jump_and_are_out_of_reach(method):
    chain = sk.robots.load("ufactory_xarm7")
    rng = np.random.default_rng(4)
    servo = sk.Servo(chain, method, dt=0.02)
    before, last = sk.robots.home("ufactory_xarm7"), np.zeros(7)
    servo.reset(before)
    for cycle in range(2000):
        if cycle % 100 == 0:
            target = chain.pose(chain.random_configuration(rng))
            target[:3, 3] *= rng.choice([1, 1, 3, 1e6])
        step = servo.update(target)
        check_step(step, chain, before, 0.02, last)
        assert np.all(np.isfinite(step.pose_error))
        before, last = step.q, step.qdot


def test_out_of_reach_and_back():
    """The xArm7's line: out, stretched and still, and back to within a micrometre.

    Without position limits: on its way back the elbow may fold to the side where it has no room, see
    docs/limits.md.
    """
    chain, home = sk.robots.load("ufactory_xarm7"), sk.robots.home("ufactory_xarm7")
    servo = sk.Servo(chain, sk.JParse(), dt=0.01, position_limits=False)
    servo.reset(home)
    start = servo.pose
    for _ in range(2000):
        step = servo.update(offset(start, (3, 0, 0)))
    assert step.status == sk.Status.DAMPED
    assert step.singular.any()
    assert step.singular_values[-1] < 0.05 * step.singular_values[0]
    assert np.linalg.norm(step.qdot) < 0.05
    for _ in range(3000):
        step = servo.update(start)
    np.testing.assert_allclose(step.pose_error, 0, atol=1e-6)


def test_posture_is_pinned_where_the_arm_started_or_as_given():
    chain, home = sk.robots.load("franka_panda"), sk.robots.home("franka_panda")
    rng = np.random.default_rng(5)
    given = home + rng.uniform(-0.2, 0.2, 7)
    for posture in (None, given):
        servo = sk.Servo(chain, sk.JParse(), dt=0.01, posture=posture, posture_gain=2.0)
        servo.reset(home)
        target = chain.pose(home)
        for _ in range(1500):
            servo.update(target)
        np.testing.assert_allclose(servo.pose, target, atol=1e-6)
        away = (home if posture is None else given) - servo.q
        # At rest the posture pulls along nothing that the task leaves free.
        null = np.linalg.svd(chain.jacobian(servo.q))[2][6:]
        np.testing.assert_allclose(null @ away, 0, atol=1e-6)
    with pytest.raises(sk.Error, match="posture"):
        sk.Servo(chain, sk.JParse(), posture=np.zeros(6))


def test_only_some_rows():
    chain, home = sk.robots.load("ur10"), sk.robots.home("ur10")
    target = offset(chain.pose(home), (0.1, 0.05, -0.1), (0.4, -0.3, 0.5))
    servo = sk.Servo(chain, sk.JParse(), dt=0.01, mask=[1, 1, 1, 0, 0, 0])
    servo.reset(home)
    for _ in range(1500):
        step = servo.update(target)
    np.testing.assert_allclose(step.pose_error[:3], 0, atol=1e-8)
    assert np.linalg.norm(step.pose_error[3:]) > 0.1
    assert step.singular.shape == step.singular_values.shape == (3,)

    # Free rotation about the tool's z axis: the axis itself arrives.
    servo = sk.Servo(chain, sk.JParse(), dt=0.01, mask=[1, 1, 1, 1, 1, 0], frame="tool")
    servo.reset(home)
    for _ in range(2500):
        step = servo.update(target)
    np.testing.assert_allclose(step.pose_error[:3], 0, atol=1e-6)
    np.testing.assert_allclose(servo.pose[:3, 2], target[:3, 2], atol=1e-6)


class Homogeneous:
    def __init__(self, matrix):
        self.homogeneous = matrix


class AsMatrix:
    def __init__(self, matrix):
        self.matrix = matrix

    def as_matrix(self):
        return self.matrix


class Spatialmath:
    def __init__(self, matrix):
        self.A = matrix


def test_poses_of_other_libraries():
    chain, home = sk.robots.load("ur10"), sk.robots.home("ur10")
    target = offset(chain.pose(home), (0.1, 0, 0))

    def first(pose):
        servo = sk.Servo(chain, sk.JParse())
        servo.reset(home)
        return servo.update(pose).qdot

    expected = first(target)
    for same in (
        Homogeneous(target),
        AsMatrix(target),
        Spatialmath(target),
        target.tolist(),
        np.asfortranarray(target),
    ):
        np.testing.assert_array_equal(first(same), expected)
    np.testing.assert_allclose(first(target.astype(np.float32)), expected, rtol=1e-4, atol=1e-6)


NOT_POSES = [
    np.full((4, 4), np.nan),
    np.zeros((4, 4)),
    2 * np.eye(4),
    np.diag([1, 1, -1, 1]),
    np.diag([1, 1, 1, 2]),
    np.eye(4) + 1e-3 * np.eye(4, k=1),
    np.eye(3),
    np.eye(4)[None],
    np.zeros(7),
    None,
    "pose",
    1.0,
    np.eye(4, dtype=complex),
]


@pytest.mark.parametrize("wrong", NOT_POSES, ids=repr)
def test_what_is_not_a_pose_is_refused_and_leaves_no_trace(wrong):
    chain, home = sk.robots.load("ur10"), sk.robots.home("ur10")
    target = offset(chain.pose(home), (0.1, 0, 0))
    servo, untouched = sk.Servo(chain, sk.JParse(), strict=True), sk.Servo(chain, sk.JParse(), strict=True)
    servo.reset(home)
    untouched.reset(home)
    for _ in range(10):
        with pytest.raises(sk.Error, match="target"):
            servo.update(wrong)
        np.testing.assert_array_equal(servo.q, untouched.q)
        np.testing.assert_array_equal(servo.update(target).qdot, untouched.update(target).qdot)


@pytest.mark.parametrize(
    "wrong", [np.full(6, np.nan), [0, 0, 0, 0, 0, np.inf], np.zeros(7), np.zeros((6, 1)), None, "x", 0.0]
)
def test_what_is_not_a_twist_is_refused(wrong):
    servo = sk.Servo(sk.robots.load("ur10"), sk.JParse())
    servo.reset(sk.robots.home("ur10"))
    q = servo.q
    with pytest.raises(sk.Error, match="twist"):
        servo.update_twist(wrong)
    np.testing.assert_array_equal(servo.q, q)


def test_before_reset():
    servo = sk.Servo(sk.robots.load("ur10"), sk.JParse())
    for call in (
        lambda: servo.update(np.eye(4)),
        lambda: servo.update_twist(np.zeros(6)),
        lambda: servo.q,
        lambda: servo.pose,
    ):
        with pytest.raises(sk.Error, match="reset"):
            call()


@pytest.mark.parametrize("n", [0, 1, 5, 7, 16, 17, 20, 10_000])
def test_reset_with_a_wrong_size(n):
    servo = sk.Servo(sk.robots.load("ur10"), sk.JParse())
    with pytest.raises(sk.Error, match="q has shape"):
        servo.reset(np.zeros(n))
    servo.reset(np.zeros(6))
    with pytest.raises(sk.Error, match="qdot has shape"):
        servo.reset(np.zeros(6), np.zeros(n))
    with pytest.raises(sk.Error, match="qddot has shape"):
        servo.reset(np.zeros(6), np.zeros(6), np.zeros(n))
    with pytest.raises(sk.Error, match="q has shape"):
        servo.measure(np.zeros(n))
    with pytest.raises(sk.Error, match="qdot has shape"):
        servo.measure(np.zeros(6), np.zeros(n))


def test_reset_with_what_is_not_finite():
    servo = sk.Servo(sk.robots.load("ur10"), sk.JParse())
    servo.reset(sk.robots.home("ur10"))
    with pytest.raises(sk.Error, match=r"q\[2\]"):
        servo.reset([0, 0, np.nan, 0, 0, 0])
    np.testing.assert_array_equal(servo.q, sk.robots.home("ur10"))


@pytest.mark.parametrize(
    "options",
    [
        {"dt": 0.0},
        {"dt": -1e-3},
        {"dt": np.nan},
        {"dt": np.inf},
        {"gain_linear": -1.0},
        {"gain_angular": np.nan},
        {"gain_linear": np.inf},
        {"max_linear_error": 0.0},
        {"max_angular_error": -1.0},
        {"max_angular_error": np.nan},
        {"soft_start": -0.1},
        {"soft_start": np.inf},
        {"posture_gain": -1.0},
        {"posture_max_speed": 0.0},
        {"length_scale": 0.0},
        {"length_scale": np.nan},
        {"on_limit": "ignore"},
        {"assumed_acceleration": 0.0},
        {"assumed_acceleration": np.nan},
        {"recovery_speed": 0.0},
        {"recovery_speed": 1.1},
        {"exact": [1] * 5},
        {"mask": [0] * 6},
        {"mask": [1] * 7},
        {"frame": "world"},
        {"posture": np.zeros(20)},
        {"posture": [np.nan] * 6},
    ],
    ids=repr,
)
def test_options_out_of_their_range(options):
    with pytest.raises(sk.Error, match=next(iter(options))):
        sk.Servo(sk.robots.load("ur10"), sk.JParse(), **options)


def test_beyond_numbers():
    chain, home = sk.robots.load("ur10"), sk.robots.home("ur10")
    servo = sk.Servo(chain, sk.JParse(), dt=1e10, **NO_LIMITS)
    servo.reset(home)
    with pytest.raises(sk.Error, match="too large"):
        servo.update_twist(np.full(6, 1e300))
    np.testing.assert_array_equal(servo.q, home)


def test_what_can_be_asked_of_a_servo():
    chain = sk.robots.load("ur10")
    servo = sk.Servo(chain, sk.JParse(0.2), 0.002, acceleration_limits=False)
    assert servo.dt == 0.002
    assert servo.chain.joint_names == chain.joint_names
    assert servo.method == sk.JParse(0.2)
    servo.method = sk.DampedLeastSquares()
    assert servo.method == sk.DampedLeastSquares()
    servo.reset(sk.robots.home("ur10"))
    step = servo.update_twist([0.1, 0, 0, 0, 0, 0])
    assert step.status == sk.Status.DAMPED
    assert "damped" in repr(step)
    with pytest.raises(TypeError):
        servo.method = None
    with pytest.raises(AttributeError):
        servo.dt = 1.0
    with pytest.raises(AttributeError):
        step.q = np.zeros(6)


def test_an_arm_of_few_joints_says_which_directions_it_has_not():
    """Two joints, six rows: four directions that nothing can move are singular, too."""
    urdf = """<robot name="two"><link name="a"/><link name="b"/><link name="c"/><link name="d"/>
      <joint name="j1" type="continuous"><parent link="a"/><child link="b"/><axis xyz="0 0 1"/></joint>
      <joint name="j2" type="continuous"><parent link="b"/><child link="c"/>
        <origin xyz="1 0 0"/><axis xyz="0 0 1"/></joint>
      <joint name="t" type="fixed"><parent link="c"/><child link="d"/><origin xyz="1 0 0"/></joint></robot>"""
    chain = sk.Chain.from_urdf(urdf)
    servo = sk.Servo(chain, sk.JParse())
    servo.reset([0.3, 0.7])
    step = servo.update_twist([0, 0, 0.1, 0, 0, 0])
    assert step.status == sk.Status.DAMPED
    np.testing.assert_allclose(step.qdot, 0, atol=1e-12)
    solution = sk.VelocitySolver(sk.JParse()).solve(chain.jacobian([0.3, 0.7]), [0, 0, 0.1, 0, 0, 0])
    assert solution.singular.sum() == 4
    np.testing.assert_array_equal(step.singular, solution.singular)


@pytest.mark.parametrize("avoid", ["potential", "manipulability"])
def test_a_redundant_arm_keeps_away_from_singularities(avoid):
    arm = sk.robots.load("kuka_lbr_iiwa_14_r820")
    sing = sk.singularities.of(arm)
    q = np.array([0.3, 0.1, 1.3, -1.0, 0.4, 0.9, 0.2])  # near the shoulder's set
    servo = sk.Servo(arm, sk.JParse(), avoid=avoid, avoid_gain=1.0 if avoid == "potential" else 20.0)
    servo.reset(q)
    target = servo.pose
    for _ in range(4000):
        step = servo.update(target)
        assert np.linalg.norm(step.pose_error) < 2e-3
    assert sing.residuals(step.q).min() > 2.0 * sing.residuals(q).min()
    assert sing.manipulability(step.q) > sing.manipulability(q)


@pytest.mark.parametrize(
    ("options", "text"),
    [
        ({"avoid": "walls"}, "avoid = 'walls'"),
        ({"avoid": "potential", "avoid_gain": -1.0}, "avoid_gain"),
        ({"avoid": "potential", "avoid_max_speed": 0.0}, "avoid_max_speed"),
        ({"avoid": "potential", "eta2": -1.0}, "eta2"),
    ],
)
def test_avoidance_refuses(options, text):
    with pytest.raises(sk.Error, match=text):
        sk.Servo(sk.robots.load("franka_panda"), sk.JParse(), **options)


def test_avoidance_by_potential_needs_known_sets():
    with pytest.raises(sk.Error, match="not known"):
        sk.Servo(sk.robots.load("ufactory_xarm7"), sk.JParse(), avoid="potential")


def test_a_jog_device_sends_twists_in_the_axes_of_the_tool():
    arm = sk.robots.load("ur10")
    servo = sk.Servo(arm)
    servo.reset([0.0, -1.2, 1.5, -1.87, -1.57, 0.0])
    before = servo.pose
    for _ in range(500):
        servo.update_twist([0, 0, 0.1, 0, 0, 0], frame="tool")
    way = servo.pose[:3, 3] - before[:3, 3]
    np.testing.assert_allclose(before[:3, :3].T @ way, [0, 0, np.linalg.norm(way)], atol=1e-4)
    assert np.linalg.norm(way) > 0.04
    while servo.hold().qdot.any():
        pass
    # A turn about a point 0.2 m before the tool leaves this point in its place.
    point = servo.pose @ [0, 0, 0.2, 1]
    for _ in range(300):
        servo.update_twist([0, 0, 0, 0.3, 0, 0], frame="tool", point=[0, 0, 0.2])
    np.testing.assert_allclose(servo.pose @ [0, 0, 0.2, 1], point, atol=1e-4)
    with pytest.raises(sk.Error, match="frame"):
        servo.update_twist(np.zeros(6), frame="world")
    with pytest.raises(sk.Error, match="point"):
        servo.update_twist(np.zeros(6), point=[0, 0])


@pytest.mark.parametrize("kind", ["5 digits", "6 digits", "float32 products", "quaternion"])
def test_a_rotation_that_is_one_but_for_rounding_is_taken_and_counted(kind):
    arm = sk.robots.load("ur10")
    servo = sk.Servo(arm)
    q = np.array([0.0, -1.2, 1.5, -1.87, -1.57, 0.0])
    rng = np.random.default_rng(3)
    servo.reset(q)
    for _ in range(50):
        exact = arm.pose(q + 0.1 * rng.normal(size=6))
        target = exact.copy()
        if "digits" in kind:
            target = np.round(exact, int(kind[0]))
        elif kind == "quaternion":
            target[:3, :3] *= 1.0 + rng.choice([-1, 1]) * 2e-4  # of a quaternion whose length is off by 1e-4
        else:
            product = np.eye(4, dtype=np.float32)
            for _ in range(50):
                product = product @ arm.pose(q + rng.normal(size=6)).astype(np.float32)
            target[:3, :3] = product[:3, :3]
        assert servo.update(target).status != sk.Status.BAD_INPUT
    assert servo.rough_targets == 50
    servo.update(arm.pose(q))
    assert servo.rough_targets == 50
    assert servo.update(np.diag([1.01, 1.01, 1.01, 1.0])).status == sk.Status.BAD_INPUT
    assert servo.rough_targets == 50


@pytest.mark.parametrize("gain", ["gain_linear", "gain_angular"])
def test_without_a_gain_nothing_is_led(gain):
    arm, home = sk.robots.load("franka_panda"), sk.robots.home("franka_panda")
    far = arm.pose(home)
    far[0, 3] += 5.0  # out of reach
    states = {}
    for options in ({}, {gain: 0.0}):
        servo = sk.Servo(arm, dt=4e-3, guided=True, **options)
        servo.reset(home)
        states[len(options)] = {servo.update(far).guide for _ in range(500)}
    assert sk.GuideState.UNREACHABLE in states[0]
    assert states[1] == {sk.GuideState.DIRECT}
