"""Cartesian motions between taught poses: lines, circular arcs, a cubic spline."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import ArrayLike

from sigmaik import _core
from sigmaik._types import Array

__all__ = ["PosePath", "pose_paths", "smooth", "when_smooth"]

PosePath = Callable[[Array], Array]
"""Poses (K, 4, 4) at parameters s (K,) in [0, 1]."""


def pose_paths(poses: Array, via: Sequence[ArrayLike | None] | None, spline: bool) -> list[PosePath]:
    """The motions from each of N poses (N, 4, 4) to the next pose.

    Positions move on a line, or where `via` has a point (3,) [m] on the circular arc through this point, at constant
    speed; with `spline` all positions move on one natural cubic spline over chord lengths. Orientations turn about one
    axis at constant speed, by at most half a turn.
    """
    count = len(poses) - 1
    if via is not None and len(via) != count:
        raise ValueError(f"via has {len(via)} entries; it needs one, a point or None, for each of the {count} motions")
    if spline and via is not None:
        raise ValueError("a spline takes no via points")
    if spline:
        positions = _spline(poses[:, :3, 3])
    else:
        positions = [
            _line(a[:3, 3], b[:3, 3]) if via is None or via[k] is None else _arc(a[:3, 3], via[k], b[:3, 3])
            for k, (a, b) in enumerate(zip(poses[:-1], poses[1:], strict=True))
        ]
    return [_path(positions[k], poses[k, :3, :3], poses[k + 1, :3, :3]) for k in range(count)]


def smooth(time: Array) -> Array:
    """s in [0, 1] over time in [0, 1], at rest with no acceleration at both ends; ṡ is at most 1.875."""
    return time**3 * (10.0 + time * (6.0 * time - 15.0))


def when_smooth(s: Array) -> Array:
    """The time in [0, 1] at which `smooth` is at s in [0, 1], by bisection."""
    low, high = np.zeros_like(s), np.ones_like(s)
    for _ in range(60):
        middle = 0.5 * (low + high)
        early = smooth(middle) < s
        low, high = np.where(early, middle, low), np.where(early, high, middle)
    return 0.5 * (low + high)


def _path(position: Callable[[Array], Array], first: Array, last: Array) -> PosePath:
    turn = _core.rotation_log(last @ first.T)

    def path(s: Array) -> Array:
        out = np.tile(np.eye(4), (len(s), 1, 1))
        out[:, :3, 3] = position(s)
        out[:, :3, :3] = np.array([_core.rotation_exp(share * turn) for share in s]) @ first
        return out

    return path


def _line(a: Array, b: Array) -> Callable[[Array], Array]:
    return lambda s: a + s[:, None] * (b - a)


def _arc(a: Array, via: ArrayLike | None, b: Array) -> Callable[[Array], Array]:
    middle = np.asarray(via, dtype=np.float64)
    if middle.shape != (3,) or not np.all(np.isfinite(middle)):
        raise ValueError(f"a via point must be finite and of shape (3,), not {middle.shape}")
    u, v = middle - a, b - a
    normal = np.cross(u, v)
    size = float(np.linalg.norm(u) * np.linalg.norm(v))
    if not np.linalg.norm(normal) > 1e-9 * size:
        raise ValueError(f"no circle goes through {a}, {middle} and {b}: they are in one line")
    centre = a + np.cross(u @ u * v - v @ v * u, normal) / (2.0 * normal @ normal)
    x = a - centre
    y = np.cross(normal / np.linalg.norm(normal), x)
    # About this normal the arc runs counterclockwise, so that `via` comes before `b`.
    angle = math.atan2((b - centre) @ y, (b - centre) @ x) % (2.0 * math.pi)
    return lambda s: centre + np.cos(angle * s)[:, None] * x + np.sin(angle * s)[:, None] * y


def _spline(points: Array) -> list[Callable[[Array], Array]]:
    """Second derivatives m from h_{k−1} m_{k−1} + 2(h_{k−1} + h_k) m_k + h_k m_{k+1} = 6(d_k − d_{k−1}), zero at the
    ends."""
    h = np.linalg.norm(np.diff(points, axis=0), axis=1)
    if np.any(h == 0.0):
        raise ValueError("a spline needs neighbouring positions that differ")
    slope = np.diff(points, axis=0) / h[:, None]
    n = len(points)
    matrix, right = np.eye(n), np.zeros((n, 3))
    for k in range(1, n - 1):
        matrix[k, k - 1 : k + 2] = h[k - 1], 2.0 * (h[k - 1] + h[k]), h[k]
        right[k] = 6.0 * (slope[k] - slope[k - 1])
    bend = np.linalg.solve(matrix, right)

    def piece(k: int) -> Callable[[Array], Array]:
        def position(s: Array) -> Array:
            b = s[:, None]
            a = 1.0 - b
            line = a * points[k] + b * points[k + 1]
            value: Array = line + h[k] ** 2 / 6.0 * ((a**3 - a) * bend[k] + (b**3 - b) * bend[k + 1])
            return value

        return position

    return [piece(k) for k in range(n - 1)]
