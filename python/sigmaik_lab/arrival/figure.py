"""The distribution of arrival times. Needs matplotlib."""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np
from matplotlib.figure import Figure

from sigmaik._plotting import empty_figure, plain_axes

from .experiment import Arrivals

__all__ = ["arrival_figure"]

_STYLES = {"default": ("#0072B2", "-"), "guided": ("#D55E00", "-"), "fixed": ("#7A5C3E", (0, (5, 1.5)))}
_OTHERS = [
    ("#009E73", (0, (5, 1.5))),
    ("#555555", (0, (1.5, 1.5))),
    ("#CC79A7", (0, (4, 1, 1, 1))),
    ("#56B4E9", "-"),
    ("#E69F00", (0, (5, 1.5))),
    ("#8B8B00", (0, (1.5, 1.5))),
]


def arrival_figure(title: str, seconds: float, done: Mapping[str, Mapping[str, Arrivals]]) -> Figure:
    """The share of the trials that have arrived over time. done: of each arm and servo. A panel for each arm."""
    columns = min(3, len(done))
    rows = math.ceil(len(done) / columns)
    most = max(map(len, done.values()))  # names in the legend, of which three stand under a panel
    width = 3.4 * columns + 0.6 if most <= 3 * columns else max(6.2, 3.4 * columns + 0.6)
    figure = empty_figure(width, 2.5 * rows + 0.8, title, x=0.01, ha="left")
    grid = figure.subplots(rows, columns, squeeze=False, sharex=True, sharey=True)
    for axes in grid.flat[len(done) :]:
        axes.set_visible(False)
    for i, (robot, servos) in enumerate(done.items()):
        axes = grid.flat[i]
        others = iter(_OTHERS * len(servos))
        for servo, arrivals in servos.items():
            times = np.sort(arrivals.time[np.isfinite(arrivals.time)])
            share = 100.0 * np.arange(1, len(times) + 1) / len(arrivals.time)
            colour, dash = _STYLES[servo] if servo in _STYLES else next(others)
            x, y = np.concatenate([[0.0], times, [seconds]]), np.concatenate([[0.0], share, share[-1:]])
            axes.step(x[: len(y)], y, where="post", color=colour, linestyle=dash, linewidth=1.4, label=servo)
        axes.set_title(robot, fontsize=10)
        axes.set_xlim(0.0, seconds)
        axes.set_ylim(0.0, 102.0)
        plain_axes(axes, "arrived [%]" if i % columns == 0 else None, 8)
        if i + columns >= len(done):
            axes.set_xlabel("time [s]", fontsize=9)
            axes.tick_params(labelbottom=True)
    handles, labels = grid[0][0].get_legend_handles_labels()
    figure.legend(
        handles,
        labels,
        loc="outside lower center",
        ncols=min(len(labels), max(3, 3 * columns)),
        frameon=False,
        fontsize=9,
    )
    return figure
