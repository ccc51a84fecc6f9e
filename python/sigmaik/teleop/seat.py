"""One driver at a time: the owner of the session's arm."""

from __future__ import annotations

import threading
from collections.abc import Hashable

from sigmaik import Error, LoopToken

from .session import Session

__all__ = ["Seat"]


class Seat:
    """Who drives: the first who commands, until the driver leaves or another takes over. Any thread may call.

    The driver has the token of the session's loop, and the loop takes motion from this token alone: a command that
    comes late, of a browser that drove before, is refused there.
    """

    def __init__(self, session: Session) -> None:
        self._session = session
        self._driver: Hashable | None = None
        self._token: LoopToken | None = None
        self._lock = threading.Lock()

    @property
    def driver(self) -> Hashable | None:
        """Who drives; None: nobody, and the next who commands will."""
        return self._driver

    def claim(self, who: Hashable) -> LoopToken:
        """The token of `who`, who becomes the driver where nobody drives. Error where another drives."""
        with self._lock:
            if self._driver is None or self._token is None:
                self._token = self._session.take(name(who))
                self._driver = who
            elif self._driver != who:
                raise Error(f"{name(self._driver)} drives: press 'Take over' first")
            return self._token

    def take_over(self, who: Hashable) -> LoopToken:
        """Makes `who` the driver in any case. The arm stops, and the last driver's token is worth nothing any more."""
        with self._lock:
            self._token = self._session.take(name(who), take_over=True)
            self._driver = who
            return self._token

    def leave(self, who: Hashable) -> bool:
        """Frees the seat where `who` is the driver, and stops the arm; returns whether this was so."""
        with self._lock:
            if self._driver is None or self._driver != who or self._token is None:
                return False
            self._session.give_back(self._token)
            self._driver = self._token = None
            return True


def name(who: Hashable | None) -> str:
    """A driver in words."""
    return "nobody" if who is None else f"browser {who}" if isinstance(who, int) else str(who)
