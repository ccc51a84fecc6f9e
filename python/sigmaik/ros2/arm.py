"""A simulated arm as a node: joint commands in, /joint_states and the robot description out."""

from __future__ import annotations

import time
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from sigmaik._core import Chain, Error
from sigmaik._extras import need
from sigmaik._types import Array

need("rclpy")

import rclpy.node  # noqa: E402
from rclpy.qos import DurabilityPolicy, QoSProfile  # noqa: E402
from sensor_msgs.msg import JointState  # noqa: E402
from std_msgs.msg import Float64MultiArray, String  # noqa: E402
from trajectory_msgs.msg import JointTrajectory  # noqa: E402

__all__ = ["ArmNode"]

_STIFFNESS = 20.0  # [1/s] of the joints' position controllers
_LATE = 0.1  # [s] of simulated time that are made up for at once; beyond this the arm's clock has lost time


class ArmNode(rclpy.node.Node):  # type: ignore[misc]
    """An arm whose joints follow position and velocity commands, in MuJoCo or exactly.

    Positions of the last command are held for ever, its velocities for `hold_after`: without commands the arm stops.
    """

    def __init__(
        self,
        chain: Chain,
        start: ArrayLike,
        description: str,
        *,
        name: str = "arm",
        command_topic: str = "/servo_node/command",
        rate: float = 250.0,
        physics: bool = True,
        hold_after: float = 0.05,
    ) -> None:
        """start: (n,) [rad or m]. physics: MuJoCo; False: the joints do as they are told."""
        super().__init__(name)
        self._chain, self._period, self._hold_after = chain, 1.0 / rate, hold_after
        self._q: Array = np.array(start, dtype=float)
        if self._q.shape != (chain.dof,):
            raise Error(f"start needs shape ({chain.dof},), got {self._q.shape}")
        self._qdot: Array = np.zeros(chain.dof)
        self._simulation: Any = None
        if physics:
            from sigmaik.sim import Simulation

            self._simulation = Simulation(chain, timestep=self._period / 8.0, control_period=self._period)
            self._simulation.reset(self._q)
        self._goal, self._speed, self._commanded = self._q.copy(), np.zeros(chain.dof), -np.inf
        self._states = self.create_publisher(JointState, "/joint_states", 10)
        latched = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
        self._description = self.create_publisher(String, "/robot_description", latched)
        self._description.publish(String(data=description))
        self.create_subscription(JointTrajectory, command_topic, self._take_trajectory, 10)
        self.create_subscription(Float64MultiArray, command_topic + "_array", self._take_array, 10)
        self._begin, self._steps = time.monotonic(), 0
        self.create_timer(self._period, self._turn)

    def close(self) -> None:
        """Nothing has to be stopped."""

    def _take_trajectory(self, message: Any) -> None:
        if not message.points:
            return
        point, n = message.points[-1], self._chain.dof
        try:
            order = [list(message.joint_names).index(name) for name in self._chain.joint_names]
        except ValueError:
            return  # another arm's
        for values in (point.positions, point.velocities):
            if len(values) not in (0, len(message.joint_names)) or not np.all(np.isfinite(values)):
                return
        self._speed = np.array(point.velocities)[order] if len(point.velocities) else np.zeros(n)
        if len(point.positions):
            self._goal = np.array(point.positions)[order]
        self._commanded = time.monotonic()

    def _take_array(self, message: Any) -> None:
        if len(message.data) == self._chain.dof and np.all(np.isfinite(message.data)):
            self._goal, self._speed = np.array(message.data), np.zeros(self._chain.dof)
            self._commanded = time.monotonic()

    def _turn(self) -> None:
        now = time.monotonic()
        due = int((now - self._begin) / self._period) - self._steps
        if due > _LATE / self._period:
            self._begin += (due - 1) * self._period
            due = 1
        for _ in range(due):
            self._step(now)
        self._steps += due
        if due > 0:
            self._publish()

    def _step(self, now: float) -> None:
        fresh = now - self._commanded <= self._hold_after
        speed = _STIFFNESS * (self._goal - self._q) + (self._speed if fresh else 0.0)
        if self._simulation is None:
            self._qdot = np.clip(speed, -self._chain.limits.velocity, self._chain.limits.velocity)
            self._q = self._q + self._period * self._qdot
            return
        measured = self._simulation.step(speed)
        self._q, self._qdot = measured.q, measured.qdot

    def _publish(self) -> None:
        message = JointState(name=list(self._chain.joint_names))
        message.header.stamp = self.get_clock().now().to_msg()
        message.position, message.velocity = self._q.tolist(), self._qdot.tolist()
        self._states.publish(message)
