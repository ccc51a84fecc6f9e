"""A recording on disk while it goes on: whatever ends the program, the cycles up to the last chunk are there.

The file (`.part`) begins with `archive.MAGIC`. Parts follow, each an array in numpy's format (`numpy.save`): bytes are
a note in JSON, which adds to the notes before; anything else is a chunk of samples as `ServoLoop.read` gives them.
`Episode.load` reads the file, without a last part that was cut off.
"""

from __future__ import annotations

import contextlib
import fcntl
import io
import json
import os
import pathlib
import queue
import threading
import time
from typing import Any

import numpy as np
from numpy.typing import NDArray

from sigmaik import Error

from .archive import MAGIC

__all__ = ["Journal", "cut_off"]

SYNCED = 1.0  #: [s] A loss of power loses at most this time, and what `read` was not called for.


class Journal:
    """The file of a recording that goes on. A thread of its own writes, so that a slow disk delays no command.

    Where the file cannot be written any more, `trouble` has the reason, and the file keeps what it has.
    """

    def __init__(self, file: str | pathlib.Path, note: dict[str, Any]) -> None:
        """Makes a new file, with a first note. Error where the file exists, OSError where it cannot be written."""
        self.file = pathlib.Path(file)
        self.file.parent.mkdir(parents=True, exist_ok=True)
        try:
            self._stream = self.file.open("xb", buffering=0)
        except FileExistsError:
            raise Error(f"{self.file} exists already") from None
        self.trouble = ""
        self._size = 0
        try:
            fcntl.flock(self._stream, fcntl.LOCK_EX | fcntl.LOCK_NB)  # says that somebody still writes
            self._write(MAGIC + _part(_as_bytes(note)))
        except OSError:
            self._stream.close()
            self.file.unlink()
            raise
        self._parts: queue.SimpleQueue[NDArray[Any] | None] = queue.SimpleQueue()
        self._thread = threading.Thread(target=self._run, name="sigmaik journal", daemon=True)
        self._thread.start()

    def append(self, samples: NDArray[np.void]) -> None:
        """Adds a chunk of samples."""
        if len(samples) and not self.trouble:
            self._parts.put(samples)

    def note(self, **note: Any) -> None:
        """Adds to the notes."""
        self._parts.put(_as_bytes(note))

    def close(self) -> None:
        """Writes what waits, and closes the file. A second call does nothing."""
        if self._thread.is_alive():
            self._parts.put(None)
            self._thread.join()
        self._stream.close()

    def discard(self) -> None:
        """Closes and removes the file: the recording is saved elsewhere."""
        self.close()
        self.file.unlink(missing_ok=True)

    def _run(self) -> None:
        synced = time.monotonic()
        while True:
            part = self._parts.get()
            try:
                if part is not None and not self.trouble:
                    self._write(_part(part))
                if part is None or time.monotonic() - synced > SYNCED:
                    os.fsync(self._stream.fileno())
                    synced = time.monotonic()
            except OSError as error:
                self.trouble = f"{self.file}: {error.strerror or error}"
                with contextlib.suppress(OSError):  # no half part, so that the file can be read
                    os.ftruncate(self._stream.fileno(), self._size)
            if part is None:
                return

    def _write(self, data: bytes) -> None:
        view = memoryview(data)
        while view:
            view = view[self._stream.write(view) :]
        self._size += len(data)


def cut_off(directory: pathlib.Path) -> list[pathlib.Path]:
    """The recordings in a folder that were cut off: files `.part` that no program writes any more."""
    found = []
    for file in sorted(directory.glob("*.part")):
        with contextlib.suppress(OSError), file.open("rb") as stream:
            if stream.read(len(MAGIC)) == MAGIC:
                fcntl.flock(stream, fcntl.LOCK_EX | fcntl.LOCK_NB)
                found.append(file)
    return found


def _as_bytes(note: dict[str, Any]) -> NDArray[np.uint8]:
    return np.frombuffer(json.dumps(note).encode(), dtype=np.uint8)


def _part(values: NDArray[Any]) -> bytes:
    stream = io.BytesIO()
    np.save(stream, values, allow_pickle=False)
    return stream.getvalue()
