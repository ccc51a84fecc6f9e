"""EmbodiK, after its example 01_basic_ik_simple.py."""

from __future__ import annotations

import os
import tempfile
from typing import Any

import embodik
import numpy as np

import sigmaik as sk
from sigmaik._types import Array
from sigmaik_lab.arrival.judge import held_limits

from . import versions
from .urdf import chain_urdf

__all__ = ["Peer"]


class Peer:
    """The example's tasks, gains and runtime policy, with limits of position and velocity. Its adaptive time step is
    off: a longer step than the cycle is no command of a cycle."""

    led = False

    def __init__(self, chain: sk.Chain, dt: float, gain: float = 0.0, acceleration: bool = False) -> None:
        """gain: not used, because the example has a gain of its own.

        acceleration: with EmbodiK's acceleration limits, too
        """
        self.settings = (
            "frame task SCALE_ELASTIC, gains 10; posture task 1e-2 MIN_ERROR towards the start; automatic "
            "layout and weighted fallback; limits of position and velocity"
            + (" and acceleration" if acceleration else "")
            + "; adaptive_dt off"
        )
        self.version = versions("embodik")
        with tempfile.TemporaryDirectory() as folder:
            file = os.path.join(folder, "robot.urdf")
            with open(file, "w", encoding="utf-8") as stream:
                stream.write(chain_urdf(chain))
            self._robot: Any = embodik.RobotModel(file)
        self._solver: Any = embodik.KinematicsSolver(self._robot)
        self._solver.dt = self._dt = dt
        policy = self._solver.runtime_config()
        policy.enable_auto_task_layout = True
        policy.weighted_fallback_enabled = True
        self._solver.configure_runtime(policy)
        self._solver.enable_position_limits(True)
        self._solver.enable_velocity_limits(True)
        self._acceleration = acceleration
        if acceleration:
            self._solver.set_acceleration_limits(held_limits(chain)[1])
            self._solver.enable_acceleration_limits(True)
        self._add_tasks(chain)
        self._options: Any = embodik.PositionStepOptions()
        self._options.position_gain = self._options.orientation_gain = 10.0
        self._options.max_steps = 1
        self._options.adaptive_dt = False
        self.q = np.zeros(chain.dof)

    def _add_tasks(self, chain: sk.Chain) -> None:
        task = self._solver.add_frame_task("ee_task", chain.tip)
        task.priority, task.weight = 0, 1.0
        task.solve_mode = embodik.TaskSolveMode.SCALE_ELASTIC
        task.allow_min_error_fallback = False
        self._posture: Any = self._solver.add_posture_task("posture_bias")
        self._posture.priority, self._posture.weight = 1, 1e-2
        self._posture.solve_mode = embodik.TaskSolveMode.MIN_ERROR
        self._posture.allow_min_error_fallback = False

    def reset(self, q: Array) -> None:
        self.put(q)
        self._posture.set_target_configuration(np.array(q))
        self._solver.reset_adaptive_state()
        if self._acceleration:
            self._solver.set_previous_joint_velocities(np.zeros(len(q)))

    def put(self, q: Array) -> None:
        self.q = np.array(q)
        self._robot.update_configuration(self.q)

    def update(self, target: Array) -> Array:
        result = self._solver.solve_position_step(self.q, np.asfortranarray(target), "ee_task", self._options)
        before, self.q = self.q, np.asarray(result.q_solution, dtype=float)
        self._robot.update_configuration(self.q)
        qdot: Array = (self.q - before) / self._dt
        if self._acceleration:
            self._solver.set_previous_joint_velocities(qdot)
        return qdot
