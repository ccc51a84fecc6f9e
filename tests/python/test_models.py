"""Models: versions of URDF, mimic and locked joints, tools, weights, turns of continuous joints, other formats."""

import numpy as np
import pytest

import sigmaik as sk

JOINT = """<joint name="{name}" type="{kind}"><parent link="{parent}"/><child link="{child}"/>
<origin xyz="{xyz}"/><axis xyz="0 0 1"/>{inside}</joint>"""
LIMIT = '<limit lower="-2" upper="2" velocity="2" effort="10" acceleration="10"/>'


def planar(*inside: str, version: str = "1.0") -> str:
    """A planar arm of links of 0.5 m: `inside` each joint."""
    kinds = ["revolute" if "lower" in text else "continuous" for text in inside]
    joints = "".join(
        JOINT.format(
            name=f"j{i}", kind=kind, parent=f"l{i}", child=f"l{i + 1}", xyz="0.5 0 0" if i else "0 0 0", inside=text
        )
        for i, (kind, text) in enumerate(zip(kinds, inside, strict=True))
    )
    links = "".join(f'<link name="l{i}"/>' for i in range(len(inside) + 1))
    return f'<robot name="r" version="{version}">{links}{joints}</robot>'


@pytest.mark.parametrize("version", ["1.0", "1.1", "1.2"])
def test_urdf_versions(version):
    limit = '<limit lower="-2" upper="2" velocity="inf" effort="inf" acceleration="5" deceleration="3" jerk="50"/>'
    arm = sk.Chain.from_urdf(planar(limit, LIMIT, version=version))
    assert arm.limits.velocity[0] == np.inf
    np.testing.assert_array_equal(arm.limits.acceleration, [5, 10])
    np.testing.assert_array_equal(arm.limits.deceleration, [3, 10])
    assert arm.limits.jerk[0] == 50
    changed = arm.with_limits(acceleration=8.0)
    np.testing.assert_array_equal(changed.limits.deceleration, [3, 8])
    np.testing.assert_array_equal(arm.with_limits(deceleration=2.0).limits.deceleration, [2, 2])


@pytest.mark.parametrize(("a", "b"), [(5.0, 3.0), (2.0, 6.0)])
def test_a_servo_brakes_with_the_deceleration(a, b):
    limit = f'<limit lower="-9" upper="9" velocity="2" effort="1" acceleration="{a}" deceleration="{b}"/>'
    arm = sk.Chain.from_urdf(planar(limit))
    servo = sk.Servo(arm, mask=(0, 0, 0, 0, 0, 1))
    servo.reset([0.0])
    speeds = [servo.update_twist([0, 0, 0, 0, 0, 1.0]).qdot[0] for _ in range(1000)]
    speeds += [servo.update_twist(np.zeros(6)).qdot[0] for _ in range(1000)]
    change = np.diff([0.0, *speeds]) / servo.dt
    assert change.max() == pytest.approx(a)
    assert change.min() == pytest.approx(-b)


def test_mimic_joints():
    arm = sk.Chain.from_urdf(planar(LIMIT, LIMIT + '<mimic joint="j0" multiplier="-1" offset="0.1"/>', LIMIT))
    free = sk.Chain.from_urdf(planar(LIMIT, LIMIT, LIMIT))
    assert arm.joint_names == ("j0", "j2")
    assert arm.segments[1].mimic == ("j0", -1.0, 0.1)
    assert arm.segments[0].mimic is None
    assert arm.limits.lower[0] == pytest.approx(-1.9)
    q = np.array([0.3, 0.7])
    every = [0.3, -0.2, 0.7]
    np.testing.assert_allclose(arm.pose(q), free.pose(every), atol=1e-14)
    coupling = np.array([[1, 0], [-1, 0], [0, 1]])
    np.testing.assert_allclose(arm.jacobian(q), free.jacobian(every) @ coupling, atol=1e-14)
    step = 1e-6
    for k in range(2):
        up, down = q.copy(), q.copy()
        up[k] += step
        down[k] -= step
        difference = (arm.jacobian(up) - arm.jacobian(down)) / (2 * step)
        np.testing.assert_allclose(arm.jacobian_gradient(q)[k], difference, atol=1e-8)


def test_locked_joints_and_cables():
    arm = sk.robots.load("ufactory_xarm7")
    q = np.array([0.1, -0.5, 0.2, 1.0, 0.3, 1.2, 0.4])
    locked = arm.lock({arm.joint_names[2]: 0.2})
    assert locked.dof == 6
    np.testing.assert_allclose(locked.pose(np.delete(q, 2)), arm.pose(q), atol=1e-14)
    with pytest.raises(sk.Error, match="there is no joint 'elbow'"):
        arm.lock({"elbow": 0.0})
    endless = sk.Chain.from_urdf(planar("<limit velocity='2' effort='1'/>", LIMIT))
    assert endless.joint_types == ("continuous", "revolute")
    cable = endless.with_limits(lower=[-2, -2], upper=[2, 2])
    assert cable.joint_types == ("revolute", "revolute")
    np.testing.assert_array_equal(cable.limits.upper, [2, 2])


