"""The command `sigmaik robots`."""

from __future__ import annotations

import argparse

import sigmaik as sk
from sigmaik_lab.output import say
from sigmaik_lab.reach import paths
from sigmaik_lab.report import Table

__all__ = ["options", "run"]


def options(parser: argparse.ArgumentParser) -> None:
    """There are none."""


def run(_: argparse.Namespace) -> int:
    table = Table("", "arm")
    table.add_numbers("joints")
    table.add_column("paths of `sigmaik reach`", wrap=True)
    for name in sk.robots.names():
        table.add_row(name, str(sk.robots.load(name).dof), ", ".join(paths.names(name)))
    say(table)
    return 0
