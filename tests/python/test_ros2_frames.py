"""The frames of the ROS 2 node's commands, without ROS: every pose against the chain's, which another reader made."""

import numpy as np
import pytest

import sigmaik as sk
from sigmaik.ros2 import Frames

TREE = """<robot name="cell">
  <link name="world"/><link name="table"/><link name="base"/><link name="upper"/><link name="fore"/>
  <link name="tip"/><link name="camera"/><link name="finger"/>
  <joint name="stand" type="fixed"><parent link="world"/><child link="table"/>
    <origin xyz="1 2 0.5" rpy="0 0 1.5"/></joint>
  <joint name="mount" type="fixed"><parent link="table"/><child link="base"/>
    <origin xyz="0.1 0 0.2" rpy="0.3 -0.2 0.1"/></joint>
  <joint name="j1" type="revolute"><parent link="base"/><child link="upper"/><origin xyz="0 0 0.3" rpy="0.1 0.2 0.3"/>
    <axis xyz="0 0 2"/><limit lower="-2" upper="2" velocity="2" effort="10"/></joint>
  <joint name="j2" type="prismatic"><parent link="upper"/><child link="fore"/><origin xyz="0.2 0 0"/><axis xyz="1 1 0"/>
    <limit lower="-1" upper="1" velocity="1" effort="10"/></joint>
  <joint name="j3" type="continuous"><parent link="fore"/><child link="tip"/><origin xyz="0.2 0 0.1" rpy="1 0 0"/>
    <axis xyz="0 1 0"/><limit velocity="2" effort="10"/></joint>
  <joint name="eye" type="fixed"><parent link="tip"/><child link="camera"/><origin xyz="0 0 0.1" rpy="0 0.4 0"/></joint>
  <joint name="grip" type="prismatic"><parent link="tip"/><child link="finger"/><axis xyz="0 1 0"/>
    <limit lower="0" upper="0.1" velocity="1" effort="10"/></joint>
</robot>"""


@pytest.mark.parametrize("link", ["upper", "fore", "tip"])
def test_links_of_the_arm_are_where_the_chain_says(link):
    chain = sk.Chain.from_urdf(TREE, base="base", tip=link)
    frames = Frames(sk.Chain.from_urdf(TREE, base="base", tip="tip"), TREE)
    rng = np.random.default_rng(1)
    for _ in range(100):
        q = rng.uniform(-1, 1, chain.dof)
        pose = frames.pose("/" + link, dict(zip(chain.joint_names, q, strict=True)))
        np.testing.assert_allclose(pose, chain.pose(q), atol=1e-12)


def test_every_shipped_arm_has_its_flange_where_the_chain_says():
    for name in sk.robots.names():
        chain = sk.robots.load(name)
        frames = Frames(chain, sk.robots.path(name).read_text(encoding="utf-8"))
        for seed in range(5):
            q = chain.random_configuration(seed)
            pose = frames.pose("flange", dict(zip(chain.joint_names, q, strict=True)))
            np.testing.assert_allclose(pose, chain.pose(q), atol=1e-9)


def test_links_beside_and_above_the_arm_are_frames():
    chain = sk.Chain.from_urdf(TREE, base="base", tip="tip")
    frames, q = Frames(chain, TREE), {"j1": 0.3, "j2": -0.2, "j3": 1.0, "grip": 0.05}
    tip = frames.pose("tip", q)
    np.testing.assert_allclose(frames.pose("finger", q)[:3, 3], tip[:3, 3] + 0.05 * tip[:3, 1], atol=1e-12)
    np.testing.assert_allclose(frames.pose("camera", q)[:3, 3], tip[:3, 3] + 0.1 * tip[:3, 2], atol=1e-12)
    world = frames.pose("world", q)
    up = sk.Chain.from_urdf(TREE, base="world", tip="tip")
    np.testing.assert_allclose(world @ up.pose([0.3, -0.2, 1.0]), tip, atol=1e-12)
    np.testing.assert_allclose(frames.pose("", q), np.eye(4))


def test_a_frame_that_is_no_link_is_refused():
    frames = Frames(sk.Chain.from_urdf(TREE, base="base", tip="tip"), TREE)
    with pytest.raises(sk.Error, match="no link 'tool'"):
        frames.pose("tool", {})


