"""The study `sigmaik arrival`."""

from __future__ import annotations

import argparse
import concurrent.futures
import functools
import itertools
import pathlib
from collections.abc import Iterable
from dataclasses import dataclass
from typing import TYPE_CHECKING, TypeAlias

import sigmaik as sk
from sigmaik_lab.csv_file import save_rows
from sigmaik_lab.options import add_arms, add_output, open_arms
from sigmaik_lab.report import Csv, Picture, Report
from sigmaik_lab.study import Progress
from sigmaik_lab.work import add_work, check_work, executor

from .experiment import TARGETS, TIMES, Arrivals, ArrivalSettings, arrivals
from .judge import ARRIVED, TrialRow
from .peers import PEERS, VARIANTS
from .run import ArmSource, Plan, known_rows, missing_tasks, run_trials
from .servos import SERVOS, check_servo
from .summary import summarize_arrivals
from .table import arrival_table

if TYPE_CHECKING:
    from matplotlib.figure import Figure

__all__ = ["ArrivalExperiment", "load", "options", "report", "run"]

Done: TypeAlias = dict[str, dict[str, Arrivals]]  #: of each arm, of each servo

_SETTINGS = (
    ("--trials", int, "N", "of each arm"),
    ("--time", float, "S", "of each trial (" + ", ".join(f"{name} {t:g}" for name, t in TIMES.items()) + ")"),
    ("--rate", float, "HZ", "control rate"),
    ("--seed", int, "N", "of starts and targets"),
    ("--acceleration", float, "LIMIT", "of all joints, rad/s² or m/s² (the arm's own, or the servo's assumption)"),
    ("--jerk", float, "LIMIT", "of all joints, rad/s³ or m/s³ (the arm's own)"),
)


@dataclass(frozen=True)
class ArrivalExperiment:
    """Arms, servos and settings, the file from which the run resumes, and the executor of the work."""

    plan: Plan
    file: pathlib.Path | None
    pool: concurrent.futures.Executor | None
    jobs: int


def options(parser: argparse.ArgumentParser) -> None:
    parser.epilog = (
        "targets: " + "; ".join(f"{name}: {text}" for name, text in TARGETS.items())
        + ". servos: " + "; ".join(f"{name}: {text}" for name, text in SERVOS.items())
        + "; peers: " + "; ".join(f"{name}: {peer.about}" for name, peer in PEERS.items())
        + "; and after a peer's name: " + "; ".join(f"+{name}: {text}" for name, text in VARIANTS.items()) + "."
    )  # fmt: skip
    add_arms(parser, "ufactory_xarm7", ", or all shipped arms (all)")
    parser.add_argument("--targets", choices=tuple(TARGETS), default="near", help="(%(default)s)")
    parser.add_argument(
        "--servo", default=",".join(SERVOS), metavar="LIST", help="of %(default)s, methods (dls, pinv, …) and peers"
    )
    defaults = ArrivalSettings()
    for option, kind, unit, text in _SETTINGS:
        value = getattr(defaults, option.removeprefix("--"))
        shown = text if value is None else f"{text} ({value:g})"
        parser.add_argument(option, type=kind, default=value, metavar=unit, help=shown)
    parser.add_argument(
        "--resume",
        type=pathlib.Path,
        metavar="FILE",
        help="a CSV file with a row for each trial: its rows are not computed again, and new rows are added",
    )
    add_work(parser, jobs=1, why="1, so that cycles are timed undisturbed")
    add_output(parser, "sigmaik-arrival")


def load(args: argparse.Namespace) -> Iterable[ArrivalExperiment]:
    names = ["targets", *(option.removeprefix("--") for option, _, _, _ in _SETTINGS)]
    settings = ArrivalSettings(**{name: getattr(args, name) for name in names})
    check_work(args)
    servos = tuple(dict.fromkeys(args.servo.split(",")))
    for name in servos:
        check_servo(name, installed=False)
    open_arms(args, sk.robots.names())
    listed = sk.robots.names() if args.robot == "all" else args.robot.split(",")
    arms = tuple(ArmSource(robot, args.base, args.tip) for robot in listed)
    plan = Plan(arms, servos, settings)
    for _, name, _, _ in missing_tasks(plan, known_rows(plan, args.resume)):
        check_servo(name)
    with executor(args) as (pool, jobs):
        yield ArrivalExperiment(plan, args.resume, pool, jobs)


def run(experiment: ArrivalExperiment, progress: Progress) -> list[TrialRow]:
    e = experiment
    left = sum(len(numbers) for _, _, _, numbers in missing_tasks(e.plan, known_rows(e.plan, e.file)))
    progress.expect(left)

    def advance(what: str, done: int) -> None:
        progress.say(what)
        progress.advance(done)

    return run_trials(e.plan, e.file, e.pool, e.jobs, advance)


def report(experiment: ArrivalExperiment, rows: list[TrialRow]) -> Report:
    s, arms = experiment.plan.settings, experiment.plan.arms
    done: Done = {}
    setups: dict[str, str] = {}
    for (robot, servo), group in itertools.groupby(rows, key=lambda row: (row.robot, row.servo)):
        mine = list(group)
        done.setdefault(robot, {})[servo] = arrivals(mine)
        setups[servo] = mine[-1].setup
    summaries = [
        summarize_arrivals(robot, s.targets, servo, found)
        for robot, servos in done.items()
        for servo, found in servos.items()
    ]
    limits = "".join(
        f", {name} {value:g}" for name, value in (("acceleration", s.acceleration), ("jerk", s.jerk)) if value
    )
    headline = (
        f"{s.targets} targets, {s.trials} trials of {s.seconds:g} s at {s.rate:g} Hz, seed {s.seed}{limits}; "
        f"arrived: {1e3 * ARRIVED[0]:g} mm and 0.5°, to stay"
    )
    stem = f"{arms[0].name if len(arms) == 1 else 'arms'}-arrival-{s.targets}"
    draw = functools.partial(_draw, f"{s.targets} targets: arrivals", s.seconds, done)
    return Report(
        [headline, arrival_table(summaries), *(f"{servo}: {setup}" for servo, setup in setups.items())],
        [Csv(stem, lambda file: save_rows(summaries, file)), Picture(stem, draw)],
    )


def _draw(title: str, seconds: float, done: Done) -> Figure:
    from .figure import arrival_figure

    return arrival_figure(title, seconds, done)
