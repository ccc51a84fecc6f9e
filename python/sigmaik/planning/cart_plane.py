"""Motions of a cart with two linear axes under an arm, clear of its shoulder singularity."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import ArrayLike

from sigmaik import _core
from sigmaik._types import Array

from .cart import TOLERANCE, azimuth_turn, least_distance, planar_path, positive

__all__ = ["PlaneCartMotion", "cart_motion_plane", "evaluate_cart_motion_plane"]
Range = tuple[float, float]

EVERYWHERE = (-math.inf, math.inf)


@dataclass(frozen=True)
class PlaneCartMotion:
    """Where a cart with two axes is at each of M samples evenly spaced in time, straight between them."""

    xy: Array = field(repr=False)
    """(M, 2) [m] of the cart."""
    flange_xy: Array = field(repr=False)
    """(M, 2) [m] the path that was given."""
    push: Array | None = field(repr=False)
    """(M,) [m] ≥ 0, |2c_i − c_{i−1} − c_{i+1}| where the cart c touches the disc about the point, away from it, else 0.
    At an optimum without limits the cart bends nowhere else. None for a motion that was only looked at."""
    radius: float
    """[m] of the forbidden disc, without the margin."""
    margin: float
    """[m] that was added to the radius in planning."""
    duration: float
    """[s] from the first to the last sample."""
    energy: float
    """[m²] Σ |c_{i+1} − c_i|²."""
    admissible: bool
    """No sample is within the radius."""
    clearance: float
    """[m] the point's least distance from the first joint's axis, between the samples too."""
    farthest: float
    """[m] the point's largest distance from it."""
    inside: int
    """Samples within the radius."""
    turn: float
    """[rad] by which the point's azimuth turns, seen from the axis: which way round, and how often."""
    starts: int = 0
    """First guesses tried."""
    programs: int = 0
    """Quadratic programs solved."""

    @property
    def time_inside(self) -> float:
        """[s] of the samples within the radius."""
        return self.inside * self.duration / (len(self.xy) - 1)

    @property
    def t(self) -> Array:
        """(M,) [s] of the samples."""
        return np.linspace(0.0, self.duration, len(self.xy))

    @property
    def max_speed(self) -> Array:
        """(2,) [m/s] of each axis."""
        top: Array = np.max(np.abs(np.diff(self.xy, axis=0)), axis=0) * ((len(self.xy) - 1) / self.duration)
        return top

    @property
    def max_acceleration(self) -> Array:
        """(2,) [m/s²] of each axis, the largest second differences over the samples."""
        top: Array = np.max(np.abs(np.diff(self.xy, 2, axis=0)), axis=0) * ((len(self.xy) - 1) / self.duration) ** 2
        return top

    def sample(self, t: ArrayLike) -> Array:
        """xy (…, 2) [m] at times t (…) [s], held at the ends."""
        times = np.asarray(t, dtype=np.float64)
        if not np.all(np.isfinite(times)):
            raise ValueError("t must be finite")
        return np.stack([np.interp(times, self.t, self.xy[:, axis]) for axis in (0, 1)], axis=-1)


