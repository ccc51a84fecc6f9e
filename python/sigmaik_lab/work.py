"""Where a study's work runs: in this process, in processes of this machine, or on a Dask cluster."""

from __future__ import annotations

import argparse
import concurrent.futures
import contextlib
import os
from collections.abc import Callable, Iterable, Iterator
from typing import TypeVar

from sigmaik._extras import need

__all__ = ["add_work", "check_work", "compute", "executor"]

J = TypeVar("J")
R = TypeVar("R")


def add_work(parser: argparse.ArgumentParser, jobs: int | None = None, why: str = "all cores") -> None:
    """The options --jobs and --dask, for `executor`. jobs: default; None: one for each core. why: its explanation."""
    work = parser.add_argument_group("where it runs")
    default = (os.cpu_count() or 1) if jobs is None else jobs
    work.add_argument("--jobs", type=int, default=default, metavar="N", help=f"processes on this machine ({why})")
    work.add_argument("--dask", metavar="ADDRESS", help="a Dask scheduler instead, such as tcp://host:8786")


def check_work(args: argparse.Namespace) -> None:
    """ValueError where an option of `add_work` is wrong, MissingPackage where Dask is not installed."""
    if args.jobs < 1:
        raise ValueError("--jobs must be at least 1")
    if args.dask is not None:
        need("distributed")


@contextlib.contextmanager
def executor(args: argparse.Namespace) -> Iterator[tuple[concurrent.futures.Executor | None, int]]:
    """The executor that --jobs and --dask ask for, and its number of workers; None: this process."""
    check_work(args)
    if args.dask is not None:
        from distributed import Client

        with Client(args.dask, timeout="10s") as client:  # type: ignore[no-untyped-call]
            yield client.get_executor(), max(1, len(client.nthreads()))
    elif args.jobs == 1:
        yield None, 1
    else:
        with concurrent.futures.ProcessPoolExecutor(args.jobs) as pool:
            yield pool, args.jobs


def compute(
    work: Callable[[J], R], tasks: Iterable[J], pool: concurrent.futures.Executor | None, jobs: int = 1
) -> Iterator[R]:
    """work(task) of all tasks, as they are done. Two tasks per worker wait; the rest is cancelled where the caller
    stops early. pool: any executor; None: this thread works, in the order of the tasks."""
    if pool is None:
        yield from map(work, tasks)
        return
    left = iter(tasks)
    waiting: set[concurrent.futures.Future[R]] = set()

    def submit() -> bool:
        for task in left:
            waiting.add(pool.submit(work, task))
            return True
        return False

    try:
        while len(waiting) < 2 * jobs and submit():
            pass
        while waiting:
            finished = next(concurrent.futures.as_completed(waiting))
            waiting.remove(finished)
            submit()
            yield finished.result()
    finally:
        for future in waiting:
            future.cancel()
