"""The shipped arms: the URDF files against the figures in tests/data/arms, and the chains read from them."""

import json
import warnings
import xml.etree.ElementTree as ET
from pathlib import Path

import numpy as np
import pytest

import sigmaik as sk

DATA = Path(__file__).resolve().parents[1] / "data" / "arms"
ARMS = sorted(p.stem for p in DATA.glob("*.json"))

INERTIA = ("ixx", "ixy", "ixz", "iyy", "iyz", "izz")


@pytest.fixture(params=ARMS)
def arm(request):
    """(name, figures) of one arm."""
    return request.param, json.loads((DATA / f"{request.param}.json").read_text(encoding="utf-8"))


def figures_of(element, attribute):
    return [float(x) for x in element.get(attribute).split()]


def urdf(name):
    root = ET.parse(sk.robots.path(name)).getroot()
    assert root.get("name") == name
    return root


# Kinematics of its own, from the figures ----------


def translation(xyz):
    T = np.eye(4)
    T[:3, 3] = xyz
    return T


def rotation(axis, angle):
    x, y, z = axis
    K = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    T = np.eye(4)
    T[:3, :3] += np.sin(angle) * K + (1.0 - np.cos(angle)) * K @ K
    return T


X, Y, Z = np.eye(3)


def frame(figures):
    roll, pitch, yaw = figures["origin_rpy"]
    return translation(figures["origin_xyz"]) @ rotation(Z, yaw) @ rotation(Y, pitch) @ rotation(X, roll)


def pose_from_joints(figures, q):
    T = np.eye(4)
    for joint, angle in zip(figures["joints"], q, strict=True):
        assert joint["type"] in ("revolute", "continuous")
        T = T @ frame(joint) @ rotation(joint["axis"], angle)
    return T @ frame(figures["flange"])


def pose_from_dh(figures, q):
    dh = figures["dh"]
    rows = list(zip(dh["rows"], np.array(dh["map"]["sign"]) * q + dh["map"]["offset"], strict=True))
    if dh["end"] is not None:
        rows.append((dh["end"], 0.0))
    T = frame(dh["map"]["base"])
    for row, angle in rows:
        about_z = rotation(Z, angle + row["theta_offset"]) @ translation([0.0, 0.0, row["d"]])
        about_x = rotation(X, row["alpha"]) @ translation([row["a"], 0.0, 0.0])
        T = T @ (about_x @ about_z if dh["convention"] == "modified" else about_z @ about_x)
    return T @ frame(dh["map"]["tip"])


def random_configurations(figures, count=100):
    """(count, n) inside the limits, a turn to each side where there are none."""
    rng = np.random.default_rng(20)
    lower = [-2 * np.pi if j["lower"] is None else j["lower"] for j in figures["joints"]]
    upper = [2 * np.pi if j["upper"] is None else j["upper"] for j in figures["joints"]]
    return rng.uniform(lower, upper, (count, len(lower)))


# The files, figure by figure ----------


def test_every_arm_is_shipped():
    assert sk.robots.names() == tuple(ARMS)
    assert len(ARMS) == 14


def test_tree_is_a_chain_from_the_base_to_the_flange(arm):
    name, figures = arm
    root = urdf(name)
    links = [link["name"] for link in figures["links"]]
    expected = [figures["base_frame"], *links, "flange"]
    assert [link.get("name") for link in root.findall("link")] == expected
    joints = root.findall("joint")
    assert [j.get("name") for j in joints] == [j["name"] for j in figures["joints"]] + ["flange_joint"]
    assert [j.find("parent").get("link") for j in joints] == expected[:-1]
    assert [j.find("child").get("link") for j in joints] == expected[1:]


def test_joints(arm):
    name, figures = arm
    for element, joint in zip(urdf(name).findall("joint"), figures["joints"], strict=False):
        assert element.get("type") == joint["type"]
        assert figures_of(element.find("origin"), "xyz") == joint["origin_xyz"]
        assert figures_of(element.find("origin"), "rpy") == joint["origin_rpy"]
        assert figures_of(element.find("axis"), "xyz") == joint["axis"]


def test_limits_in_the_file(arm):
    name, figures = arm
    for element, joint in zip(urdf(name).findall("joint"), figures["joints"], strict=False):
        limit = {key: float(value) for key, value in element.find("limit").attrib.items()}
        # URDF wants velocity and effort; 0 stands for "not given".
        expected = {"velocity": joint["velocity"] or 0.0, "effort": joint["effort"] or 0.0}
        given = ("lower", "upper", "acceleration", "jerk")
        expected |= {key: joint[key] for key in given if joint.get(key) is not None}
        assert limit == expected
        assert (joint["type"] == "continuous") == ("lower" not in limit)


def test_flange(arm):
    name, figures = arm
    element = urdf(name).findall("joint")[-1]
    assert element.get("type") == "fixed"
    assert figures_of(element.find("origin"), "xyz") == figures["flange"]["origin_xyz"]
    assert figures_of(element.find("origin"), "rpy") == figures["flange"]["origin_rpy"]


