"""A figure of the Monte Carlo study. Needs matplotlib."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from matplotlib.figure import Figure

from sigmaik._plotting import empty_figure

from .experiment import MonteCarlo, Row

__all__ = ["study_figure"]

# Okabe and Ito's colours.
_COLOURS = {"none": "#555555", "manipulability": "#D55E00", "potential": "#0072B2"}


def study_figure(study: MonteCarlo, rows: Sequence[Row]) -> Figure:
    """How manipulability, duration and path length are distributed, for each objective.

    Least manipulability of a motion: dashed at the nodes, solid between them too.
    """
    title = f"{study.name}, {study.samples} pairs, time weight {study.time_weight:g}"
    figure = empty_figure(11.0, 3.8, title, fontsize=12)
    panels = figure.subplots(1, 3)
    for objective in study.objectives:
        good = [row for row in rows if row.objective == objective and row.status != "failed"]
        if not good:
            continue
        share = np.arange(1, len(good) + 1) / len(good)
        colour = _COLOURS[objective]
        panels[0].plot(np.sort([r.m_dense for r in good]), share, color=colour, label=objective)
        panels[0].plot(np.sort([r.m_min for r in good]), share, color=colour, linestyle="--", linewidth=1.0)
        panels[1].plot(np.sort([r.duration for r in good]), share, color=colour)
        panels[2].plot(np.sort([r.l_p for r in good]), share, color=colour)
    panels[0].set_xscale("log")
    panels[0].set_xlim(left=1e-7)
    panels[0].set_xlabel("least manipulability of a motion")
    panels[1].set_xlabel("t_F [s]")
    panels[2].set_xlabel("length of the flange's path [m]")
    panels[0].set_ylabel("part of the motions below")
    for panel in panels:
        panel.grid(alpha=0.3)
        panel.set_ylim(0.0, 1.0)
    panels[0].legend(frameon=False, loc="upper left")
    return figure
