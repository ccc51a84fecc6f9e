"""Any planned motion played through a servo."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np

from sigmaik._core import Servo, Status, pose_error
from sigmaik._types import Array

from .trajectory import Trajectory

__all__ = ["Playback", "play"]

AT_START = 1e-6
"""[rad or m] by which a servo's joints may differ from a trajectory's first ones."""


@dataclass(frozen=True)
class Playback:
    """What a servo made of a planned motion: M samples, one a cycle, and the last cycle's end."""

    t: Array = field(repr=False)
    """(M,) [s], the trajectory's times, and those held after it."""
    planned: Array = field(repr=False)
    """(M, n) the trajectory's positions [rad or m]"""
    q: Array = field(repr=False)
    """(M, n) the servo's [rad or m]"""
    qdot: Array = field(repr=False)
    """(M, n) command of the cycle that begins at the sample; the last row repeats the one before [rad/s or m/s]"""
    pose_error: Array = field(repr=False)
    """(M, 6) planned pose minus the servo's, [position; rotation vector], base axes [m, rad]"""
    status: tuple[Status, ...] = field(repr=False)
    """M − 1, one a cycle."""

    @property
    def joint_difference(self) -> Array:
        """(M, n) planned minus the servo's [rad or m]: poses do not say where a redundant arm's elbow is."""
        return self.planned - self.q

    @property
    def max_position_error(self) -> float:
        """The tip's largest distance from its plan [m]."""
        return float(np.linalg.norm(self.pose_error[:, :3], axis=1).max())

    @property
    def max_orientation_error(self) -> float:
        """The largest angle between the tip and its plan [rad]."""
        return float(np.linalg.norm(self.pose_error[:, 3:], axis=1).max())

    @property
    def max_joint_difference(self) -> float:
        """The largest |planned minus the servo's| of all joints [rad or m]."""
        return float(np.abs(self.joint_difference).max())


def play(trajectory: Trajectory, servo: Servo, *, settle: float = 0.5) -> Playback:
    """Plays a planned motion through a servo that stands at its start, as poses with feed-forward twists, at the
    servo's dt.

    In the cycle from t to t + dt the target is the pose planned for t, where the tip should be by now, and the
    feed-forward J(q) q̇ of the plan in the middle of the cycle: what a cycle of constant q̇ leaves is ½ dt² J̇ q̇, and
    the gains keep it to ½ dt |J̇ q̇| / gain, micrometres at 1 kHz. The soft start costs more. The servo holds its
    limits and treats singularities by its own rule, so it may leave the plan, and comes back by its gains.
    It goes on from where it is: call `servo.reset` before.

    settle: [s] for which the last pose is held

    ValueError where the trajectory is empty or has other joints, the servo stands elsewhere, or settle is out of its
    range.
    """
    chain, dt = servo.chain, servo.dt
    if trajectory.q.ndim != 2 or trajectory.q.shape[1] != chain.dof:
        raise ValueError(f"the trajectory's q has shape {trajectory.q.shape}, the servo's arm {chain.dof} joints")
    if not 0.0 <= settle < math.inf:
        raise ValueError(f"settle = {settle} must be finite and not negative")
    begin, end = (float(trajectory.t[0]), float(trajectory.t[-1])) if trajectory.t.size else (0.0, 0.0)
    cycles = max(1, math.ceil((end - begin + settle) / dt - 1e-9))
    t: Array = begin + dt * np.arange(cycles + 1, dtype=np.float64)
    planned = trajectory.sample(t)[0]
    off = np.abs(servo.q - planned[0])
    joint = int(np.argmax(off))
    if not off[joint] <= AT_START:
        raise ValueError(
            f"the servo stands at {servo.q[joint]:.6g} in joint {chain.joint_names[joint]}, the trajectory begins at "
            f"{planned[0, joint]:.6g}: reset the servo there, or plan from where it stands"
        )

    middle = t[:-1] + 0.5 * dt
    between, qdot_planned, _ = trajectory.sample(middle)
    qdot_planned[middle > end] = 0.0  # held at the end, even where a trajectory ends in motion
    poses = chain.pose(planned)
    twists = np.einsum("kij,kj->ki", chain.jacobian(between), qdot_planned)

    q, qdot, errors = np.empty_like(planned), np.empty_like(planned), np.empty((cycles + 1, 6))
    status = []
    q[0] = servo.q
    for k in range(cycles):
        step = servo.update(poses[k], twists[k])
        q[k + 1], qdot[k], errors[k] = step.q, step.qdot, step.pose_error
        status.append(step.status)
    qdot[-1], errors[-1] = qdot[-2], pose_error(servo.pose, poses[-1])
    return Playback(t, planned, q, qdot, errors, tuple(status))
