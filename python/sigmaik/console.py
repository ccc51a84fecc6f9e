"""What the commands share: the terminal, and extras that may be missing."""

from __future__ import annotations

import importlib.util
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from rich.console import Console

__all__ = ["MissingPackage", "need", "terminal"]


class MissingPackage(Exception):
    """A package of an extra is not installed."""


def terminal() -> Console:
    need("rich")
    from rich.console import Console

    return Console(soft_wrap=False)


def need(package: str, extra: str = "demo") -> None:
    """Raises with the name of the extra where a package is not installed."""
    if importlib.util.find_spec(package) is None:
        raise MissingPackage(f"{package} is not installed; pip install 'sigmaik[{extra}]' brings it")
