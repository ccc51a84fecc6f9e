"""Summaries as a table for the terminal. Needs rich, `pip install 'sigmaik[demo]'`."""

from __future__ import annotations

import math
from collections.abc import Sequence

from rich import box
from rich.table import Table
from rich.text import Text

from .reach import Experiment
from .summary import Summary

__all__ = ["summary_table"]

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
    the largest distance from the line and its root mean square, the largest errors, and the last two.
    """
    moving = experiment.path.line is not None
    table = Table(
        title=title,
        title_justify="left",
        title_style="bold",
        box=box.SIMPLE_HEAD,
        padding=(0, 1, 0, 0),
        pad_edge=False,
    )
    table.add_column("method", overflow="fold")
    table.add_column("cycle" if moving else "waypoint")
    heads = _MOVING_HEADS if moving else _HEADS
    for head in heads:
        table.add_column(head, justify="right", no_wrap=True)

    for i, row in enumerate(rows):
        speed = Text(_compact(row.max_joint_speed), style="red" if row.max_speed_ratio > 1.0 + 1e-9 else "")
        if moving:
            cells = [
                _compact(1e3 * row.max_deviation),
                _compact(1e3 * row.rms_deviation),
                _compact(1e3 * row.max_position_error),
                _compact(math.degrees(row.max_orientation_error)),
            ]
        else:
            settled = "–" if math.isnan(row.settling_time) else f"{row.settling_time:.1f}"
            cells = [
                _compact(1e3 * row.position_error),
                _compact(math.degrees(row.orientation_error)),
                settled,
            ]
        at_rest = [] if moving else [_compact(row.rest_speed)]
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


def _compact(value: float) -> str:
    """At most five characters, two decimals at most."""
    if not math.isfinite(value):
        return "–"
    for limit, decimals in ((9.995, 2), (999.95, 1), (99999.5, 0)):
        if abs(value) < limit:
            return f"{value:.{decimals}f}"
    return f"{value:.0e}"


def _ratio(value: float) -> str:
    return f"{value:.4f}" if value >= 1e-3 or value == 0.0 else f"{value:.0e}"
