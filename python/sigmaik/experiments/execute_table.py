"""Planned motions in physics, as a table for the terminal. Needs rich."""

from __future__ import annotations

from collections.abc import Sequence

from rich.table import Table

from .execute import ExecuteRun
from .table import compact, titled_table

__all__ = ["execute_table"]


def execute_table(runs: Sequence[ExecuteRun], title: str) -> Table:
    """A line per way to drive the arm: largest errors of joints and tip, on the way and at the end, and the torques
    used."""
    table = titled_table(title)
    table.add_column("", no_wrap=True)
    for head in ("error\nmrad", "\nrms", "at the\nend", "tip off\nmm", "at the\nend", "effort\n%", "cut\n% of t"):
        table.add_column(head, justify="right", no_wrap=True)
    for run in runs:
        done = run.execution
        table.add_row(
            run.variant,
            compact(1e3 * done.max_error),
            compact(1e3 * done.rms_error),
            compact(1e3 * done.final_error),
            compact(1e3 * float(run.tip_error.max())),
            compact(1e3 * float(run.tip_error[-1])),
            compact(100.0 * done.max_effort),
            compact(100.0 * done.saturated),
        )
    return table
