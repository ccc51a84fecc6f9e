"""A CSV file of rows from which a long run resumes.

The first line is "# " with the settings as JSON, the second line the columns; each further line is a row, a dataclass
of texts, numbers and truth values.
"""

from __future__ import annotations

import csv
import io
import json
import os
import pathlib
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import fields
from typing import Any, TypeVar

__all__ = ["append_rows", "read_rows", "resume_rows"]

R = TypeVar("R")


def resume_rows(
    file: pathlib.Path,
    facts: Mapping[str, object],
    kind: type[R],
    whole: Callable[[list[R]], list[R]] = lambda rows: rows,
    may_differ: Sequence[str] = (),
) -> list[R]:
    """The rows of a file, or none where the file is begun. ValueError where the file's facts are others.

    whole: the rows to keep; the file is cut to these
    may_differ: names of facts that may be others, such as the number of rows; the file then gets the new ones
    """
    header = "# " + json.dumps(facts) + "\n" + ",".join(_columns(kind)) + "\n"
    if not file.exists() or file.stat().st_size == 0:
        file.parent.mkdir(parents=True, exist_ok=True)
        file.write_text(header, encoding="utf-8")
        return []
    known, rows = read_rows(file, kind)
    free = dict.fromkeys(may_differ)
    if {**known, **free} != {**json.loads(json.dumps(facts)), **free}:
        raise ValueError(f"{file} is of another study: {json.dumps(known)}")
    kept = whole(rows)
    text = header + "".join(map(_line, kept))
    if text != file.read_text(encoding="utf-8"):
        beside = file.with_name(file.name + ".part")
        beside.write_text(text, encoding="utf-8")
        os.replace(beside, file)
    return kept


def append_rows(file: pathlib.Path, rows: Iterable[object]) -> None:
    """Writes rows to the end of a file at once."""
    with open(file, "a", encoding="utf-8", newline="") as stream:
        stream.write("".join(map(_line, rows)))


def read_rows(file: str | pathlib.Path, kind: type[R]) -> tuple[dict[str, object], list[R]]:
    """The facts of a file, and its rows; a line that was cut off is left out."""
    text = pathlib.Path(file).read_text(encoding="utf-8")
    lines = text.splitlines()
    try:
        facts = json.loads(lines[0].removeprefix("# "))
        if not lines[0].startswith("# ") or lines[1] != ",".join(_columns(kind)):
            raise ValueError
    except (IndexError, ValueError) as error:
        raise ValueError(f"{file} is not the file of a study") from error
    if not text.endswith("\n"):
        lines.pop()
    types = [field.type for field in fields(kind)]  # type: ignore[arg-type]
    rows = []
    for values in csv.reader(lines[2:]):
        if len(values) == len(types):
            rows.append(kind(*(_parse(t, value) for t, value in zip(types, values, strict=True))))
    return facts, rows


def _columns(kind: type) -> list[str]:
    return [field.name for field in fields(kind)]


def _line(row: object) -> str:
    text = io.StringIO()
    csv.writer(text, lineterminator="\n").writerow([getattr(row, name) for name in _columns(type(row))])
    return text.getvalue()


def _parse(kind: Any, text: str) -> int | float | str | bool:
    if kind == "bool":
        return text == "True"
    return text if kind == "str" else int(text) if kind == "int" else float(text)
