"""Figures of recordings, as a text table."""

from __future__ import annotations

from collections.abc import Sequence

from sigmaik_lab.report import Table

from .experiment import Drill

__all__ = ["drill_table"]


def drill_table(rows: Sequence[Drill]) -> Table:
    """A line per arm and method."""
    table = Table("", "arm", "method")
    table.add_numbers("cycles", "min σ₆/σ₁", "speed", "broken", "error")
    robot = ""
    for row in rows:
        table.add_row(
            row.robot if row.robot != robot else "",
            row.method,
            str(row.cycles),
            f"{row.smallest_ratio:.2e}",
            f"{row.largest_speed:.3f}",
            str(row.broken),
            f"{1e3 * row.error:.1f} mm",
        )
        robot = row.robot
    return table
