"""Planned motions in physics, as a text table."""

from __future__ import annotations

from collections.abc import Sequence

from sigmaik_lab.report import Table, compact

from .experiment import ExecuteRun

__all__ = ["execute_table"]


def execute_table(runs: Sequence[ExecuteRun], title: str) -> Table:
    """A line per way to drive the arm: largest errors of joints and tip, on the way and at the end, and the torques
    used."""
    table = Table(title, "")
    table.add_numbers("error\nmrad", "\nrms", "at the\nend", "tip off\nmm", "at the\nend", "effort\n%", "cut\n% of t")
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
