"""The study `sigmaik round-table`, by its older name `sigmaik table`."""

from __future__ import annotations

import argparse
from collections.abc import Iterable
from typing import TYPE_CHECKING

from sigmaik.planning import Trajectory
from sigmaik_lab.options import add_arm, add_output, open_arm
from sigmaik_lab.report import Picture, Report
from sigmaik_lab.study import Progress

from . import experiment
from .experiment import ROBOT, RoundTable
from .table import motion_table

if TYPE_CHECKING:
    from matplotlib.figure import Figure

__all__ = ["load", "options", "report", "run"]


def options(parser: argparse.ArgumentParser) -> None:
    add_arm(parser, ROBOT, only="the table stands where that arm reaches under it and above it")
    parser.add_argument("--seed", type=int, default=0, metavar="N", help="of start, goal and samples (%(default)s)")
    add_output(parser, "sigmaik-table")


def load(args: argparse.Namespace) -> Iterable[tuple[RoundTable, int]]:
    open_arm(args)
    if args.seed < 0:
        raise ValueError("--seed must not be negative")
    return [(experiment.load(args.seed), args.seed)]


def run(asked: tuple[RoundTable, int], progress: Progress) -> dict[str, Trajectory]:
    task, seed = asked
    progress.expect(2)
    plans = {}
    for name, index in (("with", True), ("without", False)):
        progress.say(f"{name} the index")
        plans[name] = experiment.plan(task, index, seed)
        progress.advance()
    return plans


def report(asked: tuple[RoundTable, int], plans: dict[str, Trajectory]) -> Report:
    task, _ = asked
    motions = {name: experiment.along(task, plan) for name, plan in plans.items() if plan.status != "failed"}

    def draw() -> Figure:
        from .figure import round_table_figure

        return round_table_figure(task, motions)

    return Report([motion_table(plans, motions)], [Picture("table", draw)])
