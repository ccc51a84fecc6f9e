"""The study `sigmaik montecarlo`."""

from __future__ import annotations

import argparse
import concurrent.futures
import pathlib
from collections.abc import Iterable
from dataclasses import dataclass
from typing import TYPE_CHECKING

import sigmaik as sk
from sigmaik._extras import need
from sigmaik_lab.options import add_arms, add_output, open_arms
from sigmaik_lab.report import Csv, Picture, Report
from sigmaik_lab.study import Progress
from sigmaik_lab.work import add_work, check_work, executor

from .experiment import MonteCarlo, Row, run_study, summarize_study
from .table import study_table

if TYPE_CHECKING:
    from matplotlib.figure import Figure

__all__ = ["Job", "load", "options", "report", "run"]


@dataclass(frozen=True)
class Job:
    """A study of one arm, the file from which the study resumes, and the executor of the work."""

    study: MonteCarlo
    file: pathlib.Path
    executor: concurrent.futures.Executor | None
    jobs: int


def options(parser: argparse.ArgumentParser) -> None:
    standard = MonteCarlo()
    add_arms(parser, "all", "; all: shipped arms whose singular sets are known")
    parser.add_argument("--samples", type=int, default=standard.samples, metavar="N", help="pairs (%(default)s)")
    parser.add_argument("--seed", type=int, default=standard.seed, metavar="N", help="of the pairs (%(default)s)")
    parser.add_argument(
        "--objective",
        default=",".join(standard.objectives),
        metavar="LIST",
        help="some of %(default)s",
    )
    parser.add_argument(
        "--time-weight",
        type=float,
        default=standard.time_weight,
        metavar="W",
        help="1 as printed in the paper; with 600 the durations are like the paper's (%(default)g)",
    )
    parser.add_argument("--nodes", type=int, default=standard.nodes, metavar="N", help="of a motion (%(default)s)")
    parser.add_argument(
        "--solver", choices=("sigmaik", "ipopt"), default=standard.solver, help="ipopt: by CasADi (%(default)s)"
    )
    parser.add_argument("--generic", action="store_true", help="manipulability from the Jacobian, not in closed form")
    parser.add_argument(
        "--between-nodes", action="store_true", help="keep limits of position between the nodes, as the paper does not"
    )
    add_work(parser)
    add_output(parser, "sigmaik-montecarlo")


def load(args: argparse.Namespace) -> Iterable[Job]:
    if args.solver == "ipopt":
        need("casadi")
    check_work(args)
    every = sk.singularities.names()
    open_arms(args, every)
    studies = [
        MonteCarlo(
            robot,
            args.samples,
            args.seed,
            tuple(args.objective.split(",")),
            args.nodes,
            args.time_weight,
            solver=args.solver,
            generic=args.generic,
            between_nodes=args.between_nodes,
            base=args.base,
            tip=args.tip,
        )
        for robot in (every if args.robot == "all" else args.robot.split(","))
    ]
    with executor(args) as (pool, jobs):
        for study in studies:
            yield Job(study, args.out / f"{_stem(study)}.csv", pool, jobs)


def run(job: Job, progress: Progress) -> list[Row]:
    progress.expect(job.study.samples)
    progress.say(f"{job.study.name}, {job.study.samples} pairs")
    return run_study(job.study, job.file, job.executor, progress.advance, job.jobs)


def report(job: Job, rows: list[Row]) -> Report:
    study = job.study

    def draw() -> Figure:
        from .figure import study_figure

        return study_figure(study, rows)

    headline = (
        f"{study.name}: {study.samples} pairs, seed {study.seed}, time weight {study.time_weight:g}, "
        f"{study.nodes} nodes, {study.solver}{', m from the Jacobian' if study.generic else ''}"
    )
    stem = _stem(study)
    written = Csv(stem, lambda _: None)  # the run has written the file, line by line
    return Report([headline, "", study_table(study, summarize_study(rows))], [Picture(stem, draw), written])


def _stem(study: MonteCarlo) -> str:
    words = [word for word, said in (("ipopt", study.solver == "ipopt"), ("generic", study.generic)) if said]
    return "-".join([study.name, f"montecarlo-w{study.time_weight:g}", *words])
