"""Targets and starts, in three groups of panels after arXiv 2604.13405. The fourth panel, the cost, is measured in all.

Units: m, rad.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

import sigmaik as sk
from sigmaik._types import Array

__all__ = ["BINS", "PANELS", "STARTS", "STEP", "Case", "condition_number", "draw_cases", "position_jacobian"]

#: Panels, and what they ask.
PANELS: dict[str, str] = {
    "condition": "the error by the condition number of the target's configuration; starts anywhere in the ranges",
    "amplification": "the way of the joints for a step of the tip, by the condition number of the start",
    "starts": "starts near the solution, in the ranges, at the limits, outside the ranges, and at zero",
}
#: Bounds of the condition number of the position's Jacobian (3, n) in m.
BINS: dict[str, tuple[float, float]] = {
    "κ < 5": (1.0, 5.0),
    "5 to 20": (5.0, 20.0),
    "20 to 100": (20.0, 100.0),
    "κ > 100": (100.0, math.inf),
}
#: Starts of the panel of this name.
STARTS: dict[str, str] = {
    "near": "within 0.1 rad of a solution in each joint",
    "ranges": "anywhere in the joint ranges",
    "limits": "each joint at one of its limits",
    "outside": "each joint beyond a limit by up to a half of its range",
    "zeros": "all joints at zero, whether the ranges contain zero or not",
}
STEP = 1e-3  #: [m] of the tip in the panel "amplification"
_NEAR = 0.1  #: [rad or m]
_BATCH = 4096
_MOST = 400  #: batches in which a bin's configurations are sought


@dataclass(frozen=True)
class Case:
    """One problem."""

    panel: str
    group: str
    target: Array  #: (3,) of the tip, in the base
    start: Array  #: (n,)
    least: float  #: [rad or m] the smallest way of the joints that the linearised problem needs; panel amplification


def position_jacobian(chain: sk.Chain, q: Array) -> Array:
    """(3, n) at q (n,), or (B, 3, n) at q (B, n)."""
    J: Array = chain.jacobian(q)[..., :3, :]
    return J


def condition_number(chain: sk.Chain, q: Array) -> Array:
    """σ₁/σ₃ of the position's Jacobian; inf where the rank is smaller."""
    sigma = np.linalg.svd(position_jacobian(chain, q), compute_uv=False)
    with np.errstate(divide="ignore"):
        kappa: Array = sigma[..., 0] / sigma[..., 2]
    return kappa


def draw_cases(chain: sk.Chain, trials: int, seed: int) -> list[Case]:
    """trials of each group. ValueError where the arm has too few configurations of a bin."""
    rng = np.random.default_rng(seed)
    lower, upper = _ranges(chain)
    cases = []
    for name, bounds in BINS.items():
        found = _configurations(chain, bounds, trials, rng, name)
        for q in found:
            cases.append(Case("condition", name, chain.pose(q)[:3, 3], rng.uniform(lower, upper), math.nan))
        for k, q in enumerate(found):
            cases.append(_step(chain, name, q, rng, weakest=k % 2 == 0))
    for name in STARTS:
        for _ in range(trials):
            goal = rng.uniform(lower, upper)
            start = _start(name, goal, lower, upper, rng)
            cases.append(Case("starts", name, chain.pose(goal)[:3, 3], start, math.nan))
    return cases


def _ranges(chain: sk.Chain) -> tuple[Array, Array]:
    """Joint ranges; one turn of joints without limits."""
    limits = chain.limits
    bounded = np.isfinite(limits.lower) & np.isfinite(limits.upper)
    return np.where(bounded, limits.lower, -math.pi), np.where(bounded, limits.upper, math.pi)


def _configurations(
    chain: sk.Chain, bounds: tuple[float, float], count: int, rng: np.random.Generator, name: str
) -> list[Array]:
    lower, upper = _ranges(chain)
    found: list[Array] = []
    for _ in range(_MOST):
        q = rng.uniform(lower, upper, (_BATCH, chain.dof))
        kappa = condition_number(chain, q)
        found += list(q[(kappa >= bounds[0]) & (kappa < bounds[1])])
        if len(found) >= count:
            return found[:count]
    raise ValueError(f"among {_MOST * _BATCH} configurations only {len(found)} have a condition number {name}")


def _step(chain: sk.Chain, name: str, q: Array, rng: np.random.Generator, weakest: bool) -> Case:
    """A step along the weakest singular direction, or in any direction."""
    u, sigma, _ = np.linalg.svd(position_jacobian(chain, q), full_matrices=False)
    way = rng.normal(size=3)
    direction = u[:, 2] * math.copysign(1.0, way[0]) if weakest else way / np.linalg.norm(way)
    least = float(np.linalg.norm((u.T @ direction) / sigma)) * STEP if sigma[2] > 0.0 else math.inf
    return Case("amplification", name, chain.pose(q)[:3, 3] + STEP * direction, q, least)


def _start(name: str, goal: Array, lower: Array, upper: Array, rng: np.random.Generator) -> Array:
    span = upper - lower
    up = rng.random(len(goal)) < 0.5
    if name == "near":
        start = np.clip(goal + rng.uniform(-_NEAR, _NEAR, len(goal)), lower, upper)
    elif name == "ranges":
        start = rng.uniform(lower, upper)
    elif name == "limits":
        start = np.where(up, upper, lower)
    elif name == "outside":
        beyond = 0.5 * span * rng.random(len(goal))
        start = np.where(up, upper + beyond, lower - beyond)
    else:
        start = np.zeros(len(goal))
    return start
