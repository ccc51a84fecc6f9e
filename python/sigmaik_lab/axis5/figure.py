"""Figures of the axis-5 experiments, after the paper's figures 5 to 18.

Needs matplotlib.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from numpy.typing import NDArray

from sigmaik._plotting import empty_figure, plain_axes
from sigmaik._types import Array

from .experiment import VARIANTS, Track

__all__ = ["axis_figure", "error_figure", "overview_figure"]

# Okabe and Ito's colours. The closed form is orange everywhere.
_COLOURS = {
    "closed": "#D55E00",
    "constrained": "#0072B2",
    "no-beta": "#CC79A7",
    "scaled": "#009E73",
    "scaled-exact": "#8C6D00",
}


def axis_figure(tracks: Sequence[Track], joint: int) -> Figure:
    """Position, difference, speed and acceleration of a joint: a column per variant, against the closed form.

    The difference is to the closed form at the same point of the path. Limits are dashed; curves far beyond a
    limit are cut off, with a note. Variants that did not finish are left out.
    """
    closed, others = _split(tracks)
    chain = closed.motion.chain
    labels = ("position [°]", "difference [°]", "speed [rad/s]", "acceleration [rad/s²]")
    figure, grid = _figure(4, len(others), 3.3 * len(others) + 0.8, 8.2)
    figure.suptitle(f"Example {closed.motion.example}, axis {joint + 1}", fontsize=13, fontweight="bold")
    shown = [closed, *others]
    speeds, accelerations = [t.qdot[:, joint] for t in shown], [t.qddot[:, joint] for t in shown]
    end = max(track.t[-1] for track in shown)
    for column, track in enumerate(others):
        colour = _COLOURS[track.variant]
        panels: list[Axes] = list(grid[:, column])
        panels[0].set_title(VARIANTS[track.variant], fontsize=11)
        panels[0].plot(closed.t, np.degrees(closed.q[:, joint]), color=_COLOURS["closed"], linewidth=1.1)
        panels[0].plot(track.t, np.degrees(track.q[:, joint]), color=colour, linewidth=1.4)
        reference = np.interp(track.clock, closed.t, closed.q[:, joint])
        panels[1].plot(track.t, np.degrees(track.q[:, joint] - reference), color=colour, linewidth=1.4)
        for axes, curves, limit in (
            (panels[2], speeds, float(chain.limits.velocity[joint])),
            (panels[3], accelerations, float(chain.limits.acceleration[joint])),
        ):
            axes.plot(closed.t, curves[0], color=_COLOURS["closed"], linewidth=1.0)
            axes.plot(track.t, curves[column + 1], color=colour, linewidth=1.1)
            _limit(axes, limit, curves)
        panels[3].set_xlabel("time [s]")
        panels[3].set_xlim(-0.02 * end, end)
    for row, label in enumerate(labels):
        grid[row, 0].set_ylabel(label)
    _legend(figure, shown, solid=True)
    return figure


def error_figure(tracks: Sequence[Track]) -> Figure:
    """Orientation error, its change in a sample, position error and ϑ: a column per variant."""
    _, others = _split(tracks)
    figure, grid = _figure(4, len(others), 3.3 * len(others) + 0.8, 8.2)
    figure.suptitle(f"Example {others[0].motion.example}, errors of the path", fontsize=13, fontweight="bold")
    names = ("about x", "about y", "about z")
    shades = ("#0072B2", "#D55E00", "#009E73")
    for column, track in enumerate(others):
        panels: list[Axes] = list(grid[:, column])
        panels[0].set_title(VARIANTS[track.variant], fontsize=11)
        angles = np.degrees(track.path_error[:, 3:])
        change = np.diff(angles, axis=0, prepend=angles[:1])
        for axis in range(3):
            panels[0].plot(track.t, angles[:, axis], color=shades[axis], linewidth=1.2, label=names[axis])
            panels[1].plot(track.t, change[:, axis], color=shades[axis], linewidth=1.0)
        panels[0].plot(track.t, np.degrees(track.orientation_error), color="0.25", linewidth=1.0, label="angle")
        panels[2].plot(track.t, np.maximum(1e6 * track.position_error, 1e-7), color="0.25", linewidth=1.0)
        panels[2].set_yscale("log")
        panels[2].set_ylim(1e-7, 1e1)
        panels[3].plot(track.t, track.time_scale, color="0.25", linewidth=1.2)
        panels[3].set_ylim(-0.03, 1.03)
        panels[3].set_xlabel("time [s]")
        panels[3].set_xlim(0.0, max(o.t[-1] for o in others))
    for row, label in enumerate(
        ("orientation error [°]", "its change in\na sample [°]", "position error [µm]", "time scaling ϑ")
    ):
        grid[row, 0].set_ylabel(label)
    handles, labels = grid[0, 0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower center", ncols=4, frameon=False)
    return figure


def overview_figure(tracks: Sequence[Track]) -> Figure:
    """Axis 4 as it passes the singularity, the orientation error and ϑ, all variants that finished."""
    closed, others = _split(tracks)
    finished = [closed, *others]
    by_name = {track.variant: track for track in finished}
    motion = closed.motion
    limits = motion.chain.limits
    end = max(track.t[-1] for track in finished)
    first = np.flatnonzero(others[0].optimised)
    begin = float(others[0].t[first[0]]) if len(first) else 0.0
    window = (begin - 0.05, min(end, begin + 0.75))

    figure, grid = _figure(3, 2, 11.5, 8.6, sharex=False)
    way = "there and back, close by" if motion.back else "straight across"
    figure.suptitle(f"Example {motion.example}: {way} the axis-5 singularity", fontsize=13, fontweight="bold")

    for track in finished:
        style = _style(track)
        grid[0, 0].plot(track.t, np.degrees(track.q[:, 3]), **style)
        grid[0, 1].plot(track.t, np.degrees(track.orientation_error), **style)
        if track.variant in ("scaled", "scaled-exact"):
            grid[1, 1].plot(track.t, track.time_scale, **style)
    for axes, label in ((grid[0, 0], "axis 4 [°]"), (grid[0, 1], "orientation error [°]"), (grid[1, 1], "ϑ")):
        axes.set_ylabel(label)
        axes.set_xlim(-0.02 * end, end)
    grid[1, 1].set_ylim(-0.03, 1.03)
    _panel_title(grid[1, 1], "how hard it is: time scaling")

    for axes, variants, rate, limit, title in (
        (grid[1, 0], ("closed", "constrained", "scaled"), "qdot", limits.velocity[3], "speed of axis 4"),
        (grid[2, 0], ("closed", "constrained"), "qddot", limits.acceleration[3], "acceleration of axis 4"),
        (
            grid[2, 1],
            ("no-beta", "constrained"),
            "qdot",
            limits.velocity[3],
            "speed of axis 4: with β, without",
        ),
    ):
        shown = [by_name[name] for name in variants if name in by_name]
        curves = [getattr(track, rate)[:, 3] for track in shown]
        for track, curve in zip(shown, curves, strict=True):
            axes.plot(track.t, curve, **_style(track))
        axes.set_xlim(*window)
        axes.set_ylabel("[rad/s]" if rate == "qdot" else "[rad/s²]")
        _limit(axes, float(limit), curves)
        _panel_title(axes, title)
    for axes in grid[2]:
        axes.set_xlabel("time [s]")
    _legend(figure, finished)
    return figure


def _split(tracks: Sequence[Track]) -> tuple[Track, list[Track]]:
    """The closed form, and the others that finished."""
    closed = next(track for track in tracks if track.variant == "closed")
    others = [track for track in tracks if track.variant != "closed" and track.finished]
    if not others:
        raise ValueError("no variant reached the end; there is nothing to draw")
    return closed, others


def _figure(
    rows: int, columns: int, width: float, height: float, sharex: bool = True
) -> tuple[Figure, NDArray[np.object_]]:
    figure = empty_figure(width, height)
    grid = figure.subplots(rows, columns, sharex=sharex, sharey="row" if sharex else False, squeeze=False)
    for axes in grid.flat:
        plain_axes(axes)
    return figure, grid


def _style(track: Track) -> dict[str, Any]:
    main = track.variant == "constrained"
    return {
        "color": _COLOURS[track.variant],
        "linewidth": 1.7 if main else 1.2,
        "zorder": 3 if main else 2,
        "linestyle": (0, (4, 1.5)) if track.variant == "scaled-exact" else "-",
    }


def _limit(axes: Axes, limit: float, curves: Sequence[Array]) -> None:
    """Draws ±limit where a curve comes near the limit, and cuts off curves far beyond."""
    peak = max(float(np.abs(curve).max()) for curve in curves)
    if peak < 0.4 * limit:
        _note(axes, f"limit ±{limit:.3g}", "0.35")
        return
    for sign in (-1.0, 1.0):
        axes.axhline(sign * limit, color="0.35", linewidth=0.9, linestyle="--", zorder=1)
    top = limit * (1.45 if peak > limit * (1.0 + 1e-9) else 1.15)
    axes.set_ylim(-top, top)
    if peak > top:
        times = f"{peak / limit:.{1 if peak < 100.0 * limit else 0}f}"
        _note(axes, f"cut off: up to {times} × limit", _COLOURS["closed"])


def _note(axes: Axes, text: str, colour: str) -> None:
    box = {"facecolor": "white", "edgecolor": "none", "alpha": 0.8, "pad": 1.0}
    axes.text(0.99, 0.985, text, transform=axes.transAxes, ha="right", va="top", fontsize=8, color=colour, bbox=box)


def _panel_title(axes: Axes, text: str) -> None:
    axes.set_title(text, fontsize=10, loc="left", color="0.25")


def _legend(figure: Figure, tracks: Sequence[Track], solid: bool = False) -> None:
    handles = []
    for track in tracks:
        style = _style(track)
        if solid:
            style["linestyle"] = "-"
        handles.append(Line2D([], [], label=VARIANTS[track.variant], **style))
    handles.append(Line2D([], [], color="0.35", linewidth=0.9, linestyle="--", label="the joint's limit"))
    figure.legend(handles=handles, loc="outside lower center", ncols=len(handles), frameon=False)
