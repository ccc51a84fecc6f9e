"""The command `sigmaik montecarlo`."""

from __future__ import annotations

import argparse
import concurrent.futures
import contextlib
import os
import pathlib
from collections.abc import Iterator
from typing import TYPE_CHECKING

import sigmaik as sk

from ._extras import need
from .console import terminal
from .experiments import montecarlo as mc

if TYPE_CHECKING:
    from rich.console import Console

__all__ = ["add_montecarlo"]


def add_montecarlo(parser: argparse.ArgumentParser) -> None:
    parser.description = (
        "Time-optimal motions between random pairs of configurations, by three objectives, with the metrics of Beck et "
        "al. (2022) beside the paper's. Writes a line for each sample as it comes: called again with the same options "
        "it goes on from where it stopped. The last line on stdout is the last arm's file."
    )
    standard = mc.Study()
    parser.add_argument(
        "--robot",
        default="all",
        metavar="LIST",
        help="shipped arms; all: those whose singular sets are known (%(default)s)",
    )
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
        help="1 as printed in the paper; with 600 durations are like its own (%(default)g)",
    )
    parser.add_argument("--nodes", type=int, default=standard.nodes, metavar="N", help="of a motion (%(default)s)")
    parser.add_argument(
        "--solver", choices=("sigmaik", "ipopt"), default=standard.solver, help="ipopt: by CasADi (%(default)s)"
    )
    parser.add_argument("--generic", action="store_true", help="manipulability from the Jacobian, not in closed form")
    parser.add_argument(
        "--between-nodes", action="store_true", help="keep limits of position between the nodes, as the paper does not"
    )
    work = parser.add_argument_group("where it runs")
    work.add_argument(
        "--jobs", type=int, default=os.cpu_count() or 1, metavar="N", help="processes on this machine (all cores)"
    )
    work.add_argument("--dask", metavar="ADDRESS", help="a Dask scheduler instead, such as tcp://host:8786")
    out = parser.add_argument_group("what is written")
    out.add_argument("--out", default="sigmaik-montecarlo", type=pathlib.Path, metavar="DIR", help="(%(default)s)")
    out.add_argument("--no-plot", action="store_true", help="no picture")
    parser.set_defaults(run=_montecarlo)


def _montecarlo(arguments: argparse.Namespace) -> int:
    console = terminal()
    if not arguments.no_plot:
        need("matplotlib")
    if arguments.solver == "ipopt":
        need("casadi")
    if arguments.jobs < 1:
        raise ValueError("--jobs must be at least 1")
    robots = sk.singularities.names() if arguments.robot == "all" else tuple(arguments.robot.split(","))
    studies = [
        mc.Study(
            robot,
            arguments.samples,
            arguments.seed,
            tuple(arguments.objective.split(",")),
            arguments.nodes,
            arguments.time_weight,
            solver=arguments.solver,
            generic=arguments.generic,
            between_nodes=arguments.between_nodes,
        )
        for robot in robots
    ]
    with _executor(arguments) as (executor, jobs):
        for study in studies:
            _run(study, arguments, console, executor, jobs)
    return 0


def _run(
    study: mc.Study,
    arguments: argparse.Namespace,
    console: Console,
    executor: concurrent.futures.Executor | None,
    jobs: int,
) -> None:
    stem = f"{study.robot}-montecarlo-w{study.time_weight:g}"
    stem += "".join(
        f"-{word}" for word, said in (("ipopt", study.solver == "ipopt"), ("generic", study.generic)) if said
    )
    file = arguments.out / f"{stem}.csv"

    from rich.console import Console
    from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

    from .experiments.montecarlo_table import study_table

    stderr = Console(stderr=True)
    columns = (TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), TimeRemainingColumn())
    with Progress(*columns, console=stderr, transient=True, disable=not stderr.is_terminal) as progress:
        task = progress.add_task(study.robot, total=study.samples)
        rows = mc.run_study(study, file, executor, lambda n: progress.advance(task, n), jobs)

    console.print(
        f"{study.robot}: {study.samples} pairs, seed {study.seed}, time weight {study.time_weight:g}, "
        f"{study.nodes} nodes, {study.solver}{', m from the Jacobian' if study.generic else ''}",
        highlight=False,
    )
    console.print()
    console.print(study_table(study, mc.summarize_study(rows)))
    if not arguments.no_plot:
        from . import plots, plots_montecarlo

        figure = plots_montecarlo.study_figure(study, rows)
        print(f"picture: {plots.save_figure(figure, arguments.out / f'{stem}.png')}")
    print(file)


@contextlib.contextmanager
def _executor(arguments: argparse.Namespace) -> Iterator[tuple[concurrent.futures.Executor | None, int]]:
    if arguments.dask is not None:
        need("distributed")
        from distributed import Client

        with Client(arguments.dask, timeout="10s") as client:  # type: ignore[no-untyped-call]
            yield client.get_executor(), max(1, len(client.nthreads()))
    elif arguments.jobs == 1:
        yield None, 1
    else:
        with concurrent.futures.ProcessPoolExecutor(arguments.jobs) as pool:
            yield pool, arguments.jobs
