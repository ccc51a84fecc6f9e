"""What the commands share: the arm's options and the terminal."""

from __future__ import annotations

import argparse
from typing import TYPE_CHECKING

from ._extras import need

if TYPE_CHECKING:
    from rich.console import Console

__all__ = ["add_arm", "add_links", "terminal"]


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
