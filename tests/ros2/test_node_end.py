"""What the arm does when the node ends: by itself, or killed."""

import signal

import numpy as np


def test_a_node_that_ends_brings_the_arm_to_rest_first(own_cell):
    cell = own_cell
    cell.drive([0, 0.2, 0, 0, 0, 0], 0.5)
    cell.node_process.send_signal(signal.SIGTERM)
    cell.wait(lambda: cell.node_process.poll() is not None)
    assert cell.node_process.returncode == 0
    cell.spin(0.2)
    assert np.abs(cell.commands[-1].points[0].velocities).max() == 0.0
    cell.rests()
    np.testing.assert_allclose(cell.q(), cell.commands[-1].points[0].positions, atol=1e-6)


def test_an_arm_whose_node_is_killed_holds(own_cell):
    cell = own_cell
    cell.drive([0, 0.2, 0, 0, 0, 0], 0.5)
    cell.node_process.kill()
    cell.node_process.wait(10)
    cell.rests()
    np.testing.assert_allclose(cell.q(), cell.commands[-1].points[0].positions, atol=1e-6)
