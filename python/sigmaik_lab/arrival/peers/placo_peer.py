"""PlaCo, after its page "Getting started" of the kinematics solver."""

from __future__ import annotations

import os
import tempfile
from typing import Any

import placo

import sigmaik as sk
from sigmaik._types import Array

from . import versions
from .urdf import chain_urdf

__all__ = ["Peer"]


class Peer:
    """One soft frame task, with joint limits and velocity limits."""

    led = False

    def __init__(self, chain: sk.Chain, dt: float, gain: float = 1.0) -> None:
        """gain: part of the solver's step that is taken, because PlaCo's tasks have no gain."""
        self.settings = (
            "frame task soft 1, 1; mask_fbase; joint limits (default); enable_velocity_limits, dt of the cycle"
            + ("" if gain == 1.0 else f"; {gain:g} of each step is taken")
        )
        self._gain = gain
        self.version = versions("placo")
        with tempfile.TemporaryDirectory() as folder:
            file = os.path.join(folder, "robot.urdf")
            with open(file, "w", encoding="utf-8") as stream:
                stream.write(chain_urdf(chain))
            # Without this flag PlaCo looks for a file of collision pairs, and for shapes.
            self._robot: Any = placo.RobotWrapper(file, placo.Flags.ignore_collisions)
        self._solver: Any = placo.KinematicsSolver(self._robot)
        self._solver.mask_fbase(True)
        self._task: Any = self._solver.add_frame_task(chain.tip, chain.pose([0.0] * chain.dof))
        self._task.configure("effector", "soft", 1.0, 1.0)
        self._solver.enable_joint_limits(True)
        self._solver.enable_velocity_limits(True)
        self._solver.dt = dt / gain  # the limits hold for the part of the step that is taken
        self._dt = dt
        self._dof = chain.dof
        self._names = chain.joint_names

    @property
    def q(self) -> Array:
        q: Array = self._robot.state.q[7:].copy()
        return q

    def reset(self, q: Array) -> None:
        self.put(q)

    def put(self, q: Array) -> None:
        for name, value in zip(self._names, q, strict=True):
            self._robot.set_joint(name, value)
        self._robot.update_kinematics()

    def update(self, target: Array) -> Array:
        self._task.T_world_frame = target
        if self._gain == 1.0:
            step: Array = self._solver.solve(True)[6:]
            self._robot.update_kinematics()
        else:
            step = self._gain * self._solver.solve(False)[6:]
            self.put(self.q + step)
        return step / self._dt
