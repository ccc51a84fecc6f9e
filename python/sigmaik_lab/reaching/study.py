"""The study `sigmaik reaching`."""

from __future__ import annotations

import argparse
import dataclasses
from collections.abc import Iterable
from dataclasses import dataclass

from sigmaik_lab.csv_file import save_csv
from sigmaik_lab.options import add_arms, add_output, choices, open_arms
from sigmaik_lab.report import Csv, Report
from sigmaik_lab.study import Progress

from .experiment import METHODS, ROBOTS, Planning, ReachingSummary, solve_task, summarize_runs, task
from .table import reaching_table

__all__ = ["Tasks", "load", "options", "report", "run"]


@dataclass(frozen=True)
class Tasks:
    """The same number of tasks for each arm, by several methods."""

    robots: dict[str, str]  #: name to the name or file that `task` opens
    base: str | None
    tip: str | None
    methods: list[str]
    count: int
    seed: int
    planning: Planning


def options(parser: argparse.ArgumentParser) -> None:
    parser.epilog = "methods: " + "; ".join(f"{name}: {text}" for name, text in METHODS.items())
    add_arms(parser, ",".join(ROBOTS))
    parser.add_argument("--tasks", type=int, default=100, metavar="N", help="of each arm (%(default)s)")
    parser.add_argument("--seed", type=int, default=0, metavar="N", help="of tasks and samples (%(default)s)")
    parser.add_argument("--method", default=",".join(METHODS), metavar="LIST", help="some of %(default)s")
    standard = Planning()
    parser.add_argument("--states", type=int, default=standard.states, metavar="N", help="of a motion (%(default)s)")
    parser.add_argument(
        "--samples", type=int, default=standard.samples, metavar="N", help="of an iteration, stochastic (%(default)s)"
    )
    parser.add_argument(
        "--prior-weight", type=float, default=standard.prior_weight, metavar="W", help="against the index (%(default)g)"
    )
    add_output(parser, "sigmaik-reaching", plots=False)


def load(args: argparse.Namespace) -> Iterable[Tasks]:
    methods = choices("method", args.method, METHODS)
    if args.tasks < 1 or args.seed < 0:
        raise ValueError("--tasks must be positive, and --seed not negative")
    names = [arm.name for arm in open_arms(args)]
    robots = dict(zip(names, args.robot.split(","), strict=True))
    planning = Planning(args.states, args.samples, args.prior_weight)
    return [Tasks(robots, args.base, args.tip, methods, args.tasks, args.seed, planning)]


def run(tasks: Tasks, progress: Progress) -> dict[str, list[ReachingSummary]]:
    progress.expect(len(tasks.robots) * tasks.count)
    summaries = {}
    for name, robot in tasks.robots.items():
        progress.say(name)
        runs = []
        for number in range(tasks.count):
            chain, start, goal = task(robot, tasks.seed, number, tasks.base, tasks.tip)
            seed = tasks.seed + number
            runs += [solve_task(chain, start, goal, method, seed, tasks.planning) for method in tasks.methods]
            progress.advance()
        summaries[name] = summarize_runs(runs)
    return summaries


def report(tasks: Tasks, summaries: dict[str, list[ReachingSummary]]) -> Report:
    text = [
        line
        for name, rows in summaries.items()
        for line in (f"{name}, {tasks.count} tasks, seed {tasks.seed}", reaching_table(name, rows))
    ]
    columns = ["robot", *(field.name for field in dataclasses.fields(ReachingSummary))]
    lines = [[name, *dataclasses.astuple(row)] for name, rows in summaries.items() for row in rows]
    return Report(text, [Csv("reaching", lambda file: save_csv(file, columns, lines))])
