"""Output of all commands: text and tables on stdout, progress on stderr, files in the folder of --out."""

from __future__ import annotations

import argparse
import contextlib
import os
import pathlib
import shutil
import sys
import textwrap
import time
from collections.abc import Callable, Iterator, Sequence
from itertools import groupby
from typing import TYPE_CHECKING, TextIO

from sigmaik._extras import installed

from .report import Csv, File, Film, Picture, Report, Series, Table

if TYPE_CHECKING:
    from rich.progress import Progress as Bars

    from .study import Progress

__all__ = ["Lines", "progress", "say", "show"]

#: [s] between two lines of progress where no bar can be drawn.
_EVERY = 10.0


def say(text: str | Table = "") -> None:
    """Prints a text, wrapped at the terminal's width, or a table: by rich where rich is installed, else plain."""
    if isinstance(text, Table) and installed("rich"):
        from rich.console import Console

        Console(soft_wrap=False).print(text)
    elif isinstance(text, Table):
        print(text, flush=True)
    else:
        width = shutil.get_terminal_size().columns
        for line in text.split("\n"):
            print(textwrap.fill(line, width, break_long_words=False, break_on_hyphens=False), flush=True)


def show(report: Report, args: argparse.Namespace) -> None:
    """Prints a report and writes its files, as --out, --format and --no-plot say."""
    for text in report.text:
        say(text)
    form, folder = getattr(args, "format", "none"), getattr(args, "out", pathlib.Path())
    plots = not getattr(args, "no_plot", False)
    wanted = [
        file
        for file in report.files
        if (plots or not isinstance(file, Picture | Film)) and (form != "none" or not isinstance(file, Series))
    ]
    lines: list[tuple[str, str]] = []
    for kind, files in groupby(wanted, type):
        lines += _write(kind, list(files), folder, form)
        for what, path in lines[:-1]:
            print(f"{what}: {path}")
        lines = lines[-1:]
    if lines:
        print(lines[0][1])


def _write(kind: type, files: Sequence[File], folder: pathlib.Path, form: str) -> list[tuple[str, str]]:
    """Writes files of one kind. Returns pairs of a word and a path; many files share one pair."""
    for file in files:
        if isinstance(file, Series):
            file.save(folder / f"{file.stem}.{form}", form)
        elif isinstance(file, Csv):
            file.save(folder / f"{file.stem}.csv")
        elif isinstance(file, Film):
            file.save(folder / f"{file.stem}.gif")
        else:
            from sigmaik._plotting import save_figure

            save_figure(file.draw(), folder / f"{file.stem}.png")
    if kind is Series:
        return [("time series", _many(files, folder, form))]
    if kind is Csv:
        return [("table", str(folder / f"{file.stem}.csv")) for file in files]
    if kind is Film:
        return [("film", str(folder / f"{file.stem}.gif")) for file in files]
    *first, last = files
    if len(first) > 3:
        return [("pictures", _many(first, folder, "png")), ("picture", str(folder / f"{last.stem}.png"))]
    return [("picture", str(folder / f"{file.stem}.png")) for file in files]


def _many(files: Sequence[File], folder: pathlib.Path, suffix: str) -> str:
    common = os.path.commonprefix([file.stem for file in files])
    if len(files) > 1:
        common = common[: common.rfind("-") + 1] + "*"
    return f"{len(files)} files {folder / common}.{suffix}"


@contextlib.contextmanager
def progress(name: str) -> Iterator[Progress]:
    """Shows progress: a bar where stderr is a terminal and rich is installed, else a line every ten seconds."""
    if not (sys.stderr.isatty() and installed("rich")):
        yield Lines(name, sys.stderr)
        return
    from rich.console import Console
    from rich.progress import BarColumn, Progress, TaskProgressColumn, TextColumn, TimeRemainingColumn

    columns = (TextColumn("{task.description:<40}"), BarColumn(), TaskProgressColumn(), TimeRemainingColumn())
    with Progress(*columns, console=Console(stderr=True), transient=True) as bars:
        yield _Bar(bars, name)


class _Bar:
    def __init__(self, bars: Bars, name: str) -> None:
        self._bars, self._task = bars, bars.add_task(name, total=None)

    def expect(self, total: float) -> None:
        self._bars.update(self._task, total=total)

    def say(self, what: str) -> None:
        self._bars.update(self._task, description=what)

    def advance(self, done: float = 1.0) -> None:
        self._bars.advance(self._task, done)


class Lines:
    """Progress as lines. The first line comes after `every` seconds, so that a short run prints none."""

    def __init__(
        self, name: str, stream: TextIO, every: float = _EVERY, clock: Callable[[], float] = time.monotonic
    ) -> None:
        self._name, self._stream, self._every, self._clock = name, stream, every, clock
        self._total = self._done = 0.0
        self._what = ""
        self._next = clock() + every

    def expect(self, total: float) -> None:
        self._total = total

    def say(self, what: str) -> None:
        self._what = what
        self._print()

    def advance(self, done: float = 1.0) -> None:
        self._done += done
        self._print()

    def _print(self) -> None:
        now = self._clock()
        if now < self._next:
            return
        self._next = now + self._every
        part = f"{100.0 * min(1.0, self._done / self._total):.0f} %" if self._total > 0.0 else ""
        said = ", ".join(text for text in (self._what, part) if text)
        print(f"sigmaik {self._name}: {said}", file=self._stream, flush=True)
