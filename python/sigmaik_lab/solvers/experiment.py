"""Solves all cases with one solver, and judges the answers.

Units: m, rad, s; for prismatic joints m in place of rad.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

import sigmaik as sk

from .cases import STEP, Case
from .solvers import Solver

__all__ = ["SOLVED", "SolverRow", "SolverSummary", "solve_cases", "summarize_solvers"]

SOLVED = 1e-3  #: [m] A smaller error counts as success.
_SLACK = 1e-6  #: [rad or m] by which an answer may be outside the joint ranges


@dataclass(frozen=True)
class SolverRow:
    """A case and a solver."""

    solver: str
    panel: str
    group: str
    error: float  #: [m] of the tip at the answer
    inside: bool  #: whether the answer is inside the joint ranges
    solved: bool  #: error below `SOLVED`, inside the ranges
    way: float  #: [rad or m] ‖q − start‖
    amplification: float  #: [rad/m] way/step of the tip; nan in other panels, and where the case is not solved
    ratio: float  #: amplification/(the least one of the linearised problem); nan where there is no amplification
    seconds: float  #: wall time


@dataclass(frozen=True)
class SolverSummary:
    """A solver in one group of a panel."""

    solver: str
    panel: str
    group: str
    trials: int
    solved: float  #: share
    median_error: float  #: [m]
    mean_error: float  #: [m]
    largest_error: float  #: [m]
    amplification: float  #: [rad/m] median of the solved cases; nan in other panels
    largest_amplification: float  #: [rad/m]
    ratio: float  #: median of the solved cases' amplification/(the least one of the linearised problem)
    largest_ratio: float
    median_seconds: float
    seconds_95: float  #: [s] 95 %


def solve_cases(
    chain: sk.Chain, name: str, solver: Solver, cases: Sequence[Case], advance: Callable[[], None] = lambda: None
) -> list[SolverRow]:
    """Rows in the order of the cases. A solver that raises an error answers with the start."""
    limits = chain.limits
    rows = []
    for case in cases:
        begin = time.perf_counter()
        try:
            q = solver.solve(case.target, case.start)
        except Exception:  # whatever a library may raise
            q = case.start
        taken = time.perf_counter() - begin
        finite = bool(np.all(np.isfinite(q)))
        error = float(np.linalg.norm(chain.pose(q)[:3, 3] - case.target)) if finite else math.inf
        inside = finite and bool(np.all((q >= limits.lower - _SLACK) & (q <= limits.upper + _SLACK)))
        solved = inside and error < SOLVED
        way = float(np.linalg.norm(q - case.start)) if finite else math.inf
        steps = case.panel == "amplification"
        # A step is as long as `SOLVED`, and standing still would count; the amplification asks for a tenth of it.
        reached = inside and error < 0.1 * STEP
        rows.append(
            SolverRow(
                name,
                case.panel,
                case.group,
                error,
                inside,
                reached if steps else solved,
                way,
                way / STEP if steps and reached else math.nan,
                way / case.least if steps and reached else math.nan,
                taken,
            )
        )
        advance()
    return rows


def summarize_solvers(rows: Sequence[SolverRow]) -> list[SolverSummary]:
    """A summary of each solver, panel and group, in the order of the rows."""
    groups: dict[tuple[str, str, str], list[SolverRow]] = {}
    for row in rows:
        groups.setdefault((row.solver, row.panel, row.group), []).append(row)
    return [_summary(*key, found) for key, found in groups.items()]


def _summary(solver: str, panel: str, group: str, rows: Sequence[SolverRow]) -> SolverSummary:
    errors = np.array([row.error for row in rows])
    ways = np.array([row.amplification for row in rows if not math.isnan(row.amplification)])
    ratios = np.array([row.ratio for row in rows if not math.isnan(row.ratio)])
    seconds = np.array([row.seconds for row in rows])
    return SolverSummary(
        solver,
        panel,
        group,
        len(rows),
        float(np.mean([row.solved for row in rows])),
        float(np.median(errors)),
        float(errors.mean()),
        float(errors.max()),
        float(np.median(ways)) if len(ways) else math.nan,
        float(ways.max()) if len(ways) else math.nan,
        float(np.median(ratios)) if len(ratios) else math.nan,
        float(ratios.max()) if len(ratios) else math.nan,
        float(np.median(seconds)),
        float(np.percentile(seconds, 95)),
    )
