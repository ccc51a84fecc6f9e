"""CSV files, each written whole or not at all."""

from __future__ import annotations

import csv
import dataclasses
import io
import pathlib
from collections.abc import Iterable, Sequence
from typing import Any, BinaryIO

from sigmaik.files import write_atomically

__all__ = ["save_csv", "save_rows", "write_csv"]


def write_csv(stream: BinaryIO, columns: Sequence[str], rows: Iterable[Sequence[object]]) -> None:
    """Writes the columns' names, then the rows, as UTF-8."""
    text = io.TextIOWrapper(stream, encoding="utf-8", newline="")
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(columns)
    writer.writerows(rows)
    text.flush()
    text.detach()


def save_csv(file: str | pathlib.Path, columns: Sequence[str], rows: Iterable[Sequence[object]]) -> pathlib.Path:
    """Writes a CSV file. Returns the file's path."""
    return write_atomically(pathlib.Path(file), lambda stream: write_csv(stream, columns, rows))


def save_rows(rows: Sequence[Any], file: str | pathlib.Path) -> pathlib.Path:
    """Writes one or more dataclasses of one type: a column per field, a line per object, SI units. Returns the path."""
    columns = [field.name for field in dataclasses.fields(rows[0])]
    return save_csv(file, columns, ([getattr(row, column) for column in columns] for row in rows))
