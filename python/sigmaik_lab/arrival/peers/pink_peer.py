"""Pink, after its README."""

from __future__ import annotations

from typing import Any

import numpy as np
import pink
import pinocchio as pin
from pink.limits import AccelerationLimit, ConfigurationLimit, VelocityLimit
from pink.tasks import FrameTask, PostureTask

import sigmaik as sk
from sigmaik._types import Array
from sigmaik_lab.arrival.judge import held_limits

from . import versions
from .urdf import chain_urdf

__all__ = ["Peer"]


class Peer:
    """The README's frame task and posture task; `solve_ik` holds the model's limits of position and velocity."""

    led = False

    def __init__(self, chain: sk.Chain, dt: float, gain: float = 1.0, acceleration: bool = False) -> None:
        """gain: of the frame task.

        acceleration: with Pink's `AccelerationLimit`, too, which is told the last command
        """
        self.settings = (
            f"frame task 1, 1, gain {gain:g}; posture task 1e-3 towards the start; quadprog; limits of position and "
            "velocity (default)" + (", AccelerationLimit" if acceleration else "")
        )
        self.version = versions("pin-pink", "quadprog")
        model: Any = pin.buildModelFromXML(chain_urdf(chain))
        self._configuration: Any = pink.Configuration(model, model.createData(), np.zeros(chain.dof))
        self._task = FrameTask(chain.tip, position_cost=1.0, orientation_cost=1.0, gain=gain)
        self._posture = PostureTask(cost=1e-3)
        self._dt = dt
        self._limits: list[Any] = [ConfigurationLimit(model), VelocityLimit(model)]
        self._acceleration: Any = AccelerationLimit(model, held_limits(chain)[1]) if acceleration else None
        if acceleration:
            self._limits.append(self._acceleration)

    @property
    def q(self) -> Array:
        q: Array = np.array(self._configuration.q)
        return q

    def reset(self, q: Array) -> None:
        self.put(q)
        self._posture.set_target(np.array(q))
        if self._acceleration is not None:
            self._acceleration.set_last_integration(np.zeros(len(q)), self._dt)

    def put(self, q: Array) -> None:
        self._configuration.update(np.array(q))

    def update(self, target: Array) -> Array:
        self._task.set_target(pin.SE3(target))
        tasks = [self._task, self._posture]
        qdot: Array = pink.solve_ik(self._configuration, tasks, self._dt, solver="quadprog", limits=self._limits)
        self._configuration.integrate_inplace(qdot, self._dt)
        if self._acceleration is not None:
            self._acceleration.set_last_integration(qdot, self._dt)
        return qdot
