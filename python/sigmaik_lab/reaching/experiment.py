"""Reaching tasks: motions between random configurations along which an index is good (Petrović et al., table 1).

Every task is solved by every method. Along the motion, at 201 points, λ₁ (the smallest eigenvalue of JJᵀ), m =
√det(JJᵀ) and κ = log₁₀(λ₆/λ₁) are averaged: the definitions that fit the paper's figures, where its text has others.
A better index costs a longer path, so that the path's length and the largest acceleration in unit time stand beside the
indices.
"""

from __future__ import annotations

import functools
import math
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np

import sigmaik as sk
from sigmaik._types import Array

__all__ = ["METHODS", "PAPER", "ROBOTS", "Planning", "ReachingSummary", "Run", "solve_task", "summarize_runs", "task"]

ROBOTS = ("ur10", "kinova_jaco2_7dof_spherical", "kuka_lbr_iiwa_14_r820")
METHODS = {
    "straight": "the straight line in joint space",
    "gradient": "geometry-aware index, by its gradient",
    "stochastic": "geometry-aware index, by samples",
    "manipulability": "log of the manipulability over the same prior, by its gradient (after Marić et al. 2019)",
    "task-priority": "the tool along a line, the rest towards the goal's joints (Chiaverini 1997)",
}
POINTS = 201

# λ₁, m, κ of table 1.
PAPER: dict[str, dict[str, tuple[float, float, float]]] = {
    "ur10": {
        "straight": (0.031, 0.096, 2.716),
        "stochastic": (0.044, 0.130, 2.339),
        "manipulability": (0.034, 0.111, 2.518),
        "task-priority": (0.030, 0.072, 2.801),
    },
    "kinova_jaco2_7dof_spherical": {
        "straight": (0.021, 0.090, 2.583),
        "stochastic": (0.027, 0.111, 2.364),
        "manipulability": (0.025, 0.099, 2.380),
        "task-priority": (0.023, 0.073, 2.440),
    },
    "kuka_lbr_iiwa_14_r820": {
        "straight": (0.013, 0.049, 2.851),
        "stochastic": (0.025, 0.076, 2.404),
        "manipulability": (0.017, 0.057, 2.621),
        "task-priority": (0.026, 0.061, 2.421),
    },
}


@dataclass(frozen=True)
class Planning:
    """The options of the planners."""

    states: int = 21
    samples: int = 10
    prior_weight: float = 10.0


@dataclass(frozen=True)
class Run:
    """A task solved by a method."""

    method: str
    lambda_1: float
    """Mean over the motion of the smallest eigenvalue of JJᵀ"""
    m: float
    """Mean manipulability"""
    kappa: float
    """Mean of log₁₀(λ₆/λ₁)"""
    length: float
    """[rad] length of the path in joint space"""
    acceleration: float
    """[rad] largest |q̈| in unit time"""
    least: float
    """λ₁ at the worst of 2001 points"""
    solve_time: float
    """[s]"""
    joint_error: float
    """[rad] largest error of a joint at the end"""


def task(
    robot: str, seed: int, number: int, base: str | None = None, tip: str | None = None
) -> tuple[sk.Chain, Array, Array]:
    """Chain, start and goal of a task: uniform within the limits, within ±π where a joint turns more than once.

    robot, base, tip: as for `sigmaik.robots.open`
    """
    chain = _chain(robot, base, tip)
    wide = chain.limits.upper - chain.limits.lower > 2.0 * math.pi + 1e-6
    lower = np.where(wide, -math.pi, chain.limits.lower)
    upper = np.where(wide, math.pi, chain.limits.upper)
    rng = np.random.default_rng([seed, number])
    return chain, rng.uniform(lower, upper), rng.uniform(lower, upper)


@functools.lru_cache(maxsize=8)
def _chain(robot: str, base: str | None, tip: str | None) -> sk.Chain:
    return sk.robots.open(robot, base, tip).chain


