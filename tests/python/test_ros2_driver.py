"""The driver behind the ROS 2 node, without ROS."""

import time

import numpy as np
import pytest

import sigmaik as sk
from sigmaik.ros2 import Driver, DriverSettings


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
        (lambda d: d.twist("abc"), "no array of numbers: 'abc'"),
        (lambda d: d.twist([0, 0, 0, 0, 0, "fast"]), "no array of numbers"),
        (lambda d: d.twist([[1, 2], [3]]), "no array of numbers"),
        (lambda d: d.twist(None), "six"),
        (lambda d: d.twist(np.zeros(6), None), "name of a link, not None"),
        (lambda d: d.twist(np.zeros(6), "", np.nan), "age is nan"),
        (lambda d: d.twist(np.zeros(6), "", np.inf), "age is inf"),
        (lambda d: d.twist(np.zeros(6), "nowhere"), "no link 'nowhere'"),
        (lambda d: d.twist(np.zeros(6), "", 0.2), "0.2 s old"),
        (lambda d: d.twist(np.zeros(6), "", -3.0), "3 s ahead"),
        (lambda d: d.pose(np.eye(3)), "shape"),
        (lambda d: d.pose("abc"), "no array of numbers: 'abc'"),
        (lambda d: d.pose({"position": 1}), "no array of numbers"),
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


BAD_SETTINGS = [
    {"rate": 0.0},
    {"rate": np.nan},
    {"timeout": 0.0},
    {"timeout": -1.0},
    {"timeout": 60.1},
    {"timeout": 1000.0},
    {"timeout": np.nan},
    {"timeout": np.inf},
    {"max_following_error": -1.0},
    {"max_following_error": 0.0},
    {"max_following_error": np.nan},
    {"max_following_error": np.inf},
    {"measure_timeout": -1.0},
    {"measure_timeout": 0.0},
    {"measure_timeout": np.nan},
    {"method": "x"},
    {"servo": {"gain_linear": -1.0}},
]


@pytest.mark.parametrize("bad", BAD_SETTINGS, ids=str)
def test_settings_out_of_range_are_refused_at_once_and_change_nothing(panda, bad):
    name = next(iter(bad))
    reason = {"method": "'x'", "servo": "gain_linear"}.get(name, f"^{name} = ")
    with pytest.raises(ValueError, match=reason):
        Driver(panda[0], panda[2], DriverSettings(**bad))
    driver = Driver(panda[0], panda[2])
    with pytest.raises(ValueError, match=reason):  # before the arm is active
        driver.change(DriverSettings(**bad))
    assert driver.settings == DriverSettings()


@pytest.mark.parametrize("bad", [{"timeout": 1000.0}, {"timeout": -1.0}, {"measure_timeout": -1.0}], ids=str)
def test_an_active_driver_goes_on_after_settings_that_are_out_of_range(panda, bad):
    driver = make(panda)
    with pytest.raises(sk.Error, match=next(iter(bad))):
        driver.change(DriverSettings(**bad))
    assert driver.twist([0.05, 0, 0, 0, 0, 0])
    assert driver.deactivate()


@pytest.mark.parametrize("good", [{"timeout": 60.0}, {"max_following_error": 1e-3}, {"measure_timeout": 5.0}], ids=str)
def test_settings_in_range_are_those_of_a_loop_that_starts_and_takes_commands(panda, good):
    driver = make(panda, **good)
    assert driver.twist(np.zeros(6))
    assert driver.deactivate()


def test_a_twist_in_the_frame_of_a_tool_moves_along_the_tools_axes(panda):
    chain, home, text = panda
    turned = np.eye(4)
    turned[:3, :3] = sk.rotation_exp([0.9, -0.4, 0.3])
    turned[:3, 3] = [0.02, 0.0, 0.1]
    chain = chain.with_tool(turned)
    driver = make((chain, home, text))
    begin = chain.pose(home)
    assert driver.twist([0, 0, 0.1, 0, 0, 0], chain.tip), driver.last_refusal
    assert wait(lambda: driver.state == sk.LoopState.HOLDING and newest(driver)["cycle"] > 60)
    moved = chain.pose(newest(driver)["q"])[:3, 3] - begin[:3, 3]
    assert np.linalg.norm(moved) > 1e-3
    assert np.dot(moved, begin[:3, 2]) > 0.999 * np.linalg.norm(moved)
    assert driver.deactivate()
