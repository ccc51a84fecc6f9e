"""Reading arrays from files that may be damaged or hostile: npz files, and the files of recordings that still go on.

Sizes are checked against the file before memory is taken, and nothing in a file is executed: no pickles.
"""

from __future__ import annotations

import json
import math
import pathlib
import zipfile
from typing import Any, BinaryIO

import numpy as np
from numpy.lib import format as npy
from numpy.typing import NDArray

from sigmaik import Error

__all__ = ["ALWAYS_READ", "DENSEST", "MAGIC", "largest_unpacked", "read_npz", "read_parts"]

#: The first bytes of the file of a recording that goes on.
MAGIC = b"sigmaik recording 1\n"
#: A file may unpack to this many times its own size. A resting arm's recording has about 150.
DENSEST = 200
#: [bytes] A file may always unpack to this size.
ALWAYS_READ = 64 << 20

_LONGEST_HEADER = 10_000  # bytes of one array's header; numpy's own bound


def largest_unpacked(file_size: int) -> int:
    """[bytes] to which a file of `file_size` bytes may unpack."""
    return max(ALWAYS_READ, DENSEST * file_size)


def read_npz(path: pathlib.Path, names: set[str], largest: int | None = None) -> dict[str, NDArray[Any]]:
    """The named arrays of an npz file, as far as the file has these arrays.

    largest: [bytes] to which the whole file may unpack; None: `largest_unpacked`. Error where the file is larger, or
    an array does not have the size that the zip directory says.
    """
    size = path.stat().st_size
    most = largest_unpacked(size) if largest is None else largest
    with zipfile.ZipFile(path) as archive:
        members = archive.infolist()
        unpacked = sum(member.file_size for member in members)
        if unpacked > most:
            raise Error(
                f"{size / 1e6:.1f} MB that unpack to {unpacked / 1e6:.0f} MB, where {most / 1e6:.0f} MB are allowed; "
                f"Episode.load(file, largest={unpacked}) reads a file that you trust"
            )
        found: dict[str, NDArray[Any]] = {}
        for member in members:
            name = member.filename.removesuffix(".npy")
            if name not in names:
                continue
            if name in found:
                raise Error(f"the array '{name}' is there twice")
            with archive.open(member) as stream:
                found[name] = _read_array(stream, member.file_size, name)  # type: ignore[arg-type]
                if stream.read(1):
                    raise Error(f"the array '{name}' has more bytes than its shape says")
        return found


def read_parts(path: pathlib.Path) -> tuple[dict[str, Any], list[NDArray[Any]]]:
    """What a recording that went on has left: the merged notes, and the chunks of samples.

    A last part that was cut off is left out. Error where the file has no complete part.
    """
    size = path.stat().st_size
    notes: dict[str, Any] = {}
    chunks: list[NDArray[Any]] = []
    with path.open("rb") as stream:
        if stream.read(len(MAGIC)) != MAGIC:
            raise Error("it does not begin as a recording")
        while stream.tell() < size:
            try:
                part = _read_array(stream, size - stream.tell(), "a part", exact=False)
            except (Error, EOFError, ValueError):
                break  # cut off by the crash
            if part.dtype == np.uint8:
                note = json.loads(part.tobytes())
                if not isinstance(note, dict):
                    raise Error("a note is no JSON object")
                settings = {**notes.get("settings", {}), **note.get("settings", {})}
                notes = {**notes, **note, "settings": settings}
            else:
                chunks.append(part)
    if not notes or not chunks:
        raise Error("it ends before the first cycle")
    return notes, chunks


def _read_array(stream: BinaryIO, most: int, name: str, exact: bool = True) -> NDArray[Any]:
    """An array in numpy's format of at most, or exactly, `most` bytes with its header. No memory before the check."""
    start = stream.tell()
    version = npy.read_magic(stream)
    if version == (1, 0):
        shape, fortran, dtype = npy.read_array_header_1_0(stream, max_header_size=_LONGEST_HEADER)
    elif version == (2, 0):
        shape, fortran, dtype = npy.read_array_header_2_0(stream, max_header_size=_LONGEST_HEADER)
    else:
        raise Error(f"the array '{name}' has version {version} of numpy's format")
    if dtype.hasobject:
        raise Error(f"the array '{name}' has Python objects, which are never read")
    bytes_ = math.prod(shape) * dtype.itemsize
    left = most - (stream.tell() - start)
    if min(shape, default=0) < 0 or bytes_ > left or (exact and bytes_ < left):
        raise Error(f"the array '{name}' is said to have shape {shape}, and has {left} bytes")
    data = stream.read(bytes_)
    if len(data) < bytes_:
        raise Error(f"the array '{name}' ends early")
    if dtype.itemsize == 0:
        raise Error(f"the array '{name}' has a type of no size")
    flat = np.frombuffer(data, dtype=dtype)
    return flat.reshape(shape[::-1]).T if fortran else flat.reshape(shape)
