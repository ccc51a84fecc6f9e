"""Other people's URDFs, as the PyPI packages example-robot-data and rtb-data ship them.

Every path from the root to a leaf, in every file, against a reader and kinematics of the test's own; some
arms also against Pinocchio, where it is installed.
"""

import contextlib
import functools
import importlib.metadata
import xml.etree.ElementTree as ET
from pathlib import Path

import numpy as np
import pytest

import sigmaik as sk
from sigmaik_lab.arrival import experiment as arrival

TOLERANCE = 1e-12  # m, and entries of rotations
SEED = 11


def vendor_files():
    """{short name: path} of every URDF in the packages."""
    found = {}
    for package in ("example-robot-data", "rtb-data"):
        for file in importlib.metadata.distribution(package).files:
            if file.suffix == ".urdf":
                found["/".join((package, file.parts[-3], file.name))] = Path(file.locate())
    return found


FILES = vendor_files()

# name, tip (the base is the root), movable joints
ARMS = [
    ("example-robot-data/panda_description/panda.urdf", "panda_hand_tcp", 7),
    ("example-robot-data/ur_description/ur3_robot.urdf", "tool0", 6),
    ("example-robot-data/ur_description/ur5_robot.urdf", "ee_link", 6),
    ("example-robot-data/ur_description/ur10_robot.urdf", "tool0", 6),
    ("example-robot-data/kinova_description/kinova.urdf", "j2s6s200_end_effector", 6),
    ("example-robot-data/xarm_description/xarm7.urdf", "link7", 7),
    ("example-robot-data/z1_description/z1.urdf", "gripperStator", 6),
    ("example-robot-data/so_arm_description/so101.urdf", "gripper_frame_link", 5),
    ("example-robot-data/baxter_description/baxter.urdf", "left_gripper", 7),
    ("example-robot-data/pr2_description/pr2.urdf", "r_gripper_palm_link", 8),
    ("example-robot-data/tiago_description/tiago.urdf", "arm_7_link", 8),
    ("example-robot-data/talos_data/talos_left_arm.urdf", "gripper_left_motor_double_link", 7),
    ("rtb-data/kuka_kr210/kr210l150.urdf", "tool0", 6),
    ("rtb-data/kuka_lbr_iiwa/lbr_iiwa_14_r820.urdf", "tool0", 7),
    ("rtb-data/abb_irb140_description/irb140.urdf", "tool0", 6),
    ("rtb-data/unimation_puma560_description/puma560_robot.urdf", "link7", 6),
    ("rtb-data/lynxmotion_al5d_description/al5d_robot.urdf", "link4", 4),
]
IDS = [name.rsplit("/")[-1] for name, _, _ in ARMS]


# A reader of its own ----------


@functools.cache
def read(path):
    """(links in order, {child: joint element}, {link: <inertia>}) of a URDF; None where it is not XML."""
    try:
        robot = ET.parse(path).getroot()
    except ET.ParseError:
        return None
    links = [link.get("name") for link in robot.findall("link")]
    inertias = {
        link.get("name"): e for link in robot.findall("link") if (e := link.find("inertial/inertia")) is not None
    }
    return links, {joint.find("child").get("link"): joint for joint in robot.findall("joint")}, inertias


def path_to(joints, tip):
    path = []
    while tip in joints:
        path.append(joints[tip])
        tip = joints[tip].find("parent").get("link")
    return path[::-1]


def leaves(links, joints):
    parents = {joint.find("parent").get("link") for joint in joints.values()}
    return [link for link in links if link not in parents]


def movable(path):
    return [joint for joint in path if joint.get("type") != "fixed"]


def has_negative_moment(element):
    entry = {name: float(value) for name, value in element.attrib.items()}
    xx, xy, xz, yy, yz, zz = (entry[name] for name in ("ixx", "ixy", "ixz", "iyy", "iyz", "izz"))
    tensor = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
    return np.linalg.eigvalsh(tensor)[0] < -1e-12 - 1e-9 * np.abs(tensor).max()


