"""Spaces of observations and actions, and what an environment says beside its observations."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from .episode import PHASES, Action, layout
from .scene import Task
from .world import World

if TYPE_CHECKING:
    from gymnasium import spaces

__all__ = ["IMAGE", "action_space", "information", "one", "state_space"]

#: Pixels of an image's side.
IMAGE = 96
#: [rad] bound of a joint's position in an observation, where the joint has no limit.
_MANY_TURNS = 100.0
#: In physics a joint may be a little beyond its limits, for example after a bump.
_BEYOND = 2.0


def state_space(task: Task) -> spaces.Box:
    """The Box of a state: lengths within three times the reach, rotations within ±1."""
    from gymnasium import spaces

    parts, limits = layout(task.chain.dof), task.chain.limits
    high = np.ones(parts.size)
    low = -high
    far = 3.0 * task.reach
    for part in (parts.tool, parts.cup, parts.goal):
        low[part], high[part] = -far, far
    for part in (parts.gripper, parts.sigma):
        low[part] = 0.0
    low[parts.rotation], high[parts.rotation] = -1.0 - 1e-6, 1.0 + 1e-6  # rounding to float32
    low[parts.q] = _BEYOND * np.minimum(np.maximum(limits.lower, -_MANY_TURNS), -0.1)
    high[parts.q] = _BEYOND * np.maximum(np.minimum(limits.upper, _MANY_TURNS), 0.1)
    speed = np.minimum(limits.velocity, _MANY_TURNS)
    low[parts.qdot], high[parts.qdot] = -_BEYOND * speed, _BEYOND * speed
    return spaces.Box(low.astype(np.float32), high.astype(np.float32), dtype=np.float32)


def action_space(task: Task, action: Action) -> spaces.Box:
    """The Box of an action. A pose has a position [m] within the reach, or within 1 m where the reach is shorter, a 6-D
    rotation and the gripper's opening; a twist has v [m/s], ω [rad/s] and the opening."""
    from gymnasium import spaces

    high = np.ones(10 if action == "pose" else 7)
    if action == "pose":
        high[:3] = max(1.0, 1.1 * task.reach)
    low = -high
    low[-1] = 0.0
    return spaces.Box(low.astype(np.float32), high.astype(np.float32), dtype=np.float32)


def information(world: World) -> dict[str, NDArray[Any]]:
    """What is told beside the observations, (B, …) each.

    phase: where the arm is now; reached: the furthest phase that is behind it, "" for none (both of PHASES); success,
    lost: the cup stands at the goal, the cup fell; sigma_ratio: σ_min/σ_max; asked_twist, achieved_twist: (6,) [v; ω]
    means over the action; limits_broken and position_, velocity_, acceleration_: cycles of this episode beyond a limit,
    counted from the joint positions that the arm was told, alone.
    """
    names = np.array([*PHASES, ""])
    counts = world.limits
    return {
        "phase": names[world.phase],
        "reached": names[world.reached],
        "success": world.placed.copy(),
        "lost": world.lost.copy(),
        "sigma_ratio": world.sigma.copy(),
        "asked_twist": world.asked_twist.copy(),
        "achieved_twist": world.achieved_twist.copy(),
        "limits_broken": counts.all,
        "position_limits_broken": counts.position.copy(),
        "velocity_limits_broken": counts.velocity.copy(),
        "acceleration_limits_broken": counts.acceleration.copy(),
    }


def one(info: dict[str, Any], b: int = 0) -> dict[str, Any]:
    """The information of one environment, in Python's own types and arrays."""
    return {name: value[b].item() if value[b].ndim == 0 else value[b] for name, value in info.items()}
