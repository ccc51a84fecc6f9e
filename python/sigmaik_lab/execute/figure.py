"""A figure of a planned motion in physics. Needs matplotlib."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from sigmaik._plotting import JOINT_COLOURS, empty_figure, plain_axes

from .experiment import ExecuteRun

__all__ = ["execution_figure"]


def execution_figure(runs: Sequence[ExecuteRun]) -> Figure:
    """Positions, errors and torques of a planned motion: a column per way to drive the arm."""
    if not runs:
        raise ValueError("no run to draw")
    first = runs[0].execution
    names = runs[0].joint_names
    title = f"{runs[0].robot}: a planned motion in physics"
    figure = empty_figure(3.3 * len(runs) + 1.0, 7.4, title, x=0.01, ha="left")
    grid = figure.subplots(3, len(runs), sharex=True, squeeze=False, sharey="row")
    for column, run in enumerate(runs):
        done = run.execution
        title = run.variant if run.variant == "velocity loops" else f"computed torque, {run.variant}"
        title = title.removesuffix(", computed torque")
        rows = (
            ("joint position [rad]", done.q),
            ("error [mrad]", 1e3 * np.abs(done.error)),
            ("torque / effort limit", done.torque / done.effort),
        )
        for row, (label, values) in enumerate(rows):
            axes = grid[row][column]
            for joint in range(values.shape[1]):
                colour = JOINT_COLOURS[joint % len(JOINT_COLOURS)]
                shown = np.maximum(values, 1e-4) if row == 1 else values
                axes.plot(done.t, shown[:, joint], color=colour, linewidth=1.0, label=names[joint])
                if row == 0:
                    axes.plot(done.t, done.planned[:, joint], color="black", linewidth=0.7, linestyle=":")
            plain_axes(axes, label if column == 0 else None)
            axes.axvline(run.duration, color="0.6", linewidth=0.8, linestyle=(0, (4, 3)), zorder=0)
        grid[0][column].set_title(title, fontsize=10)
        grid[1][column].set_yscale("log")
        grid[1][column].set_ylim(1e-3, 2e3)
        grid[2][column].set_ylim(0.0, 1.05)
        grid[2][column].set_xlabel("time [s]")
        grid[2][column].set_xlim(0.0, float(first.t[-1]))
    handles, labels = grid[1][0].get_legend_handles_labels()
    handles.append(Line2D([], [], color="black", linestyle=":", linewidth=0.9))
    figure.legend(
        handles, [*labels, "planned"], loc="outside lower center", ncols=min(8, len(handles)), frameon=False, fontsize=9
    )
    return figure
