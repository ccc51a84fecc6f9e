"""jparse-robotics, the package of the J-PARSE authors, after its README: the inverse times a twist."""

from __future__ import annotations

from typing import Any

import jparse_robotics
import numpy as np
import pinocchio as pin

import sigmaik as sk
from sigmaik._types import Array

from . import versions
from .urdf import chain_urdf

__all__ = ["Peer"]

_GAIN = 5.0  #: [1/s] of the loop, which the README leaves to the user


class Peer:
    """q̇ = J⁺ gain·error, of `Robot.from_urdf(…, gamma=0.1)`. The package has no limits."""

    settings = f"gamma 0.1; twist {_GAIN:g}/s times the pose error; no limits, because the package has none"
    led = False

    def __init__(self, chain: sk.Chain, dt: float, gain: float = 0.0) -> None:
        """gain: not used, because the loop has a gain of its own."""
        self.version = versions("jparse-robotics", "pin")
        self._robot: Any = jparse_robotics.Robot.from_urdf(chain_urdf(chain), chain.base, chain.tip, gamma=0.1)
        self._dt = dt
        self.q = np.zeros(chain.dof)

    def reset(self, q: Array) -> None:
        self.put(q)

    def put(self, q: Array) -> None:
        self.q = np.array(q)

    def update(self, target: Array) -> Array:
        position, rotation = self._robot.forward_kinematics(self.q)
        twist = _GAIN * np.r_[target[:3, 3] - position, pin.log3(target[:3, :3] @ rotation.T)]
        qdot: Array = self._robot.jparse(self.q) @ twist
        self.q = self.q + self._dt * qdot
        return qdot
