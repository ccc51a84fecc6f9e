"""The panels as text tables."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from sigmaik_lab.report import Table, compact

from .cases import BINS, STARTS
from .experiment import SolverRow, summarize_solvers

__all__ = ["panel_tables"]


def panel_tables(rows: Sequence[SolverRow]) -> list[Table]:
    """A table for each of the four panels, a line for each solver.

    Error: share solved and mean error, by condition number. Amplification: share that made the step, and the median way
    of the joints, where the step was made, as a multiple of the least way of the linearised problem. Starts: share
    solved. Cost: median and 95 % of all cases.
    """
    found = {(row.solver, row.panel, row.group): row for row in summarize_solvers(rows)}
    solvers = list(dict.fromkeys(row.solver for row in rows))
    error = Table("error by condition number: solved, mean error", "solver")
    steps = Table("a step of 1 mm by condition number: made, joint way × the least", "solver")
    starts = Table("solved, by start", "solver")
    cost = Table("cost of a solution, all cases", "solver")
    for name in BINS:
        error.add_numbers(f"{name}\n%", "\nmm")
        steps.add_numbers(f"{name}\n%", "\n×")
    starts.add_numbers(*(f"{name}\n%" for name in STARTS))
    cost.add_numbers("median\nµs", "95 %\nµs")
    for solver in solvers:
        mine = [found[solver, "condition", name] for name in BINS]
        error.add_row(solver, *(text for row in mine for text in (_share(row.solved), compact(1e3 * row.mean_error))))
        mine = [found[solver, "amplification", name] for name in BINS]
        steps.add_row(solver, *(text for row in mine for text in (_share(row.solved), compact(row.ratio))))
        starts.add_row(solver, *(_share(found[solver, "starts", name].solved) for name in STARTS))
        seconds = [1e6 * row.seconds for row in rows if row.solver == solver]
        cost.add_row(solver, compact(float(np.median(seconds))), compact(float(np.percentile(seconds, 95))))
    return [error, steps, starts, cost]


def _share(value: float) -> str:
    return "–" if math.isnan(value) else f"{100.0 * value:.3g}"
