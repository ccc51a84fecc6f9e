"""Figures of the cart experiment. Needs matplotlib."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from sigmaik import _core
from sigmaik._plotting import empty_figure
from sigmaik._types import Array
from sigmaik.planning.cart import CartMotion

from .experiment import METHODS, CartExperiment, CartRun, cart_xy, density

__all__ = ["joints_figure", "laws_figure", "plane_figure"]

# Okabe and Ito's colours.
_JOINT_COLOURS = ("#000000", "#E69F00", "#56B4E9", "#009E73", "#F0E442", "#0072B2", "#D55E00")
_REGION = "#F6C99B"
_LAW = "#D55E00"


def laws_figure(
    e: CartExperiment,
    runs: Sequence[CartRun],
    linear: Sequence[tuple[int, Array]],
    admissible: Sequence[tuple[int, Array]],
) -> Figure:
    """Cart over time beside the forbidden region: the paper's figures 3, 4, 5 and 9, and the exact law.

    linear, admissible: pairs of a number of iterations and the law of the gradient descent, from either guess.
    """
    figure = empty_figure(13.0, 7.2, f"cart, {e.variant}", fontsize=12)
    panels = figure.subplots(2, 4).ravel()
    laws = {run.method: run.motion for run in runs if isinstance(run.motion, CartMotion)}
    lower, upper = _core.forbidden_intervals(e.flange_xy, e.radius)

    for panel, title, stages in (
        (panels[0], "gradient, linear guess (figure 3)", linear),
        (panels[4], "gradient, admissible guess (figure 9)", admissible),
    ):
        _region(panel, e, lower, upper)
        for k, (iterations, x) in enumerate(stages):
            shade = str(0.75 - 0.6 * k / max(1, len(stages) - 1))
            last = k + 1 == len(stages)
            panel.plot(
                e.s * e.duration,
                x,
                color=_LAW if last else shade,
                linewidth=2.0 if last else 1.0,
                label=f"{iterations}",
            )
        panel.set_title(title, fontsize=10)
        panel.legend(title="iterations", fontsize=7, title_fontsize=7, loc="lower right")

    middle = int(np.flatnonzero(lower < upper)[len(np.flatnonzero(lower < upper)) // 2])
    low, high = lower[middle], upper[middle]
    x = np.linspace(low - 0.25 * (high - low), high + 0.25 * (high - low), 401)
    panels[1].plot(x, density(x, low, high), color=_LAW)
    panels[1].set_title(f"density H at t = {e.s[middle] * e.duration:.0f} s (figure 4)", fontsize=10)
    panels[1].set_xlabel("cart [m]")

    places = {
        "exact": (panels[2], ""),
        "linear": (panels[3], " (figure 5b)"),
        "redundancy": (panels[5], " (figure 5c)"),
    }
    places |= {"gradient": (panels[6], ""), "gradient-admissible": (panels[7], "")}
    for method, (panel, note) in places.items():
        if method not in laws:
            panel.set_axis_off()
            continue
        _region(panel, e, lower, upper)
        panel.plot(e.s * e.duration, laws[method].x, color=_LAW, linewidth=1.8)
        note = " (figure 5a)" if method == "exact" else note
        panel.set_title(METHODS[method] + note, fontsize=10)
    for panel in panels:
        panel.grid(alpha=0.3)
    return figure


def joints_figure(e: CartExperiment, runs: Sequence[CartRun]) -> Figure:
    """Cart and joints over time, taught values dashed: the paper's figures 6 to 8, and the other methods' runs."""
    figure = empty_figure(
        4.2 * len(runs), 4.2, f"cart [m] and joints [rad], {e.variant}; taught values dashed", fontsize=12
    )
    numbers = {"linear": " (figure 6)", "redundancy": " (figure 7)", "exact": " (figure 8)"}
    panels = figure.subplots(1, len(runs), sharey=True, squeeze=False)[0]
    for panel, run in zip(panels, runs, strict=True):
        t = e.s[: len(run.q)] * e.duration
        for k, colour in enumerate(_JOINT_COLOURS):
            panel.plot(t, run.q[:, k], color=colour, label=f"q{k}")
            panel.axhline(e.taught[1, k], color=colour, linestyle="--", linewidth=0.8)
        if len(run.q) < e.samples:
            panel.axvline(t[-1], color="#CC0000", linewidth=1.0)
            panel.text(t[-1], 2.2, " the arm cannot follow", fontsize=8, color="#CC0000")
        panel.set_title(METHODS[run.method] + numbers.get(run.method, ""), fontsize=10)
        panel.set_xlabel("t [s]")
        panel.set_xlim(0.0, e.duration)
        panel.grid(alpha=0.3)
    panels[0].set_ylim(-2.6, 2.6)
    handles, labels = panels[0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower center", ncol=7, fontsize=8, frameon=False)
    return figure


def plane_figure(e: CartExperiment, runs: Sequence[CartRun]) -> Figure:
    """The cart with one axis and with two: from above, as seen from the flange, and both coordinates over time."""
    figure = empty_figure(13.0, 4.6, f"cart with one axis and with two, {e.variant}", fontsize=12)
    above, seen, over_time = figure.subplots(1, 3)
    f = e.flange_xy
    angle = np.linspace(0.0, 2.0 * np.pi, 181)
    circle = e.radius * np.column_stack([np.cos(angle), np.sin(angle)])
    some = np.linspace(0, e.samples - 1, 6).astype(int)
    above.plot(*f.T, color="black", linewidth=1.2, label="flange")
    for i in some:
        above.plot(*(f[i] + circle).T, color="#B98B52", linewidth=0.7, label="radius about it" if i == 0 else None)
    seen.fill(*circle.T, color=_REGION, label="forbidden")
    t = e.s * e.duration
    for run, colour in zip(runs, ("#0072B2", _LAW), strict=True):
        c = cart_xy(run.motion)
        above.plot(*c.T, color=colour, linewidth=1.8, label=METHODS[run.method])
        above.plot(*c[some].T, "o", color=colour, markersize=4)
        # Both laws can follow the same curve at different speeds.
        style = "--" if run.method == "plane" else "-"
        seen.plot(*(c - f).T, color=colour, linewidth=1.8, linestyle=style, label=METHODS[run.method])
        over_time.plot(t, c[:, 0], color=colour, linewidth=1.8, label=f"x, {METHODS[run.method]}")
        if np.any(c[:, 1]):
            over_time.plot(t, c[:, 1], color=colour, linewidth=1.8, linestyle="--", label=f"y, {METHODS[run.method]}")
    above.set_title("from above; dots and circles at six times", fontsize=10)
    seen.set_title("cart as seen from the flange", fontsize=10)
    over_time.set_title("over time", fontsize=10)
    for panel in (above, seen):
        panel.set_aspect("equal")
        panel.set_xlabel("x [m]")
        panel.set_ylabel("y [m]")
    over_time.set_xlabel("t [s]")
    over_time.set_ylabel("cart [m]")
    for panel in (above, seen, over_time):
        panel.grid(alpha=0.3)
        panel.legend(fontsize=7, loc="best")
    return figure


def _region(panel: Axes, e: CartExperiment, lower: Array, upper: Array) -> None:
    some = lower < upper
    panel.fill_between(
        e.s * e.duration, np.where(some, lower, np.nan), np.where(some, upper, np.nan), color=_REGION, linewidth=0.0
    )
    panel.set_xlabel("t [s]")
    panel.set_ylabel("cart [m]")
    panel.set_xlim(0.0, e.duration)
    panel.set_ylim(e.cart_range[0] - 0.05, e.cart_range[1] + 0.05)
