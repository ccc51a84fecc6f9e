"""The same problem for a general solver: direct transcription in CasADi, solved by IPOPT with MUMPS (extra `plan`)."""

from __future__ import annotations

import functools
import math
import threading
import time
from typing import Any

import numpy as np

from sigmaik import singularities
from sigmaik._core import Chain
from sigmaik._extras import need
from sigmaik._types import Array

from .objective import Ends, Objective, Sets

__all__ = ["solve"]

TOLERATED = 1e-6
"""What constraints may be broken by, or the plan has failed."""


def solve(
    chain: Chain, sets: Sets, objective: Objective, ends: Ends, bend: Array | None
) -> tuple[Array, Array, Array, str, float, float, int, float]:
    """q, q̇, q̈ (N, n), status, cost, t_F, iterations, solve time. From the straight line, at an even speed."""
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
