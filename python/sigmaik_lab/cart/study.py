"""The study `sigmaik cart`."""

from __future__ import annotations

import argparse
from collections.abc import Iterable
from dataclasses import dataclass
from typing import TYPE_CHECKING

from sigmaik._types import Array
from sigmaik.planning.cart import PUBLISHED_ITERATIONS
from sigmaik_lab.options import add_arm, add_output, choices, open_arm
from sigmaik_lab.report import Csv, Picture, Report
from sigmaik_lab.study import Progress

from . import experiment
from .experiment import METHODS, ROBOT, VARIANTS, CartExperiment, CartRun
from .table import cart_table, save_cart_table

if TYPE_CHECKING:
    from matplotlib.figure import Figure

__all__ = ["Drive", "load", "options", "report", "run"]

_GUESSES = ("linear", "admissible")


@dataclass(frozen=True)
class Drive:
    """A variant, and the ways to drive the cart."""

    experiment: CartExperiment
    methods: list[str]
    iterations: int  #: of the gradient descent


def options(parser: argparse.ArgumentParser) -> None:
    add_arm(parser, ROBOT, only="the taught joints and the poses on the cart are that arm's")
    parser.add_argument(
        "--variant",
        choices=(*VARIANTS, "both"),
        default="both",
        help="fk: poses of the paper's joints; paper: the paper's poses, with a tool that makes them fit (%(default)s)",
    )
    parser.add_argument("--method", default=",".join(METHODS), metavar="LIST", help="some of %(default)s")
    parser.add_argument(
        "--samples", type=int, default=5068, metavar="M", help="of the motion; the paper's are %(default)s"
    )
    parser.add_argument(
        "--iterations",
        type=int,
        default=PUBLISHED_ITERATIONS,
        metavar="N",
        help="of the gradient descent; the paper's are %(default)s",
    )
    add_output(parser, "sigmaik-cart")


def load(args: argparse.Namespace) -> Iterable[Drive]:
    open_arm(args)
    if args.iterations < 1:
        raise ValueError("--iterations must be at least 1")
    methods = choices("method", args.method, METHODS)
    variants = VARIANTS if args.variant == "both" else (args.variant,)
    return [Drive(experiment.load(variant, args.samples), methods, args.iterations) for variant in variants]


def run(drive: Drive, progress: Progress) -> list[CartRun]:
    progress.expect(len(drive.methods))
    runs = []
    for method in drive.methods:
        progress.say(f"{drive.experiment.variant}, {METHODS[method]}")
        runs.append(experiment.run(drive.experiment, method, drive.iterations))
        progress.advance()
    return runs


def report(drive: Drive, runs: list[CartRun]) -> Report:
    e = drive.experiment
    exact = [done for done in runs if done.method in ("exact", "plane")]

    def laws() -> Figure:
        from .figure import laws_figure

        return laws_figure(e, runs, *(_stages(drive, guess) for guess in _GUESSES))

    def plane() -> Figure:
        from .figure import plane_figure

        return plane_figure(e, exact)

    def joints() -> Figure:
        from .figure import joints_figure

        return joints_figure(e, runs)

    stem = f"cart-{e.variant}"
    pictures = [Picture(f"{stem}-laws", laws)]
    pictures += [Picture(f"{stem}-plane", plane)] if len(exact) == 2 else []
    pictures += [Picture(f"{stem}-joints", joints)]
    return Report([cart_table(e, runs)], [Csv(stem, lambda file: save_cart_table(e, runs, file)), *pictures])


def _stages(drive: Drive, guess: str) -> list[tuple[int, Array]]:
    """The descent's laws after several numbers of iterations."""
    stops = [n for n in (100, 1000, 10000) if n < drive.iterations] + [drive.iterations]
    return experiment.descent(drive.experiment, guess, stops)
