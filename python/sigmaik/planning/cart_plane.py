"""Motions of a cart with two linear axes under an arm, clear of its shoulder singularity."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from numpy.typing import ArrayLike

from sigmaik import _core
from sigmaik._core import PlaneCartMotion, evaluate_cart_motion_plane

from .options import PlaneCartOptions, checked

if TYPE_CHECKING:
    from typing_extensions import Unpack

__all__ = ["PlaneCartKeywords", "PlaneCartMotion", "cart_motion_plane", "evaluate_cart_motion_plane"]

EVERYWHERE = (-math.inf, math.inf)


class PlaneCartKeywords(PlaneCartOptions, total=False):
    """Keywords of `cart_motion_plane`."""

    x_range: tuple[float, float]
    """[m] (lowest, highest) position of the first axis; unlimited. Where both are the same the axis stands."""
    y_range: tuple[float, float]
    """[m] of the second axis."""


def cart_motion_plane(
    flange_xy: ArrayLike, start: ArrayLike, end: ArrayLike, radius: float, **options: Unpack[PlaneCartKeywords]
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
    options
        `PlaneCartKeywords`: turn, x_range, y_range, max_radius, margin, duration, max_speed, max_acceleration, at_rest.

    Raises
    ------
    CartError
        A ValueError: `reason` is "start inside", "end inside", "range", "winding", "speed" or "acceleration".
        "range" and "winding" also where the path has so few samples that steps leap over the disc; the text tells.
    ValueError
        where an argument is out of its range.
    """
    given = checked("cart_motion_plane", PlaneCartKeywords, options, None)
    ranges = given.pop("x_range", EVERYWHERE), given.pop("y_range", EVERYWHERE)
    lower, upper = ([limits[end_of] for limits in ranges] for end_of in (0, 1))
    return _core.plane_cart_motion(flange_xy, start, end, radius, lower=lower, upper=upper, **given)
