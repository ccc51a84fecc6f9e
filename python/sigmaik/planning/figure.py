"""A trajectory as a figure. Needs matplotlib."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from sigmaik import indices
from sigmaik._plotting import DASHES, JOINT_COLOURS, empty_figure, limit_lines
from sigmaik._types import Array

if TYPE_CHECKING:
    from sigmaik._core import Chain, Trajectory

__all__ = ["trajectory_figure"]

_STEP_SAMPLES = 10  # drawn between two samples of a trajectory
_CROSSING = "#D55E00"


def trajectory_figure(trajectory: Trajectory, chain: Chain | None = None) -> Figure:
    """Positions, speeds and accelerations of all joints over time, between the trajectory's samples too, a line per
    joint.

    With a chain the values are parts of the chain's limits, ±1, and 0 is the middle of a position's range. A joint
    without the limit is named and not drawn; where no joint has the limit, values have the joints' own units. Below are
    σ_min and manipulability √det(JJᵀ) along the way, with the crossings of singular sets that the trajectory knows.

    ValueError where the trajectory is empty or the chain has other joints.
    """
    if trajectory.t.size == 0:
        raise ValueError(f"nothing to draw: the trajectory is empty, its plan {trajectory.status}")
    n = trajectory.q.shape[1]
    if chain is not None and chain.dof != n:
        raise ValueError(f"the trajectory has {n} joints, the chain {chain.dof}")
    nodes = trajectory.t
    parts = np.linspace(0.0, 1.0, _STEP_SAMPLES, endpoint=False)
    t = np.append((nodes[:-1, None] + np.diff(nodes)[:, None] * parts).ravel(), nodes[-1])
    names = chain.joint_names if chain is not None else tuple(f"joint {i + 1}" for i in range(n))

    count = 3 if chain is None else 5
    figure = empty_figure(8.0, 1.9 * count + 1.0)
    panels: list[Axes] = list(figure.subplots(count, 1, sharex=True))
    _draw_joints(panels[:3], trajectory, t, chain, names)
    if chain is not None:
        _draw_indices(panels[3:], trajectory, t, chain)
    for axes in panels:
        axes.spines[["top", "right"]].set_visible(False)
        axes.tick_params(labelsize=8)
    panels[-1].set_xlabel("time [s]")
    if t[-1] > t[0]:
        panels[-1].set_xlim(t[0], t[-1])
    shown = {
        label: handle for axes in panels[:3] for handle, label in zip(*axes.get_legend_handles_labels(), strict=True)
    }
    figure.legend(
        [shown[name] for name in names if name in shown],
        [name for name in names if name in shown],
        loc="outside lower center",
        ncols=min(len(shown), 8),
        frameon=False,
        fontsize=9,
    )
    return figure


def _draw_joints(
    panels: list[Axes], trajectory: Trajectory, t: Array, chain: Chain | None, names: tuple[str, ...]
) -> None:
    """Positions, speeds and accelerations, as parts of the chain's limits where there are any."""
    q, qdot, qddot = trajectory.sample(t)
    n = q.shape[1]
    units = _joint_units(chain)
    middle, position, velocity, acceleration = np.zeros(n), np.full(n, np.inf), np.full(n, np.inf), np.full(n, np.inf)
    if chain is not None:
        limits = chain.limits
        position, velocity, acceleration = 0.5 * (limits.upper - limits.lower), limits.velocity, limits.acceleration
        np.add(limits.lower, position, out=middle, where=np.isfinite(position))
    rows = (
        ("position", "", "middle 0, limits ±1", q - middle, position, "default"),
        ("speed", "/s", "/ limit", qdot, velocity, "default"),
        ("acceleration", "/s²", "/ limit", qddot, acceleration, "default" if trajectory.cubic else "steps-post"),
    )
    for axes, (what, per, part, values, limit, style) in zip(panels, rows, strict=True):
        known = np.isfinite(limit) & (limit > 0.0)
        scaled = bool(known.any())
        if scaled:
            values = values / np.where(known, limit, 1.0)
            limit_lines(axes, max(1.15, 1.05 * float(np.abs(values[:, known]).max())), f"joint {what}\n{part}")
        else:
            axes.set_ylabel(f"joint {what}\n[{' or '.join(unit + per for unit in units)}]")
            axes.grid(True, color="0.9", linewidth=0.6)
        for joint in np.flatnonzero(known) if scaled else range(n):
            axes.plot(
                t, values[:, joint], label=names[joint], drawstyle=style, linewidth=1.2, **_joint_style(int(joint))
            )
        if scaled and not known.all():
            missing = ", ".join(names[joint] for joint in np.flatnonzero(~known))
            axes.set_title(f"without limit, not drawn: {missing}", fontsize=8, color="0.35", loc="right")


def _draw_indices(panels: list[Axes], trajectory: Trajectory, t: Array, chain: Chain) -> None:
    """σ_min and manipulability, with the crossings of singular sets."""
    jacobians = chain.jacobian(trajectory.sample(t)[0])
    crossings = trajectory.clearance.crossings if trajectory.clearance is not None else ()
    for axes, label, index in (
        (panels[0], r"$\sigma_{min}$", indices.min_singular_value),
        (panels[1], "manipulability\n" + r"$\sqrt{\det JJ^T}$", indices.manipulability),
    ):
        axes.plot(t, index(jacobians), color="black", linewidth=1.2)
        axes.set_ylim(bottom=0.0)
        axes.set_ylabel(label)
        axes.grid(True, color="0.9", linewidth=0.6)
        for crossing in crossings:
            axes.axvline(crossing.t, color=_CROSSING, linewidth=0.9, linestyle=(0, (4, 3)))
    for crossing in crossings:
        panels[0].annotate(
            crossing.name,
            (crossing.t, 0.97),
            xycoords=panels[0].get_xaxis_transform(),
            xytext=(3.0, 0.0),
            textcoords="offset points",
            va="top",
            rotation=90,
            color=_CROSSING,
            fontsize=8,
        )


def _joint_style(joint: int) -> dict[str, Any]:
    return {
        "color": JOINT_COLOURS[joint % len(JOINT_COLOURS)],
        "linestyle": DASHES[joint // len(JOINT_COLOURS)],
    }


def _joint_units(chain: Chain | None) -> tuple[str, ...]:
    """Units of positions; both units where the types of the joints are not known."""
    if chain is None:
        return ("rad", "m")
    return tuple(dict.fromkeys("m" if kind == "prismatic" else "rad" for kind in chain.joint_types))
