"""OInK of RoboPlan, after its example example_oink.py."""

from __future__ import annotations

from typing import Any

import numpy as np
from roboplan.core import CartesianConfiguration, Scene, loadUrdfSceneDescriptionFromXml
from roboplan.optimal_ik import AccelerationLimit, FrameTask, FrameTaskOptions, Oink, PositionLimit, VelocityLimit

import sigmaik as sk
from sigmaik._types import Array
from sigmaik_lab.arrival.judge import held_limits

from . import versions
from .urdf import chain_urdf

__all__ = ["Peer"]


class Peer:
    """The example's frame task, position limit and velocity limit. Neither its posture task, which pulls the tool off
    the target, nor its filter of the target, which delays the arrival, is used."""

    led = False

    def __init__(self, chain: sk.Chain, dt: float, gain: float = 1.0, acceleration: bool = False) -> None:
        """gain: of the frame task.

        acceleration: with OInK's `AccelerationLimit`, too, which is told the last command, and how far the target is,
        from a solution without limits
        """
        self.settings = (
            f"frame task 1, 0.1, gain {gain:g}, lm_damping 0.01, regularization 1e-6; PositionLimit gain 1, "
            "VelocityLimit"
            + (", AccelerationLimit with target displacement" if acceleration else "")
            + "; without the example's posture task and target filter"
        )
        self.version = versions("roboplan-oink")
        self._scene: Any = Scene("arm", loadUrdfSceneDescriptionFromXml(chain_urdf(chain)))
        self._oink: Any = Oink(self._scene)
        goal = CartesianConfiguration(chain.base, chain.tip, np.asfortranarray(chain.pose(np.zeros(chain.dof))))
        options = FrameTaskOptions(position_cost=1.0, orientation_cost=0.1, task_gain=gain, lm_damping=0.01)
        self._task: Any = FrameTask(self._oink, self._scene, goal, options)
        velocity = np.minimum(chain.limits.velocity, 1e3)
        self._limits: list[Any] = [PositionLimit(self._oink, gain=1.0), VelocityLimit(self._oink, dt, velocity)]
        self._acceleration: Any = AccelerationLimit(self._oink, dt, held_limits(chain)[1]) if acceleration else None
        if acceleration:
            self._limits.append(self._acceleration)
        self._step, self._way = np.zeros(chain.dof), np.zeros(chain.dof)
        self._tip, self._dt = chain.tip, dt
        self.q = np.zeros(chain.dof)

    def reset(self, q: Array) -> None:
        self.put(q)
        self._step[:] = 0.0
        if self._acceleration is not None:
            self._acceleration.reset()

    def put(self, q: Array) -> None:
        self.q = np.array(q)
        self._scene.setJointPositions(self.q)
        self._scene.forwardKinematics(self.q, self._tip)

    def update(self, target: Array) -> Array:
        self._task.setTargetFrameTransform(np.asfortranarray(target))
        try:
            if self._acceleration is not None:
                self._oink.solveIk(self._scene, [self._task], self._way, 1e-6)
                self._acceleration.setLastVelocity(self._step / self._dt)
                self._acceleration.setTargetDisplacement(self._way)
            self._oink.solveIk(self._scene, [self._task], self._limits, [], self._step, 1e-6)
        except RuntimeError:  # as the example does
            self._step[:] = 0.0
        self.put(self._scene.integrate(self.q, self._step))
        return self._step / self._dt
