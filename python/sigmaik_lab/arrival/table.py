"""Arrivals as a text table."""

from __future__ import annotations

import math
from collections.abc import Sequence

from sigmaik_lab.report import Table, red

from .summary import ArrivalSummary

__all__ = ["arrival_table"]


def arrival_table(rows: Sequence[ArrivalSummary]) -> Table:
    """A row for each arm and servo: the share of trials that arrived, and of those that arrived late (`ON_TIME`); the
    share that the guide led away from the tool's own way; the times in which a half and 90 % of all trials had
    arrived; the share at rest; and the largest excess over a limit.

    Red: joints that move at the end, and broken limits.
    """
    table = Table("", "arm", "servo")
    table.add_numbers("there\n%", "late\n%", "led\n%", "50 %\ns", "90 %\ns", "rest\n%", "over\n")
    for i, row in enumerate(rows):
        first = i == 0 or rows[i - 1].robot != row.robot
        table.add_row(
            row.robot if first else "",
            row.servo,
            f"{100.0 * row.arrived:.3g}",
            f"{100.0 * (row.arrived - row.on_time):.3g}",
            f"{100.0 * row.led:.0f}" if row.servo == "guided" else "–",
            _seconds(row.median_time),
            _seconds(row.time_90),
            red(f"{100.0 * row.at_rest:.3g}", row.at_rest < 1.0),
            red("0" if row.excess == 0.0 else f"{row.excess:.1e}", row.excess > 0.0),
            end_section=i + 1 < len(rows) and rows[i + 1].robot != row.robot,
        )
    return table


def _seconds(value: float) -> str:
    return f"{value:.2f}" if math.isfinite(value) else "–"