def test_inertials(arm):
    name, figures = arm
    elements = {link.get("name"): link.find("inertial") for link in urdf(name).findall("link")}
    assert elements.pop(figures["base_frame"]) is None
    assert elements.pop("flange") is None
    assert len(elements) == len(figures["links"])
    for link in figures["links"]:
        element, inertial = elements[link["name"]], link["inertial"]
        if inertial is None:
            assert element is None
            continue
        assert float(element.find("mass").get("value")) == inertial["mass"]
        assert figures_of(element.find("origin"), "xyz") == inertial["com_xyz"]
        assert figures_of(element.find("origin"), "rpy") == [0.0, 0.0, 0.0]
        assert [float(element.find("inertia").get(key)) for key in INERTIA] == inertial["inertia"]


def test_every_link_can_be_drawn(arm):
    name, _ = arm
    root = urdf(name)
    materials = {m.get("name") for m in root.findall("material")}
    for link in root.findall("link"):
        visuals = link.findall("visual")
        assert visuals, link.get("name")
        for shape in visuals + link.findall("collision"):
            (geometry,) = shape.find("geometry")
            assert geometry.tag in ("box", "cylinder", "sphere")
            assert all(float(x) > 0 for value in geometry.attrib.values() for x in value.split())
        assert {v.find("material").get("name") for v in visuals} <= materials


# The chains read from them ----------


def test_chain(arm):
    name, figures = arm
    chain = sk.robots.load(name)
    assert chain.dof == len(figures["joints"])
    assert list(chain.joint_names) == [j["name"] for j in figures["joints"]]
    assert chain.base == figures["base_frame"]
    assert chain.tip == "flange"


def test_limits_of_the_chain(arm):
    name, figures = arm
    limits = sk.robots.load(name).limits

    def expected(key, otherwise=np.inf):
        return [otherwise if j.get(key) is None else j[key] for j in figures["joints"]]

    np.testing.assert_array_equal(limits.lower, expected("lower", -np.inf))
    np.testing.assert_array_equal(limits.upper, expected("upper"))
    for key in ("velocity", "acceleration", "jerk", "effort"):
        np.testing.assert_array_equal(getattr(limits, key), expected(key))


def test_pose_against_the_joint_figures(arm):
    name, figures = arm
    chain = sk.robots.load(name)
    for q in random_configurations(figures):
        np.testing.assert_allclose(chain.pose(q), pose_from_joints(figures, q), rtol=0, atol=1e-12)


def test_pose_against_the_dh_table(arm):
    name, figures = arm
    if figures["dh"] is None:
        pytest.skip("no DH table for this arm")
    chain = sk.robots.load(name)
    for q in random_configurations(figures):
        np.testing.assert_allclose(chain.pose(q), pose_from_dh(figures, q), rtol=0, atol=1e-12)


def test_home_is_inside_the_limits_and_not_singular(arm):
    name, figures = arm
    chain, q = sk.robots.load(name), sk.robots.home(name)
    assert q.shape == (chain.dof,)
    assert q.dtype == np.float64
    np.testing.assert_array_equal(q, figures["home"])
    assert np.all(chain.limits.lower < q)
    assert np.all(q < chain.limits.upper)
    sigma = np.linalg.svd(chain.jacobian(q), compute_uv=False)
    assert sigma[-1] / sigma[0] > 0.01


def test_inertias_are_those_of_bodies(arm):
    """But for those of which the chain warns: the table of the PUMA 560 has what can be measured."""
    name, _ = arm
    with warnings.catch_warnings():
        warnings.simplefilter("error" if name != "puma560" else "ignore", sk.ModelWarning)
        chain = sk.robots.load(name)
    assert bool(chain.warnings) == (name == "puma560")


@pytest.mark.parametrize(
    ("name", "lengths"),
    [  # upper arm, forearm, shoulder's height, and the three of the wrist (DH table of the maker) [m]
        ("ur3e", (0.24355, 0.2132, 0.15185, 0.13105, 0.08535, 0.0921)),
        ("ur5e", (0.425, 0.3922, 0.1625, 0.1333, 0.0997, 0.0996)),
        ("ur10", (0.612, 0.5723, 0.1273, 0.163941, 0.1157, 0.0922)),
    ],
)
def test_universal_robots_stretched_out_and_upright(name, lengths):
    a2, a3, d1, d4, d5, d6 = lengths
    chain = sk.robots.load(name)
    position = chain.pose(np.zeros(6))[:3, 3]
    np.testing.assert_allclose(position, [a2 + a3, d4 + d6, d1 - d5], rtol=0, atol=1e-12)
    upright = chain.pose([0.0, -np.pi / 2, 0.0, -np.pi / 2, 0.0, 0.0])[:3, 3]
    np.testing.assert_allclose(upright, [0.0, d4 + d6, d1 + a2 + a3 + d5], rtol=0, atol=1e-12)


