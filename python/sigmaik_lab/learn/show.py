"""Makes a table and a picture of what the policies did."""

from __future__ import annotations

import argparse
from typing import TYPE_CHECKING

from sigmaik._extras import need
from sigmaik_lab import output
from sigmaik_lab.csv_file import save_rows
from sigmaik_lab.options import add_output
from sigmaik_lab.report import Csv, Picture, Report, Table, compact, red

from .evaluate import RULES
from .rollout import Rollouts, load_rollouts
from .summary import ALL_SEEDS, Summary, interval, summaries

if TYPE_CHECKING:
    from matplotlib.figure import Figure

__all__ = ["options", "results_table", "run"]


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

    return Report([results_table(rows)], [Csv("results", lambda file: save_rows(rows, file)), Picture("results", draw)])


def results_table(rows: list[Summary]) -> Table:
    table = Table("scenes in which each phase was passed, in %", "policy", "rule")
    table.add_numbers("scenes", "approach", "grasp", "carry", "place", "95 %", "fell", "limits\nbroken")
    table.add_numbers("time\ns", "lag\nmm/s", "least\nσ ratio")
    for k, row in enumerate(rows):
        low, high = interval(row.place, row.scenes)
        last = k + 1 < len(rows) and (rows[k + 1].policy, rows[k + 1].region) != (row.policy, row.region)
        name = "all of them" if row.policy == ALL_SEEDS else row.policy
        table.add_row(
            name if row.region == "edge" else f"{name}, {row.region}",
            row.rule,
            str(row.scenes),
            *(f"{100.0 * getattr(row, phase) / row.scenes:.0f}" for phase in ("approach", "grasp", "carry", "place")),
            f"{100.0 * low:.0f}–{100.0 * high:.0f}",
            str(row.lost),
            red(str(row.limits_broken), row.limits_broken > 0),
            compact(row.median_time),
            f"{1000.0 * row.lag:.1f}",
            f"{row.least_sigma:.4f}",
            end_section=last,
        )
    return table
