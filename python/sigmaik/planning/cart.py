"""Motions of the cart under an arm that keep it clear of its shoulder singularity (Salvato et al. 2022)."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from sigmaik import _core
from sigmaik._core import CartError, CartRegion, Error
from sigmaik._types import Array

__all__ = ["CartError", "CartMotion", "CartRegion", "Guess", "Method", "cart_motion", "evaluate_cart_motion"]

Method = Literal["exact", "gradient"]
Guess = Literal["linear", "admissible"]

TOLERANCE = 1e-12
"""Of lengths, relative to them: what counts as on the border, not inside."""
PUBLISHED_ITERATIONS = 53707
"""Of the gradient descent, as in the paper."""


@dataclass(frozen=True)
class CartMotion:
    """Where the cart is at each of M samples evenly spaced in time, and what it had to keep out of.

    Straight between samples, but where `corners` has one between two of them: at the tip of a forbidden region.
    """

    x: Array = field(repr=False)
    """(M,) [m] of the cart."""
    flange_xy: Array = field(repr=False)
    """(M, 2) [m] the path that was given."""
    lower: Array = field(repr=False)
    """(M,) [m] λ−: between it and `upper` the cart is not allowed, at radius + margin; inf where it is free."""
    upper: Array = field(repr=False)
    """(M,) [m] λ+; −inf where the cart is free."""
    sides: NDArray[np.int8] = field(repr=False)
    """(M,) 1 where the cart is above a forbidden interval, −1 below, 0 where there is none, or it is inside."""
    regions: tuple[CartRegion, ...] = field(repr=False)
    """Connected parts of the forbidden region, with their sides; empty where `method` is not "exact"."""
    corners: Array = field(repr=False)
    """(K,) [samples] where the law bends, and its ends."""
    corner_x: Array = field(repr=False)
    """(K,) [m] there."""
    multipliers: Array | None = field(repr=False)
    """(M,) [m] μ_i = 2x_i − x_{i−1} − x_{i+1} of the exact law: > 0 only where it is held up by λ+ or the cart's range,
    < 0 only where it is held down, 0 elsewhere (not where the acceleration is limited); else None."""
    radius: float
    """[m] of the forbidden cylinder, without the margin."""
    margin: float
    """[m] that was added to the radius in planning."""
    duration: float
    """[s] from the first to the last sample."""
    energy: float
    """[m²] Σ (x_{i+1} − x_i)²; with a corner between samples, of the steps that it makes, each over its part of a
    sample."""
    admissible: bool
    """No sample is within the radius."""
    clearance: float
    """[m] the point's least distance from the first joint's axis, between the samples too."""
    inside: int
    """Samples within the radius."""
    turn: float
    """[rad] by which the point's azimuth turns, seen from the axis."""
    method: str
    """"exact" or "gradient"; "given" for a law that was only looked at."""
    iterations: int = 0
    """Steps of the gradient descent, or taut strings drawn."""

    @property
    def time_inside(self) -> float:
        """[s] of the samples within the radius."""
        return self.inside * self.duration / (len(self.x) - 1)

    @property
    def t(self) -> Array:
        """(M,) [s] of the samples."""
        return np.linspace(0.0, self.duration, len(self.x))

    @property
    def max_speed(self) -> float:
        """[m/s]"""
        return float(np.max(np.abs(np.diff(self.corner_x) / np.diff(self.corners)))) * (len(self.x) - 1) / self.duration

    @property
    def max_acceleration(self) -> float:
        """[m/s²], the largest second difference over the samples."""
        step = self.duration / (len(self.x) - 1)
        return float(np.max(np.abs(np.diff(self.x, 2)), initial=0.0)) / step**2

    def sample(self, t: ArrayLike) -> Array:
        """x (…) [m] at times t (…) [s], held at the ends."""
        times = np.asarray(t, dtype=np.float64)
        if not np.all(np.isfinite(times)):
            raise ValueError("t must be finite")
        at = times * ((len(self.x) - 1) / self.duration)
        return np.asarray(np.interp(at, self.corners, self.corner_x), dtype=np.float64)


