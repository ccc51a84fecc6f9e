"""Figures of experiments, in the style of the J-PARSE paper's. Needs matplotlib.

Nothing here needs a display, and pyplot's global state is left alone.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from numpy.typing import NDArray

from ._plotting import DASHES, JOINT_COLOURS, limit_lines, save_figure
from ._types import Array

if TYPE_CHECKING:
    from .experiments.limits import Trace
    from .experiments.methods import NamedMethod
    from .experiments.reach import Run

__all__ = ["experiment_figure", "limits_figure", "method_colour", "save_figure"]

# Okabe and Ito's colours, which most colour-blind people can tell apart. J-PARSE is the strong blue
# everywhere.
_COLOURS = {
    "jparse": "#0072B2",
    "pinv": "#D55E00",
    "dls": "#009E73",
    "adaptive-dls": "#7FBF3F",
    "sdls": "#CC79A7",
    "projection": "#E69F00",
    "safety": "#56B4E9",
    "safety-projection": "#7A5C3E",
}
_SWEEP = ("#9CC9E8", "#5BA7D6", "#2E86C1", "#1B5E9E", "#123A6B", "#081D40")


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


def experiment_figure(runs: Sequence[Run], title: str | None = None) -> Figure:
    """Position error, orientation error, inverse condition number and joint speed over time, a line per run.

    All runs are of one experiment. Runs without and with the arm's speed limits stand side by side. Where the
    target moves along a line, the distance from it has a panel of its own. Scales are logarithmic; waypoints
    are marked, as are γ and the least and the largest of the joints' speed limits.
    """
    if not runs:
        raise ValueError("no run to draw")
    experiment = runs[0].experiment
    moving = experiment.path.line is not None
    panels = [_DEVIATION if moving else _POSITION, _ORIENTATION, _CONDITION, _SPEED]
    columns = sorted({run.velocity_limits for run in runs})

    figure = Figure(figsize=(6.4 * len(columns) + 0.6, 2.1 * len(panels) + 1.4), layout="constrained")
    FigureCanvasAgg(figure)
    grid = figure.subplots(len(panels), len(columns), sharex=True, sharey="row", squeeze=False)
    figure.suptitle(title or f"{experiment.robot}: {experiment.path.name}", fontsize=13, fontweight="bold")

    styles = _styles(runs)
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
        _name_waypoints(grid[0][column], runs[0])

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


def limits_figure(traces: Sequence[Trace], seconds: tuple[float, float] | None = None) -> Figure:
    """Joint positions, speeds and accelerations as parts of their limits, and the tool's path, per variant.

    All traces are of one trial. Limits are dashed, and what is beyond is shaded; a curve that leaves its
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

    figure = Figure(figsize=(3.0 * len(traces) + 1.0, 9.6), layout="constrained")
    FigureCanvasAgg(figure)
    grid = figure.subplots(4, len(traces), squeeze=False, gridspec_kw={"height_ratios": [1, 1, 1, 1.25]})
    figure.suptitle(
        f"{first.experiment.robot}, {first.scenario}: {trial.name}",
        fontsize=13,
        fontweight="bold",
        x=0.01,
        ha="left",
    )
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


def _layer(run: Run) -> tuple[bool, bool]:
    return run.method.family == "jparse", run.method.family != "pinv"


def method_colour(method: NamedMethod) -> str:
    """A colour a family, the same in all figures."""
    return _COLOURS.get(method.family, "black")


def _styles(runs: Sequence[Run]) -> dict[str, tuple[str, object]]:
    """Colour by family; variants of a family differ in their dashes, and J-PARSE's variants in their blue."""
    families: dict[str, list[str]] = {}
    for run in runs:
        variants = families.setdefault(run.method.family, [])
        if run.method.label not in variants:
            variants.append(run.method.label)
    styles: dict[str, tuple[str, object]] = {}
    for family, variants in families.items():
        for i, label in enumerate(variants):
            colour = _COLOURS.get(family, "black")
            dash: object = DASHES[i % len(DASHES)]
            if family == "jparse" and len(variants) > 2:
                colour, dash = _SWEEP[round(i * (len(_SWEEP) - 1) / (len(variants) - 1))], "-"
            styles[label] = (colour, dash)
    return styles


def _decorate(axes: Axes, panel: _Panel, run: Run, first: bool) -> None:
    experiment = run.experiment
    axes.set_yscale("log")
    axes.grid(True, which="major", color="0.88", linewidth=0.6)
    axes.tick_params(labelsize=9)
    axes.spines[["top", "right"]].set_visible(False)
    if first:
        axes.set_ylabel(panel.label)
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


def _name_waypoints(axes: Axes, run: Run) -> None:
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
