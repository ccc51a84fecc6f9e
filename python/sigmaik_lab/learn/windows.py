"""What a policy sees and says, relative to the tool: features of observations, and chunks of actions."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from sigmaik._types import Array

from .episode import Episode, layout, rotation_6d, rotation_of_6d

__all__ = ["FEATURES", "WIDTH", "absolute_chunks", "features", "relative_chunks", "windows"]

Floats = NDArray[np.float32]

#: Entries of a pose action: position (3), 6-D rotation (6), gripper (1).
WIDTH = 10
#: [m] lengths at which offsets saturate in the features that show small offsets large.
_SCALES = (0.02, 0.1)
#: Entries of one observation's features.
FEATURES = 2 * 3 * (1 + len(_SCALES)) + 3 + 6 + 2


def features(states: Floats) -> Floats:
    """(…, FEATURES) of states (…, S).

    The offsets tool → cup and cup → goal in the tool's axes, in metres and saturated by tanh at 2 cm and 10 cm, so that
    a network can tell millimetres at the cup; the tool's position and rotation in the base; opening; σ_min/σ_max.
    """
    parts = layout((states.shape[-1] - layout(0).size) // 2)
    values = states.astype(np.float64)
    rotation = rotation_of_6d(values[..., parts.rotation])

    def seen(offset: Array) -> list[Array]:
        local = np.einsum("...ij,...i->...j", rotation, offset)
        return [local, *(np.tanh(local / scale) for scale in _SCALES)]

    found = [
        *seen(values[..., parts.cup] - values[..., parts.tool]),
        *seen(values[..., parts.goal] - values[..., parts.cup]),
        values[..., parts.tool],
        values[..., parts.rotation],
        values[..., parts.gripper],
        values[..., parts.sigma],
    ]
    return np.concatenate(found, axis=-1).astype(np.float32)


def relative_chunks(states: Floats, actions: Floats) -> Floats:
    """(B, H, WIDTH) pose actions (B, H, WIDTH) in the axes of the tool of states (B, S)."""
    position, rotation = _tool(states)
    local = np.einsum("bij,bhi->bhj", rotation, actions[..., :3] - position[:, None])
    turned = np.einsum("bji,bhjk->bhik", rotation, rotation_of_6d(actions[..., 3:9]))
    return np.concatenate([local, rotation_6d(turned), actions[..., 9:]], axis=-1).astype(np.float32)


def absolute_chunks(states: Floats, chunks: Floats) -> Floats:
    """The inverse of `relative_chunks`: pose actions in the base."""
    position, rotation = _tool(states)
    there = position[:, None] + np.einsum("bij,bhj->bhi", rotation, chunks[..., :3])
    turned = np.einsum("bij,bhjk->bhik", rotation, rotation_of_6d(chunks[..., 3:9]))
    return np.concatenate([there, rotation_6d(turned), chunks[..., 9:]], axis=-1).astype(np.float32)


def windows(episodes: Sequence[Episode], horizon: int) -> tuple[Floats, Floats]:
    """Features (N, FEATURES) and chunks (N, horizon, WIDTH) of every frame of all episodes; after an episode's end its
    last action stands.

    A policy sees one observation, and not the one before: from two it learns to stand still where it stood still, as a
    demonstrator does in a pause.
    """
    seen, said = [], []
    for episode in episodes:
        n = len(episode.times)
        steps = np.arange(n)
        ahead = np.minimum(steps[:, None] + np.arange(horizon), n - 1)
        seen.append(features(episode.state))
        said.append(relative_chunks(episode.state, episode.action[ahead]))
    return np.concatenate(seen), np.concatenate(said)


def _tool(states: Floats) -> tuple[Array, Array]:
    parts = layout((states.shape[-1] - layout(0).size) // 2)
    values = states.astype(np.float64)
    return values[:, parts.tool], rotation_of_6d(values[:, parts.rotation])
