"""The summaries of runs as a text table."""

from __future__ import annotations

import math
from collections.abc import Sequence

from sigmaik_lab.report import Table, compact, red

from .experiment import Experiment
from .summary import Summary

__all__ = ["method_table", "summary_table"]

_HEADS = (
    "pos.\nerror\nmm",
    "ori.\nerror\n°",
    "sett-\nling\ns",
    "joint\nspeed\nrad/s",
    "at\nrest\nrad/s",
    "least\nσ_min/\nσ_max",
)
_MOVING_HEADS = (
    "off the\nline\nmm",
    "\nrms\nmm",
    "behind\ntarget\nmm",
    "ori.\nerror\n°",
    "joint\nspeed\nrad/s",
    "least\nσ_min/\nσ_max",
)


def summary_table(experiment: Experiment, rows: Sequence[Summary], title: str) -> Table:
    """A line per method and waypoint, for 80 characters and more. Speeds beyond the arm's limits are red.

    A waypoint's line has the settled errors, the time to settle, the largest joint speed on the way and in
    the last second, and the smallest σ_min/σ_max. A cycle's line, where the target moves along a line, has
    the largest distance from the line and its root mean square, the largest errors, the largest joint speed,
    and the smallest σ_min/σ_max.
    """
    moving = experiment.path.line is not None
    table = method_table(title, "cycle" if moving else "waypoint", _MOVING_HEADS if moving else _HEADS)
    for i, row in enumerate(rows):
        speed = red(compact(row.max_joint_speed), row.max_speed_ratio > 1.0 + 1e-9)
        if moving:
            cells = [
                compact(1e3 * row.max_deviation),
                compact(1e3 * row.rms_deviation),
                compact(1e3 * row.max_position_error),
                compact(math.degrees(row.max_orientation_error)),
            ]
        else:
            settled = "–" if math.isnan(row.settling_time) else f"{row.settling_time:.1f}"
            cells = [
                compact(1e3 * row.position_error),
                compact(math.degrees(row.orientation_error)),
                settled,
            ]
        at_rest = [] if moving else [compact(row.rest_speed)]
        ends = i + 1 == len(rows) or rows[i + 1].method != row.method
        begins = i == 0 or rows[i - 1].method != row.method
        table.add_row(
            row.method if begins else "",
            row.waypoint,
            *cells,
            speed,
            *at_rest,
            _ratio(row.min_inverse_condition),
            end_section=ends and len(experiment.path.segments) > 1,
        )
    return table


def method_table(title: str, leg: str, heads: Sequence[str]) -> Table:
    """An empty table of methods, the legs of a path, and figures."""
    table = Table(title)
    table.add_column("method", wrap=True)
    table.add_column(leg, wrap=True)
    table.add_numbers(*heads)
    return table


def _ratio(value: float) -> str:
    return f"{value:.4f}" if value >= 1e-3 or value == 0.0 else f"{value:.0e}"
