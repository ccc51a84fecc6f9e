"""The study `sigmaik arrival`."""

from __future__ import annotations

import argparse
import functools
from collections.abc import Iterable
from dataclasses import dataclass
from typing import TYPE_CHECKING, TypeAlias

import sigmaik as sk
from sigmaik_lab.csv_file import save_rows
from sigmaik_lab.options import add_arms, add_output, choices, open_arms
from sigmaik_lab.report import Csv, Picture, Report
from sigmaik_lab.study import Progress

from .experiment import ARRIVED, SERVOS, TARGETS, TIMES, Arrivals, ArrivalSettings, draw_trials, drive
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
    """Arms, servos and settings."""

    chains: dict[str, sk.Chain]  #: with the limits of the settings
    servos: list[str]
    settings: ArrivalSettings


def options(parser: argparse.ArgumentParser) -> None:
    parser.epilog = (
        "targets: " + "; ".join(f"{name}: {text}" for name, text in TARGETS.items())
        + ". servos: " + "; ".join(f"{name}: {text}" for name, text in SERVOS.items()) + "."
    )  # fmt: skip
    add_arms(parser, "ufactory_xarm7", ", or all shipped arms (all)")
    parser.add_argument("--targets", choices=tuple(TARGETS), default="near", help="(%(default)s)")
    parser.add_argument(
        "--servo", default=",".join(SERVOS), metavar="LIST", help="of %(default)s, or of methods: dls, pinv, …"
    )
    defaults = ArrivalSettings()
    for option, kind, unit, text in _SETTINGS:
        value = getattr(defaults, option.removeprefix("--"))
        shown = text if value is None else f"{text} ({value:g})"
        parser.add_argument(option, type=kind, default=value, metavar=unit, help=shown)
    add_output(parser, "sigmaik-arrival")


def load(args: argparse.Namespace) -> Iterable[ArrivalExperiment]:
    names = ["targets", *(option.removeprefix("--") for option, _, _, _ in _SETTINGS)]
    settings = ArrivalSettings(**{name: getattr(args, name) for name in names})
    methods = [name for name in args.servo.split(",") if name not in SERVOS]
    for name in methods:
        _check_method(name)
    servos = choices("servo", args.servo, [*SERVOS, *methods])
    arms = open_arms(args, sk.robots.names())
    return [ArrivalExperiment({arm.name: settings.with_limits(arm.chain) for arm in arms}, servos, settings)]


def _check_method(name: str) -> None:
    try:
        sk.methods.parse(name)
    except sk.Error as error:
        raise ValueError(f"no servo '{name}'; there are {', '.join(SERVOS)}, and methods: {error}") from None


def run(experiment: ArrivalExperiment, progress: Progress) -> Done:
    e = experiment
    progress.expect(len(e.chains) * len(e.servos) * e.settings.trials)
    done: Done = {}
    for robot, chain in e.chains.items():
        trials = draw_trials(chain, e.settings)
        done[robot] = {}
        for servo in e.servos:
            progress.say(f"{robot}, {servo}")
            done[robot][servo] = drive(chain, trials, servo, e.settings, progress.advance)
    return done


def report(experiment: ArrivalExperiment, done: Done) -> Report:
    e, s = experiment, experiment.settings
    rows = [
        summarize_arrivals(robot, s.targets, servo, arrivals)
        for robot, servos in done.items()
        for servo, arrivals in servos.items()
    ]
    limits = "".join(
        f", {name} {value:g}" for name, value in (("acceleration", s.acceleration), ("jerk", s.jerk)) if value
    )
    headline = (
        f"{s.targets} targets, {s.trials} trials of {s.seconds:g} s at {s.rate:g} Hz, seed {s.seed}{limits}; "
        f"arrived: {1e3 * ARRIVED[0]:g} mm and 0.5°, to stay"
    )
    stem = f"{next(iter(e.chains)) if len(e.chains) == 1 else 'arms'}-arrival-{s.targets}"
    draw = functools.partial(_draw, f"{s.targets} targets: arrivals", s.seconds, done)
    return Report([headline, arrival_table(rows)], [Csv(stem, lambda file: save_rows(rows, file)), Picture(stem, draw)])


def _draw(title: str, seconds: float, done: Done) -> Figure:
    from .figure import arrival_figure

    return arrival_figure(title, seconds, done)
