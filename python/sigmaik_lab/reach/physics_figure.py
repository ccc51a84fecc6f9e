"""A figure of an arm in physics beside the kinematic arm. Needs matplotlib."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from sigmaik._plotting import empty_figure, plain_axes
from sigmaik._types import Array
from sigmaik_lab.colours import method_styles

from .figure import name_waypoints
from .physics import PhysicsRun

__all__ = ["physics_figure"]


def physics_figure(runs: Sequence[PhysicsRun]) -> Figure:
    """Position error and joint speed, kinematic (thin) and in physics; the tips' distance; torque. A line per run."""
    if not runs:
        raise ValueError("no run to draw")
    first = runs[0].kinematic
    experiment = first.experiment
    columns = sorted({run.kinematic.velocity_limits for run in runs})
    panels: tuple[
        tuple[str, Callable[[PhysicsRun], Array], Callable[[PhysicsRun], Array] | None, float, float], ...
    ] = (
        (
            "position error [mm]",
            lambda r: 1e3 * r.physical.position_error,
            lambda r: 1e3 * r.kinematic.position_error,
            1e-2,
            4e3,
        ),
        ("tips apart [mm]", lambda r: 1e3 * r.tip_distance, None, 1e-2, 4e3),
        (
            "largest joint\nspeed [rad/s]",
            lambda r: r.physical.joint_speed,
            lambda r: r.kinematic.joint_speed,
            1e-3,
            1e3,
        ),
        ("largest torque\n/ effort limit", lambda r: r.effort.max(axis=1), None, 0.0, 1.05),
    )
    title = f"{experiment.robot} in physics: {experiment.path.name}"
    figure = empty_figure(6.4 * len(columns) + 0.6, 2.1 * len(panels) + 1.4, title)
    grid = figure.subplots(len(panels), len(columns), sharex=True, sharey="row", squeeze=False)
    styles = method_styles(run.kinematic.method for run in runs)
    for column, limits in enumerate(columns):
        chosen = [run for run in runs if run.kinematic.velocity_limits == limits]
        # J-PARSE on top.
        chosen.sort(key=lambda run: run.kinematic.method.family == "jparse")
        for row, (label, physical, kinematic, low, high) in enumerate(panels):
            axes = grid[row][column]
            for run in chosen:
                colour, dash = styles[run.kinematic.method.label]
                floor = 1e-3 * low if low else -1.0
                if kinematic is not None:
                    axes.plot(
                        first.t,
                        np.maximum(kinematic(run), floor),
                        color=colour,
                        linewidth=0.7,
                        alpha=0.6,
                        linestyle=":",
                    )
                axes.plot(
                    first.t, np.maximum(physical(run), floor), color=colour, linewidth=1.2, linestyle=dash, alpha=0.9
                )
            if low:
                axes.set_yscale("log")
            axes.set_ylim(low, high)
            plain_axes(axes, label if column == 0 else None)
            end = 0.0
            for segment in experiment.path.segments[:-1]:
                end += segment.duration
                axes.axvline(end, color="0.6", linewidth=0.8, linestyle=(0, (4, 3)), zorder=0)
        grid[0][column].set_title(f"joint speed limits {'on' if limits else 'off'}", fontsize=11, pad=18)
        grid[-1][column].set_xlabel("time [s]")
        grid[-1][column].set_xlim(0.0, experiment.path.duration)
        name_waypoints(grid[0][column], first)
    labels = list(dict.fromkeys(run.kinematic.method.label for run in runs))
    handles = [Line2D([], [], color=styles[label][0], linestyle=styles[label][1], linewidth=1.4) for label in labels]  # type: ignore[arg-type]
    handles.append(Line2D([], [], color="0.4", linestyle=":", linewidth=0.9))
    figure.legend(
        handles,
        [*labels, "without physics"],
        loc="outside lower center",
        ncols=min(len(handles), 5 * len(columns)),
        frameon=False,
    )
    return figure
