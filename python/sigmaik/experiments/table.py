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


def summary_table(experiment: Experiment, rows: Sequence[Summary], title: str) -> Table:
    """A line per method and waypoint; 80 characters wide. Joint speeds beyond the arm's limits are red."""
    moving = experiment.path.line is not None
    table = Table(
        title=title,
        title_justify="left",
        title_style="bold",
        box=box.SIMPLE_HEAD,
        padding=(0, 1, 0, 0),
        pad_edge=False,
    )
    table.add_column("method", no_wrap=True)
    table.add_column("cycle" if moving else "waypoint", no_wrap=True)
    if moving:
        heads = ("off the\nline\nmm", "rms\n\nmm", "behind\ntarget\nmm", "orient.\nerror\n°")
    else:
        heads = ("pos.\nerror\nmm", "orient.\nerror\n°", "settled\nafter\ns")
    for head in (*heads, "joint\nspeed\nrad/s", "same,\nat rest\nrad/s", "least\nσ_min/\nσ_max"):
        if not (moving and "rest" in head):
            table.add_column(head, justify="right", no_wrap=True)

    limit = float(min(experiment.chain.limits.velocity.max(), math.inf))
    last = ""
    for i, row in enumerate(rows):
        speed = Text(_compact(row.max_joint_speed), style="red" if row.max_joint_speed > 1.001 * limit else "")
        if moving:
            cells = [
                _compact(1e3 * row.max_deviation),
                _compact(1e3 * row.rms_deviation),
                _compact(1e3 * row.max_position_error),
                _compact(math.degrees(row.max_orientation_error)),
            ]
        else:
            settled = "–" if math.isnan(row.settling_time) else f"{row.settling_time:.1f}"
            cells = [_compact(1e3 * row.position_error), _compact(math.degrees(row.orientation_error)), settled]
        at_rest = [] if moving else [_compact(row.rest_speed)]
        ends = i + 1 == len(rows) or rows[i + 1].method != row.method
        name = "" if row.method == last else row.method
        last = row.method
        table.add_row(
            name,
            row.waypoint,
            *cells,
            speed,
            *at_rest,
            f"{row.min_inverse_condition:.4f}",
            end_section=ends and len(experiment.path.segments) > 1,
        )
    return table


def _compact(value: float) -> str:
    """At most seven characters, two decimals at most."""
    if not math.isfinite(value):
        return "–"
    for limit, decimals in ((100.0, 2), (1000.0, 1), (1e6, 0)):
        if abs(value) < limit:
            return f"{value:.{decimals}f}"
    return f"{value:.1e}"
