"""LeRobot's kinematics on a servo: the same two methods, and all limits hold from call to call."""

import importlib.util
import subprocess
import sys

import numpy as np
import pytest

import sigmaik as sk
from sigmaik import _extras
from sigmaik.lerobot import RobotKinematics, inverse_kinematics_step

PERIOD = 1.0 / 30.0
MOTORS = ["shoulder_pan", "shoulder_lift", "elbow_flex", "wrist_flex", "wrist_roll", "gripper"]
HOME = np.array([*np.degrees(sk.robots.home("so101")), 40.0])


@pytest.fixture
def kinematics():
    return RobotKinematics("so101", "flange", MOTORS, period=PERIOD)


def moved(pose, *way):
    out = pose.copy()
    out[:3, 3] += way
    return out


def test_forward_kinematics_is_that_of_the_chain(kinematics):
    pose = kinematics.forward_kinematics(HOME)
    np.testing.assert_allclose(pose, sk.robots.load("so101").pose(np.radians(HOME[:5])), atol=1e-15)
    assert kinematics.joint_names == MOTORS


def test_other_orders_and_other_joints(kinematics):
    turned = RobotKinematics("so101", "flange", MOTORS[::-1], period=PERIOD)
    pose = kinematics.forward_kinematics(HOME)
    np.testing.assert_array_equal(turned.forward_kinematics(HOME[::-1]), pose)
    target = moved(pose, 0.0, 0.005, 0.0)
    q = kinematics.inverse_kinematics(HOME, target)
    np.testing.assert_array_equal(turned.inverse_kinematics(HOME[::-1], target)[::-1], q)
    assert q[5] == 40.0  # the gripper is not the arm's
    longer = kinematics.inverse_kinematics([*q, 7.0], target)
    assert (len(longer), longer[6]) == (7, 7.0)
    assert RobotKinematics("so101", "flange").joint_names == MOTORS[:5]


@pytest.mark.parametrize("robot", ["so101", "ur10", "ufactory_xarm7"])
def test_the_tip_follows_the_pose(robot):
    kinematics = RobotKinematics(robot, "flange", period=PERIOD)
    q = np.degrees(sk.robots.home(robot))
    start = kinematics.forward_kinematics(q)
    errors = []
    for k in range(90):
        u = 2.0 * k * PERIOD
        target = moved(start, 0.03 * np.sin(u), 0.03 * (np.cos(u) - 1.0), 0.015 * np.sin(0.5 * u))
        q = kinematics.inverse_kinematics(q, target)
        errors.append(np.linalg.norm(kinematics.forward_kinematics(q)[:3, 3] - target[:3, 3]))
    # An arm of five joints has the position first, as LeRobot's weights ask; and no delay of a period.
    assert np.max(errors[15:]) < 5e-4
    assert kinematics.restarts == 0


@pytest.mark.parametrize("robot", ["so101", "ur10", "ufactory_xarm7"])
@pytest.mark.parametrize("weights", [(1.0, 0.01), (1.0, 1.0), (1.0, 0.0), (0.0, 1.0)])
def test_all_limits_hold_where_the_target_jumps_out_of_reach(robot, weights):
    kinematics = RobotKinematics(robot, "flange", period=PERIOD)
    arm = sk.robots.load(robot)
    q = np.degrees(sk.robots.home(robot))
    start = kinematics.forward_kinematics(q)
    rng = np.random.default_rng(3)
    positions = [q, q]  # at rest before
    for k in range(120):
        if k % 20 == 0:
            target = moved(start, *rng.normal(scale=1.0, size=3))
            target[:3, :3] = sk.rotation_exp(rng.normal(size=3)) @ start[:3, :3]
        q = kinematics.inverse_kinematics(q, target, *weights)
        positions.append(q)
    q = np.radians(positions)
    velocity = np.diff(q, axis=0) / PERIOD
    acceleration = np.diff(velocity, axis=0) / PERIOD
    limits = arm.limits
    assert np.all(q >= limits.lower - 1e-9)
    assert np.all(q <= limits.upper + 1e-9)
    assert np.max(np.abs(velocity) / limits.velocity) < 1.0 + 1e-9
    most = np.where(np.isfinite(limits.acceleration), limits.acceleration, 10.0)  # assumed_acceleration
    assert np.max(np.abs(acceleration) / most) < 1.0 + 1e-9
    assert np.max(np.abs(velocity)) > 0.3  # the arm did move
    assert kinematics.restarts == 0


