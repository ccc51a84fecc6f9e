"""The study `sigmaik solvers`."""

from __future__ import annotations

import argparse
import functools
from collections.abc import Iterable
from dataclasses import dataclass

import sigmaik as sk
from sigmaik._extras import installed
from sigmaik_lab.csv_file import save_rows
from sigmaik_lab.options import add_arm, add_output, open_arm
from sigmaik_lab.report import Csv, Picture, Report
from sigmaik_lab.study import Progress

from .cases import PANELS, STARTS, Case, draw_cases
from .experiment import SOLVED, SolverRow, solve_cases, summarize_solvers
from .solvers import SOLVERS, check_solver, make_solver
from .table import panel_tables

__all__ = ["SolversExperiment", "load", "options", "report", "run"]


@dataclass(frozen=True)
class SolversExperiment:
    """An arm, solvers and cases."""

    arm: sk.robots.Arm
    solvers: list[str]
    cases: list[Case]
    trials: int
    seed: int


def options(parser: argparse.ArgumentParser) -> None:
    parser.epilog = (
        "panels: " + "; ".join(f"{name}: {text}" for name, text in PANELS.items())
        + ". starts: " + "; ".join(f"{name}: {text}" for name, text in STARTS.items())
        + ". solvers: " + "; ".join(f"{name}: {entry.about}" for name, entry in SOLVERS.items()) + "."
    )  # fmt: skip
    add_arm(parser, "franka_panda")
    parser.add_argument("--solver", metavar="LIST", help="of the solvers below (all whose packages are installed)")
    parser.add_argument("--trials", type=int, default=100, metavar="N", help="of each group (%(default)s)")
    parser.add_argument("--seed", type=int, default=0, metavar="N", help="(%(default)s)")
    add_output(parser, "sigmaik-solvers")


def load(args: argparse.Namespace) -> Iterable[SolversExperiment]:
    if args.trials < 1 or args.seed < 0:
        raise ValueError("--trials must be positive, and --seed not negative")
    if args.solver is None:
        names = [name for name, entry in SOLVERS.items() if all(map(installed, entry.modules))]
    else:
        names = list(dict.fromkeys(args.solver.split(",")))
    for name in names:
        check_solver(name)
    arm = open_arm(args)
    return [SolversExperiment(arm, names, draw_cases(arm.chain, args.trials, args.seed), args.trials, args.seed)]


def run(experiment: SolversExperiment, progress: Progress) -> list[SolverRow]:
    e = experiment
    progress.expect(len(e.solvers) * len(e.cases))
    rows = []
    for name in e.solvers:
        progress.say(name)
        rows += solve_cases(e.arm.chain, name, make_solver(name, e.arm.chain), e.cases, progress.advance)
    return rows


def report(experiment: SolversExperiment, rows: list[SolverRow]) -> Report:
    e = experiment
    summaries = summarize_solvers(rows)
    headline = (
        f"{e.arm.name}: positions of the tip, {e.trials} trials of each group, seed {e.seed}; solved: within "
        f"{1e3 * SOLVED:g} mm and inside the joint ranges; a step of the tip: within 0.1 mm"
    )
    stem = f"{e.arm.name}-solvers"

    def draw() -> object:
        from .figure import solvers_figure

        return solvers_figure(f"{e.arm.name}: solvers of positions, {e.trials} trials of each group", rows)

    return Report(
        [headline, *panel_tables(rows)],
        [
            Csv(f"{stem}-trials", functools.partial(save_rows, rows)),
            Csv(stem, functools.partial(save_rows, summaries)),
            Picture(stem, draw),  # type: ignore[arg-type]
        ],
    )
