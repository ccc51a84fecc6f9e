"""Time-optimal motions that keep clear of singularities (Beck et al. 2022, eqs. 21 to 27)."""

from __future__ import annotations

import functools
import math
import threading
import time
from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike

from sigmaik import _core, singularities
from sigmaik._core import Chain
from sigmaik._types import Array

from . import nlp
from .clearance import Crossing, clearance
from .objective import Avoid, Ends, Objective, Sets, Solver
from .trajectory import Trajectory

__all__ = ["ETA1", "ETA2", "Avoid", "Solver", "time_optimal"]

ETA1 = math.log(2400.0)
"""log of a potential's height (Beck et al. 2022, table 2)."""
ETA2 = 400.0
"""[1/rad²] of a potential, its inverse squared width (Beck et al. 2022, table 2)."""

DENSE = 10
"""Samples of a step where clearance is measured."""
BEND = 0.6
"""[rad] by which the first guess of a second start is bent."""


def time_optimal(
    chain: Chain,
    start: ArrayLike,
    goal: ArrayLike,
    avoid: Avoid | None = None,
    nodes: int = 30,
    time_weight: float = 1.0,
    effort_weight: float = 1.0,
    avoid_weight: float = 1e2,
    epsilon: float = 1e-6,
    eta1: float = ETA1,
    eta2: float = ETA2,
    acceleration: ArrayLike | None = None,
    *,
    start_velocity: ArrayLike | None = None,
    goal_velocity: ArrayLike | None = None,
    sets: singularities.SingularSets | None = None,
    generic_manipulability: bool = False,
    between_nodes: bool = True,
    restarts: bool = True,
    solver: Solver = "sigmaik",
    tolerance: float = 1e-9,
    max_iterations: int = 500,
) -> Trajectory:
    """A motion from start to goal in little time, at little effort, within limits, clear of singularities.

    Minimises ``time_weight t_F + effort_weight Σ q̈_kᵀ q̈_k + Σ L(q_k)`` over N nodes, t_k = k h, h = t_F/N, as in
    Beck et al. (2022), eqs. 21 to 27: a double integrator for each joint, q̈ constant over a step, free t_F, the chain's
    limits of position, velocity and acceleration at every node. With

        avoid=None              L = 0
        avoid="manipulability"  L = avoid_weight / (m(q) + epsilon), m = √det(JJᵀ)                      (23)
        avoid="potential"       L = avoid_weight Σ_i exp(eta1 − eta2 ψ_i(q)), ψ_i = 0 on singular set i (26), (27)

    Parameters
    ----------
    start, goal
        (n,) [rad or m] within the limits. Whole turns count: 0 and 2π are different places.
    nodes
        N, at least 5.
    acceleration
        (n,) [rad/s² or m/s²] or one number, instead of the chain's limits.
    start_velocity, goal_velocity
        (n,) [rad/s or m/s] at the ends; by default at rest.
    sets
        The arm's singular sets; by default `singularities.of(chain)`. "potential" needs them.
    generic_manipulability
        Take m from the Jacobian though a closed form is known: what an arm without one costs.
    between_nodes
        Keep the limits of position between the nodes too, where a parabola can overshoot; False: at the nodes alone, as
        in the paper. IPOPT's problem is always the paper's.
    restarts
        Where the motion found still leads through what is to be avoided, look on the other sides too.
    solver
        "sigmaik": an interior-point method made for this problem. "ipopt": IPOPT with MUMPS by CasADi (extra `plan`),
        for comparison; one start, `tolerance` is its own, relative to its scaled problem.

    Returns
    -------
    Trajectory
        with ``duration`` = t_F = N h as the paper defines h: the last step of length h is spent at the goal. `status`
        says whether it is "optimal" (a local minimum), "feasible" (stopped before), or "failed": then there are no
        samples. Whatever is returned keeps the dynamics and all limits. `clearance` tells m and ψ between the nodes,
        and which crossings of singular sets no path could avoid.

    Raises
    ------
    ValueError
        where an end or an option is out of its range, where "potential" is asked for and the arm's sets are not known,
        or with the name of the extra where CasADi is not installed.
    """
    if avoid not in (None, "manipulability", "potential"):
        raise ValueError(f"avoid = {avoid!r} must be None, 'manipulability' or 'potential'")
    if solver not in ("sigmaik", "ipopt"):
        raise ValueError(f"solver = {solver!r} must be 'sigmaik' or 'ipopt'")
    if acceleration is not None:
        chain = chain.with_limits(acceleration=acceleration)
    sets = sets or singularities.of(chain)
    if avoid == "potential" and sets is None:
        raise ValueError(
            "the singular sets of this arm are not known; avoid='manipulability' needs none. Known are: "
            + ", ".join(singularities.names())
        )
    objective = Objective(
        avoid,
        nodes,
        time_weight,
        effort_weight,
        avoid_weight,
        epsilon,
        eta1,
        eta2,
        generic_manipulability,
        tolerance,
        max_iterations,
        between_nodes,
        restarts,
    )
    ends = (start, goal, start_velocity, goal_velocity)
    plan = _solve(chain, sets, objective, solver, ends, None)
    if avoid is None or not restarts or plan.clearance is None or not plan.clearance.avoidable or sets is None:
        return plan
    return _other_sides(plan, chain, sets, objective, solver, ends)


