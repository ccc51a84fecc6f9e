"""The panels as a picture. Needs matplotlib."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from matplotlib.figure import Figure

from sigmaik._plotting import empty_figure, plain_axes

from .cases import BINS, STARTS
from .experiment import SolverRow

__all__ = ["solvers_figure"]

_COLOURS = [
    "#D55E00",
    "#0072B2",
    "#009E73",
    "#CC79A7",
    "#56B4E9",
    "#7A5C3E",
    "#555555",
    "#E69F00",
    "#8B8B00",
    "#9467BD",
]


def solvers_figure(title: str, rows: Sequence[SolverRow]) -> Figure:
    """Share solved by condition number; way of the joints for a step; share solved by start; time of a solution."""
    solvers = list(dict.fromkeys(row.solver for row in rows))
    figure = empty_figure(10.6, 7.0, title, x=0.01, ha="left")
    grid = figure.subplots(2, 2)
    for k, solver in enumerate(solvers):
        mine = [row for row in rows if row.solver == solver]
        colour = _COLOURS[k % len(_COLOURS)]
        style = {
            "color": colour,
            "marker": "o",
            "markersize": 3.5,
            "linewidth": 2.0 if k == 0 else 1.1,
            "label": solver,
        }
        for axes, panel, groups in ((grid[0][0], "condition", list(BINS)), (grid[1][0], "starts", list(STARTS))):
            share = [100.0 * np.mean([r.solved for r in mine if (r.panel, r.group) == (panel, g)]) for g in groups]
            axes.plot(groups, share, **style)
        ways = [[r.ratio for r in mine if (r.panel, r.group) == ("amplification", g)] for g in BINS]
        grid[0][1].plot(list(BINS), [np.nanmedian(w) if np.isfinite(w).any() else np.nan for w in ways], **style)
        seconds = np.sort([row.seconds for row in mine])
        axes = grid[1][1]
        axes.plot(1e6 * seconds, 100.0 * np.arange(1, len(seconds) + 1) / len(seconds), color=colour, label=solver)
    for axes, label in (
        (grid[0][0], "solved [%]"),
        (grid[0][1], "joint way for a step / the least"),
        (grid[1][0], "solved, by start [%]"),
        (grid[1][1], "answers [%]"),
    ):
        plain_axes(axes, label, 8)
    grid[0][1].set_yscale("log")
    grid[1][1].set_xscale("log")
    grid[1][1].set_xlabel("time [µs]", fontsize=9)
    handles, labels = grid[0][1].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower center", ncols=6, frameon=False, fontsize=9)
    return figure