def test_ur3e_is_the_small_one_with_an_endless_wrist():
    small, large = sk.robots.load("ur3e").limits, sk.robots.load("ur5e").limits
    assert np.flatnonzero(np.isinf(small.upper)).tolist() == [5]
    np.testing.assert_allclose(np.degrees(small.velocity), [180.0] * 3 + [360.0] * 3)
    np.testing.assert_allclose(np.degrees(large.velocity), 180.0)
    assert np.all(small.effort < large.effort)
    assert np.all(np.isinf([small.acceleration, large.acceleration]))


def test_franka_research_3_is_a_panda_with_other_limits():
    fr3, panda = sk.robots.load("franka_fr3"), sk.robots.load("franka_panda")
    for seed in range(20):
        q = panda.random_configuration(seed)
        np.testing.assert_array_equal(fr3.pose(q), panda.pose(q))
    limits = fr3.limits
    np.testing.assert_array_equal(limits.acceleration, 10.0)
    np.testing.assert_array_equal(limits.jerk, 5000.0)
    assert np.all(limits.velocity > panda.limits.velocity)
    np.testing.assert_array_equal(limits.effort, panda.limits.effort)
    assert limits.upper[5] == 4.5169


def test_xarm6_at_zero_is_where_the_maker_says():
    # The controller shows x 207 mm, z 112 mm and a roll of 180° for all joints at zero.
    pose = sk.robots.load("ufactory_xarm6").pose(np.zeros(6))
    np.testing.assert_allclose(pose[:3, 3], [0.207, 0.0, 0.112], rtol=0, atol=1e-12)
    np.testing.assert_allclose(pose[:3, :3], np.diag([1.0, -1.0, -1.0]), rtol=0, atol=1e-12)


def test_so101_points_forward_at_zero():
    chain = sk.robots.load("so101")
    pose = chain.pose(np.zeros(5))
    np.testing.assert_allclose(pose[:3, 3], [0.3914, 0.0, 0.2265], atol=1e-4)
    np.testing.assert_allclose(pose[:3, 2], [1.0, 0.0, 0.0], atol=1e-12)  # the jaws' axis
    np.testing.assert_allclose(chain.limits.velocity, 45.0 * 2.0 * np.pi / 60.0)


# A servo on them ----------

NEW = ("franka_fr3", "so101", "ufactory_xarm6", "ur3e", "ur5e")


@pytest.mark.parametrize("name", NEW)
def test_a_guided_servo_reaches_random_targets_inside_the_limits(name):
    chain, dt = sk.robots.load(name), 2e-3
    limits = chain.limits
    # Five joints: the position is exact, the rotation as near as they can.
    options = {"exact": (1, 1, 1, 0, 0, 0)} if chain.dof < 6 else {}
    servo = sk.Servo(chain, dt=dt, guided=True, **options)
    servo.reset(sk.robots.home(name))
    acceleration = np.where(np.isfinite(limits.acceleration), limits.acceleration, 10.0)  # the assumed one
    rng = np.random.default_rng(0)
    last, before = np.zeros(chain.dof), np.zeros(chain.dof)
    for _ in range(5):
        target = chain.pose(chain.random_configuration(rng))
        for _ in range(round(8.0 / dt)):
            step = servo.update(target)
            rate = (step.qdot - last) / dt
            assert np.all((limits.lower <= step.q) & (step.q <= limits.upper))
            assert np.all(np.abs(step.qdot) <= limits.velocity)
            assert np.all(np.abs(rate) <= acceleration * (1 + 1e-9))
            assert np.all(np.abs(rate - before) <= limits.jerk * dt * (1 + 1e-9))
            last, before = step.qdot, rate
            error = step.pose_error
            if np.linalg.norm(error[:3]) < 1e-4 and np.linalg.norm(error[3:]) < 1e-3:
                break
        else:
            pytest.fail(f"{name} is {np.linalg.norm(error[:3])} m and {np.linalg.norm(error[3:])} rad away after 8 s")


def test_home_is_a_new_array_each_time():
    sk.robots.home("ur10")[:] = np.nan
    assert np.all(np.isfinite(sk.robots.home("ur10")))


# Names ----------


@pytest.mark.parametrize("call", [sk.robots.load, sk.robots.home, sk.robots.path])
@pytest.mark.parametrize("name", ["xarm7", "nonsense", "", "homes", "../robots/ur10", "ur10.urdf"])
def test_unknown_name_lists_the_names_there_are(call, name):
    with pytest.raises(ValueError, match="is shipped") as error:
        call(name)
    for shipped in ARMS:
        assert shipped in str(error.value)


def test_unknown_name_suggests_a_close_one():
    with pytest.raises(ValueError, match="did you mean 'ufactory_xarm7'"):
        sk.robots.load("xarm7")
