"""Figures of the tracking experiment. Needs matplotlib."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Literal

import numpy as np
from matplotlib.figure import Figure

from sigmaik._plotting import DASHES, empty_figure
from sigmaik._types import Array
from sigmaik_lab.colours import method_colour

from .experiment import Follow

__all__ = ["event_figure", "path_figure", "time_figure"]

# Okabe and Ito's colours.
_MODES = {"predict": "#0072B2", "interpolate": "#009E73", "hold": "#E69F00", "raw": "#D55E00", "true": "#000000"}


def time_figure(runs: Sequence[Follow], by: Literal["method", "mode"]) -> Figure:
    """Errors against the true target, and the largest joint jerk around, over time; a line per run.

    Grey: the target is out of reach. Hatched: the stream has stopped.
    """
    e = runs[0].experiment
    figure = empty_figure(9.0, 7.4)
    panels: Any = figure.subplots(3, 1, sharex=True)
    shared = runs[0].variant
    what = shared.mode if by == "method" else shared.method.label
    figure.suptitle(f"{e.robot}, {e.target}: {'rules' if by == 'method' else 'modes'}, with {what}", fontweight="bold")
    for i, run in enumerate(runs):
        v = run.variant
        label = v.method.label if by == "method" else v.mode + (", feed-forward" if v.feedforward else "")
        style: dict[str, Any] = {
            "color": method_colour(v.method) if by == "method" else _MODES[v.mode],
            "linestyle": DASHES[i % len(DASHES)] if by == "method" else "-",
            "linewidth": 1.8 if i == 0 else 1.1,
            "zorder": 3 if i == 0 else 2,
            "label": label,
        }
        panels[0].plot(e.t, np.maximum(1e3 * run.position_error, 1e-2), **style)
        panels[1].plot(e.t, np.maximum(np.degrees(run.orientation_error), 1e-2), **style)
        t, jerk = _envelope(e.t, np.abs(run.jerk).max(axis=1), round(0.1 * e.settings.rate))
        panels[2].plot(t, np.maximum(jerk, 1.0), **style)
    for panel, text in zip(
        panels, ("position error [mm]", "orientation error [°]", "joint jerk, largest\nin 0.1 s [rad/s³]"), strict=True
    ):
        panel.set_yscale("log")
        panel.set_ylabel(text)
        panel.grid(alpha=0.25)
        _shade(panel, runs[0])
    panels[0].set_ylim(bottom=0.05)
    panels[1].set_ylim(bottom=0.02)
    panels[2].set_xlabel("time [s]")
    panels[2].set_xlim(0.0, e.t[-1])
    figure.legend(
        *panels[0].get_legend_handles_labels(), loc="outside lower center", ncols=5, frameon=False, fontsize=9
    )
    return figure


def path_figure(run: Follow) -> Figure:
    """The target, its samples and the tip, from above and from the side."""
    e = run.experiment
    figure = empty_figure(10.0, 4.2)
    panels: Any = figure.subplots(1, 2)
    figure.suptitle(f"{e.robot}, {e.target}: the way of the tip, {run.variant.label}", fontweight="bold")
    target, tip = e.poses[:, :3, 3], run.tips[:, :3, 3]
    seen = np.array([frame.pose[:3, 3] for frame in e.frames])
    away = np.where(e.reachable[:, None], np.nan, target)
    for panel, (a, b), names in zip(panels, ((0, 1), (0, 2)), (("x", "y"), ("x", "z")), strict=True):
        panel.plot(seen[:, a], seen[:, b], ".", color="#AAAAAA", markersize=3.0, label="samples")
        panel.plot(target[:, a], target[:, b], color="#D55E00", linewidth=1.2, label="target")
        panel.plot(away[:, a], away[:, b], color="#D55E00", linewidth=4.0, alpha=0.3, label="target out of reach")
        panel.plot(tip[:, a], tip[:, b], color="#0072B2", linewidth=1.2, label="tip")
        panel.plot(0.0, 0.0, "k+", markersize=9.0, label="base")
        both = np.concatenate([target, tip, np.zeros((1, 3))])
        for set_limits, axis in ((panel.set_xlim, a), (panel.set_ylim, b)):
            set_limits(both[:, axis].min() - 0.1, both[:, axis].max() + 0.1)
        panel.set_aspect("equal", adjustable="box")
        panel.set_xlabel(f"{names[0]} [m]")
        panel.set_ylabel(f"{names[1]} [m]")
        panel.grid(alpha=0.25)
    figure.legend(
        *panels[0].get_legend_handles_labels(), loc="outside lower center", ncols=5, frameon=False, fontsize=9
    )
    return figure


def event_figure(runs: Sequence[Follow]) -> Figure:
    """Close by: around a wrong sample, and where the stream stops and goes on. The tip's coordinates over time."""
    e = runs[0].experiment
    figure = empty_figure(10.0, 5.4)
    wrong = [f for f in e.frames if f.outlier]
    # Of the wrong samples that come while all else is well, the one that is farthest off.
    offs = []
    for f in wrong:
        k = _cycle(runs[0], f.stamp)
        well = e.judged[k] and e.reachable[k] and not e.gap[0] - 1.2 < f.stamp < e.gap[1]
        offs.append(float(np.linalg.norm(f.pose[:3, 3] - e.poses[k, :3, 3])) if well else 0.0)
    windows = []
    if wrong:
        stamp = wrong[int(np.argmax(offs))].stamp
        windows.append(("a wrong sample", stamp - 0.4, stamp + 1.2))
    if e.gap[1] > e.gap[0]:
        windows.append(("the stream stops, and goes on", e.gap[0] - 0.5, min(e.t[-1], e.gap[1] + 1.5)))
    panels: Any = figure.subplots(1, len(windows), squeeze=False)[0]
    figure.suptitle(f"{e.robot}, {e.target}, {runs[0].variant.method.label}: events", fontweight="bold")
    for panel, (title, begin, end) in zip(panels, windows, strict=True):
        part = slice(_cycle(runs[0], begin), _cycle(runs[0], end))
        # The coordinate that shows most: the target's, or the wrong sample's.
        shown = np.ptp(e.poses[part, :3, 3], axis=0)
        if title.startswith("a wrong"):
            frame = wrong[int(np.argmax(offs))]
            shown = np.abs(frame.pose[:3, 3] - e.poses[_cycle(runs[0], frame.stamp), :3, 3])
        axis = int(np.argmax(shown))
        panel.plot(e.t[part], e.poses[part, axis, 3], color="#777777", linewidth=4.0, alpha=0.45, label="target")
        samples = [(f.arrival, f.pose[axis, 3], f.outlier) for f in e.frames if begin <= f.arrival <= end]
        for good, mark in ((True, "."), (False, "x")):
            chosen = [(t, x) for t, x, outlier in samples if outlier != good]
            panel.plot(
                [t for t, _ in chosen], [x for _, x in chosen], mark, color="#333333", markersize=4.0 if good else 8.0,
                label="samples, as they come" if good else "wrong samples",
            )  # fmt: skip
        for run in runs:
            label = run.variant.mode + (", feed-forward" if run.variant.feedforward else "")
            panel.plot(
                e.t[part],
                run.tips[:-1][part, axis, 3],
                color=_MODES[run.variant.mode],
                linewidth=1.5,
                label=f"tip, {label}",
            )
        panel.set_title(title, fontsize=11)
        panel.set_xlabel("time [s]")
        panel.set_ylabel(f"{'xyz'[axis]} [m]")
        panel.set_xlim(begin, end)
        panel.grid(alpha=0.25)
        _shade(panel, runs[0])
    handles, labels = panels[0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower center", ncols=4, frameon=False, fontsize=9)
    return figure


def _cycle(run: Follow, time: float) -> int:
    e = run.experiment
    return int(np.clip(round(time * e.settings.rate), 0, len(e.poses) - 1))


def _envelope(t: Array, values: Array, width: int) -> tuple[Array, Array]:
    """The largest of every `width` values."""
    count = len(values) // width
    return t[: count * width : width], values[: count * width].reshape(count, width).max(axis=1)


def _shade(panel: Any, run: Follow) -> None:
    e = run.experiment
    edges = np.flatnonzero(np.diff(np.concatenate([[0], ~e.reachable, [0]]).astype(int)))
    for begin, end in edges.reshape(-1, 2):
        panel.axvspan(begin / e.settings.rate, end / e.settings.rate, color="#000000", alpha=0.08, linewidth=0.0)
    if e.gap[1] > e.gap[0]:
        panel.axvspan(*e.gap, facecolor="none", edgecolor="#999999", hatch="///", linewidth=0.0)
