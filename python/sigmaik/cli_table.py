"""The command `sigmaik table`."""

from __future__ import annotations

import argparse
import pathlib

import numpy as np

from ._extras import need
from .console import terminal
from .experiments import around_table as at

__all__ = ["add_table"]


def add_table(parser: argparse.ArgumentParser) -> None:
    parser.description = (
        "An iiwa from under a table to above it, planned by samples, with the geometry-aware index and without, after "
        "Petrović et al., section 4.2. Distances are checked at ten times as many points as the planner looks at. The "
        "last line on stdout is the picture's path."
    )
    parser.add_argument("--seed", type=int, default=0, metavar="N", help="of start, goal and samples (%(default)s)")
    parser.add_argument("--out", default="sigmaik-table", type=pathlib.Path, metavar="DIR", help="(%(default)s)")
    parser.add_argument("--no-plot", action="store_true", help="no picture")
    parser.set_defaults(run=_table)


def _table(arguments: argparse.Namespace) -> int:
    console = terminal()
    if not arguments.no_plot:
        need("matplotlib")
    if arguments.seed < 0:
        raise ValueError("--seed must not be negative")
    from rich import box
    from rich.table import Table

    scene = at.load_scene(arguments.seed)
    table = Table(box=box.SIMPLE_HEAD, pad_edge=False, padding=(0, 1, 0, 0))
    table.add_column("index", no_wrap=True)
    for head in ("mean λ₁", "m", "κ", "least λ₁", "m", "clear mm", "length", "ms"):
        table.add_column(head, justify="right", no_wrap=True)
    motions = {}
    for name, index in (("with", True), ("without", False)):
        plan = at.plan(scene, index, arguments.seed)
        if plan.status == "failed":
            table.add_row(f"{name}: failed", *["–"] * 7, f"{1e3 * plan.solve_time:.1f}")
            continue
        motion = motions[name] = at.along(scene, plan)
        table.add_row(
            name,
            f"{motion.lambda_1.mean():.4f}",
            f"{motion.m.mean():.3f}",
            f"{motion.kappa.mean():.3f}",
            f"{motion.lambda_1.min():.4f}",
            f"{motion.m.min():.3f}",
            f"{1e3 * motion.distance.min():.1f}",
            f"{np.linalg.norm(np.diff(motion.q, axis=0), axis=1).sum():.2f}",
            f"{1e3 * plan.solve_time:.1f}",
        )
    console.print(table)
    if arguments.no_plot:
        return 0
    from . import plots, plots_table

    print(plots.save_figure(plots_table.table_figure(scene, motions), arguments.out / "table.png"))
    return 0
