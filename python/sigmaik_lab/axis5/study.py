"""The study `sigmaik axis5`."""

from __future__ import annotations

import argparse
import math
from collections.abc import Callable, Iterable
from typing import TYPE_CHECKING

from sigmaik_lab.options import add_arm, add_output, open_arm
from sigmaik_lab.report import Csv, Picture, Report, Series
from sigmaik_lab.study import Progress

from . import experiment
from .experiment import EXAMPLES, ROBOT, VARIANTS, Axis5Settings, Motion, Track
from .files import save_summary, save_track
from .summary import summarize
from .table import headline, smoothness_table, summary_table

if TYPE_CHECKING:
    from matplotlib.figure import Figure

__all__ = ["load", "options", "report", "run"]


def options(parser: argparse.ArgumentParser) -> None:
    motion = parser.add_argument_group("the motion")
    add_arm(motion, ROBOT, only="the lines start at configurations of that arm, by its axis-5 singularity")
    motion.add_argument(
        "--example",
        type=int,
        choices=EXAMPLES,
        required=True,
        help="1: there and back, close by the singularity; 2: straight across it",
    )
    for option, unit, text in (
        ("--distance", "M", "from one end of the line to the other (0.2)"),
        ("--duration", "S", "from one end to the other (2, 0.5)"),
        ("--offset", "DEG", "of axis 5 from zero, where it is closest (1), or at the start (0)"),
    ):
        motion.add_argument(option, type=float, metavar=unit, help=text)
    solver = parser.add_argument_group("the samples and the solver")
    for option, unit, text in (
        ("--dt", "S", "from one sample to the next (0.004)"),
        ("--beta", "Β", "weight of the error's change in a sample (5 at 1 ms, ∝ 1/√dt)"),
        ("--gamma", "Γ", "weight of the time scaling (0.005 at 4 ms, ∝ √dt)"),
        ("--max-error", "DEG", "largest orientation error about each axis; inf for any (3)"),
    ):
        solver.add_argument(option, type=float, metavar=unit, help=text)
    solver.add_argument("--iterations", type=int, help="linearisations a sample (2)")
    add_output(parser, "sigmaik-axis5", ("npz", "csv"))


def load(args: argparse.Namespace) -> Iterable[tuple[Motion, Axis5Settings]]:
    open_arm(args)
    offset = None if args.offset is None else math.radians(args.offset)
    motion = experiment.motion(args.example, args.distance, args.duration, offset)
    changes = {name: getattr(args, name) for name in ("dt", "beta", "gamma", "iterations")}
    if args.max_error is not None:
        changes["max_error"] = math.radians(args.max_error)
    return [(motion, Axis5Settings(**{name: value for name, value in changes.items() if value is not None}))]


def run(asked: tuple[Motion, Axis5Settings], progress: Progress) -> list[Track]:
    motion, settings = asked
    progress.expect(len(VARIANTS) * experiment.count_samples(motion, settings))
    tracks = []
    for variant, title in VARIANTS.items():
        progress.say(title)
        tracks.append(experiment.run(motion, variant, settings, progress.advance))
    return tracks


def report(asked: tuple[Motion, Axis5Settings], tracks: list[Track]) -> Report:
    motion, settings = asked
    rows = [summarize(track) for track in tracks]
    stem = f"axis5-example{motion.example}"

    def series(track: Track) -> Series:
        return Series(f"{stem}-{track.variant}", lambda file, form: save_track(track, file, form))

    return Report(
        [headline(motion, settings), summary_table(rows), smoothness_table(rows)],
        [
            *map(series, tracks),
            Csv(stem, lambda file: save_summary(rows, file)),
            *(Picture(f"{stem}-axis{joint + 1}", _axis(tracks, joint)) for joint in range(6)),
            Picture(f"{stem}-error", lambda: _figure("error_figure", tracks)),
            Picture(stem, lambda: _figure("overview_figure", tracks)),
        ],
    )


def _axis(tracks: list[Track], joint: int) -> Callable[[], Figure]:
    return lambda: _figure("axis_figure", tracks, joint)


def _figure(name: str, *arguments: object) -> Figure:
    from . import figure

    drawn: Figure = getattr(figure, name)(*arguments)
    return drawn
