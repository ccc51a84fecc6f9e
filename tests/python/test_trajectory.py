"""A trajectory in a picture, and played through a servo."""

import importlib.util

import numpy as np
import pytest
from PIL import Image

import sigmaik as sk
from sigmaik._extras import MissingPackage

figure = pytest.importorskip("sigmaik.planning.figure")

START = sk.robots.home("franka_panda")
GOAL = START + np.array([0.4, 0.2, -0.3, 0.2, 0.3, -0.2, 0.1])


@pytest.fixture(scope="module")
def arm():
    return sk.robots.load("franka_panda")


@pytest.fixture(scope="module")
def plan(arm):
    return sk.planning.time_optimal(arm, START, GOAL, time_weight=10.0)


def drawn(axes, joint):
    """Times and values of the line that bears a name."""
    (line,) = (line for line in axes.get_lines() if line.get_label() == joint)
    return line.get_xdata(), line.get_ydata()


def test_the_figure_has_parts_of_limits_and_indices(arm, plan):
    axes = figure.trajectory_figure(plan, arm).axes
    assert len(axes) == 5
    limits = arm.limits
    middle, half = 0.5 * (limits.upper + limits.lower), 0.5 * (limits.upper - limits.lower)
    for j, name in enumerate(arm.joint_names):
        t, position = drawn(axes[0], name)
        assert set(plan.t) <= set(t)
        q, qdot, qddot = plan.sample(t)
        np.testing.assert_allclose(position, (q[:, j] - middle[j]) / half[j], atol=1e-12)
        np.testing.assert_allclose(drawn(axes[1], name)[1], qdot[:, j] / limits.velocity[j], atol=1e-12)
        np.testing.assert_allclose(drawn(axes[2], name)[1], qddot[:, j] / limits.acceleration[j], atol=1e-12)
    for panel, index in ((axes[3], "min_singular_value"), (axes[4], "manipulability")):
        t, values = panel.get_lines()[0].get_data()
        np.testing.assert_allclose(values, sk.indices.evaluate(arm, plan.sample(t)[0], index), rtol=1e-9)


def test_the_figure_without_a_chain(plan):
    axes = figure.trajectory_figure(plan).axes
    assert [panel.get_ylabel().split("\n")[1] for panel in axes] == ["[rad or m]", "[rad/s or m/s]", "[rad/s² or m/s²]"]
    for row, values in enumerate(("q", "qdot", "qddot")):
        t, line = drawn(axes[row], "joint 3")
        np.testing.assert_array_equal(line[np.searchsorted(t, plan.t)], getattr(plan, values)[:, 2])


def test_joints_without_limits(arm, plan):
    free = np.array([np.inf] + 6 * [3.0])
    some = arm.with_limits(lower=-free, upper=free, acceleration=np.inf)
    axes = figure.trajectory_figure(plan, some).axes
    assert axes[0].get_legend_handles_labels()[1] == list(arm.joint_names[1:])
    assert arm.joint_names[0] in axes[0].get_title(loc="right")
    assert axes[2].get_ylabel().endswith("[rad/s²]")
    np.testing.assert_array_equal(drawn(axes[2], arm.joint_names[0])[1][0], plan.qddot[0, 0])


def test_crossings_are_named():
    iiwa = sk.robots.load("kuka_lbr_iiwa_14_r820")
    bent = np.array([0.1, 0.5, 0.1, 1.2, 0.1, 0.8, 0.1])
    crossing = sk.planning.time_optimal(iiwa, bent, bent * [1, 1, 1, -1, 1, 1, 1])
    assert crossing.clearance.crossings
    texts = [text.get_text() for text in figure.trajectory_figure(crossing, iiwa).axes[3].texts]
    assert texts == [c.name for c in crossing.clearance.crossings]


def test_motions_of_planners_with_cubic_steps(arm, tmp_path):
    smooth = sk.planning.gradient(arm, START, GOAL)
    assert smooth.cubic
    with Image.open(smooth.plot(tmp_path / "new" / "smooth.png", arm)) as picture:
        assert picture.size[0] > 600
    t, line = drawn(figure.trajectory_figure(smooth).axes[2], "joint 1")
    np.testing.assert_allclose(line, smooth.sample(t)[2][:, 0])


