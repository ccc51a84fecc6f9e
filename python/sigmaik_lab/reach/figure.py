"""A figure of runs, in the style of the J-PARSE paper's. Needs matplotlib."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from sigmaik._plotting import empty_figure, plain_axes
from sigmaik._types import Array
from sigmaik_lab.colours import method_styles

from .experiment import Run

__all__ = ["name_waypoints", "reach_figure"]


@dataclass(frozen=True)
class _Panel:
    label: str
    values: Callable[[Run], Array]
    floor: float  #: where the axis begins
    ceiling: float  #: where it ends at the latest


def _millimetres(run: Run) -> Array:
    return 1e3 * run.position_error


def _degrees(run: Run) -> Array:
    return np.degrees(run.orientation_error)


def _deviation(run: Run) -> Array:
    deviation = run.deviation
    return np.zeros(len(run.t)) if deviation is None else 1e3 * deviation


_POSITION = _Panel("position error [mm]", _millimetres, 1e-2, 4e3)
_ORIENTATION = _Panel("orientation error [°]", _degrees, 1e-3, 400.0)
_DEVIATION = _Panel("distance from\nthe line [mm]", _deviation, 1e-2, 4e3)
_CONDITION = _Panel(r"$\sigma_{min}\,/\,\sigma_{max}$", lambda run: run.inverse_condition, 1e-4, 0.4)
_SPEED = _Panel("largest joint\nspeed [rad/s]", lambda run: run.joint_speed, 1e-3, 1e5)


def reach_figure(runs: Sequence[Run], title: str | None = None) -> Figure:
    """Position error, orientation error, inverse condition number and joint speed over time, a line per run.

    All runs are of one experiment. Runs without and with the arm's speed limits stand side by side. Where the
    target moves along a line, the distance from this line has a panel of its own. Scales are logarithmic; waypoints
    are marked, as are γ and the least and the largest of the joints' speed limits.
    """
    if not runs:
        raise ValueError("no run to draw")
    experiment = runs[0].experiment
    moving = experiment.path.line is not None
    panels = [_DEVIATION if moving else _POSITION, _ORIENTATION, _CONDITION, _SPEED]
    columns = sorted({run.velocity_limits for run in runs})

    heading = title or f"{experiment.robot}: {experiment.path.name}"
    figure = empty_figure(6.4 * len(columns) + 0.6, 2.1 * len(panels) + 1.4, heading)
    grid = figure.subplots(len(panels), len(columns), sharex=True, sharey="row", squeeze=False)

    styles = method_styles(run.method for run in runs)
    for column, limits in enumerate(columns):
        chosen = [run for run in runs if run.velocity_limits == limits]
        for row, panel in enumerate(panels):
            axes = grid[row][column]
            # J-PARSE last, on top; the pseudo-inverse, which can fill a panel, first.
            for run in sorted(chosen, key=_layer):
                colour, dash = styles[run.method.label]
                strong = run.method.family == "jparse"
                values = np.maximum(panel.values(run), 1e-3 * panel.floor)  # zero has no logarithm
                axes.plot(
                    run.t,
                    values,
                    color=colour,
                    linestyle=dash,
                    linewidth=1.7 if strong else 1.2,
                    alpha=0.55 if run.method.family == "pinv" else 0.95,
                    label=run.method.label,
                )
            _decorate(axes, panel, chosen[0], column == 0)
        grid[0][column].set_title(f"joint speed limits {'on' if limits else 'off'}", fontsize=11, pad=18)
        grid[-1][column].set_xlabel("time [s]")
        grid[-1][column].set_xlim(0.0, experiment.path.duration)
        name_waypoints(grid[0][column], runs[0])

    handles, labels = grid[0][0].get_legend_handles_labels()
    order = [run.method.label for run in runs]
    pairs = sorted(zip(handles, labels, strict=True), key=lambda pair: order.index(pair[1]))
    figure.legend(
        [handle for handle, _ in pairs],
        [label for _, label in pairs],
        loc="outside lower center",
        ncols=min(len(pairs), 4 * len(columns)),
        frameon=False,
    )
    return figure


def _layer(run: Run) -> tuple[bool, bool]:
    return run.method.family == "jparse", run.method.family != "pinv"


def _decorate(axes: Axes, panel: _Panel, run: Run, first: bool) -> None:
    experiment = run.experiment
    axes.set_yscale("log")
    plain_axes(axes, panel.label if first else None)
    end = 0.0
    for segment in experiment.path.segments[:-1]:
        end += segment.duration
        axes.axvline(end, color="0.6", linewidth=0.8, linestyle=(0, (4, 3)), zorder=0)
    note: dict[str, Any] = {
        "color": "0.35",
        "fontsize": 8,
        "ha": "right",
        "va": "bottom",
        "transform": axes.get_yaxis_transform(),
    }
    top = axes.get_ylim()[1]
    if panel is _CONDITION:
        top = panel.ceiling
        gamma = experiment.settings.gamma
        axes.axhline(gamma, color="0.35", linewidth=0.8, linestyle=":")
        axes.text(1.006, gamma, "γ", **{**note, "ha": "left", "va": "center", "fontsize": 10})
    if panel is _SPEED:
        speeds = experiment.chain.limits.velocity
        known = speeds[np.isfinite(speeds)]
        for limit in np.unique([known.min(), known.max()]) if len(known) else ():
            axes.axhline(float(limit), color="0.35", linewidth=0.8, linestyle=":")
        if len(known):
            axes.text(0.995, float(known.max()) * 1.1, "arm's limits", **note)
            top = max(top, 4.0 * float(known.max()))
    axes.set_ylim(panel.floor, min(max(top, 10.0 * panel.floor), panel.ceiling))


def name_waypoints(axes: Axes, run: Run) -> None:
    """The waypoints' names, above the axes."""
    start = 0.0
    for segment in run.experiment.path.segments:
        axes.text(
            start + 0.5 * segment.duration,
            1.02,
            segment.name,
            transform=axes.get_xaxis_transform(),
            ha="center",
            va="bottom",
            fontsize=8.5,
            color="0.35",
        )
        start += segment.duration
