"""What limits break and cost, as text tables."""

from __future__ import annotations

import math
from collections.abc import Sequence

from sigmaik_lab.report import Cell, Table, bold, compact, red

from .summary import LimitsSummary

__all__ = ["broken_table", "cost_table", "hold_table"]


def broken_table(rows: Sequence[LimitsSummary]) -> Table:
    """How often limits were broken, joints times cycles, and by how much at worst. Broken limits are red."""
    table = _limits_table("limits broken")
    jerk = any(row.jerk_worst > 0.0 for row in rows)
    heads = [
        "position\nbroken",
        "by at\nmost",
        "speed\nbroken",
        "× the\nlimit",
        "accel.\nbroken",
        "× the\nlimit",
    ]
    heads += ["jerk\nbroken", "× the\nlimit"] if jerk else []
    table.add_numbers(*heads, "accel.\npeak", "accel.\nrms")
    for i, row in enumerate(rows):
        pairs = [
            (row.position_broken, row.position_excess),
            (row.speed_broken, row.speed_worst),
            (row.acceleration_broken, row.acceleration_worst),
        ]
        pairs += [(row.jerk_broken, row.jerk_worst)] if jerk else []
        cells = [red(cell, bool(count)) for count, worst in pairs for cell in (str(count), compact(worst))]
        _add(table, rows, i, [*cells, compact(row.acceleration_peak), compact(row.acceleration_rms)])
    return table


def cost_table(rows: Sequence[LimitsSummary]) -> Table:
    """The cost of limits: the part of the rule's twist that is done, and the tool's deviation from this twist."""
    table = _limits_table("what it costs")
    table.add_numbers(
        "limited\n%",
        "others\nhelp %",
        "done\n%",
        "direction\n°",
        "\n95 %, °",
        "turns\nrad/s",
    )
    for i, row in enumerate(rows):
        cells = [
            compact(100.0 * row.limited),
            compact(100.0 * row.taken_over),
            compact(100.0 * row.achieved),
            compact(math.degrees(row.direction_error)),
            compact(math.degrees(row.direction_error_worst)),
            compact(row.turning_error),
        ]
        _add(table, rows, i, cells)
    return table


def hold_table(rows: Sequence[LimitsSummary]) -> Table:
    """Motion during a hold, and the return of the arm after the release."""
    table = _limits_table("hold and release")
    table.add_numbers(
        "error\nmm",
        "\n°",
        "rms at rest\nrad/s",
        "peak\nrad/s",
        "resumes\nafter s",
        "peak\nrad/s",
        "came\nback",
    )
    rows = [row for row in rows if row.trials]
    for i, row in enumerate(rows):
        cells = [
            compact(1e3 * row.hold_error),
            compact(math.degrees(row.hold_angle)),
            f"{row.rest_speed:.4f}",
            f"{row.rest_speed_peak:.4f}",
            compact(row.resume_time),
            compact(row.resume_speed),
            f"{row.returned}/{row.trials}",
        ]
        _add(table, rows, i, cells)
    return table


def _limits_table(title: str) -> Table:
    return Table(title, "")


def _add(table: Table, rows: Sequence[LimitsSummary], i: int, cells: Sequence[Cell | str]) -> None:
    """A scenario's name has a line of its own, above its variants."""
    row = rows[i]
    if i == 0 or rows[i - 1].scenario != row.scenario:
        table.add_row(bold(row.scenario))
    ends = i + 1 == len(rows) or rows[i + 1].scenario != row.scenario
    table.add_row(f" {row.variant}", *cells, end_section=ends)