def test_measured_positions_that_lag_do_not_slow_the_arm():
    """LeRobot gives measured positions, which are behind the commands."""
    start = sk.robots.load("so101").pose(np.radians(HOME[:5]))
    ends = []
    for lag in (0, 3):
        kinematics = RobotKinematics("so101", "flange", MOTORS, period=PERIOD)
        sent = [HOME]
        for k in range(60):
            sent.append(
                kinematics.inverse_kinematics(sent[max(0, len(sent) - 1 - lag)], moved(start, 0.0, 1e-3 * k, 0.0))
            )
        ends.append(sent[-1])
        assert kinematics.restarts == 0
    np.testing.assert_array_equal(ends[0], ends[1])


def test_an_arm_that_was_moved_by_hand_starts_anew(kinematics):
    target = moved(kinematics.forward_kinematics(HOME), 0.0, 0.02, 0.0)
    for _ in range(10):
        q = kinematics.inverse_kinematics(HOME, target)
    assert kinematics.step is not None
    elsewhere = q + np.array([45.0, 0.0, 0.0, 0.0, 0.0, 0.0])
    answer = kinematics.inverse_kinematics(elsewhere, target)
    assert kinematics.restarts == 1
    assert np.abs(answer - elsewhere).max() < 1.0
    kinematics.reset()
    assert kinematics.step is None
    assert np.abs(kinematics.inverse_kinematics(HOME, target) - HOME).max() < 1.0
    assert kinematics.restarts == 1


@pytest.mark.parametrize(
    ("options", "text"),
    [
        ({"urdf_path": "no_such_arm"}, "no_such_arm"),
        ({"target_frame_name": "nowhere"}, "nowhere"),
        ({"joint_names": MOTORS[1:]}, "joint_names lacks shoulder_pan"),
        ({"joint_names": [*MOTORS, "gripper"]}, "twice"),
        ({"period": 0.0}, "period"),
        ({"max_lag": float("nan")}, "max_lag"),
    ],
)
def test_what_is_wrong_is_named(options, text):
    with pytest.raises(sk.Error, match=text):
        RobotKinematics(**{"urdf_path": "so101", "target_frame_name": "flange", **options})


def test_values_that_are_none_are_refused_and_change_nothing(kinematics):
    pose = kinematics.forward_kinematics(HOME)
    for call in (
        lambda: kinematics.forward_kinematics([0.0, 1.0]),
        lambda: kinematics.forward_kinematics([float("nan")] * 6),
        lambda: kinematics.inverse_kinematics(HOME, np.full((4, 4), 1.0)),
        lambda: kinematics.inverse_kinematics(HOME, pose, 0.0, 0.0),
        lambda: kinematics.inverse_kinematics(HOME, pose, -1.0, 1.0),
    ):
        with pytest.raises(sk.Error):
            call()
    assert kinematics.step is None


def test_the_module_imports_no_lerobot_and_names_its_command(kinematics, monkeypatch):
    command = "import sys, sigmaik.lerobot; sys.exit('lerobot' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", command]).returncode == 0
    find = importlib.util.find_spec
    monkeypatch.setattr(importlib.util, "find_spec", lambda name: None if name == "lerobot" else find(name))
    with pytest.raises(_extras.MissingPackage, match="pip install lerobot"):
        inverse_kinematics_step(kinematics)


# --- beside LeRobot itself


@pytest.fixture
def lerobot():
    """LeRobot's processors; the test is skipped where LeRobot, or a package that LeRobot needs, is missing."""
    try:
        import lerobot.processor as found
    except Exception as error:  # a package that does not fit raises errors of any kind
        pytest.skip(f"no LeRobot: {error}")
    return found


