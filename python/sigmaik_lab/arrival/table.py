"""Arrivals as a text table."""

from __future__ import annotations

import math
from collections.abc import Sequence

from sigmaik_lab.report import Cell, Table, red

from .summary import ArrivalSummary

__all__ = ["arrival_table"]

_HELD = 1e-6  #: An excess below this part of a limit is a solver's tolerance, and not red.


def arrival_table(rows: Sequence[ArrivalSummary]) -> Table:
    """A row for each arm and servo: the share of trials that arrived, and of those that arrived late (`ON_TIME`); the
    share that the guide led away from the tool's own way; the times in which a half and 90 % of all trials had
    arrived; the share at rest; the largest excess over a limit of position, velocity or jerk; the largest change of q̇
    in a cycle, as a multiple of what the acceleration limits allow; the tool's departure from the straight line, as the
    median of the trials; the wall time of an update; and the share of trials in which the servo raised an error, where
    there are any.

    Red: joints that move at the end, and broken limits.
    """
    failures = any(row.failed > 0.0 for row in rows)
    table = Table()
    table.add_column("arm", wrap=True)  # a narrow terminal breaks the names, and cuts no number
    table.add_column("servo", wrap=True)
    table.add_numbers("there\n%", "late\n%", "led\n%", "50 %\ns", "90 %\ns", "rest\n%", "over\n", "jump\n×")
    table.add_numbers("off\nmm", "cycle\nµs", *(["error\n%"] if failures else []))
    for i, row in enumerate(rows):
        first = i == 0 or rows[i - 1].robot != row.robot
        cells: list[str | Cell] = [
            row.robot if first else "",
            row.servo,
            f"{100.0 * row.arrived:.3g}",
            f"{100.0 * (row.arrived - row.on_time):.3g}",
            f"{100.0 * row.led:.0f}" if row.servo == "guided" else "–",
            _seconds(row.median_time),
            _seconds(row.time_90),
            red(f"{100.0 * row.at_rest:.3g}", row.at_rest < 1.0),
            red("0" if row.over == 0.0 else f"{row.over:.0e}", row.over > _HELD),
            red(f"{row.jump:.3g}", row.jump > 1.0 + _HELD),
            f"{1e3 * row.departure:.3g}",
            f"{1e6 * row.cycle:.3g}",
        ]
        if failures:
            cells.append(red(f"{100.0 * row.failed:.3g}", row.failed > 0.0))
        table.add_row(*cells, end_section=i + 1 < len(rows) and rows[i + 1].robot != row.robot)
    return table


def _seconds(value: float) -> str:
    return f"{value:.2f}" if math.isfinite(value) else "–"
