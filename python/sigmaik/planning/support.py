"""Motions clear of singularities, by their gradient or by samples, under a Gaussian-process prior (Petrović et al.)."""

from __future__ import annotations

import functools
import math
import threading
import time
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike

from sigmaik import _core, indices, singularities
from sigmaik._core import ArmSpheres, Chain, DistanceField, JointCost
from sigmaik._types import Array

from .batch_cost import BatchCost
from .clearance import clearance
from .collision import arm_spheres, collision_cost, min_distance
from .obstacles import Obstacles
from .trajectory import Trajectory

__all__ = ["Index", "gradient", "stochastic"]
Index = Literal["geometry_aware", "manipulability"]

DEVIATION = 0.5
"""[rad or m] Half-way, of first guesses and of samples."""

DENSE = 10
"""Samples of a step where clearance is measured."""


def gradient(
    chain: Chain,
    start: ArrayLike,
    goal: ArrayLike,
    obstacles: Obstacles | DistanceField | None = None,
    *,
    index: Index | None = "geometry_aware",
    weight: float = 1.0,
    k: float | None = None,
    costs: tuple[JointCost | BatchCost, ...] = (),
    spheres: ArmSpheres | None = None,
    margin: float = 0.05,
    obstacle_weight: float = 1e4,
    self_collision: bool = False,
    states: int = 21,
    prior_weight: float = 10.0,
    max_iterations: int = 100,
    tolerance: float = 1e-4,
    restarts: int = 8,
    duration: float | None = None,
) -> Trajectory:
    """A smooth motion from start to goal along which an index is good, by the gradient of its cost.

    Minimises ``Σ_i cost(q_i) + prior_weight ‖q − μ‖²`` over N + 1 support states, the norm that of the inverse
    covariance of a Gaussian process with white noise on acceleration about the straight line μ (Petrović et al., eqs. 7
    to 13), by L-BFGS in coordinates where the prior is a unit ball. Between states the prior's mean, the natural cubic
    spline, is the motion.

    Parameters
    ----------
    start, goal
        (n,) [rad or m] within the limits. Whole turns count.
    obstacles
        What to keep clear of. ValueError where start or goal touches it; where the motion found does, `status` is
        "failed" and there are no samples.
    spheres
        The arm as spheres; by default `arm_spheres(chain)`, capsules along its links.
    margin
        [m] > 0 from obstacles that costs nothing (`collision_cost`).
    obstacle_weight
        [1/m] of what comes nearer, > 0.
    self_collision
        Whether the arm keeps clear of itself too.
    index
        "geometry_aware": ``weight ξ(q)``, ξ with Σ = kI (12), cut off at 2000. "manipulability": ``−weight log m(q)``,
        as in manipulability maximisation over a Gaussian-process trajectory (after Marić et al. 2019). None: neither.
    k
        by default `indices.reference_scale(chain)`.
    costs
        Further costs of the states, added up: any `JointCost`, or one written in Python (`BatchCost`).
    restarts
        ≥ 0. Where the motion found from the straight line touches an obstacle, so many others are found from first
        guesses drawn from the prior, the same each time, with a standard deviation of 0.5 rad or m half-way, and the
        one of least cost that touches none is the answer.
    duration
        [s]; by default the shortest that keeps the limits of velocity and acceleration, 1 s where there are none.

    Returns
    -------
    Trajectory
        cubic between its N + 1 samples, within the limits of position there too. `status` is "optimal" where the search
        stopped by itself, else "feasible". `cost` is the objective.

    Raises
    ------
    ValueError
        where an end or an option is out of its range, or a cost's answer has another shape or is not finite. What a
        cost written in Python raises comes through as it is.
    """
    if restarts < 0:
        raise ValueError(f"restarts = {restarts} must be at least 0")
    scene = _Scene.of(chain, obstacles, spheres, margin, obstacle_weight, self_collision, start, goal)
    planner = _planner(chain, index, weight, k, states, (*costs, *scene.costs))
    begin = time.perf_counter()

    def plan(guess: _core.SupportStates | None) -> Trajectory:
        found = planner.gradient(
            start, goal, prior_weight=prior_weight, max_iterations=max_iterations, tolerance=tolerance, guess=guess
        )
        solve_time = time.perf_counter() - begin
        return _trajectory(
            chain, found, prior_weight, "optimal" if found.converged else "feasible", duration, solve_time, scene
        )

    best = plan(None)
    if best.status != "failed":
        return best
    for seed in range(restarts):
        other = plan(planner.draw(start, goal, deviation=DEVIATION, seed=seed))
        if other.status != "failed" and not best.cost <= other.cost:
            best = other
    return replace(best, solve_time=time.perf_counter() - begin)