def solve_task(
    chain: sk.Chain,
    start: Array,
    goal: Array,
    method: str,
    seed: int = 0,
    planning: Planning = Planning(),  # noqa: B008
) -> Run:
    """Plans a motion, and measures its indices."""
    begin = time.perf_counter()
    if method == "straight":
        solve_time = 0.0

        def sample(s: Array) -> Array:
            return start + s[:, None] * (goal - start)

    elif method == "task-priority":
        path = _task_priority(chain, start, goal)
        solve_time = time.perf_counter() - begin

        def sample(s: Array) -> Array:
            return np.stack([np.interp(s, np.linspace(0, 1, len(path)), x) for x in path.T], axis=1)

    else:
        plan = _PLANNERS[method](chain, start, goal, seed, planning)
        solve_time = plan.solve_time

        def sample(s: Array) -> Array:
            return plan.sample(s)[0]

    q = sample(np.linspace(0.0, 1.0, POINTS))
    eigenvalues = np.linalg.svd(chain.jacobian(q), compute_uv=False) ** 2
    fine = sample(np.linspace(0.0, 1.0, 2001))
    least = float(np.linalg.svd(chain.jacobian(fine), compute_uv=False)[:, -1].min() ** 2)
    second = np.diff(q, 2, axis=0) * (POINTS - 1) ** 2
    return Run(
        method,
        float(eigenvalues[:, -1].mean()),
        float(np.sqrt(eigenvalues.prod(axis=1)).mean()),
        float(np.log10(eigenvalues[:, 0] / np.maximum(eigenvalues[:, -1], 1e-30)).mean()),
        float(np.linalg.norm(np.diff(q, axis=0), axis=1).sum()),
        float(np.linalg.norm(second, axis=1).max()),
        least,
        solve_time,
        float(np.abs(q[-1] - goal).max()),
    )


# The goal is the paper's configuration, and no other turn of it.
_PLANNERS: dict[str, Callable[[sk.Chain, Array, Array, int, Planning], sk.planning.Trajectory]] = {
    "gradient": lambda chain, a, b, seed, p: sk.planning.gradient(
        chain, a, b, states=p.states, prior_weight=p.prior_weight, duration=1.0, whole_turns=True
    ),
    "stochastic": lambda chain, a, b, seed, p: sk.planning.stochastic(
        chain,
        a,
        b,
        seed=seed,
        states=p.states,
        samples=p.samples,
        prior_weight=p.prior_weight,
        duration=1.0,
        whole_turns=True,
    ),
    "manipulability": lambda chain, a, b, seed, p: sk.planning.gradient(
        chain,
        a,
        b,
        index="manipulability",
        states=p.states,
        prior_weight=0.1 * p.prior_weight,
        duration=1.0,
        whole_turns=True,
    ),
}


def _task_priority(chain: sk.Chain, start: Array, goal: Array) -> Array:
    """(N, n): q̇ = J⁺ẋ + (I − J⁺J) q̇_C, the inverse damped near singularities, ẋ along the line from the start's to the
    goal's pose, and q̇_C towards the goal's joints. The tool follows the line; the joints need not end at the goal."""
    steps = 400
    solver = sk.VelocitySolver(sk.AdaptiveDampedLeastSquares())
    first, last = chain.pose(start), chain.pose(goal)
    turn = sk.rotation_log(last[:3, :3] @ first[:3, :3].T)
    q, path = start.copy(), [start]
    for i in range(steps):
        s = (i + 1) / steps
        target = np.eye(4)
        target[:3, 3] = first[:3, 3] + s * (last[:3, 3] - first[:3, 3])
        target[:3, :3] = sk.rotation_exp(s * turn) @ first[:3, :3]
        twist = sk.pose_error(chain.pose(q), target)  # over one step
        posture = (goal - q) / (steps - i)
        step = solver.solve(chain.jacobian(q), twist, posture=posture).qdot
        q = np.clip(
            q + step * min(1.0, 0.2 / max(float(np.abs(step).max()), 1e-300)), chain.limits.lower, chain.limits.upper
        )
        path.append(q)
    return np.array(path)


@dataclass(frozen=True)
class ReachingSummary:
    """Means over the tasks of a method."""

    method: str
    tasks: int
    lambda_1: float
    m: float
    kappa: float
    length: float
    acceleration: float
    least: float
    """Median"""
    solve_time: float
    """[s] median"""
    arrived: float
    """Part of the tasks that end at the goal's joints, to 1e-6 rad"""


def summarize_runs(runs: Sequence[Run]) -> list[ReachingSummary]:
    """A summary for each method, in the order of the runs."""

    def by_method() -> Iterator[tuple[str, list[Run]]]:
        for method in dict.fromkeys(run.method for run in runs):
            yield method, [run for run in runs if run.method == method]

    def mean(found: Sequence[Run], name: str) -> float:
        return float(np.mean([getattr(run, name) for run in found]))

    return [
        ReachingSummary(
            method,
            len(found),
            mean(found, "lambda_1"),
            mean(found, "m"),
            mean(found, "kappa"),
            mean(found, "length"),
            mean(found, "acceleration"),
            float(np.median([run.least for run in found])),
            float(np.median([run.solve_time for run in found])),
            float(np.mean([run.joint_error < 1e-6 for run in found])),
        )
        for method, found in by_method()
    ]
