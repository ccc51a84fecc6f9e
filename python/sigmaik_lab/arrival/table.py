"""Arrivals as a text table."""

from __future__ import annotations

import math
from collections.abc import Sequence

from sigmaik_lab.report import Table, red

from .summary import ArrivalSummary

__all__ = ["arrival_table"]


def arrival_table(rows: Sequence[ArrivalSummary]) -> Table:
    """A row for each arm and servo: the share of trials that arrived, the times in which a half and 90 % of all trials
    had arrived, the share at rest, the fastest joint at the end, and the largest excess over a limit.

    Red: joints that move at the end, and broken limits.
    """
    table = Table("", "arm", "servo")
    table.add_numbers("there\n%", "50 %\ns", "90 %\ns", "rest\n%", "end q̇\nrad/s", "excess\n")
    for i, row in enumerate(rows):
        first = i == 0 or rows[i - 1].robot != row.robot
        table.add_row(
            row.robot if first else "",
            row.servo,
            f"{100.0 * row.arrived:.1f}",
            _seconds(row.median_time),
            _seconds(row.time_90),
            red(f"{100.0 * row.at_rest:.1f}", row.at_rest < 1.0),
            f"{row.end_speed:.1g}" if row.end_speed < 1e-3 else f"{row.end_speed:.3f}",
            red("0" if row.excess == 0.0 else f"{row.excess:.1e}", row.excess > 0.0),
            end_section=i + 1 < len(rows) and rows[i + 1].robot != row.robot,
        )
    return table


def _seconds(value: float) -> str:
    return f"{value:.2f}" if math.isfinite(value) else "–"