def cart_motion(
    flange_xy: ArrayLike,
    start: float,
    end: float,
    radius: float,
    method: Method = "exact",
    alpha: float = 0.01,
    *,
    turn: float | None = None,
    cart_range: tuple[float, float] = (-math.inf, math.inf),
    margin: float = 0.0,
    duration: float = 1.0,
    max_speed: float = math.inf,
    max_acceleration: float = math.inf,
    at_rest: bool = False,
    first_guess: Guess | ArrayLike = "linear",
    step: float | None = None,
    max_iterations: int = PUBLISHED_ITERATIONS,
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
    turn
        [rad] that joint 1 turns through from the first to the last sample. Laws that turn the point's azimuth by
        another number of whole turns are left out: they would bring the arm to its last pose, but not its taught
        joints. None: the winding is not checked.
    cart_range
        [m] (lowest, highest) position of the cart.
    margin
        [m] added to the radius in planning. Between samples the law can be nearer than radius + margin by max|Δ²λ|/8.
    duration
        [s] from the first to the last sample. The limits count in it.
    max_speed, max_acceleration
        [m/s], [m/s²] of the cart, second differences over the samples. A law within the speed limit is found if there
        is one. Where the law of the least energy accelerates too much, the one of the least energy that does not takes
        its place, on the same sides, by an interior-point method; other sides are not tried.
    at_rest
        Start and stop within max_acceleration, where that is finite.
    first_guess
        Of the gradient descent: "linear" from start to end; "admissible", a jump past the region and back at the end,
        to the cart's range where it is finite; or (M,) [m]. From an inadmissible guess the descent stops at the first
        admissible law; from an admissible one it goes on smoothing.
    step
        [mm²] of the gradient descent; stable below 1/(4 alpha), by default 1/(5 alpha).
    max_iterations
        Of the gradient descent.

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
    if method not in ("exact", "gradient"):
        raise ValueError(f"method = {method!r} must be 'exact' or 'gradient'")
    lowest, highest = cart_range

    def exact() -> _core.CartLaw:
        return _core.cart_law(
            flange_xy,
            start,
            end,
            radius,
            lower=lowest,
            upper=highest,
            margin=margin,
            turn=turn,
            duration=duration,
            max_speed=max_speed,
            max_acceleration=max_acceleration,
            at_rest=at_rest,
        )

    if method == "exact":
        law = exact()
        return _motion(
            flange_xy,
            law.x,
            (law.corners, law.corner_x),
            radius,
            margin,
            duration,
            "exact",
            law.strings,
            tuple(law.regions),
            law.multipliers,
        )

    if not (math.isfinite(alpha) and alpha > 0.0):
        raise ValueError(f"alpha = {alpha} 1/mm² must be finite and greater than 0")
    step = 1.0 / (5.0 * alpha) if step is None else step
    if not 0.0 < step < 1.0 / (4.0 * alpha):
        raise ValueError(
            f"step = {step} mm² must be between 0 and 1/(4 alpha) = {1.0 / (4.0 * alpha)} mm², to be stable"
        )
    path = planar_path(flange_xy)
    if not (math.isfinite(margin) and margin >= 0.0):
        raise ValueError(f"margin = {margin} m must be finite and not negative")
    lower, upper = _core.forbidden_intervals(path, positive("radius", radius) + margin)
    if isinstance(first_guess, str):
        if first_guess not in ("linear", "admissible"):
            raise ValueError(f"first_guess = {first_guess!r} must be 'linear', 'admissible' or of shape (M,)")
        guess = np.linspace(start, end, len(path))
        if first_guess == "admissible":
            guess[1:-1] = _jump(exact(), lower, upper, guess, lowest, highest)[1:-1]
    else:
        guess = np.asarray(first_guess, dtype=np.float64)
        if guess.shape != (len(path),) or not np.all(np.isfinite(guess)):
            raise ValueError(f"first_guess must be finite and of shape ({len(path)},), not {guess.shape}")
        if guess[0] != start or guess[-1] != end:
            raise ValueError(f"first_guess must go from start = {start} to end = {end}")
    inadmissible = bool(np.any((guess > lower) & (guess < upper)))
    x, iterations = _core.cart_descent(lower, upper, guess, alpha, step, max_iterations, inadmissible)
    return _motion(path, x, None, radius, margin, duration, "gradient", iterations)


def evaluate_cart_motion(
    flange_xy: ArrayLike, x: ArrayLike, radius: float, *, margin: float = 0.0, duration: float = 1.0
) -> CartMotion:
    """Any law x (M,) [m] of the cart, such as the linear one, looked at as `cart_motion` does."""
    return _motion(flange_xy, x, None, radius, margin, duration, "given")


def _motion(
    flange_xy: ArrayLike,
    x: ArrayLike,
    corners: tuple[Sequence[float], Sequence[float]] | None,
    radius: float,
    margin: float,
    duration: float,
    method: str,
    iterations: int = 0,
    regions: tuple[CartRegion, ...] = (),
    multipliers: Array | None = None,
) -> CartMotion:
    path, law = planar_path(flange_xy), np.array(x, dtype=np.float64)
    if law.shape != (len(path),) or not np.all(np.isfinite(law)):
        raise ValueError(f"x must be finite and of shape ({len(path)},), not {law.shape}")
    positive("duration", duration)
    positive("radius", radius)
    lower, upper = _core.forbidden_intervals(path, radius + margin)
    samples = np.arange(len(law), dtype=np.float64)
    at, at_x = (samples, law) if corners is None else (np.array(c, dtype=np.float64) for c in corners)
    # Tips between samples are corners of the law: they count as samples here.
    every = np.union1d(samples, at)
    seen = np.column_stack([np.interp(every, samples, path[:, k]) for k in (0, 1)])
    seen[:, 0] -= np.interp(every, at, at_x)
    distance = np.hypot(path[:, 0] - law, path[:, 1])
    inside = int(np.count_nonzero(distance < radius - TOLERANCE * (radius + np.abs(path[:, 0]) + np.abs(law))))
    sides = np.where(law >= upper, 1, np.where(law <= lower, -1, 0))
    sides[lower > upper] = 0
    return CartMotion(
        x=law,
        flange_xy=path,
        lower=lower,
        upper=upper,
        sides=sides.astype(np.int8),
        regions=regions,
        corners=at,
        corner_x=at_x,
        multipliers=multipliers,
        radius=radius,
        margin=margin,
        duration=duration,
        energy=float(np.sum(np.diff(at_x) ** 2 / np.diff(at))),
        admissible=inside == 0,
        clearance=least_distance(seen),
        inside=inside,
        turn=azimuth_turn(seen),
        method=method,
        iterations=iterations,
    )


def least_distance(seen: Array) -> float:
    """From the origin to a polygon line (K, 2)."""
    begin, step = seen[:-1], np.diff(seen, axis=0)
    length = np.sum(step**2, axis=1)
    along = -np.sum(begin * step, axis=1) / np.where(length > 0.0, length, 1.0)
    nearest = begin + np.clip(along, 0.0, 1.0)[:, None] * step
    return float(np.min(np.hypot(nearest[:, 0], nearest[:, 1])))


def azimuth_turn(seen: Array) -> float:
    """[rad] of the azimuth along a polygon line (K, 2), seen from the origin."""
    a, b = seen[:-1], seen[1:]
    return float(np.sum(np.arctan2(a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0], np.sum(a * b, axis=1))))


