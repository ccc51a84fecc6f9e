"""Figures of experiments, in the style of the J-PARSE paper's. Needs matplotlib, of the extra "demo".

Nothing here needs a display, and pyplot's global state is left alone.
"""

from __future__ import annotations

import io
import pathlib
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, BinaryIO

import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from numpy.typing import NDArray
from PIL import Image

from .experiments.storage import write_atomically

if TYPE_CHECKING:
    from .experiments.reach import Run

__all__ = ["experiment_figure", "save_figure"]

Array = NDArray[np.float64]

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
_DASHES = ("-", (0, (5, 1.5)), (0, (2, 1)), (0, (6, 1, 1, 1)), (0, (1, 1)), (0, (8, 2)))
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


def save_figure(figure: Figure, file: str | pathlib.Path, dpi: int = 110) -> pathlib.Path:
    """Writes a PNG of at most 256 colours, which keeps it small. Returns the file's path."""
    buffer = io.BytesIO()
    figure.savefig(buffer, format="png", dpi=dpi, facecolor="white")
    buffer.seek(0)

    def write(stream: BinaryIO) -> None:
        image = (
            Image.open(buffer)
            .convert("RGB")
            .quantize(256, Image.Quantize.FASTOCTREE, dither=Image.Dither.NONE)
        )
        image.save(stream, format="PNG", optimize=True)

    return write_atomically(pathlib.Path(file), write)


def _layer(run: Run) -> tuple[bool, bool]:
    return run.method.family == "jparse", run.method.family != "pinv"


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
            dash: object = _DASHES[i % len(_DASHES)]
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
