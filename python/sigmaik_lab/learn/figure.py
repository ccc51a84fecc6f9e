"""The picture of `sigmaik learn show`. Needs matplotlib."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from matplotlib.colors import LogNorm
from matplotlib.figure import Figure
from numpy.typing import NDArray

from sigmaik._plotting import JOINT_COLOURS, empty_figure, plain_axes

from .episode import FPS, PHASES
from .rollout import DEMONSTRATOR, Rollout, Rollouts
from .summary import ALL_SEEDS, Summary, grouped

__all__ = ["results_figure"]

#: Rollouts that are drawn as trajectories, and σ_min/σ_max at the ends of the colours.
_DRAWN = 40
_SIGMA = LogNorm(1e-3, 0.2)


def results_figure(files: Sequence[Rollouts], rows: Sequence[Summary]) -> Figure:
    """Phases that are passed for each rule; trajectories coloured by σ_min/σ_max; a scene's speeds."""
    shown = _shown(rows)
    groups = {
        rule: rollouts for (policy, rule, region), rollouts in grouped(files).items() if (policy, region) == shown
    }
    rules = [row.rule for row in rows if (row.policy, row.region) == shown]
    name = "all policies" if shown[0] == ALL_SEEDS else shown[0]
    figure = empty_figure(12.0, 7.2, f"{name}, {shown[1]}: {len(groups[rules[0]])} scenes for each rule")
    best, other = rules[0], "stop" if "stop" in rules else rules[-1]
    grid = figure.add_gridspec(2, 6)
    _phases(figure.add_subplot(grid[0, :2]), [row for row in rows if (row.policy, row.region) == shown])
    left, right = figure.add_subplot(grid[0, 2:4]), figure.add_subplot(grid[0, 4:])
    for axes, rule in ((left, best), (right, other)):
        lines = _trajectories(axes, groups[rule], rule)
    figure.colorbar(lines, ax=[left, right], label="σ_min/σ_max", shrink=0.9)
    for axes, rule in ((figure.add_subplot(grid[1, :3]), best), (figure.add_subplot(grid[1, 3:]), other)):
        _speeds(axes, groups[rule][0], rule)
    return figure


def _shown(rows: Sequence[Summary]) -> tuple[str, str]:
    """All policies together where there are several, else a policy, else the demonstrator; of the first region."""
    order = sorted(rows, key=lambda r: (r.region != "edge", r.policy == DEMONSTRATOR, r.policy != ALL_SEEDS))
    return order[0].policy, order[0].region


def _phases(axes: Axes, rows: Sequence[Summary]) -> None:
    width = 0.8 / len(rows)
    for k, row in enumerate(rows):
        part = [100.0 * getattr(row, phase) / row.scenes for phase in PHASES]
        places = np.arange(len(PHASES)) + (k - 0.5 * (len(rows) - 1)) * width
        axes.bar(places, part, width, color=JOINT_COLOURS[k % len(JOINT_COLOURS)], label=row.rule)
    axes.set_xticks(range(len(PHASES)), PHASES)
    axes.set_ylim(0.0, 105.0)
    plain_axes(axes, "scenes in which the phase was passed, %")
    axes.legend(fontsize=8, frameon=False, loc="lower left")


def _trajectories(axes: Axes, rollouts: Sequence[Rollout], rule: str) -> LineCollection:
    """Tool positions from above."""
    pieces: list[NDArray[np.float32]] = []
    colours = []
    for rollout in rollouts[:_DRAWN]:
        points = rollout.tool[:, :2]
        pieces.extend(np.stack([points[:-1], points[1:]], axis=1))
        colours.append(0.5 * (rollout.sigma[:-1] + rollout.sigma[1:]))
    lines = LineCollection(pieces, cmap="viridis", norm=_SIGMA, linewidths=0.8)
    lines.set_array(np.concatenate(colours))
    axes.add_collection(lines)
    axes.autoscale()
    axes.set_aspect("equal")
    axes.set_title(f"{rule}: the tool from above", fontsize=10)
    axes.set_xlabel("x [m]", fontsize=9)
    plain_axes(axes, "y [m]")
    return lines


def _speeds(axes: Axes, rollout: Rollout, rule: str) -> None:
    time = np.arange(rollout.steps) / FPS
    for twist, style, label in ((rollout.asked, "--", "asked"), (rollout.achieved, "-", "achieved")):
        axes.plot(time, np.linalg.norm(twist[:, :3], axis=1), style, color=JOINT_COLOURS[0], label=label)
    plain_axes(axes, "tool speed [m/s]")
    axes.set_xlabel("time [s]", fontsize=9)
    axes.set_title(f"{rule}, scene {rollout.seed}: action and achieved twist", fontsize=10)
    sigma = axes.twinx()
    sigma.semilogy(np.arange(len(rollout.sigma)) / FPS, rollout.sigma, color=JOINT_COLOURS[1], linewidth=1.0)
    sigma.set_ylabel("σ_min/σ_max", color=JOINT_COLOURS[1])
    axes.legend(fontsize=8, frameon=False)
