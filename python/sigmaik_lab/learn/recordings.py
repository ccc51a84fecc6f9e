"""Recordings of a servo as episodes of a data set: states and actions at an even rate of the loop's clock."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

import sigmaik as sk
from sigmaik._types import Array
from sigmaik.teleop import Episode as Recording

from .drives import sigma_ratio
from .episode import Action, Episode, action_names, rotation_6d, rotation_of_6d, state_names

__all__ = ["action_columns", "pieces", "state_columns"]

#: Parts of a state that a recording does not have.
_UNKNOWN = ("gripper.", "cup.", "goal.")


def state_columns(recording: Recording) -> list[str]:
    """(S,) names as in `episode.state_names`, without gripper, cup and goal."""
    return [name for name in state_names(recording.arm.chain.joint_names) if not name.startswith(_UNKNOWN)]


def action_columns(action: Action) -> list[str]:
    """(A,) names as in `episode.action_names`, without the gripper."""
    return [name for name in action_names(action) if not name.startswith(_UNKNOWN)]


def pieces(recording: Recording, name: str, fps: float, action: Action) -> Iterator[Episode]:
    """Episodes at the rate `fps` [Hz], one for each span of the recording without a gap of its clock.

    A span ends where cycles are missing, where the arm was started again at another place, and where the clock went on
    by more than a frame. Spans of less than two frames are left out. An action "twist" is the mean of the asked twist
    over the frame, "pose" the tool at the frame's end. The phase is the command ("pose", "twist", "hold", "stale"), or
    "changing_branch" while the guide leads the arm another way than the command. A recording does not say whether it
    succeeded: `success` is False.
    """
    part = 0
    for run in recording.runs:
        time = recording["time"][run]
        cuts = [0, *(np.flatnonzero(np.diff(time) > 1.0 / fps) + 1).tolist(), len(time)]
        for first, last in zip(cuts[:-1], cuts[1:], strict=True):
            episode = _episode(recording, slice(run.start + first, run.start + last), fps, action)
            if episode is not None:
                episode.scene = {"recording": name, "part": part, "robot": recording.arm.name}
                part += 1
                yield episode


def _episode(recording: Recording, rows: slice, fps: float, action: Action) -> Episode | None:
    time = recording["time"][rows]
    # A frame has an action where its end is in the span, too.
    frames = int(np.floor((time[-1] - time[0]) * fps + 1e-6))
    if frames < 2:
        return None
    grid = time[0] + np.arange(frames + 1) / fps
    pose = recording["pose"][rows]
    tool = np.concatenate([pose[:, :3, 3], rotation_6d(pose[:, :3, :3])], axis=1)
    state = np.concatenate(
        [tool, _sigma_ratio(recording, rows)[:, None], recording["q"][rows], recording["qdot"][rows]], axis=1
    )
    states, tools = _at(grid, time, state), _orthonormal(_at(grid, time, tool))
    states[:, :9] = tools
    if action == "pose":
        actions = tools[1:]
    else:
        # The mean over a frame is the difference of the integral, which begins with the first cycle's end.
        steps = np.diff(time, prepend=time[0])[:, None]
        way = np.cumsum(recording["asked_twist"][rows] * steps, axis=0)
        actions = np.diff(_at(grid, time, way), axis=0) * fps
    before = np.clip(np.searchsorted(time, grid[:-1] + 1e-9, side="right") - 1, 0, None)
    return Episode(
        times=grid[:-1] - grid[0],
        state=states[:-1].astype(np.float32),
        action=actions.astype(np.float32),
        phase=_phases(recording, rows)[before],
        success=False,
    )


def _at(grid: Array, time: Array, values: Array) -> Array:
    return np.stack([np.interp(grid, time, column) for column in values.T], axis=1)


def _orthonormal(tool: Array) -> Array:
    return np.concatenate([tool[:, :3], rotation_6d(rotation_of_6d(tool[:, 3:]))], axis=1)


def _sigma_ratio(recording: Recording, rows: slice) -> Array:
    """(N,) computed anew, since a recording has singular values only where a rule has run."""
    chain = recording.arm.chain
    return sigma_ratio(chain, recording["q"][rows], chain.characteristic_length)


def _phases(recording: Recording, rows: slice) -> NDArray[np.str_]:
    commands = np.array([sk.LoopCommand(int(value)).name.lower() for value in recording["command"][rows]])
    leads = recording["guide"][rows] == int(sk.GuideState.CHANGING_BRANCH)
    return np.where(leads, "changing_branch", commands)
