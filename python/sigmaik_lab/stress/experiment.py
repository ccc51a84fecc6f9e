"""Pieces of a stress run: what they are, how one is run, and what all of them count."""

from __future__ import annotations

import concurrent.futures
import csv
import functools
import hashlib
import io
import pathlib
import subprocess
import time
from collections.abc import Callable, Iterable
from dataclasses import dataclass

from sigmaik_lab.row_file import append_rows, resume_rows
from sigmaik_lab.work import compute

__all__ = ["PROGRAMS", "CountRow", "Piece", "Plan", "Total", "fingerprint", "missing", "run_pieces", "totals"]

#: The programs, and the unit of their work.
PROGRAMS = {"sigmaik_stress": "cycles", "sigmaik_settling": "cases"}


@dataclass(frozen=True)
class CountRow:
    """A property in a piece; a line of the file."""

    program: str
    piece: int
    property: str
    of: str  #: what a case is
    cases: int
    failed: int
    worst: float  #: the largest value seen, in the unit of the property
    again: str  #: numbers of episodes that failed
    seconds: float  #: of the whole piece


@dataclass(frozen=True)
class Piece:
    """The piece `number` of a program's work: `size` cycles or cases with the seed `seed`."""

    program: str
    number: int
    size: int
    seed: int


@dataclass(frozen=True)
class Plan:
    """How much work there is of each program, cut into pieces of one size."""

    directory: pathlib.Path
    work: dict[str, int]  #: cycles or cases of each program
    size: dict[str, int]  #: of a piece
    seed: int

    def pieces(self) -> list[Piece]:
        """All pieces: any two runs of one seed begin with the same."""
        return [
            Piece(program, number, self.size[program], self.seed * 1_000_003 + number)
            for program, work in self.work.items()
            for number in range(-(-work // self.size[program]))
        ]

    def facts(self) -> dict[str, object]:
        """What rows of one file have in common: the programs, bit by bit, the seed, and the size of a piece."""
        programs = {program: fingerprint(self.directory / program) for program in self.work}
        return {"programs": programs, "seed": self.seed, "size": self.size}


@dataclass(frozen=True)
class Total:
    """A property in all pieces."""

    program: str
    property: str
    of: str
    cases: int
    failed: int
    worst: float
    again: str


def fingerprint(program: pathlib.Path) -> str:
    """The first digits of the program's SHA-256. ValueError where the program is not there."""
    if not program.is_file():
        raise ValueError(f"{program} is not there: `make build` builds it, or --programs names its folder")
    return hashlib.sha256(program.read_bytes()).hexdigest()[:16]


def run_piece(piece: Piece, directory: pathlib.Path, expected: str) -> list[CountRow]:
    """Runs a piece, in any process or on any machine that has the program at the same place."""
    program = directory / piece.program
    if fingerprint(program) != expected:
        raise ValueError(f"{program} is another program here than where the run was begun")
    begun = time.monotonic()
    run = subprocess.run(
        [program, "--table", str(piece.size), str(piece.seed)], capture_output=True, text=True, check=False
    )
    if run.returncode != 0:
        raise ValueError(
            f"{piece.program}, seed {piece.seed}, ended with {run.returncode}: {run.stderr.strip()[-200:]}"
        )
    seconds = round(time.monotonic() - begun, 3)
    return [
        CountRow(
            piece.program,
            piece.number,
            row["property"],
            row["of"],
            int(row["cases"]),
            int(row["failed"]),
            float(row["worst"]),
            row["again"],
            seconds,
        )
        for row in csv.DictReader(io.StringIO(run.stdout))
    ]


def _whole_pieces(rows: list[CountRow]) -> list[CountRow]:
    """Without a last piece that was cut off, which has fewer properties than the others of its program."""
    numbers: dict[tuple[str, int], int] = {}
    for row in rows:
        numbers[row.program, row.piece] = numbers.get((row.program, row.piece), 0) + 1
    most = {program: max(n for (p, _), n in numbers.items() if p == program) for program, _ in numbers}
    return [row for row in rows if numbers[row.program, row.piece] == most[row.program]]


def known_rows(plan: Plan, file: pathlib.Path | None) -> list[CountRow]:
    """The rows of the file, which is begun where there is none. ValueError where the file is of another run."""
    return [] if file is None else resume_rows(file, plan.facts(), CountRow, _whole_pieces)


def missing(plan: Plan, rows: Iterable[CountRow]) -> list[Piece]:
    """The pieces without rows, those of the programs in turn: a part of a run then has some of each."""
    known = {(row.program, row.piece) for row in rows}
    left = [piece for piece in plan.pieces() if (piece.program, piece.number) not in known]
    return sorted(left, key=lambda piece: piece.number * piece.size / max(1, plan.work[piece.program]))


def run_pieces(
    plan: Plan,
    file: pathlib.Path | None,
    pool: concurrent.futures.Executor | None,
    jobs: int,
    advance: Callable[[Piece], None],
) -> list[CountRow]:
    """Runs what is missing, and returns all rows. Each piece is in the file as soon as it is done."""
    rows = known_rows(plan, file)
    programs = {program: fingerprint(plan.directory / program) for program in plan.work}
    pieces = {(piece.program, piece.number): piece for piece in plan.pieces()}
    work = functools.partial(_run_with, plan.directory, programs)
    for done in compute(work, missing(plan, rows), pool, jobs):
        if file is not None:
            append_rows(file, done)
        rows += done
        advance(pieces[done[0].program, done[0].piece])
    return [row for row in rows if (row.program, row.piece) in pieces]


def _run_with(directory: pathlib.Path, programs: dict[str, str], piece: Piece) -> list[CountRow]:
    return run_piece(piece, directory, programs[piece.program])


def totals(rows: Iterable[CountRow]) -> list[Total]:
    """The sums, in the order in which the programs print their properties."""
    sums: dict[tuple[str, str], Total] = {}
    for row in rows:
        old = sums.get((row.program, row.property), Total(row.program, row.property, row.of, 0, 0, 0.0, ""))
        again = " ".join([*old.again.split(), *row.again.split()][:10])
        worst = max(old.worst, row.worst)
        sums[row.program, row.property] = Total(
            row.program, row.property, row.of, old.cases + row.cases, old.failed + row.failed, worst, again
        )
    return sorted(sums.values(), key=lambda total: list(PROGRAMS).index(total.program))
