"""A figure of a trial, driven in several ways. Needs matplotlib."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray

from sigmaik._plotting import JOINT_COLOURS, empty_figure, limit_lines

from .experiment import Trace

__all__ = ["limits_figure"]


def limits_figure(traces: Sequence[Trace], seconds: tuple[float, float] | None = None) -> Figure:
    """Joint positions, speeds and accelerations as parts of their limits, and the tool's path, per variant.

    All traces are of one trial. Limits are dashed, and the range beyond is shaded; a curve that leaves its
    panel has its peak written there. seconds: from and to; None: all.
    """
    if not traces:
        raise ValueError("no trace to draw")
    first = traces[0]
    chain, trial = first.experiment.chain, first.trial
    limits = chain.limits
    begin, end = seconds or (0.0, float(first.t[-1]))
    here = (first.t >= begin) & (first.t <= end)
    t = first.t[here]
    middle, half = 0.5 * (limits.lower + limits.upper), 0.5 * (limits.upper - limits.lower)
    bounded = np.isfinite(half)

    title = f"{first.experiment.robot}, {first.scenario}: {trial.name}"
    figure = empty_figure(3.0 * len(traces) + 1.0, 9.6, title, x=0.01, ha="left")
    grid = figure.subplots(4, len(traces), squeeze=False, gridspec_kw={"height_ratios": [1, 1, 1, 1.25]})
    spread = np.ptp(np.concatenate([trace.tip[here] for trace in traces]), axis=0)
    x, y = sorted(int(axis) for axis in np.argsort(spread)[-2:])
    for column, trace in enumerate(traces):
        with np.errstate(invalid="ignore"):
            position = np.where(bounded, (trace.q[:-1] - middle) / np.where(bounded, half, 1.0), np.nan)
        rows = (
            ("joint position\nmiddle 0, limits ±1", position[here], 1.25, bounded),
            ("joint speed\n/ limit", (trace.qdot / limits.velocity)[here], 1.6, np.isfinite(limits.velocity)),
            (
                "joint acceleration\n/ limit",
                (trace.acceleration / limits.acceleration)[here],
                2.5,
                np.isfinite(limits.acceleration),
            ),
        )
        for row, (label, values, top, known) in enumerate(rows):
            axes = grid[row][column]
            for joint in np.flatnonzero(known):
                axes.plot(
                    t,
                    values[:, joint],
                    color=JOINT_COLOURS[joint % len(JOINT_COLOURS)],
                    linewidth=0.9,
                    label=chain.joint_names[joint],
                )
            limit_lines(axes, top, label if column == 0 else None)
            for phase in trial.phases[1:]:
                axes.axvline(phase.begin / trace.experiment.settings.rate, color="0.7", linewidth=0.8, zorder=0.5)
            if not known.any():
                axes.text(
                    0.5,
                    0.5,
                    "no limits known",
                    transform=axes.transAxes,
                    ha="center",
                    color="0.5",
                    fontsize=8,
                )
            elif (peak := float(np.nanmax(np.abs(values[:, known])))) > top:
                axes.text(
                    0.98,
                    0.95,
                    f"peak {peak:.3g} ×",
                    transform=axes.transAxes,
                    ha="right",
                    va="top",
                    fontsize=8,
                )
            axes.set_xlim(begin, end)
        grid[0][column].set_title(trace.variant, fontsize=11)
        grid[2][column].set_xlabel("time [s]", fontsize=9)
        _tool_path(grid[3][column], trace, here, (x, y))
    handles, labels = grid[1][0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower center", ncols=max(1, len(labels)), frameon=False, fontsize=9)
    note = "● start  □ end" + ("  grey: target" if trial.by_pose else "")
    grid[3][0].text(0.0, 1.02, note, transform=grid[3][0].transAxes, va="bottom", fontsize=8, color="0.35")
    return figure


def _tool_path(axes: Axes, trace: Trace, here: NDArray[np.bool_], plane: tuple[int, int]) -> None:
    x, y = plane
    tip = trace.tip[here]
    if trace.trial.by_pose:
        targets = trace.trial.commands[here][:, :3, 3]
        jumps = np.linalg.norm(np.diff(targets, axis=0), axis=1) > 0.01
        for part in np.split(targets, np.flatnonzero(jumps) + 1):
            axes.plot(part[:, x], part[:, y], color="0.72", linewidth=0.8, zorder=1)
            axes.plot(*part[0, [x, y]], ".", color="0.55", markersize=6, zorder=1)
    axes.plot(tip[:, x], tip[:, y], color="black", linewidth=1.1)
    axes.plot(*tip[0, [x, y]], "o", color="black", markersize=4)
    axes.plot(*tip[-1, [x, y]], "s", color="black", markersize=4, markerfacecolor="white")
    axes.set_aspect("equal", adjustable="datalim")
    axes.grid(True, color="0.9", linewidth=0.6)
    axes.spines[["top", "right"]].set_visible(False)
    axes.tick_params(labelsize=8)
    axes.set_xlabel(f"tool {'xyz'[x]} [m]", fontsize=9)
    axes.set_ylabel(f"tool {'xyz'[y]} [m]", fontsize=9)