def test_tools():
    arm = sk.robots.load("franka_panda").with_limits(acceleration=10.0)
    tool = np.eye(4)
    tool[:3, 3] = 0.0, 0.0, 0.15
    q = np.array([0.0, -0.4, 0.0, -2.0, 0.0, 1.6, 0.7])
    held = arm.with_tool(tool, sk.Inertia(1.0))
    np.testing.assert_allclose(held.pose(q), arm.pose(q) @ tool, atol=1e-14)
    assert held.segments[-1].inertia.mass == 1.0
    servo = sk.Servo(arm)
    servo.reset(q)
    target = servo.pose
    target[1, 3] += 0.1
    last = np.zeros(7)
    for i in range(3000):
        if i == 200:
            servo.set_tool(tool)
        step = servo.update(target)
        assert np.abs(step.qdot - last).max() <= 10.0 * servo.dt * (1 + 1e-9)
        last = step.qdot
    np.testing.assert_allclose(arm.pose(step.q) @ tool, target, atol=1e-4)
    np.testing.assert_array_equal(servo.tool, tool)
    with pytest.raises(sk.Error):
        servo.set_tool(2 * np.eye(4))


def test_joint_weights():
    rng = np.random.default_rng(1)
    jacobian, twist, weights = rng.normal(size=(6, 8)), rng.normal(size=6), rng.uniform(0.1, 10, 8)
    solver = sk.VelocitySolver(sk.PseudoInverse())
    solver.set_joint_weights(weights)
    light = np.diag(1 / weights)
    expected = light @ jacobian.T @ np.linalg.solve(jacobian @ light @ jacobian.T, twist)
    np.testing.assert_allclose(solver.solve(jacobian, twist).qdot, expected, rtol=1e-8)
    arm = sk.robots.load("ufactory_xarm7")
    with pytest.raises(sk.Error, match="joint_weights"):
        sk.Servo(arm, joint_weights=np.zeros(7))
    sk.Servo(arm, joint_weights=np.arange(1, 8))


@pytest.mark.parametrize("way", [6.08, -6.08, 3.5, 12.4])
def test_plans_take_the_shorter_way_round(way):
    arm = sk.Chain.from_urdf(planar("<limit velocity='2' effort='1' acceleration='2'/>", LIMIT))
    start, goal = np.array([0.3, 0.2]), np.array([0.3 + way, -0.2])
    shorter = (way + np.pi) % (2 * np.pi) - np.pi
    for plan in (sk.planning.time_optimal(arm, start, goal), sk.planning.gradient(arm, start, goal)):
        assert plan.q[-1, 0] - start[0] == pytest.approx(shorter)
    long = sk.planning.time_optimal(arm, start, goal, whole_turns=True)
    assert long.q[-1, 0] - start[0] == pytest.approx(way)
    bounded = arm.with_limits(lower=[-20, -2], upper=[20, 2])
    assert sk.planning.time_optimal(bounded, start, goal).q[-1, 0] - start[0] == pytest.approx(way)


# ---- Other formats --------------------------------------------------------------------------------------------------

MJCF = """<mujoco><compiler angle="radian"/><worldbody>
<body name="a" pos="0.1 0 0.3" quat="0.9 0.1 0.2 0.3"><inertial pos="0 0 0.1" mass="2" diaginertia="0.02 0.03 0.04"/>
  <joint name="turn" type="hinge" axis="0 0 1" pos="0.02 0.01 0" range="-2 2" limited="true" ref="0.3"/>
  <joint name="tilt" type="hinge" axis="0 1 0" pos="0 0 0.05"/>
  <body name="b" pos="0 0.2 0.4" euler="0.2 0.1 0">
    <inertial pos="0.1 0 0" mass="1" diaginertia="0.01 0.01 0.01"/>
    <joint name="slide" type="slide" axis="1 0 1" range="-0.3 0.5" limited="true" ref="0.1"/>
    <body name="c" pos="0.3 0 0"><inertial pos="0 0 0.1" mass="1" diaginertia="0.01 0.01 0.01"/>
      <joint name="wrist" type="hinge" axis="1 1 0" range="-1 1" limited="true"/>{inside}
</body></body></body></worldbody>
{end}</mujoco>"""


def test_mjcf():
    mujoco = pytest.importorskip("mujoco")
    text = MJCF.format(inside="", end="")
    arm = sk.models.from_mjcf(text)
    assert arm.joint_names == ("turn", "tilt", "slide", "wrist")
    assert arm.joint_types == ("revolute", "continuous", "prismatic", "revolute")
    model = mujoco.MjModel.from_xml_string(text)
    data = mujoco.MjData(model)
    rng = np.random.default_rng(2)
    for _ in range(20):
        data.qpos = rng.uniform(-0.3, 0.5, 4)
        mujoco.mj_forward(model, data)
        pose = arm.pose(data.qpos)
        np.testing.assert_allclose(pose[:3, 3], data.body("c").xpos, atol=1e-12)
        np.testing.assert_allclose(pose[:3, :3], data.body("c").xmat.reshape(3, 3), atol=1e-12)
    masses = {s.link_name: s.inertia.mass for s in arm.segments if s.inertia is not None}
    assert masses == {"a": 2.0, "b": 1.0, "c": 1.0}


