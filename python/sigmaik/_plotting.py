"""Functions that all figures share. They need matplotlib but no display, and leave pyplot's global state alone."""

from __future__ import annotations

import io
import pathlib
from typing import Any, BinaryIO

from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from PIL import Image

from .files import write_atomically

__all__ = ["DASHES", "JOINT_COLOURS", "empty_figure", "limit_lines", "plain_axes", "save_figure"]

#: Joints' colours, base to tip: those of Okabe and Ito, which most colour-blind people can tell apart, and more.
JOINT_COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#7A5C3E", "#4D4D4D", "#7FBF3F")
DASHES = ("-", (0, (5, 1.5)), (0, (2, 1)), (0, (6, 1, 1, 1)), (0, (1, 1)), (0, (8, 2)))


def empty_figure(width: float, height: float, title: str | None = None, **style: Any) -> Figure:
    """A figure of width by height [inch] that can be saved without a display. style: of the title."""
    figure = Figure(figsize=(width, height), layout="constrained")
    FigureCanvasAgg(figure)
    if title is not None:
        figure.suptitle(title, **{"fontsize": 13, "fontweight": "bold", **style})
    return figure


def plain_axes(axes: Axes, label: str | None = None, size: float = 9) -> None:
    """A grid, small ticks, no frame above and to the right; with a label of the vertical axis where one is given."""
    axes.grid(True, which="major", color="0.88", linewidth=0.6)
    axes.tick_params(labelsize=size)
    axes.spines[["top", "right"]].set_visible(False)
    if label is not None:
        axes.set_ylabel(label)


def limit_lines(axes: Axes, top: float, label: str | None) -> None:
    """Draws the limits ±1 dashed, and shades from there to ±top; ticks have numbers only where there is a label."""
    for sign in (-1.0, 1.0):
        axes.axhline(sign, color="0.25", linewidth=0.9, linestyle=(0, (4, 3)))
        axes.axhspan(sign, sign * top, color="0.93", zorder=0)
    axes.set_ylim(-top, top)
    axes.spines[["top", "right"]].set_visible(False)
    axes.tick_params(labelsize=8, labelleft=label is not None)
    if label is not None:
        axes.set_ylabel(label)


def save_figure(figure: Figure, file: str | pathlib.Path, dpi: int = 110) -> pathlib.Path:
    """Writes a PNG of at most 256 colours, which keeps the file small. Returns the file's path."""
    buffer = io.BytesIO()
    figure.savefig(buffer, format="png", dpi=dpi, facecolor="white")
    buffer.seek(0)

    def write(stream: BinaryIO) -> None:
        image = Image.open(buffer).convert("RGB").quantize(256, Image.Quantize.FASTOCTREE, dither=Image.Dither.NONE)
        image.save(stream, format="PNG", optimize=True)

    return write_atomically(pathlib.Path(file), write)
