"""The problem of `sk.planning.time_optimal` for a general solver, for comparison: direct transcription in CasADi,
solved by IPOPT with MUMPS (extra `plan`). `time_optimal(solver="ipopt")` finds this module by the entry point in
pyproject.toml."""

from __future__ import annotations

import functools
import math
import threading
import time
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import ArrayLike

from sigmaik import singularities
from sigmaik._core import Chain, Clearance, Crossing, SingularSets, Trajectory, clearance
from sigmaik._extras import need
from sigmaik._types import Array
from sigmaik.planning import costs
from sigmaik.planning.costs import ETA1, ETA2

__all__ = ["plan"]

TOLERATED = 1e-6
"""Largest violation of a constraint; a plan with a larger violation has failed."""
DENSE = 10
"""Samples of a step where clearance is measured."""
BEND = 0.6
"""[rad] Size of the bend in the first guess of a second start."""


Sets: TypeAlias = SingularSets | None
Ends: TypeAlias = tuple[ArrayLike, ArrayLike, ArrayLike | None, ArrayLike | None]
"""Start, goal, and velocities there."""


@dataclass(frozen=True)
class Objective:
    """Everything that a solver object depends on, except the arm. Hashable, because each solver is built only once."""

    avoid: str | None = None
    nodes: int = 30
    time_weight: float = 1.0
    effort_weight: float = 1.0
    avoid_weight: float = 1e2
    epsilon: float = 1e-6
    eta1: float = ETA1
    eta2: float = ETA2
    generic_manipulability: bool = False


def plan(chain: Chain, sets: Sets, ends: Ends, options: Mapping[str, Any], avoid: Mapping[str, Any]) -> Trajectory:
    """The motion from the straight line at constant speed. Where this motion crosses a singular set without need, and
    `restarts` is not switched off: the better of this motion and one from the other side, as in `TimeOptimal::plan`.

    `options` and `avoid` are keywords of `time_optimal`; keywords that are no field of `Objective` do not count.
    """
    known = Objective.__dataclass_fields__
    objective = Objective(**{name: value for name, value in {**options, **avoid}.items() if name in known})
    if objective.avoid not in (None, "manipulability", "potential"):
        raise ValueError(f"avoid = {objective.avoid!r} must be None, 'manipulability' or 'potential'")
    if objective.avoid == "potential" and sets is None:
        costs.Potential().bind_term(chain)  # the error names the known arms
    found = _one(chain, sets, objective, ends, None)
    near = found.clearance
    if (
        objective.avoid is None
        or sets is None
        or near is None
        or not near.avoidable
        or not options.get("restarts", True)
    ):
        return found
    start, goal = (np.asarray(x, dtype=np.float64) for x in ends[:2])
    room = (
        0.4 * (chain.limits.lower - np.minimum(start, goal)),
        0.4 * (chain.limits.upper - np.maximum(start, goal)),
    )
    bend = np.clip(BEND * _other_side(sets, near.avoidable[0], start), *room)
    other = _one(chain, sets, objective, ends, bend)
    best = other if _along(other, sets, objective) < _along(found, sets, objective) else found
    return _trajectory(
        (best.q, best.qdot, best.qddot),
        best.duration,
        best.status,
        best.cost,
        found.solve_time + other.solve_time,
        found.iterations + other.iterations,
        2,
        best.clearance,
    )


def _one(chain: Chain, sets: Sets, objective: Objective, ends: Ends, bend: Array | None) -> Trajectory:
    q, qdot, qddot, status, cost, duration, iterations, solve_time = solve(chain, sets, objective, ends, bend)
    if status == "failed":
        empty = np.empty((0, chain.dof))
        return Trajectory(np.empty(0), empty, empty, empty, math.nan, status, math.nan, solve_time, iterations)
    found = _trajectory((q, qdot, qddot), duration, status, cost, solve_time, iterations, 1, None)
    dense = np.linspace(0.0, found.t[-1], DENSE * (len(found.t) - 1) + 1)
    near = clearance(chain, sets, dense, found.sample(dense)[0], width=objective.eta2)
    return _trajectory((q, qdot, qddot), duration, status, cost, solve_time, iterations, 1, near)