@pytest.mark.filterwarnings("ignore")
def test_a_pipeline_of_lerobot_takes_the_step(lerobot, kinematics):
    from lerobot.configs.types import PipelineFeatureType
    from lerobot.processor.converters import robot_action_observation_to_transition, transition_to_robot_action

    step = inverse_kinematics_step(kinematics, MOTORS)
    pipeline = lerobot.RobotProcessorPipeline(
        steps=[step],
        to_transition=robot_action_observation_to_transition,
        to_output=transition_to_robot_action,
    )
    start = kinematics.forward_kinematics(HOME)
    observation = {f"{name}.pos": value for name, value in zip(MOTORS, HOME, strict=True)}
    turn = sk.rotation_log(start[:3, :3])
    for k in range(40):
        target = moved(start, 0.0, 1e-3 * k, 0.0)
        action = dict(zip(("ee.x", "ee.y", "ee.z", "ee.wx", "ee.wy", "ee.wz"), [*target[:3, 3], *turn], strict=True))
        answer = pipeline((action | {"ee.gripper_pos": 12.0}, observation))
        assert set(answer) == {f"{name}.pos" for name in MOTORS}
        observation = answer
    q = [answer[f"{name}.pos"] for name in MOTORS]
    assert q[5] == 12.0
    np.testing.assert_allclose(kinematics.forward_kinematics(q)[:3, 3], target[:3, 3], atol=5e-4)
    pipeline.reset()
    assert kinematics.step is None
    features = step.transform_features({PipelineFeatureType.ACTION: {"ee.x": None, "ee.gripper_pos": None}})
    assert set(features[PipelineFeatureType.ACTION]) == {f"{name}.pos" for name in MOTORS}
    assert type(inverse_kinematics_step(kinematics, MOTORS)) is type(step)  # registered once


@pytest.mark.filterwarnings("ignore")
def test_lerobots_own_step_takes_these_kinematics(lerobot, kinematics):
    try:
        from lerobot.robots.so_follower.robot_kinematic_processor import InverseKinematicsEEToJoints
    except ImportError:
        from lerobot.robots.so100_follower.robot_kinematic_processor import InverseKinematicsEEToJoints
    step = InverseKinematicsEEToJoints(kinematics, MOTORS)
    start = kinematics.forward_kinematics(HOME)
    observation = {f"{name}.pos": value for name, value in zip(MOTORS, HOME, strict=True)}
    place = [*(start[:3, 3] + [0.0, 0.0, 1e-3]), *sk.rotation_log(start[:3, :3]), 12.0]
    names = ("ee.x", "ee.y", "ee.z", "ee.wx", "ee.wy", "ee.wz", "ee.gripper_pos")
    transition = {
        lerobot.TransitionKey.ACTION: dict(zip(names, place, strict=True)),
        lerobot.TransitionKey.OBSERVATION: observation,
    }
    action = step(transition)[lerobot.TransitionKey.ACTION]
    own = RobotKinematics("so101", "flange", MOTORS, period=PERIOD)
    target = moved(start, 0.0, 0.0, 1e-3)
    expected = own.inverse_kinematics(HOME, target)
    np.testing.assert_allclose([action[f"{name}.pos"] for name in MOTORS[:5]], expected[:5], atol=1e-9)
    assert action["gripper.pos"] == 12.0


@pytest.mark.filterwarnings("ignore")
def test_forward_kinematics_is_that_of_lerobots_class(kinematics):
    pytest.importorskip("placo")
    model = pytest.importorskip("lerobot.model.kinematics")
    theirs = model.RobotKinematics(str(sk.robots.path("so101")), "flange", MOTORS[:5])
    for q in (HOME, np.array([20.0, -30.0, 40.0, 10.0, -50.0, 0.0])):
        np.testing.assert_allclose(kinematics.forward_kinematics(q), theirs.forward_kinematics(q[:5]), atol=1e-9)
