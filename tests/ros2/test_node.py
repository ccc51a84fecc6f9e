"""The ROS 2 node, from another process: commands move the arm inside its limits, and what is wrong moves nothing."""

import numpy as np
import pytest

HOLD = 0.5  # s: long after every time-out


def inside_limits(cell):
    limits = cell.chain.limits
    for message in cell.commands:
        q, qdot = np.array(message.points[0].positions), np.array(message.points[0].velocities)
        assert list(message.joint_names) == list(cell.chain.joint_names)
        assert np.all(q >= limits.lower - 1e-12)
        assert np.all(q <= limits.upper + 1e-12)
        assert np.all(np.abs(qdot) <= limits.velocity * (1 + 1e-9))


def go_to(cell, target):
    cell.repeat(lambda: cell.pose(target), lambda: np.abs(cell.chain.pose(cell.q()) - target).max() < 1e-3)


def go_home(cell):
    go_to(cell, cell.chain.pose(cell.home))
    cell.rests()


def test_a_twist_through_a_singularity_is_smooth_and_inside_the_limits(cell):
    go_home(cell)
    cell.commands.clear()
    begin = cell.chain.pose(cell.q())[:3, 3]
    cell.drive([0.25, 0, 0.1, 0, 0, 0], 4.0)  # to the edge of reach, where the arm is singular
    singular = min(np.linalg.svd(cell.chain.jacobian(m.points[0].positions))[1][-1] for m in cell.commands)
    cell.drive([-0.25, 0, -0.1, 0, 0, 0], 2.0)  # and back
    cell.rests()
    inside_limits(cell)
    assert singular < 0.02
    assert np.linalg.norm(cell.chain.pose(cell.q())[:3, 3] - begin) > 0.05
    stamps = np.array([m.header.stamp.sec + 1e-9 * m.header.stamp.nanosec for m in cell.commands])
    qdot = np.array([m.points[0].velocities for m in cell.commands])
    change = np.abs(np.diff(qdot, axis=0)) / (np.diff(stamps)[:, None] + 0.02)  # late messages
    assert np.all(change <= cell.chain.limits.acceleration)


def test_the_arm_rests_when_commands_end(cell):
    cell.drive([0, 0.1, 0, 0, 0, 0], 0.5)
    cell.spin(HOLD)
    assert max(np.abs(m.points[0].velocities).max() for m in cell.commands[-10:]) == 0.0


def test_a_twist_in_the_tips_frame_moves_along_the_tips_axes(cell):
    go_home(cell)
    begin = cell.chain.pose(cell.q())
    cell.drive([0, 0, -0.05, 0, 0, 0], 0.5, cell.chain.tip)
    cell.rests()
    moved = cell.chain.pose(cell.q())[:3, 3] - begin[:3, 3]
    assert np.dot(moved, -begin[:3, 2]) > 0.99 * np.linalg.norm(moved) > 0.0


def test_a_pose_is_reached(cell):
    go_home(cell)
    go_to(cell, cell.chain.pose(cell.home + 0.2))
    inside_limits(cell)


@pytest.mark.parametrize(
    ("send", "reason"),
    [
        (lambda c: c.twist([np.nan, 0, 0, 0, 0, 0]), "finite"),
        (lambda c: c.twist([0.1, 0, 0, 0, 0, 0], "no_such_link"), "no_such_link"),
        (lambda c: c.twist([0.1, 0, 0, 0, 0, 0], ahead=-5.0), "old"),
        (lambda c: c.twist([0.1, 0, 0, 0, 0, 0], ahead=30.0), "ahead"),
        (lambda c: c.pose(np.eye(4), quaternion=[0, 0, 0, 0]), "target"),
        (lambda c: c.pose(np.eye(4), quaternion=[0, 0, 0.5, 1.0]), "target"),
    ],
)
def test_wrong_commands_move_nothing_and_say_why(cell, send, reason):
    cell.rests()
    before = cell.q()
    send(cell)
    cell.wait(lambda: reason in cell.refusal())
    np.testing.assert_allclose(cell.q(), before, atol=1e-5)
    cell.drive([0.0, 0.05, 0, 0, 0, 0], 0.2)  # the next good command is followed
    cell.wait(lambda: np.abs(cell.q() - before).max() > 1e-4)


def test_paused_the_arm_stays_and_goes_on_after_a_new_command(cell):
    cell.drive([0, -0.1, 0, 0, 0, 0], 0.3)
    assert cell.pause(True).success
    cell.rests()
    before = cell.q()
    cell.drive([0, 0.1, 0, 0, 0, 0], 0.3)
    np.testing.assert_allclose(cell.q(), before, atol=1e-5)
    assert cell.pause(False).success
    cell.spin(HOLD)
    np.testing.assert_allclose(cell.q(), before, atol=1e-5)
    cell.drive([0, 0.1, 0, 0, 0, 0], 0.3)
    cell.wait(lambda: np.abs(cell.q() - before).max() > 1e-4)


def test_the_rule_changes_during_a_motion_and_wrong_values_are_refused(cell):
    cell.drive([0, 0.05, 0, 0, 0, 0], 0.2)
    assert cell.set("method", "dls:damping=0.1").successful
    cell.drive([0, 0.05, 0, 0, 0, 0], 0.2)
    for name, value in [("method", "magic"), ("command_type", "joint"), ("command_out_type", "std_msgs/String")]:
        answer = cell.set(name, value)
        assert not answer.successful
        assert value in answer.reason
    assert cell.set("method", "jparse").successful
    inside_limits(cell)


def test_only_the_chosen_type_of_command_is_followed(cell):
    assert cell.set("command_type", "pose").successful
    cell.rests()
    before = cell.q()
    cell.drive([0, 0.1, 0, 0, 0, 0], 0.3)
    np.testing.assert_allclose(cell.q(), before, atol=1e-5)
    assert cell.set("command_type", "any").successful