TOOL = np.eye(4)
TOOL[:3, :3] = sk.rotation_exp([0.7, -0.2, 0.4])
TOOL[:3, 3] = [0.01, 0.02, 0.15]

# The arm is base → wrist; other links hang from it, and it hangs from others. Origins and mimics of every kind.
RICH = """<robot name="rich">
  <link name="world"/><link name="pelvis"/><link name="cart"/><link name="base"/><link name="a"/><link name="b"/>
  <link name="c"/><link name="wrist"/><link name="eye"/><link name="thumb"/><link name="finger"/><link name="leg"/>
  <joint name="free" type="floating"><parent link="world"/><child link="pelvis"/></joint>
  <joint name="drive" type="prismatic"><parent link="pelvis"/><child link="cart"/><axis xyz="1 2 0"/>
    <origin xyz="0.3 0 0.1" quat_xyzw="0.1 -0.3 0.2 0.92736"/>
    <limit lower="-1" upper="1" velocity="1" effort="1"/></joint>
  <joint name="mount" type="fixed"><parent link="cart"/><child link="base"/>
    <origin xyz="0 0.1 0.2" quat_xyzw="0.5 0.5 -0.5 0.5"/></joint>
  <joint name="j1" type="revolute"><parent link="base"/><child link="a"/><axis xyz="0 1 1"/>
    <origin xyz="0 0 0.3" quat_xyzw="0.6 0 0 0.8"/><limit lower="-2" upper="2" velocity="1" effort="1"/></joint>
  <joint name="j2" type="revolute"><parent link="a"/><child link="b"/><axis xyz="0 1 0"/><mimic joint="j1"
    multiplier="-0.5" offset="0.3"/><origin xyz="0.2 0 0" rpy="0.4 0.5 0.6"/>
    <limit lower="-2" upper="2" velocity="1" effort="1"/></joint>
  <joint name="j3" type="prismatic"><parent link="b"/><child link="c"/><axis xyz="0 0 -3"/><mimic joint="j2"
    multiplier="0.4"/><origin quat_xyzw="0 0.6 0.8 0"/><limit lower="-2" upper="2" velocity="1" effort="1"/></joint>
  <joint name="j4" type="continuous"><parent link="c"/><child link="wrist"/><origin xyz="0 0.1 0.1"/>
    <limit velocity="2" effort="1"/></joint>
  <joint name="see" type="fixed"><parent link="wrist"/><child link="eye"/>
    <origin xyz="0.05 0 0" quat_xyzw="-0.5 0.5 -0.5 0.5"/></joint>
  <joint name="close" type="prismatic"><parent link="wrist"/><child link="thumb"/><axis xyz="0 1 0"/>
    <origin quat_xyzw="0 0 0.6 0.8"/><limit lower="0" upper="0.1" velocity="1" effort="1"/></joint>
  <joint name="follow" type="revolute"><parent link="thumb"/><child link="finger"/><axis xyz="1 0 0"/>
    <mimic joint="close" multiplier="5" offset="-0.2"/><limit lower="-2" upper="2" velocity="1" effort="1"/></joint>
  <joint name="hip" type="revolute"><parent link="pelvis"/><child link="leg"/><axis xyz="0 1 0"/>
    <origin rpy="0.1 0.2 0.3"/><limit lower="-2" upper="2" velocity="1" effort="1"/></joint>
</robot>"""
Q = {"j1": 0.7, "j4": -1.1, "close": 0.06, "drive": 0.2, "hip": 0.4}


def rich():
    return sk.Chain.from_urdf(RICH, base="base", tip="wrist")


def to(link, base="base", text=RICH):
    """Pose of a link in another by a chain of these two; joints of Q."""
    chain = sk.Chain.from_urdf(text, base=base, tip=link)
    return chain.pose([Q[name] for name in chain.joint_names])


@pytest.mark.parametrize("link", ["a", "b", "c", "wrist", "eye", "thumb", "finger"])
def test_quaternions_and_mimic_joints_have_the_chains_poses(link):
    np.testing.assert_allclose(Frames(rich(), RICH).pose(link, Q), to(link), atol=1e-12)


