"""The study `sigmaik limits`."""

from __future__ import annotations

import argparse
from collections.abc import Iterable
from dataclasses import dataclass
from typing import TYPE_CHECKING

from sigmaik_lab.csv_file import save_rows
from sigmaik_lab.options import add_arm, add_output
from sigmaik_lab.report import Csv, Picture, Report, Series
from sigmaik_lab.study import Progress

from .experiment import SCENARIOS, VARIANTS, LimitsExperiment, Trace, drive, load_limits
from .files import save_traces
from .summary import LimitsSummary, summarize_limits
from .table import broken_table, cost_table, hold_table
from .trials import LimitsSettings, shown_trial

if TYPE_CHECKING:
    from matplotlib.figure import Figure

__all__ = ["Drive", "Driven", "load", "options", "report", "run"]

_SETTINGS = (
    ("--seed", int, "N", "of directions, starts and twists"),
    ("--rate", float, "HZ", "control rate"),
    ("--trials", int, "N", "directions that the target out of reach is tried in"),
    ("--seconds", float, "S", "of random twists"),
    ("--pace", float, "X", "the other scenarios take X times as long"),
    ("--acceleration", float, "LIMIT", "of all joints, rad/s² or m/s² (the arm's own)"),
    ("--jerk", float, "LIMIT", "of all joints, rad/s³ or m/s³ (the arm's own)"),
)
_NOTE = """
broken: joints times cycles; by rad or m, or times the limit. limited: cycles in
which limits changed the tool's motion; others help: only the joints'. done:
part of the rule's twist. direction: from the rule's to the tool's velocity
while limited, median and 95 %. turns: rotation not asked for, then, rms.
error: at the end of a hold, median."""


@dataclass(frozen=True)
class Drive:
    """An experiment, and whether its time series are wanted: each series takes 10 MB."""

    experiment: LimitsExperiment
    series: bool


@dataclass(frozen=True)
class Driven:
    """A variant in a scenario."""

    summary: LimitsSummary
    shown: Trace  #: of the trial that makes the picture
    traces: list[Trace]  #: of all trials; empty where time series are not wanted


def options(parser: argparse.ArgumentParser) -> None:
    parser.epilog = "ways: " + "; ".join(f"{name}: {text}" for name, text in VARIANTS.items())
    add_arm(parser)
    parser.add_argument("--method", default="jparse", help="the rule, as for reach (%(default)s)")
    defaults = LimitsSettings()
    for option, kind, unit, text in _SETTINGS:
        value = getattr(defaults, option.removeprefix("--"))
        shown = text if value is None else f"{text} ({value:g})"
        parser.add_argument(option, type=kind, default=value, metavar=unit, help=shown)
    add_output(parser, "sigmaik-limits", ("npz",), default="none")


def load(args: argparse.Namespace) -> Iterable[Drive]:
    names = [option.removeprefix("--") for option, _, _, _ in _SETTINGS]
    settings = LimitsSettings(**{name: getattr(args, name) for name in names})
    experiment = load_limits(args.robot, settings, args.method, base=args.base, tip=args.tip)
    return [Drive(experiment, args.format != "none")]


def run(job: Drive, progress: Progress) -> list[Driven]:
    e = job.experiment
    progress.expect(e.cycles * len(VARIANTS))
    driven = []
    for scenario, trials in e.trials.items():
        for variant in VARIANTS:
            progress.say(f"{scenario}, {variant}")
            traces = [drive(e, scenario, trial, variant, progress.advance) for trial in trials]
            shown = traces[shown_trial(scenario, trials)]
            driven.append(Driven(summarize_limits(traces), shown, traces if job.series else []))
    return driven


def report(job: Drive, runs: list[Driven]) -> Report:
    e = job.experiment
    rows = [done.summary for done in runs]
    headline = f"{e.robot}, {e.method.label}, {e.settings.rate:g} Hz, seed {e.settings.seed}"
    scenarios = [f"  {scenario}: {SCENARIOS[scenario]}" for scenario in e.trials]
    tables = [text for table in (broken_table(rows), cost_table(rows), hold_table(rows)) for text in ("", table)]
    series = [_series(e, done) for done in runs if done.traces]
    pictures = [_picture(e, scenario, runs) for scenario in e.trials]
    stem = f"{e.robot}-limits"
    return Report(
        [headline, *scenarios, *tables, _NOTE],
        [*series, *pictures, Csv(stem, lambda file: save_rows(rows, file))],
    )


def _stem(e: LimitsExperiment, scenario: str) -> str:
    return f"{e.robot}-limits-{scenario.replace(' ', '-')}"


def _series(e: LimitsExperiment, done: Driven) -> Series:
    stem = f"{_stem(e, done.summary.scenario)}-{done.summary.variant.replace(' ', '-')}"
    return Series(stem, lambda file, _: save_traces(done.traces, file))


def _picture(e: LimitsExperiment, scenario: str, runs: list[Driven]) -> Picture:
    def draw() -> Figure:
        from .figure import limits_figure

        window = (0.0, min(15.0, e.settings.seconds)) if scenario == "teleoperation" else None
        return limits_figure([done.shown for done in runs if done.summary.scenario == scenario], window)

    return Picture(_stem(e, scenario), draw)
