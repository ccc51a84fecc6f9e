"""The driver and the frames behind the ROS 2 node, without ROS."""

import time

import numpy as np
import pytest

import sigmaik as sk
from sigmaik.ros2 import Driver, DriverSettings, Frames

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


def wait(condition, seconds=5.0):
    end = time.monotonic() + seconds
    while time.monotonic() < end:
        if condition():
            return True
        time.sleep(0.005)
    return False


def newest(driver):
    assert wait(lambda: driver.newest() is not None)
    return driver.newest()


@pytest.fixture
def panda():
    path = sk.robots.path("franka_panda")
    return sk.robots.load("franka_panda"), sk.robots.home("franka_panda"), path.read_text(encoding="utf-8")


def make(panda, **settings):
    chain, home, text = panda
    driver = Driver(chain, text, DriverSettings(**settings))
    driver.measure(chain.joint_names, home)
    driver.activate()
    return driver


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


def test_joints_come_in_any_order_and_with_others_among_them(panda):
    chain, home, text = panda
    driver = Driver(chain, text)
    order = np.random.default_rng(0).permutation(chain.dof)
    names = ["finger", *(chain.joint_names[i] for i in order)]
    with pytest.raises(sk.Error, match="no measured positions yet"):
        driver.activate()
    assert not driver.measure(names[:3], [0.01, *home[order][:2]])
    assert not driver.ready
    assert not driver.measure(names, [0.01, *home[order][:-1], np.nan])
    assert driver.measure(names, [0.01, *home[order]])
    driver.activate()
    np.testing.assert_array_equal(newest(driver)["q"], home)
    assert driver.deactivate()


def test_a_twist_in_the_tip_frame_moves_along_the_tips_axes(panda):
    driver = make(panda)
    chain = panda[0]
    begin = chain.pose(panda[1])
    assert driver.twist([0, 0, 0.1, 0, 0, 0], chain.tip)
    assert wait(lambda: driver.state == sk.LoopState.HOLDING and newest(driver)["cycle"] > 60)
    moved = chain.pose(newest(driver)["q"])[:3, 3] - begin[:3, 3]
    assert np.linalg.norm(moved) > 1e-3
    assert np.dot(moved, begin[:3, 2]) > 0.999 * np.linalg.norm(moved)
    assert driver.deactivate()


def test_a_pose_in_another_links_frame_is_reached(panda):
    chain, home, _ = panda
    driver = make(panda, timeout=10.0)
    target = chain.pose(home)
    target[:3, 3] += [0.02, -0.01, 0.015]
    links = sk.Chain.from_urdf(panda[2], tip="link3")
    in_link = np.linalg.solve(links.pose(home[:3]), target)
    assert driver.pose(in_link, "link3")
    assert wait(lambda: np.abs(chain.pose(newest(driver)["q"]) - target).max() < 1e-4)
    assert driver.deactivate()


@pytest.mark.parametrize(
    ("command", "reason"),
    [
        (lambda d: d.twist([np.nan, 0, 0, 0, 0, 0]), "finite"),
        (lambda d: d.twist([1, 0, 0]), "six"),
        (lambda d: d.twist(np.zeros(6), "nowhere"), "no link 'nowhere'"),
        (lambda d: d.twist(np.zeros(6), "", 0.2), "0.2 s old"),
        (lambda d: d.twist(np.zeros(6), "", -3.0), "3 s ahead"),
        (lambda d: d.pose(np.eye(3)), "shape"),
        (lambda d: d.pose(np.full((4, 4), np.nan)), "target"),
    ],
)
def test_commands_that_are_refused_say_why_and_move_nothing(panda, command, reason):
    driver = make(panda)
    assert not command(driver)
    assert reason in driver.last_refusal
    assert driver.refused == 1
    time.sleep(0.02)
    np.testing.assert_array_equal(newest(driver)["q"], panda[1])
    assert driver.deactivate()
    assert not driver.twist(np.zeros(6))
    assert "not active" in driver.last_refusal


def test_an_old_command_lives_shorter(panda):
    driver = make(panda, timeout=0.3)
    assert driver.twist([0.01, 0, 0, 0, 0, 0], "", 0.25)
    begin = time.monotonic()
    assert wait(lambda: driver.state == sk.LoopState.HOLDING)
    assert time.monotonic() - begin < 0.25
    assert driver.deactivate()


def test_resume_starts_from_the_joints_as_they_are_then(panda):
    driver = make(panda)
    driver.pause()
    assert wait(lambda: driver.state == sk.LoopState.STOPPED)
    assert not driver.twist([0.1, 0, 0, 0, 0, 0])
    moved = panda[1] + 0.1  # by hand
    driver.measure(panda[0].joint_names, moved)
    driver.resume()
    np.testing.assert_allclose(newest(driver)["q"], moved, atol=1e-12)
    assert driver.twist([0.1, 0, 0, 0, 0, 0])
    assert driver.deactivate()


def test_an_arm_that_does_not_follow_stops_and_says_so(panda):
    driver = make(panda, max_following_error=0.05)
    driver.measure(panda[0].joint_names, panda[1] + 0.2)
    assert wait(lambda: driver.state == sk.LoopState.FAULTED)
    assert "joint" in driver.fault
    assert not driver.twist([0.1, 0, 0, 0, 0, 0])
    driver.resume()
    assert driver.fault == ""
    np.testing.assert_allclose(newest(driver)["q"], panda[1] + 0.2)
    assert driver.deactivate()


def test_settings_change_during_a_motion_and_bad_ones_change_nothing(panda):
    driver = make(panda)
    driver.change(DriverSettings(method="dls:damping=0.2"))
    with pytest.raises(sk.Error, match="rate"):
        driver.change(DriverSettings(method="dls", rate=100.0))
    with pytest.raises(ValueError, match="nothing"):
        driver.change(DriverSettings(method="nothing"))
    assert driver.settings.method == "dls:damping=0.2"
    assert driver.deactivate()
    driver.change(DriverSettings(rate=100.0))


@pytest.mark.parametrize("bad", [{"rate": 0.0}, {"timeout": 0.0}, {"timeout": np.inf}, {"method": "x"}])
def test_settings_out_of_range_are_refused(panda, bad):
    with pytest.raises(ValueError, match="rate|timeout|x"):
        Driver(panda[0], panda[2], DriverSettings(**bad))