def test_links_above_the_arm_and_on_another_branch_have_the_chains_poses():
    frames = Frames(rich(), RICH)
    pelvis = frames.pose("pelvis", Q)
    np.testing.assert_allclose(pelvis @ to("base", "pelvis"), np.eye(4), atol=1e-12)
    np.testing.assert_allclose(frames.pose("cart", Q) @ to("a", "cart"), to("a"), atol=1e-12)
    np.testing.assert_allclose(frames.pose("leg", Q), pelvis @ to("leg", "pelvis"), atol=1e-12)


def test_the_arms_mimic_joints_follow_where_they_are_measured_too():
    measured = {**Q, "j2": 0.9, "j3": 0.5}  # a moment later than the command that the servo refers to
    np.testing.assert_allclose(Frames(rich(), RICH).pose("eye", measured), to("eye"), atol=1e-12)


def test_a_mimic_joint_beside_the_arm_is_where_it_is_measured():
    chain = sk.Chain.from_urdf(RICH, base="thumb", tip="finger")  # here the joint moves by itself
    frames, expected = Frames(rich(), RICH), to("thumb") @ chain.pose([0.25])
    np.testing.assert_allclose(frames.pose("finger", {**Q, "follow": 0.25}), expected, atol=1e-12)


def test_an_arm_joint_that_mimics_a_joint_beside_the_arm_moves_by_itself():
    text = RICH.replace('<mimic joint="j1"', '<mimic joint="hip"')
    with pytest.warns(sk.ModelWarning):
        chain = sk.Chain.from_urdf(text, base="base", tip="wrist")
    q = {**Q, "j2": -0.3}
    assert chain.joint_names == ("j1", "j2", "j4")
    pose = Frames(chain, text).pose("wrist", q)
    np.testing.assert_allclose(pose, chain.pose([q[name] for name in chain.joint_names]), atol=1e-12)


def test_locked_joints_are_where_they_are_locked():
    chain, text = sk.Chain.from_urdf(TREE, base="base", tip="tip"), TREE
    locked = chain.lock({"j2": 0.5})
    frames = Frames(locked, text)
    for q in ({"j1": 0.3, "j3": 1.0}, {"j1": 0.3, "j2": -0.1, "j3": 1.0}):
        np.testing.assert_allclose(frames.pose("tip", q), chain.pose([0.3, 0.5, 1.0]), atol=1e-12)
        seen = sk.Chain.from_urdf(text, base="base", tip="camera").pose([0.3, 0.5, 1.0])
        np.testing.assert_allclose(frames.pose("camera", q), seen, atol=1e-12)


def test_mimics_of_a_locked_joint_are_locked_with_it():
    chain = rich()
    frames = Frames(chain.lock({"j1": 0.7}), RICH)
    for link in ("c", "wrist", "eye"):
        np.testing.assert_allclose(frames.pose(link, {"j4": -1.1}), to(link), atol=1e-12)


def test_a_mimic_beside_the_arm_of_a_locked_joint_is_refused_unless_it_is_measured():
    text = TREE.replace(
        '<axis xyz="0 1 0"/>\n    <limit lower="0"', '<axis xyz="0 1 0"/><mimic joint="j2"/><limit lower="0"'
    )
    assert text != TREE
    frames = Frames(sk.Chain.from_urdf(text, base="base", tip="tip").lock({"j2": 0.05}), text)
    q = {"j1": 0.3, "j3": 1.0}
    with pytest.raises(sk.Error, match="'grip' mimics 'j2', which is locked"):
        frames.pose("finger", q)
    tip = frames.pose("tip", q)
    for known in ({"grip": 0.04}, {"j2": 0.04}):
        np.testing.assert_allclose(
            frames.pose("finger", {**q, **known})[:3, 3], tip[:3, 3] + 0.04 * tip[:3, 1], atol=1e-12
        )


def test_the_tip_of_a_tool_is_a_frame_and_other_links_stay():
    plain = rich()
    chain = plain.with_tool(TOOL)
    frames = Frames(chain, RICH)
    assert chain.tip == "tool"
    np.testing.assert_allclose(frames.pose(chain.tip, Q), to("wrist") @ TOOL, atol=1e-12)
    for link in ("wrist", "eye", "finger", "leg"):
        np.testing.assert_array_equal(frames.pose(link, Q), Frames(plain, RICH).pose(link, Q))


