"""Servos that keep clear of the arm itself and of obstacles."""

import numpy as np
import pytest

import sigmaik as sk

ARM = sk.robots.load("ufactory_xarm7")
Q = np.array([0.0, -0.4, 0.0, 0.9, 0.0, 1.3, 0.0])


def test_the_fixed_names():
    collisions = sk.Collisions(ARM, obstacles=None, self_collision=True, margin=0.01)
    servo = sk.Servo(ARM, collisions=collisions)
    servo.reset(Q)
    step = servo.update(servo.pose)
    assert step.clearance == pytest.approx(collisions.distance(step.q), abs=1e-12)
    body, other = step.nearest
    assert collisions.body_names[body] == collisions.nearest(step.q)[1]
    assert collisions.body_names[other] == collisions.nearest(step.q)[2]
    assert step.limited_by_collisions is False
    assert collisions.margin == 0.01
    assert servo.collisions.margin == 0.01
    plain = sk.Servo(ARM)
    plain.reset(Q)
    assert plain.collisions is None
    assert plain.update(plain.pose).clearance == np.inf
    assert plain.update(plain.pose).nearest is None


def test_capsules_and_pairs_are_told():
    collisions = sk.Collisions(ARM)
    assert len(collisions.capsules) == ARM.dof + 3
    for body in collisions.capsules:
        assert 0.0 < body.excess < 0.1
        assert body.capsule.radius > 0.03
    for body, other in collisions.self_pairs:
        assert 0 <= other < body < len(collisions.capsules)
    fewer = sk.Collisions(ARM, ignore=[("link_base", link) for link in ("link3", "link4", "link5", "link6", "link7")])
    assert len(fewer.self_pairs) < len(collisions.self_pairs)
    assert sk.Collisions(ARM, self_collision=False).self_pairs == []
    assert sk.Collisions(ARM, self_collision=False).distance(Q) == np.inf


def test_an_srdf_names_pairs_that_need_no_check():
    links = ["link_base", *(f"link{i}" for i in range(1, 8)), "flange"]
    pairs = "".join(f'<disable_collisions link1="{a}" link2="{b}"/>' for a in links for b in links if a < b)
    assert sk.Collisions(ARM, srdf=f'<robot name="arm">{pairs}</robot>').self_pairs == []


def test_obstacles_of_the_planners_are_taken():
    box = sk.planning.Box(size=(0.2, 0.2, 0.2), pose=(0.9, 0.0, 0.3))
    ball = sk.planning.Sphere(radius=0.1, center=(0.3, 0.9, 0.7))
    post = sk.planning.Cylinder(radius=0.05, length=1.0, pose=(0.3, -0.9, 0.5))
    one = sk.Collisions(ARM, [box, ball, post], self_collision=False)
    other = sk.Collisions(ARM, sk.planning.Obstacles([box, ball, post]), self_collision=False)
    assert [o.shape for o in one.obstacles] == ["box", "sphere", "cylinder"]
    rng = np.random.default_rng(1)
    for q in Q + 0.3 * rng.standard_normal((50, 7)):
        distance, _, name, point, other_point = one.nearest(q)
        assert other.distance(q) == distance
        assert np.linalg.norm(point - other_point) == pytest.approx(abs(distance), abs=1e-9)
        shape = (box, ball, post)[int(name.split()[1])]
        assert shape.distance(point) == pytest.approx(distance, abs=1e-7)
    np.testing.assert_allclose(one.distance(np.array([Q, Q])), [one.distance(Q)] * 2)


def test_a_servo_stops_before_a_wall_and_goes_on_when_the_wall_is_gone():
    x = ARM.pose(Q)[0, 3]
    collisions = sk.Collisions(ARM, [sk.Obstacle.half_space([x + 0.25, 0.0, 0.0], [-1.0, 0.0, 0.0], name="wall")])
    servo = sk.Servo(ARM, dt=4e-3, collisions=collisions)
    servo.reset(Q)
    target = servo.pose
    target[0, 3] += 0.24
    steps = [servo.update(target) for _ in range(1000)]
    assert min(step.clearance for step in steps) >= 0.01 - 1e-9
    assert steps[-1].limited_by_collisions
    assert steps[-1].status == sk.Status.LIMITED
    assert collisions.body_names[steps[-1].nearest[1]] == "wall"
    assert np.abs(steps[-1].qdot).max() < 1e-3
    away = np.array(collisions.obstacles[0].pose)
    away[0, 3] += 0.5
    collisions.move(0, away)
    steps = [servo.update(target) for _ in range(1000)]
    assert np.linalg.norm(steps[-1].pose_error) < 1e-3
    assert not steps[-1].limited_by_collisions


def test_a_carried_object_counts_until_it_is_let_go():
    collisions = sk.Collisions(ARM)
    before = collisions.distance(Q)
    collisions.attach([sk.Capsule([0.0, 0.0, 0.0], [0.0, 0.0, 0.4], 0.05)])
    floor = sk.Collisions(ARM, [sk.Obstacle.half_space([0.0, 0.0, -0.5], [0.0, 0.0, 1.0])], self_collision=False)
    bare = floor.distance(Q)
    floor.attach([sk.Capsule([0.0, 0.0, 0.0], [0.0, 0.0, 0.4], 0.05)])
    tip = ARM.pose(Q)
    assert floor.distance(Q) == pytest.approx(min(bare, (tip @ [0.0, 0.0, 0.4, 1.0])[2] + 0.5 - 0.05))
    collisions.detach()
    assert collisions.distance(Q) == before