def _trajectory(
    nodes: tuple[Array, Array, Array],
    duration: float,
    status: str,
    cost: float,
    solve_time: float,
    iterations: int,
    starts: int,
    near: Clearance | None,
) -> Trajectory:
    t = np.arange(len(nodes[0]), dtype=np.float64) * (duration / len(nodes[0]))
    return Trajectory(t, *nodes, duration, status, cost, solve_time, iterations, starts, clearance=near)


def _other_side(sets: SingularSets, crossing: Crossing, start: Array) -> Array:
    """Direction (n,) of length 1: back to the start's side of a wall; at other sets, to the side without the motion."""
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


def _along(found: Trajectory, sets: SingularSets, o: Objective) -> float:
    """The objective, with the cost of avoidance counted along the whole way; inf where the plan failed."""
    if found.clearance is None:
        return math.inf
    dense = found.sample(found.clearance.t)[0]
    if o.avoid == "potential":
        avoided = o.avoid_weight * np.sum(sets.potential(dense, o.eta1, o.eta2))
    else:
        avoided = o.avoid_weight * np.sum(1.0 / (found.clearance.manipulability + o.epsilon))
    motion = o.time_weight * found.duration + o.effort_weight * np.sum(found.qddot**2)
    return float(motion + avoided / DENSE)


def solve(
    chain: Chain, sets: Sets, objective: Objective, ends: Ends, bend: Array | None
) -> tuple[Array, Array, Array, str, float, float, int, float]:
    """q, q̇, q̈ (N, n), status, cost, t_F, iterations, solve time."""
    casadi = _casadi()
    n, count = chain.dof, objective.nodes
    limits = chain.limits
    start, goal = (np.asarray(x, dtype=np.float64) for x in ends[:2])
    velocities = [np.zeros(n) if v is None else np.asarray(v, dtype=np.float64) for v in ends[2:]]
    for name, x, low, high in (
        ("start", start, limits.lower, limits.upper),
        ("goal", goal, limits.lower, limits.upper),
        ("start_velocity", velocities[0], -limits.velocity, limits.velocity),
        ("goal_velocity", velocities[1], -limits.velocity, limits.velocity),
    ):
        if x.shape != (n,) or not np.all((x >= low) & (x <= high)):
            raise ValueError(f"{name} must be ({n},) within the limits")

    lower = [np.tile(x, (count, 1)) for x in (limits.lower, -limits.velocity, -limits.acceleration)]
    upper = [np.tile(x, (count, 1)) for x in (limits.upper, limits.velocity, limits.acceleration)]
    for k, q, v in ((0, start, velocities[0]), (count - 1, goal, velocities[1])):
        lower[0][k] = upper[0][k] = q
        lower[1][k] = upper[1][k] = v
    t = 3.0 * max(float(np.max(np.abs(goal - start) / limits.velocity)), 0.1)
    s = np.linspace(0.0, 1.0, count)[:, None]
    line = start + s * (goal - start)
    if bend is not None:
        line = line + 16.0 * (s * (1.0 - s)) ** 2 * bend
    speed = np.gradient(line, t / count, axis=0)
    speed[0], speed[-1] = velocities

    run = _solvers.build(
        n,
        None if sets is None else sets.name,
        chain if objective.avoid == "manipulability" and (sets is None or objective.generic_manipulability) else None,
        objective,
    )
    begin = time.perf_counter()
    answer = run(
        x0=np.concatenate([[t], line.ravel(), speed.ravel(), np.zeros(n * count)]),
        lbx=np.concatenate([[0.0], *(x.ravel() for x in lower)]),
        ubx=np.concatenate([[math.inf], *(x.ravel() for x in upper)]),
        lbg=0.0,
        ubg=0.0,
    )
    solve_time = time.perf_counter() - begin
    stats = run.stats()
    x = np.asarray(casadi.DM(answer["x"])).ravel()
    q, qdot, qddot = x[1:].reshape(3, count, n)
    broken = max(
        float(np.max(np.abs(np.asarray(casadi.DM(answer["g"]))))),
        *(float(np.max(np.maximum(lo - y, y - up))) for lo, y, up in zip(lower, (q, qdot, qddot), upper, strict=True)),
    )
    status = "failed" if not broken <= TOLERATED else "optimal" if stats["success"] else "feasible"
    return q, qdot, qddot, status, float(answer["f"]), float(x[0]), int(stats["iter_count"]), solve_time


