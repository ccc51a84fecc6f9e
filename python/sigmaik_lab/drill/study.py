"""The study `sigmaik drill`, which `sigmaik teleop --drill` is too."""

from __future__ import annotations

import argparse
from collections.abc import Iterable

from sigmaik_lab.options import add_arms, open_arms
from sigmaik_lab.report import Report
from sigmaik_lab.study import Progress

from .experiment import ROBOTS, Drill, drill
from .table import drill_table

__all__ = ["load", "options", "report", "run"]


def options(parser: argparse.ArgumentParser) -> None:
    add_arms(parser, ",".join(ROBOTS))
    parser.add_argument("--seconds", type=float, default=3.0, metavar="S", help="of each of four targets (%(default)g)")


def load(args: argparse.Namespace) -> Iterable[argparse.Namespace]:
    open_arms(args)
    if not 0.0 < args.seconds < 1e6:
        raise ValueError(f"--seconds must be above 0, not {args.seconds:g}")
    return [args]


def run(args: argparse.Namespace, progress: Progress) -> list[Drill]:
    progress.expect(1.0)
    progress.say("driving")
    done = 0.0

    def advance(part: float) -> None:
        nonlocal done
        progress.advance(part - done)
        done = part

    return drill(args.robot.split(","), seconds=args.seconds, progress=advance, base=args.base, tip=args.tip)


def report(_: argparse.Namespace, runs: list[Drill]) -> Report:
    broken = sum(row.broken for row in runs)
    return Report(
        [
            drill_table(runs),
            "speed: the largest, of its limit. broken: joints times cycles beyond a limit of\n"
            "position, velocity or acceleration. error: from home, at the end.\n"
            f"{sum(row.cycles for row in runs)} cycles, {broken} limits broken",
        ]
    )
