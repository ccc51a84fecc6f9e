"""Figures of arms in physics: reaching beside the kinematic arm, and planned motions. Needs matplotlib."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from ._plotting import JOINT_COLOURS
from ._types import Array
from .experiments.execute import ExecuteRun
from .experiments.physics import PhysicsRun
from .plots import _name_waypoints, _styles

__all__ = ["execution_figure", "physics_figure"]


def physics_figure(runs: Sequence[PhysicsRun]) -> Figure:
    """Position error and joint speed without physics (thin) and with; the tips' distance; torque. A line per run."""
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
    figure = Figure(figsize=(6.4 * len(columns) + 0.6, 2.1 * len(panels) + 1.4), layout="constrained")
    FigureCanvasAgg(figure)
    grid = figure.subplots(len(panels), len(columns), sharex=True, sharey="row", squeeze=False)
    figure.suptitle(f"{experiment.robot} in physics: {experiment.path.name}", fontsize=13, fontweight="bold")
    styles = _styles([run.kinematic for run in runs])
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
            _plain(axes, label if column == 0 else None)
            end = 0.0
            for segment in experiment.path.segments[:-1]:
                end += segment.duration
                axes.axvline(end, color="0.6", linewidth=0.8, linestyle=(0, (4, 3)), zorder=0)
        grid[0][column].set_title(f"joint speed limits {'on' if limits else 'off'}", fontsize=11, pad=18)
        grid[-1][column].set_xlabel("time [s]")
        grid[-1][column].set_xlim(0.0, experiment.path.duration)
        _name_waypoints(grid[0][column], first)
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


def execution_figure(runs: Sequence[ExecuteRun]) -> Figure:
    """Positions, errors and torques of a planned motion: a column per way to drive the arm."""
    if not runs:
        raise ValueError("no run to draw")
    first = runs[0].execution
    names = runs[0].joint_names
    figure = Figure(figsize=(3.3 * len(runs) + 1.0, 7.4), layout="constrained")
    FigureCanvasAgg(figure)
    grid = figure.subplots(3, len(runs), sharex=True, squeeze=False, sharey="row")
    figure.suptitle(f"{runs[0].robot}: a planned motion in physics", fontsize=13, fontweight="bold", x=0.01, ha="left")
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
            _plain(axes, label if column == 0 else None)
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


def _plain(axes: Axes, label: str | None) -> None:
    axes.grid(True, which="major", color="0.88", linewidth=0.6)
    axes.tick_params(labelsize=9)
    axes.spines[["top", "right"]].set_visible(False)
    if label is not None:
        axes.set_ylabel(label)