def test_a_wrong_set_up_is_refused_with_the_facts():
    with pytest.raises(sk.Error, match="margin = -1 m"):
        sk.Collisions(ARM, margin=-1.0)
    with pytest.raises(sk.Error, match="obstacle"):
        sk.Collisions(ARM, ["a wall"])
    with pytest.raises(sk.Error, match="no link 'elbow'"):
        sk.Collisions(ARM, [sk.Obstacle.sphere([1.0, 0.0, 0.0], 0.1, links=["elbow"])])
    with pytest.raises(sk.Error, match="another arm"):
        sk.Servo(sk.robots.load("ur10"), collisions=sk.Collisions(ARM))
    with pytest.raises(sk.Error, match="no obstacle 3"):
        sk.Collisions(ARM).move(3, np.eye(4))


def test_distances_are_those_of_mujoco():
    mujoco = pytest.importorskip("mujoco")
    collisions = sk.Collisions(ARM)
    names = {body.link: body for body in collisions.capsules}
    assert len(names) > 5
    rng = np.random.default_rng(2)
    model = mujoco.MjModel.from_xml_string(
        '<mujoco><worldbody><body name="a" mocap="true"><geom type="capsule" size="0.05 0.2"/></body>'
        '<body name="b" mocap="true"><geom type="capsule" size="0.03 0.1"/></body></worldbody></mujoco>'
    )
    data = mujoco.MjData(model)
    arm = sk.Chain.from_urdf(PAIR)
    pair = sk.Collisions(
        arm,
        [sk.Obstacle.capsule([0.0, 0.0, -0.2], [0.0, 0.0, 0.2], 0.05)],
        self_collision=False,
        arm=[sk.LinkCapsule("tool", sk.Capsule([0.0, 0.0, -0.1], [0.0, 0.0, 0.1], 0.03))],
    )
    for _ in range(200):
        q = rng.uniform(-1.0, 1.0, 4)
        pose = arm.pose(q)
        data.mocap_pos[1] = pose[:3, 3]
        mujoco.mju_mat2Quat(data.mocap_quat[1], pose[:3, :3].flatten())
        mujoco.mj_forward(model, data)
        expected = mujoco.mj_geomDistance(model, data, 0, 1, 10.0, None)
        if expected > 0.0:
            assert pair.distance(q) == pytest.approx(expected, abs=1e-6)


LIMIT = '<limit lower="-3" upper="3" effort="1" velocity="1" acceleration="10"/>'
PAIR = f"""<robot name="pair"><link name="base"/><link name="x"/><link name="y"/><link name="turn"/><link name="tool"/>
<joint name="1" type="prismatic"><parent link="base"/><child link="x"/><axis xyz="1 0 0"/>{LIMIT}</joint>
<joint name="2" type="prismatic"><parent link="x"/><child link="y"/><axis xyz="0 1 0"/>{LIMIT}</joint>
<joint name="3" type="revolute"><parent link="y"/><child link="turn"/><axis xyz="1 0 0"/>{LIMIT}</joint>
<joint name="4" type="revolute"><parent link="turn"/><child link="tool"/><axis xyz="0 1 0"/>{LIMIT}</joint></robot>"""


LONG = np.block([[np.eye(3), np.array([[0.0], [0.0], [0.3]])], [np.zeros((1, 3)), np.ones((1, 1))]])


def test_a_tool_has_a_body_only_where_one_is_given():
    before_the_flange = ARM.pose(Q) @ [0.0, 0.0, 0.5, 1.0]
    ball = sk.Obstacle.sphere(before_the_flange[:3], 0.05)
    bare, arm = sk.Collisions(ARM, [ball], self_collision=False), ARM.with_tool(LONG)
    with_tool = sk.Collisions(arm, [ball], self_collision=False)
    assert with_tool.distance(Q) == bare.distance(Q)
    stick = sk.Capsule((0, 0, -0.3), (0, 0, 0), 0.03)  # in the tool's frame
    own = sk.Collisions(
        arm, [ball], self_collision=False, arm=[*sk.Collisions(arm).capsules, sk.LinkCapsule("tool", stick)]
    )
    with_tool.attach([stick])
    for collisions in (with_tool, own):
        assert collisions.distance(Q) == pytest.approx(0.5 - 0.3 - 0.05 - 0.03, abs=1e-9)
    servo = sk.Servo(ARM, collisions=bare)
    servo.reset(Q)
    servo.set_tool(LONG)
    assert servo.hold().clearance == bare.distance(Q)
    bare.attach([sk.Capsule((0, 0, 0), (0, 0, 0.3), 0.03)])  # in the tip of the chain, with set_tool too
    assert servo.hold().clearance == pytest.approx(0.12, abs=1e-9)


def test_a_servo_with_collisions_takes_cycles_of_its_dt_only():
    servo = sk.Servo(ARM, collisions=sk.Collisions(ARM))
    servo.reset(Q)
    for cycle in (lambda dt: servo.update(servo.pose, dt=dt), lambda dt: servo.update_twist(np.zeros(6), dt=dt)):
        for bad in (0.9e-3, 2e-3):
            with pytest.raises(sk.Error, match="a servo with collisions has cycles of its dt"):
                cycle(bad)
        assert cycle(1e-3).status == sk.Status.OK
    with pytest.raises(sk.Error, match="cycles of its dt"):
        servo.hold(dt=2e-3)


def test_an_obstacle_without_a_size_is_refused_with_its_number_and_its_size():
    for obstacle, fact in [
        (sk.Obstacle.sphere((1, 1, 1), -1), "radius = -1 m"),
        (sk.Obstacle.box((1, -2, 1), (1, 1, 1)), "side = -2 m"),
        (sk.Obstacle.cylinder(0.1, -3, (1, 1, 1)), "length = -3 m"),
    ]:
        with pytest.raises(sk.Error, match=f"obstacle 1: {fact} must be finite and above 0"):
            sk.Collisions(ARM, [sk.Obstacle.sphere((2, 2, 2), 0.1), obstacle])
