"""Files that are written whole or not at all."""

from __future__ import annotations

import os
import pathlib
import tempfile
from collections.abc import Callable
from typing import BinaryIO

__all__ = ["write_atomically"]


def write_atomically(file: pathlib.Path, write: Callable[[BinaryIO], object]) -> pathlib.Path:
    """Writes a temporary file in the same folder and renames the file, so that nobody ever sees half a file."""
    file.parent.mkdir(parents=True, exist_ok=True)
    handle, name = tempfile.mkstemp(dir=file.parent, prefix=f".{file.name}.")
    try:
        with os.fdopen(handle, "wb") as stream:
            write(stream)
        umask = os.umask(0)
        os.umask(umask)
        os.chmod(name, 0o666 & ~umask)  # only their owner may read mkstemp's files
        os.replace(name, file)
    except BaseException:
        os.unlink(name)
        raise
    return file