def stochastic(
    chain: Chain,
    start: ArrayLike,
    goal: ArrayLike,
    obstacles: Obstacles | DistanceField | None = None,
    seed: int = 0,
    *,
    index: Index | None = "geometry_aware",
    weight: float = 1.0,
    k: float | None = None,
    costs: tuple[JointCost | BatchCost, ...] = (),
    spheres: ArmSpheres | None = None,
    margin: float = 0.05,
    obstacle_weight: float = 1e4,
    self_collision: bool = False,
    states: int = 21,
    samples: int = 10,
    max_iterations: int = 30,
    deviation: float = DEVIATION,
    decay: float = 0.98,
    temperature: float = 0.1,
    prior_weight: float = 10.0,
    tolerance: float = 1e-3,
    refine: bool = False,
    duration: float | None = None,
) -> Trajectory:
    """A smooth motion from start to goal along which an index is good, by samples (Petrović et al., eqs. 14 to 16).

    The cost is that of `gradient`, and so are the parameters that have the same names. Each iteration draws `samples`
    motions about the current one from the prior, of standard deviation `deviation` [rad or m] half-way, which `decay`
    shrinks, and moves it by their mean, weighted by exp(−(G − G_min)/(`temperature` (G_max − G_min))) and spread by the
    covariance, as STOMP does. The best motion that was met is returned. It ends after `max_iterations`, or where eight
    together gain less than the part `tolerance` of the objective. It needs no gradient, and can leave a local minimum;
    without obstacles `gradient` is faster and as good.

    seed
        of the samples: the same seed gives the same motion.
    refine
        finish with `gradient` from there.

    Returns and raises as `gradient`; `status` is "feasible" unless refined: no minimum is claimed.
    """
    scene = _Scene.of(chain, obstacles, spheres, margin, obstacle_weight, self_collision, start, goal)
    planner = _planner(chain, index, weight, k, states, (*costs, *scene.costs))
    begin = time.perf_counter()
    found = planner.stochastic(
        start,
        goal,
        samples=samples,
        max_iterations=max_iterations,
        deviation=deviation,
        decay=decay,
        temperature=temperature,
        prior_weight=prior_weight,
        tolerance=tolerance,
        seed=seed,
    )
    plan = _trajectory(chain, found, prior_weight, "feasible", duration, time.perf_counter() - begin, scene)
    if not refine:
        return plan
    fine = planner.gradient(
        start, goal, prior_weight=max(prior_weight, 1e-6), max_iterations=100, tolerance=1e-4, guess=found
    )
    status, solve_time = "optimal" if fine.converged else "feasible", time.perf_counter() - begin
    refined = _trajectory(chain, fine, prior_weight, status, duration, solve_time, scene)
    # Between its states a finer motion may touch what the rougher one did not.
    return plan if refined.status == "failed" else refined


class _Planners(threading.local):
    """Planners without obstacles, built once per thread, arm and options."""

    def __init__(self) -> None:
        self.get = functools.lru_cache(maxsize=32)(_build)


def _build(chain: Chain, index: Index, weight: float, k: float | None, states: int) -> _core.SupportPlanner:
    return _core.SupportPlanner(chain, _index_cost(chain, index, weight, k), states)


_planners = _Planners()


def _index_cost(chain: Chain, index: Index, weight: float, k: float | None) -> JointCost:
    if index == "geometry_aware":
        return _core.geometry_aware_cost(chain, indices.reference_scale(chain) if k is None else k, weight)
    if index == "manipulability":
        return _core.log_manipulability_cost(chain, weight)
    raise ValueError(f"index = {index!r} must be None, 'geometry_aware' or 'manipulability'")


def _planner(
    chain: Chain,
    index: Index | None,
    weight: float,
    k: float | None,
    states: int,
    further: tuple[JointCost | BatchCost, ...],
) -> _core.SupportPlanner:
    if index is not None and not further:
        return _planners.get(chain, index, weight, k, states)
    own = [] if index is None else [_index_cost(chain, index, weight, k)]
    if not own and not further:
        raise ValueError("there is no cost: index is None, and neither obstacles nor other costs are given")
    python = [cost for cost in further if not isinstance(cost, JointCost)]
    own += [cost for cost in further if isinstance(cost, JointCost)]
    return _core.SupportPlanner(chain, _core.sum_of_costs(own) if own else None, states, python)


@dataclass(frozen=True)
class _Scene:
    """What a motion must not touch."""

    spheres: ArmSpheres | None
    obstacles: Obstacles | DistanceField | None
    costs: tuple[JointCost, ...]

    @staticmethod
    def of(
        chain: Chain,
        obstacles: Obstacles | DistanceField | None,
        spheres: ArmSpheres | None,
        margin: float,
        weight: float,
        self_collision: bool,
        start: ArrayLike,
        goal: ArrayLike,
    ) -> _Scene:
        if obstacles is None and not self_collision:
            return _Scene(None, None, ())
        if spheres is None:
            spheres = arm_spheres(chain)
        costs = []
        if obstacles is not None:
            for name, q in (("start", start), ("goal", goal)):
                distance = float(min_distance(spheres, obstacles, q))
                if distance < 0.0:
                    raise ValueError(f"the {name} is in collision: the arm is {-distance:.3f} m inside an obstacle")
            costs.append(collision_cost(spheres, obstacles, margin, weight))
        if self_collision:
            costs.append(_core.self_collision_cost(spheres, weight=weight))
        return _Scene(spheres, obstacles, tuple(costs))

    def free(self, q: Array) -> bool:
        """Whether no configuration (B, n) touches an obstacle."""
        if self.spheres is None or self.obstacles is None:
            return True
        return bool(np.min(min_distance(self.spheres, self.obstacles, q)) >= 0.0)


