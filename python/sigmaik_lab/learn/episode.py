"""A demonstration or a rollout of the task, and the names of all entries of its states and actions."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from sigmaik._types import Array

__all__ = [
    "FPS",
    "PHASES",
    "Action",
    "Episode",
    "Layout",
    "action_names",
    "columns",
    "layout",
    "rotation_6d",
    "rotation_of_6d",
    "state_names",
]

#: [Hz] of actions and observations.
FPS = 10
#: In the order in which a successful episode reaches the phases; "place" is reached when the cup stands at the goal.
PHASES = ("approach", "grasp", "carry", "place")

Action = Literal["pose", "twist"]

_ROTATION = tuple(f"tool.r{row}{column}" for column in (1, 2) for row in "xyz")


@dataclass
class Episode:
    """T steps of one episode. Row k has the observation at times[k], and the action that was given for it."""

    times: Array  #: (T,) [s] on the loop's clock, from 0
    state: NDArray[np.float32]  #: (T, S), entries as `state_names` names them
    action: NDArray[np.float32]  #: (T, A), entries as `action_names` names them
    phase: NDArray[np.str_]  #: (T,) of PHASES, the phase in which the observation was made
    success: bool  #: whether the cup stands at the goal at the end
    images: NDArray[np.uint8] | None = None  #: (T, 96, 96, 3) RGB
    scene: dict[str, Any] = field(default_factory=dict)  #: cup (3,), goal (3,), seed, robot, rule, region, action


@dataclass(frozen=True)
class Layout:
    """Where the parts of a state lie; all lengths in m, angles in rad, in the base frame."""

    tool: slice  #: position (3) of the tool's frame, between the fingertips
    rotation: slice  #: 6-D rotation (6): the first column of the rotation matrix, then the second column
    gripper: slice  #: opening (1) as measured, 0 closed and 1 open
    cup: slice  #: centre (3)
    goal: slice  #: where the cup's centre should be (3)
    sigma: slice  #: σ_min/σ_max (1)
    q: slice  #: joint positions (n)
    qdot: slice  #: joint velocities (n)
    size: int


def layout(dof: int) -> Layout:
    """The layout of the state of an arm with `dof` joints."""
    ends = np.cumsum([0, 3, 6, 1, 3, 3, 1, dof, dof]).tolist()
    tool, rotation, gripper, cup, goal, sigma, q, qdot = map(slice, ends[:-1], ends[1:])
    return Layout(tool, rotation, gripper, cup, goal, sigma, q, qdot, ends[-1])


def state_names(joint_names: Sequence[str]) -> list[str]:
    """(S,) one name for each entry of a state."""
    return [
        *(f"tool.{axis}" for axis in "xyz"),
        *_ROTATION,
        "gripper.opening",
        *(f"cup.{axis}" for axis in "xyz"),
        *(f"goal.{axis}" for axis in "xyz"),
        "sigma_ratio",
        *(f"{name}.position" for name in joint_names),
        *(f"{name}.velocity" for name in joint_names),
    ]


def action_names(action: Action) -> list[str]:
    """(A,) one name for each entry of an action: "pose" has position, 6-D rotation and gripper, "twist" has v, ω and
    gripper."""
    if action == "pose":
        return [*(f"tool.{axis}" for axis in "xyz"), *_ROTATION, "gripper.command"]
    return [*(f"tool.v{axis}" for axis in "xyz"), *(f"tool.w{axis}" for axis in "xyz"), "gripper.command"]


def columns(names: Sequence[str], prefix: str) -> list[int]:
    """The indices of all names that begin with a text."""
    return [k for k, name in enumerate(names) if name.startswith(prefix)]


def rotation_6d(rotation: NDArray[np.floating[Any]]) -> NDArray[Any]:
    """(…, 6) the first two columns of rotation matrices (…, 3, 3)."""
    return np.concatenate([rotation[..., :, 0], rotation[..., :, 1]], axis=-1)


def rotation_of_6d(six: NDArray[np.floating[Any]]) -> Array:
    """(…, 3, 3) the rotation matrices whose first two columns are nearest in the sense of Gram and Schmidt.

    Where the six numbers span no plane, other columns take their place, so that the answer is always a rotation.
    """
    first, second = np.split(np.asarray(six, dtype=np.float64), 2, axis=-1)
    x = _unit(first, np.array([1.0, 0.0, 0.0]))
    second = second - np.sum(x * second, axis=-1, keepdims=True) * x
    # Of two axes at right angles, at most one is near x.
    spare = np.where(np.abs(x[..., :1]) < 0.7, np.array([1.0, 0.0, 0.0]), np.array([0.0, 1.0, 0.0]))
    spare = spare - np.sum(x * spare, axis=-1, keepdims=True) * x
    y = _unit(second, spare / np.linalg.norm(spare, axis=-1, keepdims=True))
    return np.stack([x, y, np.cross(x, y)], axis=-1)


def _unit(vector: Array, spare: Array) -> Array:
    length = np.linalg.norm(vector, axis=-1, keepdims=True)
    small = length < 1e-6
    return np.where(small, spare, vector / np.where(small, 1.0, length))