def test_plot_writes_whole_or_nothing(arm, plan, tmp_path, monkeypatch):
    assert plan.plot(tmp_path / "plan.png", arm) == tmp_path / "plan.png"
    with Image.open(tmp_path / "plan.png") as picture:
        picture.load()
        assert picture.format == "PNG"
    with pytest.raises(ValueError, match="7 joints, the chain 6"):
        plan.plot(tmp_path / "six.png", sk.robots.load("ur10"))
    with pytest.raises(ValueError, match="must end in .png"):
        plan.plot(tmp_path / "plan.pdf")
    failed = sk.planning.Trajectory(*(np.empty((0, 7)),) * 4, np.nan, "failed", np.nan, 0.0)
    with pytest.raises(ValueError, match="empty, its plan failed"):
        failed.plot(tmp_path / "failed.png")
    monkeypatch.setattr(importlib.util, "find_spec", lambda name: None)
    with pytest.raises(MissingPackage, match="matplotlib is not installed; pip install matplotlib brings it"):
        plan.plot(tmp_path / "missing.png")
    assert [file.name for file in tmp_path.iterdir()] == ["plan.png"]


def test_played_through_the_servo(arm, plan):
    # Within all limits, off by the soft start, and with a posture at the goal.
    servo = sk.Servo(arm, sk.JParse(), dt=1e-3, posture=GOAL, posture_gain=5.0)
    servo.reset(START)
    done = sk.planning.play(plan, servo, settle=1.0)
    assert done.t[-1] >= plan.t[-1] + 1.0 - 1e-9
    assert len(done.t) == len(done.q) == len(done.qdot) == len(done.pose_error) == len(done.status) + 1
    np.testing.assert_array_equal(done.q[-1], servo.q)
    np.testing.assert_allclose(done.q[1:], done.q[:-1] + 1e-3 * done.qdot[:-1], atol=1e-12)
    np.testing.assert_array_equal(done.planned, plan.sample(done.t)[0])
    for k in (0, 500, len(done.t) - 1):
        error = sk.pose_error(arm.pose(done.q[k]), arm.pose(done.planned[k]))
        np.testing.assert_allclose(done.pose_error[k], error, atol=1e-12)
    assert np.all(np.abs(done.qdot) <= arm.limits.velocity)
    assert set(done.status) == {sk.Status.OK}
    assert done.max_position_error < 5e-4
    assert done.max_orientation_error < 2e-3
    assert np.linalg.norm(done.pose_error[-1]) < 1e-6
    assert done.max_joint_difference == np.abs(done.planned - done.q).max()
    assert np.abs(done.joint_difference[-1]).max() < 1e-2


def test_a_tip_on_its_plan_leaves_it_by_little(arm, plan):
    # A cycle leaves ½ dt² J̇ q̇, of which gains leave ½ dt |J̇ q̇| / gain: first order in dt.
    gain, worst = 5.0, []
    t = np.linspace(plan.t[0], plan.t[-1], 2000)
    q, qdot, _ = plan.sample(t)
    turn = np.einsum("tkij,tk,tj->ti", arm.jacobian_gradient(q), qdot, qdot)
    bend = np.linalg.norm(turn[:, :3], axis=1).max()
    for dt in (4e-3, 2e-3, 1e-3):
        servo = sk.Servo(arm, sk.PseudoInverse(), dt=dt, gain_linear=gain, gain_angular=gain, soft_start=0.0)
        servo.reset(START)
        worst.append(sk.planning.play(plan, servo, settle=0.0).max_position_error)
        assert worst[-1] < 1.1 * 0.5 * dt * bend / gain
    np.testing.assert_allclose(worst[:2], 2.0 * np.array(worst[1:]), rtol=0.05)


def test_play_refuses(arm, plan):
    servo = sk.Servo(arm, sk.JParse())
    off = START + np.array([0.0, 0.0, 0.01, 0.0, 0.0, 0.0, 0.0])
    servo.reset(off)
    with pytest.raises(
        ValueError, match=f"stands at {off[2]:.6g} in joint {arm.joint_names[2]}, the trajectory begins"
    ):
        sk.planning.play(plan, servo)
    np.testing.assert_array_equal(servo.q, off)
    servo.reset(START)
    for settle in (-1.0, np.nan, np.inf):
        with pytest.raises(ValueError, match="settle"):
            sk.planning.play(plan, servo, settle=settle)
    other = sk.Servo(sk.robots.load("ur10"), sk.JParse())
    with pytest.raises(ValueError, match="6 joints"):
        sk.planning.play(plan, other)
    failed = sk.planning.Trajectory(np.empty(0), *(np.empty((0, 7)),) * 3, np.nan, "failed", np.nan, 0.0)
    with pytest.raises(ValueError, match="empty"):
        sk.planning.play(failed, servo)
