"""Summaries as a table for the terminal. Needs rich, `pip install 'sigmaik[demo]'`."""

from __future__ import annotations

import math
from collections.abc import Sequence

from rich import box
from rich.table import Table
from rich.text import Text

from .limits import LimitsSummary
from .reach import Experiment
from .summary import Summary

__all__ = ["broken_table", "compact", "cost_table", "hold_table", "method_table", "summary_table", "titled_table"]

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
    table = method_table(title, "cycle" if moving else "waypoint", _MOVING_HEADS if moving else _HEADS)
    for i, row in enumerate(rows):
        speed = Text(compact(row.max_joint_speed), style="red" if row.max_speed_ratio > 1.0 + 1e-9 else "")
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


def titled_table(title: str | Text) -> Table:
    """An empty table with a title, as all experiments have it."""
    return Table(
        title=title,
        title_justify="left",
        title_style="bold",
        box=box.SIMPLE_HEAD,
        padding=(0, 1, 0, 0),
        pad_edge=False,
    )


def method_table(title: str, leg: str, heads: Sequence[str]) -> Table:
    """An empty table of methods, the legs of a path, and figures."""
    table = titled_table(title)
    table.add_column("method", overflow="fold")
    table.add_column(leg)
    for head in heads:
        table.add_column(head, justify="right", no_wrap=True)
    return table


def compact(value: float) -> str:
    """At most five characters, two decimals at most."""
    if not math.isfinite(value):
        return "–"
    for limit, decimals in ((9.995, 2), (999.95, 1), (99999.5, 0)):
        if abs(value) < limit:
            return f"{value:.{decimals}f}"
    return f"{value:.0e}"


def _ratio(value: float) -> str:
    return f"{value:.4f}" if value >= 1e-3 or value == 0.0 else f"{value:.0e}"


def broken_table(rows: Sequence[LimitsSummary]) -> Table:
    """How often limits were broken, joints times cycles, and by how much at worst. Broken ones are red."""
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
    for head in heads + ["accel.\npeak", "accel.\nrms"]:
        table.add_column(head, justify="right", no_wrap=True)
    for i, row in enumerate(rows):
        pairs = [
            (row.position_broken, row.position_excess),
            (row.speed_broken, row.speed_worst),
            (row.acceleration_broken, row.acceleration_worst),
        ]
        pairs += [(row.jerk_broken, row.jerk_worst)] if jerk else []
        cells = [
            Text(cell, style="red" if count else "") for count, worst in pairs for cell in (str(count), compact(worst))
        ]
        _add(table, rows, i, [*cells, compact(row.acceleration_peak), compact(row.acceleration_rms)])
    return table


def cost_table(rows: Sequence[LimitsSummary]) -> Table:
    """What limits cost: how much of the rule's twist is done, and how the tool's motion differs from it."""
    table = _limits_table("what it costs")
    for head in (
        "limited\n%",
        "others\nhelp %",
        "done\n%",
        "direction\n°",
        "\n95 %, °",
        "turns\nrad/s",
    ):
        table.add_column(head, justify="right", no_wrap=True)
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
    """How still a hold was, and how the arm came back after the release."""
    table = _limits_table("hold and release")
    for head in (
        "error\nmm",
        "\n°",
        "rms at rest\nrad/s",
        "peak\nrad/s",
        "resumes\nafter s",
        "peak\nrad/s",
        "came\nback",
    ):
        table.add_column(head, justify="right", no_wrap=True)
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
    table = titled_table(title)
    table.add_column("", no_wrap=True)
    return table


def _add(table: Table, rows: Sequence[LimitsSummary], i: int, cells: Sequence[Text | str]) -> None:
    """A scenario's name has a line of its own, above its variants."""
    row = rows[i]
    if i == 0 or rows[i - 1].scenario != row.scenario:
        table.add_row(Text(row.scenario, style="bold"))
    ends = i + 1 == len(rows) or rows[i + 1].scenario != row.scenario
    table.add_row(f" {row.variant}", *cells, end_section=ends)