@dataclass(frozen=True)
class _Spline:
    """Natural cubic spline through states, in unit time."""

    q: Array
    qdot: Array
    qddot: Array

    @staticmethod
    def through(q: Array) -> _Spline:
        h = 1.0 / (len(q) - 1)
        qdot = np.asarray(_core.spline_velocities(q))
        # In a step from q0 to q1: q̈0 = (6 (q1 − q0)/h − 4 q̇0 − 2 q̇1)/h.
        qddot = np.zeros_like(q)
        qddot[:-1] = (6.0 * (q[1:] - q[:-1]) / h - 4.0 * qdot[:-1] - 2.0 * qdot[1:]) / h
        qddot[0] = 0.0
        return _Spline(q, qdot, qddot)

    def extremes(self) -> tuple[Array, Array]:
        """Lowest and highest positions (n,), between the states too."""
        h = 1.0 / (len(self.q) - 1)
        low, high = self.q.min(axis=0), self.q.max(axis=0)
        a, b, c = self._velocity(h)
        with np.errstate(divide="ignore", invalid="ignore"):
            root = np.sqrt(b * b - 4.0 * a * c)
            for s in ((-b + root) / (2.0 * a), (-b - root) / (2.0 * a), -c / b):
                inside = (s > 0.0) & (s < 1.0)
                t = np.where(inside, s, 0.0) * h
                jerk = (self.qddot[1:] - self.qddot[:-1]) / h
                at = self.q[:-1] + t * (self.qdot[:-1] + t * (0.5 * self.qddot[:-1] + t * jerk / 6.0))
                low, high = np.minimum(low, at.min(axis=0)), np.maximum(high, at.max(axis=0))
        return low, high

    def fastest(self) -> Array:
        """Largest speeds (n,) [rad or m per unit time]."""
        h = 1.0 / (len(self.q) - 1)
        a, b, c = self._velocity(h)
        with np.errstate(divide="ignore", invalid="ignore"):
            s = -b / (2.0 * a)
        s = np.where((s > 0.0) & (s < 1.0), s, 0.0)
        between = np.abs((a * s + b) * s + c).max(axis=0)
        fastest: Array = np.maximum(np.abs(self.qdot).max(axis=0), between)
        return fastest

    def _velocity(self, h: float) -> tuple[Array, Array, Array]:
        """q̇ = a s² + b s + c in each step, s in [0, 1]."""
        return (
            0.5 * h * (self.qddot[1:] - self.qddot[:-1]),
            h * self.qddot[:-1],
            self.qdot[:-1],
        )


def _within(chain: Chain, q: Array) -> _Spline:
    """The spline through the states, or, where it overshoots a limit of position, through states as much nearer to the
    straight line as necessary. The line itself is within the limits, and the overshoot is convex in the distance of the
    states from the line."""
    line = q[0] + np.linspace(0.0, 1.0, len(q))[:, None] * (q[-1] - q[0])

    def keeps(part: float) -> bool:
        low, high = _Spline.through(line + part * (q - line)).extremes()
        return bool(np.all(low >= chain.limits.lower) and np.all(high <= chain.limits.upper))

    if keeps(1.0):
        return _Spline.through(q)
    low, high = 0.0, 1.0
    for _ in range(30):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if keeps(middle) else (low, middle)
    return _Spline.through(line + low * (q - line))


def _trajectory(
    chain: Chain,
    found: _core.SupportStates,
    prior_weight: float,
    status: str,
    duration: float | None,
    solve_time: float,
    scene: _Scene,
) -> Trajectory:
    q = found.states(chain.dof)
    spline = _within(chain, q)
    if duration is None:
        limits = chain.limits
        with np.errstate(invalid="ignore"):
            fast = float(np.max(spline.fastest() / limits.velocity))
            hard = float(np.max(np.sqrt(np.abs(spline.qddot).max(axis=0) / limits.acceleration)))
        duration = max(fast, hard) or 1.0
    elif not (math.isfinite(duration) and duration > 0.0):
        raise ValueError(f"duration = {duration} must be finite and greater than 0")
    t = np.linspace(0.0, duration, len(q))
    plan = Trajectory(
        t,
        spline.q,
        spline.qdot / duration,
        spline.qddot / duration**2,
        duration,
        status,
        found.cost + prior_weight * found.distance,
        solve_time,
        found.iterations,
        cubic=True,
    )
    dense = np.linspace(0.0, duration, DENSE * (len(t) - 1) + 1)
    if not scene.free(plan.sample(dense)[0]):
        none = np.empty((0, chain.dof))
        return Trajectory(
            np.empty(0), none, none, none, math.nan, "failed", math.nan, solve_time, found.iterations, cubic=True
        )
    return replace(plan, clearance=clearance(chain, singularities.of(chain), dense, plan.sample(dense)[0]))
