"""The reaching experiments without physics and with, as a text table."""

from __future__ import annotations

import math
from collections.abc import Sequence

from sigmaik_lab.report import Table, compact, red

from .physics import PhysicsSummary
from .table import method_table

__all__ = ["physics_table"]

_HEADS = (
    "error\nmm",
    "in phy-\nsics",
    "ori.\n°",
    "in phy-\nsics",
    "speed\nrad/s",
    "in phy-\nsics",
    "tips\napart\nmm",
    "drives\nat max.\n%",
)


def physics_table(rows: Sequence[PhysicsSummary], title: str) -> Table:
    """A line per method and waypoint, for 80 characters and more. True speeds beyond the arm's limits are red.

    A line has the settled errors, the largest joint speed, the largest distance between the tips on the way, and the
    part of the time in which any drive was at its effort limit.
    """
    table = method_table(title, "waypoint", _HEADS)
    for i, row in enumerate(rows):
        begins = i == 0 or rows[i - 1].method != row.method
        ends = i + 1 == len(rows) or rows[i + 1].method != row.method
        name = row.method if begins else ""
        if begins and not math.isnan(row.tripped):
            name += f"\ntripped, {row.tripped:.1f} s"
        fast = row.max_speed_ratio > 1.0 + 1e-9
        table.add_row(
            name,
            row.waypoint,
            compact(1e3 * row.position_error),
            compact(1e3 * row.physical_position_error),
            compact(math.degrees(row.orientation_error)),
            compact(math.degrees(row.physical_orientation_error)),
            compact(row.max_joint_speed),
            red(compact(row.physical_max_joint_speed), fast),
            compact(1e3 * row.max_tip_distance),
            compact(100.0 * row.saturated),
            end_section=ends,
        )
    return table
