"""mink, after its README, and with velocity limits as in its examples."""

from __future__ import annotations

from typing import Any

import mink
import mujoco  # type: ignore[import-untyped]
import numpy as np

import sigmaik as sk
from sigmaik._types import Array

from . import versions
from .urdf import chain_urdf

__all__ = ["Peer"]


class Peer:
    """A frame task and a posture task, with limits of position and velocity."""

    led = False

    def __init__(self, chain: sk.Chain, dt: float, gain: float = 1.0) -> None:
        """gain: of the frame task."""
        self.settings = (
            f"frame task 1, 1, gain {gain:g}; posture task 1e-3 towards the start; daqp; ConfigurationLimit and "
            "VelocityLimit"
        )
        self.version = versions("mink", "daqp")
        # MuJoCo would fold a link behind a fixed joint, such as the tip, into its parent.
        keep = '<mujoco><compiler fusestatic="false"/></mujoco>'
        model: Any = mujoco.MjModel.from_xml_string(chain_urdf(chain).replace("</robot>", keep + "</robot>"))
        self._configuration: Any = mink.Configuration(model)
        self._task: Any = mink.FrameTask(chain.tip, "body", position_cost=1.0, orientation_cost=1.0, gain=gain)
        self._posture: Any = mink.PostureTask(model, cost=1e-3)
        speeds = {
            name: speed
            for name, speed in zip(chain.joint_names, chain.limits.velocity.tolist(), strict=True)
            if np.isfinite(speed)
        }
        self._limits = [mink.ConfigurationLimit(model), *([mink.VelocityLimit(model, speeds)] if speeds else [])]
        self._dt = dt

    @property
    def q(self) -> Array:
        q: Array = np.array(self._configuration.q)
        return q

    def reset(self, q: Array) -> None:
        self.put(q)
        self._posture.set_target(np.array(q))

    def put(self, q: Array) -> None:
        self._configuration.update(np.array(q))

    def update(self, target: Array) -> Array:
        self._task.set_target(mink.SE3.from_matrix(target))
        tasks = [self._task, self._posture]
        qdot: Array = mink.solve_ik(self._configuration, tasks, self._dt, solver="daqp", limits=self._limits)
        self._configuration.integrate_inplace(qdot, self._dt)
        return qdot