def _casadi() -> Any:
    need("casadi")
    import casadi

    return casadi


class _Solvers(threading.local):
    def __init__(self) -> None:
        self.build = functools.lru_cache(maxsize=32)(_build)


def _build(n: int, sets: str | None, chain: Chain | None, o: Objective) -> Any:
    """The solver object; `chain` is given where m comes from its Jacobian."""
    casadi = _casadi()
    t = casadi.SX.sym("t")
    q, qdot, qddot = (casadi.SX.sym(name, n, o.nodes) for name in ("q", "qdot", "qddot"))
    h = t / o.nodes
    cost = o.time_weight * t + o.effort_weight * casadi.sumsqr(qddot)
    functions = {"sin": casadi.sin, "cos": casadi.cos}
    if o.avoid is not None:
        for k in range(o.nodes):
            joints = casadi.vertsplit(q[:, k])
            if o.avoid == "potential":
                known = singularities.load(str(sets))
                cost += o.avoid_weight * singularities.symbolic_potential(
                    known, joints, o.eta1, o.eta2, exp=casadi.exp, **functions
                )
            else:
                if chain is None:
                    square = singularities.symbolic_manipulability_squared(
                        singularities.load(str(sets)), joints, **functions
                    )
                else:
                    jacobian = _jacobian(casadi, chain, joints)
                    square = casadi.det(jacobian @ jacobian.T)
                cost += o.avoid_weight / (casadi.sqrt(casadi.fmax(square, 1e-30)) + o.epsilon)
    gaps = [
        q[:, :-1] + h * qdot[:, :-1] + h * h / 2 * qddot[:, :-1] - q[:, 1:],
        qdot[:, :-1] + h * qddot[:, :-1] - qdot[:, 1:],
    ]
    problem = {
        "x": casadi.vertcat(t, casadi.vec(q), casadi.vec(qdot), casadi.vec(qddot)),
        "f": cost,
        "g": casadi.vertcat(*(casadi.vec(gap) for gap in gaps)),
    }
    options = {
        "print_time": False,
        "ipopt": {"print_level": 0, "sb": "yes", "linear_solver": "mumps", "tol": 1e-8, "max_iter": 1000},
    }
    return casadi.nlpsol("time_optimal", "ipopt", problem, options)


_solvers = _Solvers()


def _jacobian(casadi: Any, chain: Chain, q: list[Any]) -> Any:
    """6×n in the last frame but one's axes, from the screws at q = 0 (product of exponentials): det(JJᵀ) is the
    same."""
    zero = chain.jacobian(np.zeros(chain.dof))
    tip = chain.pose(np.zeros(chain.dof))[:3, 3]
    columns: list[Any] = []
    rotation, translation = casadi.SX.eye(3), casadi.SX.zeros(3)
    for k in range(chain.dof):
        v, w = zero[:3, k], zero[3:, k]
        if np.linalg.norm(w) < 0.5:  # prismatic
            columns.append(casadi.vertcat(rotation @ v, casadi.SX.zeros(3)))
            translation = translation + rotation @ v * q[k]
            continue
        point = tip + np.cross(w, v)  # on the axis, as v = w × (tip − point)
        axis = rotation @ w
        columns.append(casadi.vertcat(casadi.cross(rotation @ point + translation, axis), axis))
        skew = np.cross(np.eye(3), w).T
        turn = np.eye(3) + casadi.sin(q[k]) * skew + (1 - casadi.cos(q[k])) * (skew @ skew)
        translation = translation + rotation @ ((np.eye(3) - turn) @ point)
        rotation = rotation @ turn
    return casadi.horzcat(*columns)
