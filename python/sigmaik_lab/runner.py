"""How a study is run from the command line."""

from __future__ import annotations

import argparse
import contextlib
from collections.abc import Iterator
from typing import Any

from sigmaik._extras import need

from . import output
from .study import find_study

__all__ = ["parsed", "run_study"]


def parsed(name: str, words: list[str]) -> argparse.Namespace:
    """A study's options, read from the words of a command line."""
    study = find_study(name)
    assert study is not None
    parser = argparse.ArgumentParser(prog=f"sigmaik {name}")
    study.options(parser)
    return parser.parse_args(words)


def run_study(name: str, args: argparse.Namespace) -> int:
    """Loads, runs and reports a study, one experiment after the other. Returns the exit code."""
    study = find_study(name)
    assert study is not None
    if not getattr(args, "no_plot", True):
        need("matplotlib")  # a missing package ends the command before the run, and not after
    with _closing(iter(study.load(args))) as experiments:
        for experiment in experiments:
            with output.progress(name) as progress:
                runs = study.run(experiment, progress)
            output.show(study.report(experiment, runs), args)
    return 0


@contextlib.contextmanager
def _closing(experiments: Iterator[Any]) -> Iterator[Iterator[Any]]:
    """Closes a generator, so that its `finally` runs where a run is interrupted."""
    try:
        yield experiments
    finally:
        close = getattr(experiments, "close", None)
        if close is not None:
            close()
