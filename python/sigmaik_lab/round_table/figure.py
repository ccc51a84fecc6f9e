"""A figure of the motions round the table. Needs matplotlib."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from matplotlib.figure import Figure
from mpl_toolkits.mplot3d.art3d import Poly3DCollection  # type: ignore[import-untyped]

from sigmaik._plotting import empty_figure

from .experiment import TABLE, Along, RoundTable

__all__ = ["round_table_figure"]

# Okabe and Ito's colours.
_COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7")


def round_table_figure(task: RoundTable, motions: Mapping[str, Along]) -> Figure:
    """The arm along each motion in 3-D, start dark and goal light; below, λ₁, m, κ and the distance on the way."""
    figure = empty_figure(4.6 * max(len(motions), 2), 8.4)
    parts: Any = figure.subfigures(2, 1, height_ratios=(1.35, 1.0))
    upper, lower = parts
    for i, (name, motion) in enumerate(motions.items()):
        axes = upper.add_subplot(1, len(motions), i + 1, projection="3d")
        axes.set_title(f"{name} the index", fontsize=11, y=0.94)
        axes.add_collection3d(Poly3DCollection(_faces(), facecolor="#999999", edgecolor="#555555", alpha=0.5))
        tool = task.chain.pose(motion.q)[:, :3, 3]
        axes.plot(*tool.T, color=_COLOURS[i], linewidth=1.6)
        for k in np.linspace(0, len(motion.q) - 1, 9).astype(int):
            centers = np.asarray(task.spheres.centers(motion.q[k]))
            axes.plot(*centers.T, color="black", linewidth=3.0, alpha=0.75 - 0.6 * k / len(motion.q))
        axes.set_box_aspect((1, 1, 1))
        axes.set_xlim(-0.4, 0.9)
        axes.set_ylim(-0.65, 0.65)
        axes.set_zlim(0.0, 1.3)
        axes.set_xlabel("x [m]")
        axes.set_ylabel("y [m]")
        axes.view_init(elev=18.0, azim=-60.0)
    panels = lower.subplots(1, 4)
    for i, (name, motion) in enumerate(motions.items()):
        for panel, values in zip(panels, (motion.lambda_1, motion.m, motion.kappa, motion.distance), strict=True):
            panel.plot(motion.s, values, color=_COLOURS[i], linewidth=1.4, label=name)
    for panel, text in zip(panels, ("λ₁", "m", "κ", "distance from the table [m]"), strict=True):
        panel.set_title(text, fontsize=10)
        panel.set_xlabel("part of the way")
        panel.grid(alpha=0.3)
    panels[3].axhline(0.0, color="black", linewidth=0.8)
    panels[0].legend(frameon=False, fontsize=8)
    return figure


def _faces() -> list[list[tuple[float, float, float]]]:
    center, half = np.asarray(TABLE.pose)[:3, 3], 0.5 * np.asarray(TABLE.size)
    faces = []
    for axis in range(3):
        for side in (-1.0, 1.0):
            corners = []
            for a, b in ((-1, -1), (-1, 1), (1, 1), (1, -1)):
                corner = np.insert(np.array([a, b], dtype=np.float64), axis, side)
                x, y, z = center + corner * half
                corners.append((float(x), float(y), float(z)))
            faces.append(corners)
    return faces