def cart_motion_plane(
    flange_xy: ArrayLike,
    start: ArrayLike,
    end: ArrayLike,
    radius: float,
    *,
    turn: float | None = None,
    x_range: Range = EVERYWHERE,
    y_range: Range = EVERYWHERE,
    max_radius: float = math.inf,
    margin: float = 0.0,
    duration: float = 1.0,
    max_speed: float | ArrayLike = math.inf,
    max_acceleration: float | ArrayLike = math.inf,
    at_rest: bool = False,
) -> PlaneCartMotion:
    """A motion of a cart with two linear axes that keeps a point of the arm out of a cylinder about the first joint's
    axis.

    What `cart_motion` does for one axis: the least Σ |c_{i+1} − c_i|² with |c_i − flange_i| ≥ radius + margin. Seen
    from the point, the cart goes round a disc at rest; either way round is open to it, and they differ by a whole turn
    of joint 1.

    For a flange on a straight line at constant speed there is one optimum for each number of turns: seen from the
    flange, tangent, arc, tangent. Other paths can have several; from a bounded number of starts (the straight motion
    taken round either side wherever it runs into the disc; tangent, arc, tangent) the best is returned. It meets the
    conditions of Karush, Kuhn and Tucker: free of the disc the cart moves straight at constant speed, and on it only
    the disc pushes. That no other way is better is not proven.

    Parameters
    ----------
    flange_xy
        (M, 2) [m] positions of the point, at M ≥ 3 samples evenly spaced in time.
    start, end
        (2,) [m] of the cart, where axis 1 stands, at the first and last sample.
    radius
        [m] of the cylinder.
    turn
        [rad] that joint 1 turns through. Motions that turn the point's azimuth by another number of whole turns are
        left out: they would not bring the arm to its taught joints. None: the winding is free.
    x_range, y_range
        [m] (lowest, highest) position of each axis. Where both are the same the axis stands.
    max_radius
        [m] greater than radius + margin: the arm's reach, the farthest that the point may be from axis 1.
    margin
        [m] added to the radius in planning. Between samples the point can be nearer than radius + margin by (r/8) of
        the square of the angle that a step turns it by; `clearance` tells.
    duration
        [s] from the first to the last sample. The limits count in it.
    max_speed, max_acceleration
        [m/s], [m/s²] of each axis, one number for both or (2,); accelerations are second differences over the samples.
        Where the best motion does not keep to them, the one of the least energy that does takes its place, along the
        same way.
    at_rest
        Start and stop within max_acceleration, where that is finite.

    Raises
    ------
    CartError
        A ValueError: `reason` is "start inside", "end inside", "range", "winding", "speed" or "acceleration".
        "range" and "winding" also where the path has so few samples that steps leap over the disc; the text tells.
    ValueError
        where an argument is out of its range.
    """
    law = _core.plane_cart_law(
        flange_xy,
        start,
        end,
        radius,
        lower=[x_range[0], y_range[0]],
        upper=[x_range[1], y_range[1]],
        margin=margin,
        max_radius=max_radius,
        turn=turn,
        duration=duration,
        max_speed=_of_both("max_speed", max_speed),
        max_acceleration=_of_both("max_acceleration", max_acceleration),
        at_rest=at_rest,
    )
    return _motion(flange_xy, law.c, radius, margin, duration, law.push, law.starts, law.programs)


def evaluate_cart_motion_plane(
    flange_xy: ArrayLike, xy: ArrayLike, radius: float, *, margin: float = 0.0, duration: float = 1.0
) -> PlaneCartMotion:
    """Any motion xy (M, 2) [m] of the cart, such as the straight one, looked at as `cart_motion_plane` does."""
    return _motion(flange_xy, xy, radius, margin, duration, None, 0, 0)


def _motion(
    flange_xy: ArrayLike,
    xy: ArrayLike,
    radius: float,
    margin: float,
    duration: float,
    push: Array | None,
    starts: int,
    programs: int,
) -> PlaneCartMotion:
    path, cart = planar_path(flange_xy), np.array(xy, dtype=np.float64)
    if cart.shape != path.shape or not np.all(np.isfinite(cart)):
        raise ValueError(f"xy must be finite and of shape ({len(path)}, 2), not {cart.shape}")
    positive("duration", duration)
    positive("radius", radius)
    seen = path - cart
    distance = np.hypot(seen[:, 0], seen[:, 1])
    # A program's answer is on the border to about 1e-9 of the radius.
    inside = int(np.count_nonzero(distance < radius * (1.0 - 1e3 * TOLERANCE)))
    return PlaneCartMotion(
        xy=cart,
        flange_xy=path,
        push=push,
        radius=radius,
        margin=margin,
        duration=duration,
        energy=float(np.sum(np.diff(cart, axis=0) ** 2)),
        admissible=inside == 0,
        clearance=least_distance(seen),
        farthest=float(np.max(distance)),
        inside=inside,
        turn=azimuth_turn(seen),
        starts=starts,
        programs=programs,
    )


def _of_both(name: str, value: float | ArrayLike) -> Array:
    limits = np.asarray(value, dtype=np.float64)
    if limits.shape not in ((), (2,)):
        raise ValueError(f"{name} must be a number, or of shape (2,), not {limits.shape}")
    return np.broadcast_to(limits, (2,)).copy()
