"""Motions of the cart under an arm that keep it clear of its shoulder singularity (Salvato et al. 2022)."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Literal

from numpy.typing import ArrayLike

from sigmaik import _core
from sigmaik._core import CartError, CartMotion, CartRegion, Error, evaluate_cart_motion

from .options import CartOptions, checked

if TYPE_CHECKING:
    from typing_extensions import Unpack

__all__ = [
    "CartError",
    "CartKeywords",
    "CartMotion",
    "CartRegion",
    "Guess",
    "Method",
    "cart_motion",
    "evaluate_cart_motion",
]

Method = Literal["exact", "gradient"]
Guess = Literal["linear", "admissible"]

PUBLISHED_ITERATIONS = 53707
"""Of the gradient descent, as in the paper."""


class CartKeywords(CartOptions, total=False):
    """Keywords of `cart_motion`."""

    cart_range: tuple[float, float]
    """[m] (lowest, highest) position of the cart; unlimited."""
    first_guess: Guess | ArrayLike
    """Of the gradient descent: "linear" from start to end; "admissible", a jump past the region and back at the
    end, to the cart's range where it is finite; or (M,) [m]. From an inadmissible guess the descent stops at the
    first admissible law; from an admissible one it goes on smoothing. "linear"."""
    step: float | None
    """[mm²] of the gradient descent, stable below 1/(4 alpha); 1/(5 alpha)."""
    max_iterations: int
    """Of the gradient descent; the paper's 53707."""


def cart_motion(
    flange_xy: ArrayLike,
    start: float,
    end: float,
    radius: float,
    method: Method = "exact",
    alpha: float = 0.01,
    **options: Unpack[CartKeywords],
) -> CartMotion:
    """A law of the cart that keeps a point of the arm out of a cylinder about the first joint's axis.

    The frame has x along the cart, z along the first joint's axis, which stands at (x_C, 0), y right-handed. "exact"
    finds the law of the least Σ (x_{i+1} − x_i)² outside the forbidden intervals

        λ∓_i = x_P ∓ √(r² − y_P²),   λ−_i < x_C < λ+_i  where |y_P| < r          (Salvato et al. 2022, eq. 6)

    to rounding, in O(M): the taut string in the tube that is left once the sides are chosen, and the best sides by
    branch and bound. Of all laws with these sides it has the least top speed too. It touches the cylinder: `margin`
    keeps it off.

    "gradient" is the paper's descent on Σ H(x_i) + alpha Σ (x_{i+1} − x_i)² (10), H rising from 0 at the border to 1 on
    the centre line. It may end inside the region, and says so: ``admissible`` is False then. It knows no limits, no
    sides and no turn.

    Parameters
    ----------
    flange_xy
        (M, 2) [m] positions of the flange, or any other point of the arm, at M ≥ 2 samples evenly spaced in time.
        `shoulder_cylinder` gives the best point and radius for an arm.
    start, end
        [m] of the cart at the first and last sample.
    radius
        [m] of the cylinder.
    alpha
        [1/mm²] weight of smoothness, between samples: the paper's, where lengths are in mm. Results depend on M.
    options
        `CartKeywords`: turn, cart_range, margin, duration, max_speed, max_acceleration, at_rest; and of the descent
        first_guess, step, max_iterations.

    Raises
    ------
    CartError
        A ValueError, where no law keeps out of the region: `reason` is "start inside", "end inside", "opposite sides"
        (of a region that reaches from the first to the last sample), "range", "winding", "speed", "acceleration" or
        "undecided" (too many parts of the region); `feasible_radius` [m] the largest radius that would do, nan where
        none or unknown.
    ValueError
        where an argument is out of its range.
    """
    given = checked("cart_motion", CartKeywords, options, None)
    if method not in ("exact", "gradient"):
        raise Error(f"method = {method!r} must be 'exact' or 'gradient'")
    first_guess, step = given.pop("first_guess", "linear"), given.pop("step", None)
    most = given.pop("max_iterations", PUBLISHED_ITERATIONS)
    lower, upper = given.pop("cart_range", (-math.inf, math.inf))
    if method == "exact":
        return _core.cart_motion(flange_xy, start, end, radius, lower, upper, **given)

    if not (math.isfinite(alpha) and alpha > 0.0):
        raise Error(f"alpha = {alpha} 1/mm² must be finite and greater than 0")
    step = 1.0 / (5.0 * alpha) if step is None else step
    if not 0.0 < step < 1.0 / (4.0 * alpha):
        raise Error(f"step = {step} mm² must be between 0 and 1/(4 alpha) = {1.0 / (4.0 * alpha)} mm², to be stable")
    guess = None if isinstance(first_guess, str) else first_guess
    if isinstance(first_guess, str):
        if first_guess not in ("linear", "admissible"):
            raise Error(f"first_guess = {first_guess!r} must be 'linear', 'admissible' or of shape (M,)")
        if first_guess == "admissible":
            guess = _core.admissible_guess(flange_xy, start, end, radius, lower, upper, **given)
    measured = {name: given[name] for name in ("margin", "duration") if name in given}
    return _core.cart_motion_by_descent(
        flange_xy, start, end, radius, alpha=alpha, step=step, max_iterations=most, guess=guess, **measured
    )
