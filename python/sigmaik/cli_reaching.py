"""The command `sigmaik reaching`."""

from __future__ import annotations

import argparse
import dataclasses
import pathlib

from .console import terminal
from .experiments import reaching as rc
from .experiments.storage import write_atomically, write_csv

__all__ = ["add_reaching"]


def add_reaching(parser: argparse.ArgumentParser) -> None:
    parser.description = (
        "Motions between random configurations by several methods, with the indices of Petrović et al. averaged along "
        "them, beside the paper's table 1, and what they cost in length, acceleration and time. The last line on "
        "stdout is the path of the table as CSV."
    )
    parser.epilog = "methods: " + "; ".join(f"{name}: {text}" for name, text in rc.METHODS.items())
    parser.add_argument("--robot", default=",".join(rc.ROBOTS), metavar="LIST", help="shipped arms (%(default)s)")
    parser.add_argument("--tasks", type=int, default=100, metavar="N", help="of each arm (%(default)s)")
    parser.add_argument("--seed", type=int, default=0, metavar="N", help="of tasks and samples (%(default)s)")
    parser.add_argument("--method", default=",".join(rc.METHODS), metavar="LIST", help="some of %(default)s")
    standard = rc.Planning()
    parser.add_argument("--states", type=int, default=standard.states, metavar="N", help="of a motion (%(default)s)")
    parser.add_argument(
        "--samples", type=int, default=standard.samples, metavar="N", help="of an iteration, stochastic (%(default)s)"
    )
    parser.add_argument(
        "--prior-weight", type=float, default=standard.prior_weight, metavar="W", help="against the index (%(default)g)"
    )
    parser.add_argument("--out", default="sigmaik-reaching", type=pathlib.Path, metavar="DIR", help="(%(default)s)")
    parser.set_defaults(run=_reaching)


def _reaching(arguments: argparse.Namespace) -> int:
    console = terminal()
    methods = arguments.method.split(",")
    wrong = [m for m in methods if m not in rc.METHODS]
    if wrong:
        raise ValueError(f"no method '{wrong[0]}'; there are {', '.join(rc.METHODS)}")
    if arguments.tasks < 1 or arguments.seed < 0:
        raise ValueError("--tasks must be positive, and --seed not negative")
    planning = rc.Planning(arguments.states, arguments.samples, arguments.prior_weight)
    from rich import box
    from rich.console import Console
    from rich.progress import Progress
    from rich.table import Table

    rows = []
    stderr = Console(stderr=True)
    for robot in arguments.robot.split(","):
        runs = []
        with Progress(console=stderr, transient=True, disable=not stderr.is_terminal) as progress:
            bar = progress.add_task(robot, total=arguments.tasks)
            for number in range(arguments.tasks):
                chain, start, goal = rc.task(robot, arguments.seed, number)
                runs += [
                    rc.solve_task(chain, start, goal, method, arguments.seed + number, planning) for method in methods
                ]
                progress.advance(bar)
        summaries = rc.summarize_runs(runs)
        table = Table(box=box.SIMPLE_HEAD, pad_edge=False, padding=(0, 1, 0, 0))
        console.print(f"{robot}, {arguments.tasks} tasks, seed {arguments.seed}", highlight=False)
        table.add_column("", no_wrap=True)
        for head in ("λ₁", "m", "κ", "length", "accel.", "least λ₁", "ms", "at goal"):
            table.add_column(head, justify="right", no_wrap=True)
        for s in summaries:
            rows.append([robot, *dataclasses.astuple(s)])
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
            if s.method in rc.PAPER.get(robot, {}):
                values = rc.PAPER[robot][s.method]
                table.add_row("  paper", *(f"{v:.3f}" for v in values), style="dim")
        console.print(table)
    columns = ["robot", *(field.name for field in dataclasses.fields(rc.ReachingSummary))]
    file = write_atomically(arguments.out / "reaching.csv", lambda stream: write_csv(stream, columns, rows))
    print(file)
    return 0