def test_a_tool_of_the_same_name_as_a_link_is_the_tip_and_what_hangs_from_the_link_stays():
    joints = """<link name="tool"/><link name="lamp"/>
      <joint name="tool_joint" type="fixed"><parent link="wrist"/><child link="tool"/><origin xyz="0 0 0.4"/></joint>
      <joint name="shine" type="fixed"><parent link="tool"/><child link="lamp"/><origin xyz="0 0 0.01"/></joint>
    </robot>"""
    text = RICH.replace("</robot>", joints)
    frames = Frames(rich().with_tool(TOOL), text)
    np.testing.assert_allclose(frames.pose("tool", Q), to("wrist") @ TOOL, atol=1e-12)
    np.testing.assert_allclose(frames.pose("lamp", Q), to("lamp", text=text), atol=1e-12)
    arm = Frames(sk.Chain.from_urdf(text, base="base", tip="tool"), text)
    np.testing.assert_allclose(arm.pose("lamp", Q), to("lamp", text=text), atol=1e-12)


def test_tool_and_lock_together():
    chain = sk.Chain.from_urdf(TREE, base="base", tip="tip").with_tool(TOOL).lock({"j1": -0.4}).with_limits(lower=-3)
    pose = Frames(chain, TREE).pose("tool", {"j2": 0.2, "j3": 0.6})
    np.testing.assert_allclose(pose, chain.pose([0.2, 0.6]), atol=1e-12)


GRIP = '<joint name="grip" type="prismatic">'


@pytest.mark.parametrize(
    ("old", "new", "reason"),
    [
        (GRIP, '<joint name="grip" type="floating">', "'grip' is floating"),
        (GRIP, '<joint name="grip" type="planar">', "'grip' is planar"),
        (GRIP, '<joint name="grip">', "'grip' is : "),
        (GRIP, GRIP + '<mimic joint="j1" multiplier="two"/>', "'grip' .* multiplier"),
        (GRIP, GRIP + '<mimic joint="grip"/>', "'grip' mimics itself"),
        (GRIP, GRIP + '<origin rpy="0 0 0" quat_xyzw="0 0 0 1"/>', "'grip' .* both"),
        (GRIP, GRIP + '<origin quat_xyzw="0 0 0 1.02"/>', "'grip' .* length 1.02"),
        (GRIP, GRIP + '<origin quat_xyzw="0 0 1"/>', "'grip' .* needs 4"),
        (GRIP, GRIP + '<origin xyz="0 0 one"/>', "'grip' .* needs 3"),
        (GRIP, GRIP + '<origin rpy="0 0 inf"/>', "'grip' .* finite"),
        (GRIP, GRIP + '<axis xyz="0 0 0"/>', "'grip' .* axis is zero"),
    ],
)
def test_a_link_whose_place_does_not_follow_is_refused_and_no_other(old, new, reason):
    text = TREE.replace(old, new)
    assert text != TREE
    frames, q = Frames(sk.Chain.from_urdf(TREE, base="base", tip="tip"), text), {"j1": 0.3, "j2": -0.2, "j3": 1.0}
    with pytest.raises(sk.Error, match=reason):
        frames.pose("finger", q)
    camera = sk.Chain.from_urdf(TREE, base="base", tip="camera").pose([0.3, -0.2, 1.0])
    np.testing.assert_allclose(frames.pose("camera", q), camera, atol=1e-12)


def test_the_other_side_of_a_floating_joint_is_refused():
    with pytest.raises(sk.Error, match="'free' is floating"):
        Frames(rich(), RICH).pose("world", Q)


def test_a_description_of_another_arm_is_refused():
    with pytest.raises(sk.Error, match="no link 'base', the arm's base"):
        Frames(rich(), RICH.replace('"base"', '"root"'))
    loose = RICH.replace("</robot>", '<link name="moon"/></robot>')
    with pytest.raises(sk.Error, match="'moon' is not connected"):
        Frames(rich(), loose).pose("moon", Q)
    with pytest.raises(sk.Error, match="no XML"):
        Frames(rich(), "arm.urdf")
    ring = RICH.replace('<parent link="world"/>', '<parent link="leg"/>')
    with pytest.raises(sk.Error, match="ring"):
        Frames(rich(), ring).pose("leg", Q)
