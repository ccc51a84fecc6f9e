"""The interface of a study, and how the command line finds studies by name."""

from __future__ import annotations

import argparse
import importlib
import importlib.util
import pkgutil
from collections.abc import Iterable
from typing import Any, Protocol, TypeVar

from .report import Report

__all__ = ["Command", "Progress", "Study", "describe", "find_command", "find_study", "names"]

_PACKAGE = __package__ or "sigmaik_lab"

E = TypeVar("E")
R = TypeVar("R")


class Progress(Protocol):
    """Progress of a run. The command line shows a bar, or prints a line every ten seconds."""

    def expect(self, total: float) -> None:
        """total: the whole work, in any unit. A later call replaces the total."""

    def say(self, what: str) -> None:
        """what: the part of the work that begins now."""

    def advance(self, done: float = 1.0) -> None:
        """done: the work since the last call, in the unit of the total."""


class Study(Protocol[E, R]):
    """The functions of a study's `study.py`.

    The folder's `__init__.py` has a docstring and nothing else: `sigmaik --help` shows the first line, and `sigmaik
    NAME --help` shows the rest. Files beside `study.py` are the study's own: `experiment.py` computes, `table.py` makes
    text tables, and `figure.py` draws.
    """

    def options(self, parser: argparse.ArgumentParser) -> None:
        """Adds the study's options; `sigmaik_lab.options` adds those of arm and output."""

    def load(self, args: argparse.Namespace) -> Iterable[E]:
        """The experiments that the options ask for, each of which is run and reported before the next one.

        ValueError, before anything is computed, where an option is wrong.
        """

    def run(self, experiment: E, progress: Progress) -> R:
        """Computes. A run writes no file, except one from which a long run resumes."""

    def report(self, experiment: E, runs: R) -> Report:
        """Text tables, and files to be written."""


class Command(Protocol):
    """The functions of `command.py`, in a folder of a tool that is no study."""

    def options(self, parser: argparse.ArgumentParser) -> None: ...

    def run(self, args: argparse.Namespace) -> int:
        """Returns the exit code."""


def names() -> list[str]:
    """Names of all studies and commands: the folders of this package, with - in place of _."""
    package = importlib.import_module(_PACKAGE)
    return sorted(module.name.replace("_", "-") for module in pkgutil.iter_modules(package.__path__) if module.ispkg)


def describe(name: str) -> tuple[str, str]:
    """The first line of a folder's docstring, and the rest. Nothing but the folder's `__init__.py` is imported."""
    text = importlib.import_module(_folder(name)).__doc__ or ""
    first, _, rest = text.strip().partition("\n")
    return first.rstrip("."), rest.strip()


def find_study(name: str) -> Study[Any, Any] | None:
    """The study of that name; None where the folder has a command instead."""
    return _module(name, "study")  # type: ignore[no-any-return]


def find_command(name: str) -> Command | None:
    """The command of that name; None where the folder has none."""
    return _module(name, "command")  # type: ignore[no-any-return]


def _folder(name: str) -> str:
    return f"{_PACKAGE}.{name.replace('-', '_')}"


def _module(name: str, file: str) -> Any:
    module = f"{_folder(name)}.{file}"
    return importlib.import_module(module) if importlib.util.find_spec(module) else None
