"""Signals that end a program in order."""

from __future__ import annotations

import contextlib
import signal
from collections.abc import Callable, Iterator
from typing import NoReturn

__all__ = ["handled_signals", "signals_interrupt"]


@contextlib.contextmanager
def handled_signals(handler: Callable[..., object], *numbers: signal.Signals) -> Iterator[None]:
    """Gives signals to a handler, in the main thread; a signal that is ignored, such as nohup's SIGHUP, stays so."""
    before = {}
    for number in numbers:
        with contextlib.suppress(ValueError):  # not in the main thread
            if signal.getsignal(number) is not signal.SIG_IGN:
                before[number] = signal.signal(number, handler)
    try:
        yield
    finally:
        for number, earlier in before.items():
            signal.signal(number, earlier)


def signals_interrupt() -> contextlib.AbstractContextManager[None]:
    """SIGTERM and SIGHUP end the program as Ctrl-C does, so that a recording is saved."""
    return handled_signals(_interrupt, signal.SIGTERM, signal.SIGHUP)


def _interrupt(*_: object) -> NoReturn:
    raise KeyboardInterrupt
