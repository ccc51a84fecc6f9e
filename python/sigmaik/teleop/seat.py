"""One driver at a time."""

from __future__ import annotations

import threading
from collections.abc import Hashable

from sigmaik import Error

__all__ = ["Seat"]


class Seat:
    """Who drives: the first who commands, until the driver leaves or another takes over. Any thread may call."""

    def __init__(self) -> None:
        self._driver: Hashable | None = None
        self._lock = threading.Lock()

    @property
    def driver(self) -> Hashable | None:
        """Who drives; None: nobody, and the next who commands will."""
        return self._driver

    def claim(self, who: Hashable) -> None:
        """Makes `who` the driver, where nobody drives. Error where another drives."""
        with self._lock:
            if self._driver is None:
                self._driver = who
            elif self._driver != who:
                raise Error(f"{name(self._driver)} drives: press 'Take over' first")

    def take_over(self, who: Hashable) -> None:
        """Makes `who` the driver in any case."""
        with self._lock:
            self._driver = who

    def leave(self, who: Hashable) -> bool:
        """Frees the seat where `who` is the driver; returns whether this was so."""
        with self._lock:
            if self._driver is None or self._driver != who:
                return False
            self._driver = None
            return True


def name(who: Hashable | None) -> str:
    """A driver in words."""
    return "nobody" if who is None else f"browser {who}" if isinstance(who, int) else str(who)