def test_mjcf_with_coupled_joints_and_what_is_no_arm():
    pytest.importorskip("mujoco")
    coupled = MJCF.format(
        inside="",
        end='<equality><joint joint1="wrist" joint2="turn" polycoef="0.1 -2 0 0 0"/></equality>',
    )
    arm = sk.models.from_mjcf(coupled)
    assert arm.joint_names == ("turn", "tilt", "slide")
    joint, multiplier, offset = arm.segments[[s.joint_name for s in arm.segments].index("wrist")].mimic
    assert (joint, multiplier) == ("turn", -2.0)
    assert offset == pytest.approx(0.1 + 2 * 0.3)
    with pytest.raises(sk.Error, match="floating"):
        sk.models.from_mjcf(
            '<mujoco><worldbody><body name="a"><freejoint/><geom size="1"/></body></worldbody></mujoco>'
        )
    with pytest.raises(sk.Error, match="MJCF"):
        sk.models.from_mjcf("<mujoco><nonsense/></mujoco>")
    with pytest.raises(sk.Error, match="MJCF"):
        sk.models.from_mjcf("nowhere.xml")


def test_xacro(tmp_path):
    pytest.importorskip("xacrodoc")
    file = tmp_path / "arm.urdf.xacro"
    body = planar(LIMIT, LIMIT).replace("0.5 0 0", "${length} 0 0")
    head = '<robot name="r" xmlns:xacro="http://www.ros.org/wiki/xacro"><xacro:arg name="length" default="0.5"/>'
    file.write_text(head + '<xacro:property name="length" value="$(arg length)"/>' + body.split(">", 1)[1])
    assert sk.models.from_xacro(file).pose([0, 0])[0, 3] == pytest.approx(0.5)
    assert sk.models.from_xacro(file, {"length": "0.7"}).pose([0, 0])[0, 3] == pytest.approx(0.7)
    with pytest.raises(sk.Error, match="no such file"):
        sk.models.from_xacro(tmp_path / "nothing.xacro")
    file.write_text(head + "<xacro:nonsense/></robot>")
    with pytest.raises(sk.Error, match="xacro"):
        sk.models.from_xacro(file)


def test_missing_packages_are_named(monkeypatch):
    from sigmaik import _extras

    monkeypatch.setattr(_extras, "installed", lambda module: False)
    with pytest.raises(sk.Error, match="pip install xacrodoc"):
        sk.models.from_xacro("arm.xacro")
    with pytest.raises(sk.Error, match="pip install 'mujoco>=3'"):
        sk.models.from_mjcf("arm.xml")
    with pytest.raises(sk.Error, match="pip install robot_descriptions"):
        sk.models.from_description("ur5e")


def test_descriptions_that_do_not_exist():
    pytest.importorskip("robot_descriptions")
    with pytest.raises(sk.Error, match="has no 'ur5ee'; similar names: .*ur5e_description"):
        sk.models.from_description("ur5ee")


def test_disabled_pairs(tmp_path):
    text = """<robot name="r"><group name="arm"/>
    <disable_collisions link1="b" link2="a" reason="Adjacent"/><disable_collisions link1="a" link2="b"/>
    <disable_collisions link1="b" link2="c" reason="Never"/></robot>"""
    assert sk.models.disabled_pairs(text) == {("a", "b"), ("b", "c")}
    file = tmp_path / "arm.srdf"
    file.write_text(text)
    assert sk.models.disabled_pairs(file) == {("a", "b"), ("b", "c")}
    for bad, why in (
        ("<robot><disable_collisions link1='a'/></robot>", "link1 and link2"),
        ("<sdf/>", "not an SRDF"),
        ("<robot>", "malformed"),
        ("nowhere.srdf", "nowhere.srdf"),
        ("<!DOCTYPE r [<!ENTITY a 'b'>]><robot/>", "entities"),
    ):
        with pytest.raises(sk.Error, match=why):
            sk.models.disabled_pairs(bad)


def test_limits_of_an_arm_with_mimic_joints_replace_what_the_mimic_joint_had_imposed():
    arm = sk.Chain.from_urdf(planar(LIMIT, LIMIT + '<mimic joint="j0" multiplier="4"/>', LIMIT))
    own = sk.Chain.from_urdf(planar(LIMIT, LIMIT, LIMIT)).limits
    assert arm.limits.velocity[0] == own.velocity[0] / 4
    assert arm.limits.upper[0] == own.upper[0] / 4
    wider = arm.with_limits(velocity=own.velocity[0], upper=own.upper[0])
    assert wider.limits.velocity[0] == own.velocity[0]
    assert wider.limits.upper[0] == own.upper[0]
    assert wider.limits.lower[0] == own.lower[0] / 4  # left out: as it was
    assert wider.segments[1].mimic == ("j0", 4.0, 0.0)
    with pytest.raises(sk.Error, match="mimic others; collisions of such arms are not checked"):
        sk.Collisions(arm)