def is_arm(path, inertias):
    """Whether sigmaik should accept the path. inertias: {link: <inertia>}."""
    if any(
        has_negative_moment(inertias[link]) for joint in path if (link := joint.find("child").get("link")) in inertias
    ):
        return False
    for joint in movable(path):
        limit = joint.find("limit")
        if joint.get("type") in ("floating", "planar") or joint.find("mimic") is not None:
            return False
        if joint.get("type") != "continuous" and (
            limit is None or float(limit.get("lower", 0)) >= float(limit.get("upper", 0))
        ):
            return False
    return 1 <= len(movable(path)) <= 16


def vector(element, attribute, default):
    text = default if element is None else element.get(attribute, default)
    return np.array([float(x) for x in text.split()])


def turn(axis, angle):
    """The rotation about an axis, by Rodrigues' formula."""
    x, y, z = axis
    K = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    return np.eye(3) + np.sin(angle) * K + (1.0 - np.cos(angle)) * K @ K


def reference(path, q):
    """Pose (4, 4) and Jacobian (6, n) of the tip."""
    X, Y, Z = np.eye(3)
    R, p = np.eye(3), np.zeros(3)
    axes = []
    q = iter(q)
    for joint in path:
        origin = joint.find("origin")
        roll, pitch, yaw = vector(origin, "rpy", "0 0 0")
        p = p + R @ vector(origin, "xyz", "0 0 0")
        R = R @ turn(Z, yaw) @ turn(Y, pitch) @ turn(X, roll)
        if joint.get("type") == "fixed":
            continue
        axis = vector(joint.find("axis"), "xyz", "1 0 0")
        axis /= np.linalg.norm(axis)
        if joint.get("type") == "prismatic":
            axes.append((None, R @ axis))
            p = p + next(q) * R @ axis
        else:
            axes.append((p, R @ axis))
            R = R @ turn(axis, next(q))
    pose = np.eye(4)
    pose[:3, :3], pose[:3, 3] = R, p
    columns = [np.r_[z, np.zeros(3)] if point is None else np.r_[np.cross(z, p - point), z] for point, z in axes]
    return pose, np.array(columns).T


def limits(path):
    """(lower, upper, velocity, effort), with sigmaik's reading of what is not given."""
    rows = []
    for joint in movable(path):
        limit = joint.find("limit")
        get = {} if limit is None else limit.attrib
        low, high = (float(get.get(name, 0)) for name in ("lower", "upper"))
        if joint.get("type") == "continuous":
            low, high = -np.inf, np.inf
        rows.append([low, high, *(float(get.get(name, 0)) or np.inf for name in ("velocity", "effort"))])
    rows = np.array(rows).T
    return np.where(np.abs(rows) >= 1e9, np.copysign(np.inf, rows), rows)


# Tests ----------


@pytest.mark.parametrize("name", sorted(FILES))
def test_every_path(name):
    path = FILES[name]
    if read(path) is None:
        with pytest.raises(sk.Error, match="malformed XML"):
            sk.Chain.from_urdf(path)
        return
    rng = np.random.default_rng(SEED)
    links, joints, inertias = read(path)
    text = path.read_text(encoding="utf-8")
    for leaf in leaves(links, joints):
        arm = path_to(joints, leaf)
        if any(joint.find("mimic") is not None for joint in movable(arm)):  # test_mimic.cpp has the kinematics
            with contextlib.suppress(sk.Error):
                sk.Chain.from_urdf(text, tip=leaf)
            continue
        if not is_arm(arm, inertias):
            with pytest.raises(sk.Error):
                sk.Chain.from_urdf(text, tip=leaf)
            continue
        chain = sk.Chain.from_urdf(text, tip=leaf)
        assert list(chain.joint_names) == [joint.get("name") for joint in movable(arm)]
        assert list(chain.joint_types) == [joint.get("type") for joint in movable(arm)]
        assert (chain.base, chain.tip) == (arm[0].find("parent").get("link"), leaf)
        got = chain.limits
        np.testing.assert_array_equal([got.lower, got.upper, got.velocity, got.effort], limits(arm))
        for _ in range(3):
            q = rng.uniform(-3.0, 3.0, chain.dof)
            pose, jacobian = reference(arm, q)
            np.testing.assert_allclose(chain.pose(q), pose, rtol=0, atol=TOLERANCE)
            np.testing.assert_allclose(chain.jacobian(q), jacobian, rtol=0, atol=TOLERANCE)