def _solve(
    chain: Chain, sets: Sets, objective: Objective, solver: Solver, ends: Ends, bend: Array | None
) -> Trajectory:
    if solver == "sigmaik":
        planner = _planners.get(chain, sets, objective)
        begin = time.perf_counter()
        result = planner.solve(*ends, bend)
        solve_time = time.perf_counter() - begin
        q, qdot, qddot = result.nodes(chain.dof)
        status, cost, duration = result.status, result.cost, result.duration
        iterations, starts = result.iterations, result.starts
    else:
        answer = nlp.solve(chain, sets, objective, ends, bend)
        q, qdot, qddot, status, cost, duration, iterations, solve_time = answer
        starts = 1
    if status == "failed":
        empty = np.empty((0, chain.dof))
        return Trajectory(np.empty(0), empty, empty, empty, math.nan, status, math.nan, solve_time, iterations, starts)
    t = np.arange(len(q), dtype=np.float64) * (duration / len(q))
    plan = Trajectory(t, q, qdot, qddot, duration, status, cost, solve_time, iterations, starts)
    dense = np.linspace(0.0, t[-1], DENSE * (len(t) - 1) + 1)
    return replace(plan, clearance=clearance(chain, sets, dense, plan.sample(dense)[0], width=objective.eta2))


class _Planners(threading.local):
    """Solver objects, built once per thread, arm and objective: they keep memory of their own."""

    def __init__(self) -> None:
        self.build = functools.lru_cache(maxsize=32)(_build)

    def get(self, chain: Chain, sets: Sets, objective: Objective) -> _core.TimeOptimal:
        known = sets is not None and not (objective.avoid == "manipulability" and objective.generic_manipulability)
        return self.build(chain, sets.name if sets is not None and known else None, objective)


def _build(chain: Chain, sets: str | None, o: Objective) -> _core.TimeOptimal:
    cost = None
    if o.avoid == "potential":
        cost = _core.potential_cost(_core.load_singular_sets(str(sets)), o.avoid_weight, o.eta1, o.eta2)
    elif o.avoid == "manipulability":
        arm = chain if sets is None else _core.load_singular_sets(sets)
        cost = _core.manipulability_cost(arm, o.avoid_weight, o.epsilon)
    return _core.TimeOptimal(
        chain,
        cost,
        nodes=o.nodes,
        time_weight=o.time_weight,
        effort_weight=o.effort_weight,
        tolerance=o.tolerance,
        max_iterations=o.max_iterations,
        between_nodes=o.between_nodes,
        restarts=o.restarts,
    )


_planners = _Planners()


def _other_sides(
    plan: Trajectory,
    chain: Chain,
    sets: singularities.SingularSets,
    objective: Objective,
    solver: Solver,
    ends: Ends,
) -> Trajectory:
    """Starts once more on the other side of the first crossing that could be avoided, and keeps the better motion.

    The better one is that with the smaller objective along the whole way, not only at the nodes: these can lie on
    either side of a wall that the motion between them goes through.
    """
    assert plan.clearance is not None
    bend = BEND * _other_side(sets, plan.clearance.avoidable[0], np.asarray(ends[0], dtype=np.float64))
    room = (
        0.4 * (chain.limits.lower - np.minimum(ends[0], ends[1])),
        0.4 * (chain.limits.upper - np.maximum(ends[0], ends[1])),
    )
    other = _solve(chain, sets, objective, solver, ends, np.clip(bend, *room))
    better = other if _along(other, sets, objective) < _along(plan, sets, objective) else plan
    return replace(
        better,
        solve_time=plan.solve_time + other.solve_time,
        iterations=plan.iterations + other.iterations,
        starts=plan.starts + other.starts,
    )


def _other_side(sets: singularities.SingularSets, crossing: Crossing, start: Array) -> Array:
    """Direction (n,), of length 1: back to the start's side of a wall; for other sets to where the motion is not."""
    i = sets.names.index(crossing.name)
    at = slice(sum(sets.codimensions[:i]), sum(sets.codimensions[: i + 1]))
    step = 1e-6 * np.eye(sets.dof)
    around = sets.signed_residuals(np.concatenate([crossing.q + step, crossing.q - step]))[:, at]
    slope = (around[: sets.dof] - around[sets.dof :]).T / 2e-6  # (codimension, n)
    if sets.codimensions[i] == 1:
        aim = np.sign(sets.signed_residuals(start)[at])
    else:
        here = sets.signed_residuals(crossing.q)[at]
        aim = -here if np.linalg.norm(here) > 1e-9 else np.eye(sets.codimensions[i])[0]
    direction: Array = np.asarray(np.linalg.pinv(slope) @ aim, dtype=np.float64)
    length = float(np.linalg.norm(direction))
    return direction / length if length > 0.0 else direction


def _along(plan: Trajectory, sets: singularities.SingularSets, o: Objective) -> float:
    """The objective with what is to be avoided counted all along the way; inf where the plan failed."""
    if plan.clearance is None:
        return math.inf
    dense = plan.sample(plan.clearance.t)[0]
    if o.avoid == "potential":
        avoided = o.avoid_weight * np.sum(sets.potential(dense, o.eta1, o.eta2))
    else:
        avoided = o.avoid_weight * np.sum(1.0 / (plan.clearance.manipulability + o.epsilon))
    motion = o.time_weight * plan.duration + o.effort_weight * np.sum(plan.qddot**2)
    return float(motion + avoided / DENSE)
