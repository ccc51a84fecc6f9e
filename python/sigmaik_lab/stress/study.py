"""The study `sigmaik stress`."""

from __future__ import annotations

import argparse
import concurrent.futures
import pathlib
import subprocess
from collections.abc import Iterable
from dataclasses import dataclass

import sigmaik as sk
from sigmaik_lab.csv_file import save_rows
from sigmaik_lab.options import add_output
from sigmaik_lab.report import Csv, Report, Table
from sigmaik_lab.study import Progress
from sigmaik_lab.work import add_work, check_work, executor

from .experiment import PROGRAMS, CountRow, Piece, Plan, known_rows, missing, run_pieces, totals

__all__ = ["StressExperiment", "load", "options", "report", "run"]


@dataclass(frozen=True)
class StressExperiment:
    """The work, the file from which the run resumes, and the executor."""

    plan: Plan
    file: pathlib.Path | None
    pool: concurrent.futures.Executor | None
    jobs: int


def options(parser: argparse.ArgumentParser) -> None:
    number = float  # 1e9 is a number of cycles
    parser.add_argument("--cycles", type=number, default=1e7, metavar="N", help="of the stress program (1e7)")
    parser.add_argument("--cases", type=number, metavar="N", help="of the settling program (a thousandth of --cycles)")
    parser.add_argument("--piece", type=number, default=1e6, metavar="N", help="cycles of a piece (1e6)")
    parser.add_argument("--seed", type=int, default=1, metavar="N", help="of all pieces (%(default)s)")
    parser.add_argument(
        "--programs",
        type=pathlib.Path,
        default=pathlib.Path("build/release"),
        metavar="FOLDER",
        help="of sigmaik_stress and sigmaik_settling, at the same place on each worker (%(default)s)",
    )
    parser.add_argument(
        "--resume",
        type=pathlib.Path,
        metavar="FILE",
        help="a CSV file with the counts of each piece: its pieces are not run again, and new ones are added",
    )
    add_work(parser)
    add_output(parser, "sigmaik-stress", plots=False)


def load(args: argparse.Namespace) -> Iterable[StressExperiment]:
    cases = args.cycles / 1000 if args.cases is None else args.cases
    for name, value, least in (("cycles", args.cycles, 1), ("cases", cases, 0), ("piece", args.piece, 1000)):
        if not least <= value <= 1e15:
            raise ValueError(f"--{name} must be at least {least:g}, not {value:g}")
    if not 0 <= args.seed < 2**31:
        raise ValueError("--seed must be from 0 to 2147483647")
    check_work(args)
    work = {"sigmaik_stress": int(args.cycles), "sigmaik_settling": int(cases)}
    size = {"sigmaik_stress": int(args.piece), "sigmaik_settling": max(1, int(args.piece) // 1000)}
    plan = Plan(args.programs.resolve(), {p: n for p, n in work.items() if n > 0}, size, args.seed)
    known_rows(plan, args.resume)  # a wrong file is refused before anything runs
    with executor(args) as (pool, jobs):
        yield StressExperiment(plan, args.resume, pool, jobs)


def run(experiment: StressExperiment, progress: Progress) -> list[CountRow]:
    e = experiment
    progress.expect(len(missing(e.plan, known_rows(e.plan, e.file))))

    def advance(piece: Piece) -> None:
        progress.say(f"{piece.program}, piece {piece.number}")
        progress.advance()

    return run_pieces(e.plan, e.file, e.pool, e.jobs, advance)


def report(experiment: StressExperiment, rows: list[CountRow]) -> Report:
    sums = totals(rows)
    table = Table("counts of each property")
    table.add_column("property", wrap=True)
    table.add_column("of", wrap=True)
    table.add_numbers("cases", "failed", "worst")
    for total in sums:
        table.add_row(total.property, total.of, str(total.cases), str(total.failed), f"{total.worst:.4g}")
    hours = sum({(row.program, row.piece): row.seconds for row in rows}.values()) / 3600.0
    done = {program: len({row.piece for row in rows if row.program == program}) for program in experiment.plan.work}
    size = experiment.plan.size
    work = ", ".join(f"{done[p] * size[p]:.3g} {PROGRAMS[p]} in {done[p]} pieces" for p in done)
    again = [f"{t.program}: {t.property} failed in {t.again}" for t in sums if t.failed]
    headline = (
        f"{work}; seed {experiment.plan.seed}, {hours:.2f} hours of one core; version {sk.__version__}, {_commit()}"
    )
    return Report([headline, table, *again], [Csv("stress", lambda file: save_rows(sums, file))])


def _commit() -> str:
    """The commit of this folder, with a + where files differ from it."""
    try:
        run = subprocess.run(
            ["git", "describe", "--always", "--dirty=+", "--exclude=*"], capture_output=True, text=True, check=True
        )
    except (OSError, subprocess.CalledProcessError):
        return "no commit known"
    return f"commit {run.stdout.strip()}"