def test_most_paths_are_arms():
    """The test above would pass if it refused every URDF: this test counts the comparisons."""
    files = [file for file in map(read, FILES.values()) if file]
    arms = [
        is_arm(path_to(joints, leaf), inertias) for links, joints, inertias in files for leaf in leaves(links, joints)
    ]
    assert sum(arms) > 480  # the others have mimics, planar joints, or inertias that no body has


@pytest.mark.parametrize(("name", "tip", "dof"), ARMS, ids=IDS)
def test_arm(name, tip, dof):
    chain = sk.Chain.from_urdf(FILES[name], tip=tip)
    assert chain.dof == dof
    arm = path_to(read(FILES[name])[1], tip)
    rng = np.random.default_rng(SEED)
    for _ in range(100):
        q = rng.uniform(-3.0, 3.0, dof)
        pose, jacobian = reference(arm, q)
        np.testing.assert_allclose(chain.pose(q), pose, rtol=0, atol=TOLERANCE)
        np.testing.assert_allclose(chain.jacobian(q), jacobian, rtol=0, atol=TOLERANCE)


@pytest.mark.parametrize(("name", "tip", "dof"), ARMS, ids=IDS)
def test_base_in_the_middle(name, tip, dof):
    joints = read(FILES[name])[1]
    arm = path_to(joints, tip)
    base = movable(arm)[dof // 2].find("parent").get("link")
    upper = arm[[joint.find("parent").get("link") for joint in arm].index(base) :]
    chain = sk.Chain.from_urdf(FILES[name], base, tip)
    assert chain.dof == dof - dof // 2
    q = np.random.default_rng(SEED).uniform(-3.0, 3.0, chain.dof)
    pose, jacobian = reference(upper, q)
    np.testing.assert_allclose(chain.pose(q), pose, rtol=0, atol=TOLERANCE)
    np.testing.assert_allclose(chain.jacobian(q), jacobian, rtol=0, atol=TOLERANCE)


@pytest.mark.parametrize(("name", "tip", "dof"), ARMS, ids=IDS)
def test_arm_as_in_pinocchio(name, tip, dof):
    pin = pytest.importorskip("pinocchio")
    chain = sk.Chain.from_urdf(FILES[name], tip=tip)
    model = pin.buildModelFromUrdf(str(FILES[name]))
    data = model.createData()
    ids = [model.getJointId(joint) for joint in chain.joint_names]
    rng = np.random.default_rng(SEED)
    for _ in range(20):
        q = rng.uniform(-3.0, 3.0, dof)
        full = pin.neutral(model)
        for value, i in zip(q, ids, strict=True):
            # Continuous joints are (cos, sin) there.
            full[model.idx_qs[i] : model.idx_qs[i] + model.nqs[i]] = (
                value if model.nqs[i] == 1 else (np.cos(value), np.sin(value))
            )
        frame = model.getFrameId(tip, pin.FrameType.BODY)
        pin.computeJointJacobians(model, data, full)
        pin.updateFramePlacements(model, data)
        jacobian = pin.getFrameJacobian(model, data, frame, pin.LOCAL_WORLD_ALIGNED)
        np.testing.assert_allclose(chain.pose(q), data.oMf[frame].homogeneous, rtol=0, atol=TOLERANCE)
        np.testing.assert_allclose(
            chain.jacobian(q), jacobian[:, [model.idx_vs[i] for i in ids]], rtol=0, atol=TOLERANCE
        )


@pytest.mark.filterwarnings("ignore::sigmaik.ModelWarning")
@pytest.mark.parametrize(("name", "tip", "dof"), ARMS, ids=IDS)
def test_near_targets_are_reached_without_tuning(name, tip, dof):
    """Every joint moves by up to 0.25 rad. The PR2's first joint, its torso, would take 20 s for 0.25 m."""
    settings = arrival.ArrivalSettings(trials=20, rate=500.0, seed=3)
    chain = sk.Chain.from_urdf(FILES[name], tip=tip)
    if "pr2" in name:
        chain = sk.Chain.from_urdf(FILES[name], "torso_lift_link", tip)
    done = arrival.drive(chain, arrival.draw_trials(chain, settings), "default", settings)
    assert np.all(done.excess == 0.0)
    assert np.all(np.isfinite(done.time))
    assert np.median(done.time) <= 0.8


@pytest.mark.filterwarnings("ignore::sigmaik.ModelWarning")
@pytest.mark.parametrize(("name", "tip", "dof"), ARMS, ids=IDS)
def test_small_commands_are_done_in_nine_postures_of_ten(name, tip, dof):
    """Also by small arms, whose singular values are small. The command is one that joints make: arms of 4 and 5 joints
    have twists that no joint velocity makes."""
    rng = np.random.default_rng(SEED)
    chain = sk.Chain.from_urdf(FILES[name], tip=tip)
    servo = sk.Servo(chain, acceleration_limits=False)
    damped = 0
    for trial in arrival.draw_trials(chain, arrival.ArrivalSettings(trials=200, seed=SEED)):
        servo.reset(trial.start)
        slowly = 0.01 * np.minimum(chain.limits.velocity, 1.0) * rng.uniform(-1.0, 1.0, dof)
        damped += servo.update_twist(chain.jacobian(trial.start) @ slowly).status != sk.Status.OK
    assert damped <= 20


@pytest.mark.filterwarnings("ignore::sigmaik.ModelWarning")
def test_an_arm_of_five_joints_keeps_its_position_and_gives_up_the_tilt():
    chain = sk.Chain.from_urdf(FILES["example-robot-data/so_arm_description/so101.urdf"], tip="gripper_frame_link")
    servo = sk.Servo(chain, exact=(1, 1, 1, 0, 0, 0), dt=2e-3)
    rng = np.random.default_rng(SEED)
    middle, half = 0.5 * (chain.limits.lower + chain.limits.upper), 0.5 * (chain.limits.upper - chain.limits.lower)
    for _ in range(20):
        start = middle + 0.6 * half * rng.uniform(-1.0, 1.0, 5)
        target = chain.pose(start + rng.uniform(-0.25, 0.25, 5))
        axis = rng.normal(size=3)
        target[:3, :3] = turn(axis / np.linalg.norm(axis), rng.uniform(0.1, 0.25)) @ target[:3, :3]
        servo.reset(start)
        for _ in range(2000):
            servo.update(target)
        error = sk.pose_error(servo.pose, target)
        assert np.linalg.norm(error[:3]) <= 1e-4
        assert np.linalg.norm(error[3:]) <= 0.5


def test_the_shipped_so101_is_the_makers():
    """Up to the rounding of the file's angles (1.5708, 3.14159), but for velocity and effort, which are the servo's."""
    file = FILES["example-robot-data/so_arm_description/so101.urdf"]
    chain, shipped = sk.Chain.from_urdf(file, tip="gripper_frame_link"), sk.robots.load("so101")
    assert shipped.joint_names == chain.joint_names
    assert shipped.base == chain.base
    np.testing.assert_array_equal(shipped.limits.lower, chain.limits.lower)
    np.testing.assert_array_equal(shipped.limits.upper, chain.limits.upper)
    assert np.all(shipped.limits.velocity < chain.limits.velocity)
    mass, expected = sk.Dynamics(shipped), sk.Dynamics(chain)
    rng = np.random.default_rng(SEED)
    for _ in range(100):
        q = chain.random_configuration(rng)
        np.testing.assert_allclose(shipped.pose(q), chain.pose(q), rtol=0, atol=2e-5)
        np.testing.assert_allclose(mass.mass_matrix(q), expected.mass_matrix(q), rtol=0, atol=1e-6)


@pytest.mark.parametrize(("name", "tip", "dof"), ARMS, ids=IDS)
def test_spheres(name, tip, dof):
    """Their shapes are meshes for the most part: capsules stand in, from the base to the tip."""
    arm = sk.Chain.from_urdf(FILES[name], tip=tip)
    spheres = sk.planning.arm_spheres(arm, FILES[name])
    assert dof < len(spheres) <= 256
    assert np.all((spheres.radii > 0.0) & (spheres.radii < 0.5))
    assert len(spheres.links) - spheres.first_moving >= dof - 1
    q = np.zeros(dof)
    assert spheres.jacobians(q).shape == (len(spheres), 3, dof)
    assert np.all(np.linalg.norm(spheres.centers(q), axis=1) < 5.0)
