"""The command `sigmaik`.

Studies and commands are found by name (`sigmaik_lab.study`); only the called study or command is imported. A wrong file
or a wrong option ends the run with one line on stderr and exit code 2.
"""

from __future__ import annotations

import argparse
import os
import sys
import warnings
from collections.abc import Sequence
from typing import TextIO

import sigmaik as sk

from . import study
from .runner import run_study

__all__ = ["main"]

#: Other names of studies.
_ALIASES = {"table": "round-table"}

_python_shows = warnings.showwarning


def main(argv: Sequence[str] | None = None) -> int:
    """Runs the command. Returns the exit code: 0, 2 for wrong input, 130 when interrupted."""
    words = list(sys.argv[1:] if argv is None else argv)
    called = next((word for word in words if not word.startswith("-")), "")
    warnings.showwarning = _show_warning
    warnings.simplefilter("once", sk.ModelWarning)
    try:
        args = _parser(_ALIASES.get(called, called)).parse_args(words)
        result: int = args.call(args)
        sys.stdout.flush()
        return result
    except (ValueError, OSError) as error:
        if isinstance(error, BrokenPipeError):  # `sigmaik robots | head -1`
            os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
            return 0
        print(f"sigmaik: {_one_line(error)}", file=sys.stderr)
        return 2
    except KeyboardInterrupt:
        return 130


def _parser(called: str) -> argparse.ArgumentParser:
    """The parser, with the options of the called command, and with names and a line of help of the other commands."""
    parser = argparse.ArgumentParser(
        prog="sigmaik", description="Velocity inverse kinematics at and near singularities."
    )
    parser.add_argument("--version", action="version", version=f"sigmaik {sk.__version__}")
    commands = parser.add_subparsers(metavar="COMMAND", required=True)
    for name in study.names():
        first, rest = study.describe(name)
        aliases = [alias for alias, full in _ALIASES.items() if full == name]
        command = commands.add_parser(name, aliases=aliases, help=first, description=rest)
        if name == called:
            _fill(command, name)
    return parser


def _fill(parser: argparse.ArgumentParser, name: str) -> None:
    found = study.find_study(name)
    if found is not None:
        found.options(parser)
        parser.set_defaults(call=lambda args: run_study(name, args))
        return
    command = study.find_command(name)
    if command is None:
        raise ValueError(f"the folder of '{name}' has neither study.py nor command.py")
    command.options(parser)
    parser.set_defaults(call=command.run)


def _show_warning(
    message: Warning | str,
    category: type[Warning],
    filename: str,
    lineno: int,
    file: TextIO | None = None,
    line: str | None = None,
) -> None:
    """Shows a warning of a model without a line of code, because such a warning is about the user's file."""
    if issubclass(category, sk.ModelWarning):
        print(f"sigmaik: warning: {message}", file=sys.stderr)
    else:
        _python_shows(message, category, filename, lineno, file, line)


def _one_line(error: Exception) -> str:
    if isinstance(error, OSError) and error.strerror:
        return f"{error.filename}: {error.strerror}" if error.filename else error.strerror
    return " ".join(str(error).split())


if __name__ == "__main__":
    sys.exit(main())
