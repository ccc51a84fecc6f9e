"""The answer of a study: text, tables for the terminal, and files. This module needs no package but sigmaik."""

from __future__ import annotations

import math
import pathlib
import textwrap
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, TypeAlias

if TYPE_CHECKING:
    import rich.table
    from matplotlib.figure import Figure

__all__ = ["Cell", "Csv", "File", "Film", "Picture", "Report", "Series", "Table", "bold", "compact", "red"]

_WIDTH = 80  #: of plain tables, where a column can be wrapped


@dataclass(frozen=True)
class Cell:
    """A text with a style: "red", "bold" or "dim"."""

    text: str
    style: str = ""


def red(text: str, when: bool = True) -> Cell:
    """A text that is red where `when` holds."""
    return Cell(text, "red" if when else "")


def bold(text: str) -> Cell:
    return Cell(text, "bold")


def compact(value: float) -> str:
    """At most five characters, two decimals at most."""
    if not math.isfinite(value):
        return "–"
    for limit, decimals in ((9.995, 2), (999.95, 1), (99999.5, 0)):
        if abs(value) < limit:
            return f"{value:.{decimals}f}"
    return f"{value:.0e}"


@dataclass(frozen=True)
class _Column:
    head: str
    right: bool
    wrap: bool


@dataclass(frozen=True)
class _Row:
    cells: tuple[Cell, ...]
    style: str
    end_section: bool


class Table:
    """A table for the terminal. `rich` draws the table where rich is installed; str() is plain text."""

    def __init__(self, title: str = "", *columns: str) -> None:
        """columns: heads of the first columns, to the left and never wrapped."""
        self.title = title
        self._columns: list[_Column] = []
        self._rows: list[_Row] = []
        for head in columns:
            self.add_column(head)

    def add_column(self, head: str, right: bool = False, wrap: bool = False) -> None:
        """right: flush right. wrap: a narrow terminal may break the column's texts into lines."""
        self._columns.append(_Column(head, right, wrap))

    def add_numbers(self, *heads: str) -> None:
        """Columns that are flush right."""
        for head in heads:
            self.add_column(head, right=True)

    def add_row(self, *cells: str | Cell, style: str = "", end_section: bool = False) -> None:
        """Missing cells are empty. end_section: a line follows."""
        texts = [cell if isinstance(cell, Cell) else Cell(cell) for cell in cells]
        texts += [Cell("")] * (len(self._columns) - len(texts))
        self._rows.append(_Row(tuple(texts), style, end_section))

    def __rich__(self) -> rich.table.Table:
        from rich import box, table, text

        drawn = table.Table(
            title=text.Text(self.title) if self.title else None,
            title_justify="left",
            title_style="bold",
            box=box.SIMPLE_HEAD,
            padding=(0, 1, 0, 0),
            pad_edge=False,
        )
        for column in self._columns:
            drawn.add_column(
                text.Text(column.head),
                justify="right" if column.right else "left",
                no_wrap=not column.wrap,
                overflow="fold" if column.wrap else "ellipsis",
            )
        for row in self._rows:
            cells = [text.Text(cell.text, style=cell.style) for cell in row.cells]
            drawn.add_row(*cells, style=row.style or None, end_section=row.end_section)
        return drawn

    def __str__(self) -> str:
        widths = self._widths()
        rule = "─" * (sum(widths) + len(widths) - 1)
        lines = [self.title] if self.title else []
        lines += self._lines([Cell(column.head) for column in self._columns], widths, bottom=True)
        lines.append(rule)
        for i, row in enumerate(self._rows):
            lines += self._lines(row.cells, widths)
            if row.end_section and i + 1 < len(self._rows):
                lines.append(rule)
        return "\n".join(line.rstrip() for line in lines)

    def _widths(self) -> list[int]:
        widths = []
        for i, column in enumerate(self._columns):
            texts = [column.head, *(row.cells[i].text for row in self._rows)]
            widths.append(max(len(line) for text in texts for line in text.split("\n")))
        for i, column in enumerate(self._columns):
            if column.wrap:
                others = sum(widths) - widths[i] + len(widths) - 1
                widths[i] = min(widths[i], max(12, _WIDTH - others))
        return widths

    def _lines(self, cells: Sequence[Cell], widths: Sequence[int], bottom: bool = False) -> list[str]:
        """A row's lines; a cell of fewer lines stands at the row's top, or at its bottom."""
        blocks = [
            [
                part
                for line in cell.text.split("\n")
                for part in textwrap.wrap(line, width, break_on_hyphens=False) or [""]
            ]
            if column.wrap
            else cell.text.split("\n")
            for cell, width, column in zip(cells, widths, self._columns, strict=True)
        ]
        height = max(map(len, blocks))
        for block in blocks:
            empty = [""] * (height - len(block))
            block[:] = empty + block if bottom else block + empty
        return [
            " ".join(
                f"{block[i]:>{width}}" if column.right else f"{block[i]:<{width}}"
                for block, width, column in zip(blocks, widths, self._columns, strict=True)
            )
            for i in range(height)
        ]


def _wrapped(line: str, width: int) -> list[str]:
    return textwrap.wrap(line, width, break_on_hyphens=False) or [""]


@dataclass(frozen=True)
class Series:
    """One file of several with time series, in the format of --format."""

    stem: str  #: the file's name without its suffix
    save: Callable[[pathlib.Path, str], object]  #: (file, format)


@dataclass(frozen=True)
class Csv:
    """A table as a CSV file."""

    stem: str
    save: Callable[[pathlib.Path], object]


@dataclass(frozen=True)
class Picture:
    """A PNG file; --no-plot leaves the file out. `draw` is called when the file is written, and not before."""

    stem: str
    draw: Callable[[], Figure]


@dataclass(frozen=True)
class Film:
    """A GIF file; --no-plot leaves the file out."""

    stem: str
    save: Callable[[pathlib.Path], object]


File: TypeAlias = Series | Csv | Film | Picture


@dataclass(frozen=True)
class Report:
    """Text that is printed, and files that are then written in this order. The files' paths are printed, the last path
    alone on the last line."""

    text: Sequence[str | Table]
    files: Sequence[File] = field(default=())
