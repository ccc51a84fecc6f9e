"""Makes a table and a picture of what the policies did."""

from __future__ import annotations

import argparse
from collections.abc import Iterator
from typing import TYPE_CHECKING

from sigmaik._extras import need
from sigmaik_lab import output
from sigmaik_lab.csv_file import save_rows
from sigmaik_lab.options import add_output
from sigmaik_lab.report import Csv, Picture, Report, Table, compact, red

from .episode import PHASES
from .evaluate import RULES
from .rollout import Rollouts, load_rollouts
from .summary import ALL_SEEDS, Summary, interval, summaries

if TYPE_CHECKING:
    from matplotlib.figure import Figure

__all__ = ["motion_table", "options", "results_table", "run"]


def options(parser: argparse.ArgumentParser) -> None:
    add_output(parser, "sigmaik-learn")


def run(args: argparse.Namespace) -> int:
    if not args.no_plot:
        need("matplotlib")
    folder = args.out / "rollouts"
    files = [load_rollouts(file) for file in sorted(folder.glob("*.npz"))]
    if not files:
        raise ValueError(f"there are no rollouts in {folder}; `sigmaik learn evaluate` makes them")
    output.show(report(files), args)
    return 0


def report(files: list[Rollouts]) -> Report:
    rows = summaries(files, RULES)

    def draw() -> Figure:
        from .figure import results_figure

        return results_figure(files, rows)

    tables = [results_table(rows), motion_table(rows)]
    return Report(tables, [Csv("results", lambda file: save_rows(rows, file)), Picture("results", draw)])


def results_table(rows: list[Summary]) -> Table:
    """How often each phase was passed."""
    table = Table("scenes in which each phase was passed, in %", "policy", "rule")
    table.add_numbers("scenes", "approach", "grasp", "carry", "place", "95 %", "limits\nbroken")
    for row, name, last in _named(rows):
        low, high = interval(row.place, row.scenes)
        table.add_row(
            name,
            row.rule,
            str(row.scenes),
            *(f"{100.0 * getattr(row, phase) / row.scenes:.0f}" for phase in PHASES),
            f"{100.0 * low:.0f}–{100.0 * high:.0f}",
            red(str(row.limits_broken), row.limits_broken > 0),
            end_section=last,
        )
    return table


def motion_table(rows: list[Summary]) -> Table:
    """How the arm moved."""
    table = Table("time of scenes that succeed; asked minus achieved velocity; σ_min/σ_max", "policy", "rule")
    table.add_numbers("cups that\nfell", "median time\ns", "lag, rms\nmm/s", "least σ ratio\nmedian")
    for row, name, last in _named(rows):
        numbers = (str(row.lost), compact(row.median_time), f"{1000.0 * row.lag:.1f}", f"{row.least_sigma:.4f}")
        table.add_row(name, row.rule, *numbers, end_section=last)
    return table


def _named(rows: list[Summary]) -> Iterator[tuple[Summary, str, bool]]:
    """Each row with the policy's name, and whether it is the last one of its policy."""
    for k, row in enumerate(rows):
        name = "all of them" if row.policy == ALL_SEEDS else row.policy
        last = k + 1 < len(rows) and (rows[k + 1].policy, rows[k + 1].region) != (row.policy, row.region)
        yield row, name if row.region == "edge" else f"{name}, {row.region}", last
