"""What the commands share: the arm's options, the terminal, and extras that may be missing."""

from __future__ import annotations

import argparse
import importlib.util
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from rich.console import Console

__all__ = ["MissingPackage", "add_arm", "add_links", "need", "terminal"]


class MissingPackage(Exception):
    """A package of an extra is not installed."""


def add_arm(parser: argparse._ActionsContainer, robot: str = "ufactory_xarm7") -> None:
    """The options --robot, --base and --tip."""
    parser.add_argument("--robot", default=robot, help="a shipped arm or a URDF file (%(default)s)")
    add_links(parser)


def add_links(parser: argparse._ActionsContainer) -> None:
    """The options --base and --tip."""
    parser.add_argument("--base", help="base link (the URDF's root)")
    parser.add_argument("--tip", help="tip link (the URDF's only leaf)")


def terminal() -> Console:
    need("rich")
    from rich.console import Console

    return Console(soft_wrap=False)


def need(package: str, extra: str = "demo") -> None:
    """Raises with the name of the extra where a package is not installed."""
    if importlib.util.find_spec(package) is None:
        raise MissingPackage(f"{package} is not installed; pip install 'sigmaik[{extra}]' brings it")
