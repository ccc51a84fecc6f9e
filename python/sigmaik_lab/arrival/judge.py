"""What counts as arrived, at rest, and inside the limits: the judgement of one motion.

Units: m, rad, s; for prismatic joints m in place of rad.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np

import sigmaik as sk
from sigmaik._types import Array

__all__ = ["ARRIVED", "ASSUMED", "Motion", "TrialRow", "departure", "held_limits", "joint_time", "judge"]

#: [m, rad] A tip this near has arrived: 1 mm, 0.5°.
ARRIVED = (1e-3, math.radians(0.5))
RESTING = 1e-3  #: part of the velocity limit (or rad/s, m/s): a slower joint rests
ASSUMED = 10.0  #: [rad/s² or m/s²] the acceleration limit of a joint without one: the default of `sk.Servo`


@dataclass(frozen=True)
class Motion:
    """The commands of one trial."""

    q: Array  #: (N + 1, n) before the first cycle, and after each cycle
    qdot: Array  #: (N, n)
    start_qdot: Array  #: (n,) before the first cycle
    cycle: float = 0.0  #: [s] the mean wall time of an update
    led: bool = False  #: whether the guide led the joints away from the tool's own way
    failed: bool = False  #: whether the servo raised an error
    commanded: int | None = None  #: cycles with a command; None: all. The stop after a failure is no command.


@dataclass(frozen=True)
class TrialRow:
    """One trial: a line of the file from which a run resumes. `Arrivals` explains the fields."""

    robot: str
    servo: str
    trial: int
    time: float
    position: float
    angle: float
    rest: bool
    speed: float
    excess: float
    over: float
    jump: float
    departure: float
    cycle: float
    least: float
    led: bool
    failed: bool
    setup: str  #: of the servo: package, version and settings


def held_limits(chain: sk.Chain, assumed: float = ASSUMED) -> tuple[Array, Array, Array]:
    """(n,) limits of velocity, acceleration and jerk; `assumed` where a joint has no acceleration limit."""
    limits = chain.limits
    acceleration = np.where(np.isfinite(limits.acceleration), limits.acceleration, assumed)
    return limits.velocity, acceleration, limits.jerk


def joint_time(chain: sk.Chain, start: Array, goal: Array) -> float:
    """[s] of the fastest motion of all joints from rest at `start` to rest at `goal`, without jerk limits."""
    velocity, acceleration, _ = held_limits(chain)
    way = np.abs(goal - start)
    ramps = 2.0 * np.sqrt(way / acceleration)  # never at full speed
    with np.errstate(invalid="ignore"):
        cruise = way / velocity + velocity / acceleration
    return float(np.where(way * acceleration > velocity**2, cruise, ramps).max())


def judge(chain: sk.Chain, motion: Motion, target: Array, rate: float) -> dict[str, Any]:
    """The fields of `TrialRow` that follow from the motion."""
    poses = chain.pose(motion.q)
    position = np.linalg.norm(poses[:, :3, 3] - target[:3, 3], axis=1)
    # ‖R − R_target‖ = √8 sin(angle/2), which is accurate for small angles, too.
    chord = np.linalg.norm(poses[:, :3, :3] - target[:3, :3], axis=(1, 2)) / math.sqrt(8.0)
    angle = 2.0 * np.arcsin(np.minimum(chord, 1.0))
    away = np.flatnonzero(~((position <= ARRIVED[0]) & (angle <= ARRIVED[1])))
    first = int(away[-1]) + 1 if len(away) else 0
    arrived = first < len(position) and not motion.failed
    last = np.abs(motion.qdot[-1])
    velocity = chain.limits.velocity
    over, jump = _excess(chain, motion, rate)
    return {
        "time": first / rate if arrived else math.inf,
        "position": float(position[-1]),
        "angle": float(angle[-1]),
        "rest": bool(np.all(last <= RESTING * np.where(np.isfinite(velocity), velocity, 1.0))),
        "speed": float(last.max()),
        "excess": max(over, jump[1]),
        "over": over,
        "jump": jump[0],
        "departure": departure(poses[:, :3, 3], target[:3, 3]),
        "cycle": motion.cycle,
        "led": motion.led,
        "failed": motion.failed,
    }


def departure(path: Array, goal: Array) -> float:
    """[m] The largest distance of the points (N, 3) from the line between the first of them and `goal` (3,)."""
    way = goal - path[0]
    square = float(way @ way)
    along = np.clip((path - path[0]) @ way / square, 0.0, 1.0) if square > 0.0 else np.zeros(len(path))
    return float(np.linalg.norm(path - path[0] - along[:, None] * way, axis=1).max())


def _excess(chain: sk.Chain, motion: Motion, rate: float) -> tuple[float, tuple[float, float]]:
    """By differences of the commands, as a robot's controller checks them: the largest excess over a limit of
    position, velocity or jerk; and the largest change of q̇ as a part of what the acceleration limits allow, with its
    excess.

    What the rounding of the differences can make is not counted. After a motion, the jerk of the first cycle is not
    known.
    """
    limits, (velocity, acceleration, jerk) = chain.limits, held_limits(chain)
    moving = bool(np.any(motion.start_qdot != 0.0))
    qdot = motion.qdot[: motion.commanded]
    if not len(qdot):
        return 0.0, (0.0, 0.0)
    change = np.diff(qdot, axis=0, prepend=motion.start_qdot[None]) * rate
    change_of_change = np.diff(change, axis=0, prepend=change[:1] if moving else 0.0) * rate
    rounding = 4.0 * np.finfo(float).eps * max(1.0, float(np.abs(qdot).max()))

    def beyond(value: Array, limit: Array, slack: float) -> float:
        return max(0.0, float(((np.abs(value) - slack) / limit - 1.0).max()))  # −1 without a limit

    outside = max(0.0, float((motion.q - limits.upper).max()), float((limits.lower - motion.q).max()))
    swift = beyond(qdot, velocity, rounding)
    jerky = beyond(change_of_change, jerk, 2.0 * rounding * rate**2)
    jump = float((np.abs(change) / acceleration).max())
    return max(outside, swift, jerky), (jump, beyond(change, acceleration, rounding * rate))