def _jump(law: _core.CartLaw, lower: Array, upper: Array, linear: Array, lowest: float, highest: float) -> Array:
    """Past all forbidden intervals on the sides of a law, at once (Salvato et al. 2022, figure 9)."""
    any_interval = lower < upper
    if not np.any(any_interval):
        return linear
    top = highest if math.isfinite(highest) else float(np.max(upper))
    bottom = lowest if math.isfinite(lowest) else float(np.min(lower))
    guess = np.full(len(linear), np.nan)
    guess[any_interval & (law.x >= upper)] = top
    guess[any_interval & (law.x <= lower)] = bottom
    known = np.flatnonzero(np.isfinite(guess))
    # Free samples stay where the next region wants the cart.
    after = np.minimum(np.searchsorted(known, np.arange(len(guess))), len(known) - 1)
    filled: Array = guess[known[after]]
    return filled


def planar_path(flange_xy: ArrayLike) -> Array:
    path = np.array(flange_xy, dtype=np.float64)
    if path.ndim != 2 or path.shape[1] != 2 or len(path) < 2 or not np.all(np.isfinite(path)):
        raise Error(f"flange_xy must be finite and of shape (M, 2), M ≥ 2, not {path.shape}")
    return path


def positive(name: str, value: float) -> float:
    if not (math.isfinite(value) and value > 0.0):
        raise ValueError(f"{name} = {value} must be finite and greater than 0")
    return value
