"""Indices along motions, as a text table beside the paper's."""

from __future__ import annotations

from collections.abc import Sequence

from sigmaik_lab.report import Table

from .experiment import PAPER, ReachingSummary

__all__ = ["reaching_table"]


def reaching_table(robot: str, rows: Sequence[ReachingSummary]) -> Table:
    """A line per method; below it, dim, the line of table 1 of Petrović et al., where the table has one."""
    table = Table("", "")
    table.add_numbers("λ₁", "m", "κ", "length", "accel.", "least λ₁", "ms", "at goal")
    for s in rows:
        table.add_row(
            s.method,
            f"{s.lambda_1:.3f}",
            f"{s.m:.3f}",
            f"{s.kappa:.3f}",
            f"{s.length:.2f}",
            f"{s.acceleration:.0f}",
            f"{s.least:.1e}",
            f"{1e3 * s.solve_time:.2f}" if s.solve_time else "–",
            f"{100.0 * s.arrived:.0f} %",
        )
        if s.method in PAPER.get(robot, {}):
            table.add_row("  paper", *(f"{v:.3f}" for v in PAPER[robot][s.method]), style="dim")
    return table
