"""Rotations and ways from pose to pose, of many poses at once."""

from __future__ import annotations

import numpy as np

import sigmaik as sk
from sigmaik._types import Array

__all__ = ["along", "difference", "moved", "rotation_vectors", "rotations", "shorten"]


def rotation_vectors(rotation: Array) -> Array:
    """(…, 3) axis times angle [rad] of rotation matrices (…, 3, 3), angles in [0, π]."""
    skew = 0.5 * np.stack(
        [
            rotation[..., 2, 1] - rotation[..., 1, 2],
            rotation[..., 0, 2] - rotation[..., 2, 0],
            rotation[..., 1, 0] - rotation[..., 0, 1],
        ],
        axis=-1,
    )
    sine = np.linalg.norm(skew, axis=-1)
    angle = np.arctan2(sine, 0.5 * (np.trace(rotation, axis1=-2, axis2=-1) - 1.0))
    vector = skew * np.where(sine > 1e-9, angle / np.maximum(sine, 1e-9), 1.0)[..., None]
    for row in np.argwhere(angle > 3.1):  # the difference from the transpose is too small there
        vector[tuple(row)] = sk.rotation_log(rotation[tuple(row)])
    return vector


def rotations(vector: Array) -> Array:
    """(…, 3, 3) rotations about vectors (…, 3) by their lengths [rad]: Rodrigues' formula."""
    angle = np.linalg.norm(vector, axis=-1)[..., None, None]
    x, y, z = np.moveaxis(vector, -1, 0)
    zero = np.zeros_like(x)
    cross = np.stack([zero, -z, y, z, zero, -x, -y, x, zero], axis=-1).reshape(*vector.shape, 3)
    # sin θ/θ and (1 − cos θ)/θ², by numpy's sinc, which is right at zero.
    first = np.sinc(angle / np.pi)
    second = 0.5 * np.sinc(0.5 * angle / np.pi) ** 2
    return np.asarray(np.eye(3) + first * cross + second * (cross @ cross))


def difference(start: Array, end: Array) -> Array:
    """(…, 6) [m, rad] the way from poses (…, 4, 4) to others, base axes, as `sk.pose_error`."""
    turn = end[..., :3, :3] @ np.swapaxes(start[..., :3, :3], -1, -2)
    return np.concatenate([end[..., :3, 3] - start[..., :3, 3], rotation_vectors(turn)], axis=-1)


def along(start: Array, way: Array) -> Array:
    """(…, 4, 4) the poses at the end of a way (…, 6) from `start`: the inverse of `difference`."""
    return moved(start, way[..., :3], rotations(way[..., 3:]))


def moved(start: Array, shift: Array, turn: Array) -> Array:
    """(…, 4, 4) poses (…, 4, 4) that are shifted by (…, 3) and turned by rotations (…, 3, 3), both in base axes."""
    pose = start.copy()
    pose[..., :3, 3] += shift
    pose[..., :3, :3] = turn @ start[..., :3, :3]
    return pose


def shorten(way: Array, most_linear: float, most_angular: float) -> Array:
    """A way (…, 6) whose linear part is no longer than most_linear [m], and its angular part than most_angular [rad].

    Both parts are shortened alike, so that a screw motion stays one.
    """
    linear, angular = np.linalg.norm(way[..., :3], axis=-1), np.linalg.norm(way[..., 3:], axis=-1)
    part = np.maximum(1.0, np.maximum(linear / most_linear, angular / most_angular))
    return np.asarray(way / part[..., None])
