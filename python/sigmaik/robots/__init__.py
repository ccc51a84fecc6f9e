"""Arms shipped with the package, as URDF files.

    >>> import sigmaik as sk
    >>> chain = sk.robots.load("ufactory_xarm7")
    >>> q = sk.robots.home("ufactory_xarm7")

Each file says in its first lines where its figures come from and what to know before using it.
The tip of every arm is its mechanical flange (link ``flange``), the base the root link.
"""

from __future__ import annotations

import difflib
import json
from importlib import resources
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from sigmaik._core import Chain

__all__ = ["home", "load", "names", "path"]

_SUFFIX = ".urdf"


def names() -> tuple[str, ...]:
    """Names of the shipped arms, sorted."""
    files = (entry.name for entry in resources.files(__name__).iterdir())
    return tuple(sorted(f.removesuffix(_SUFFIX) for f in files if f.endswith(_SUFFIX)))


def path(name: str) -> Path:
    """Path of the arm's URDF file. ValueError where no arm of that name is shipped."""
    _check(name)
    return Path(str(resources.files(__name__) / (name + _SUFFIX)))


def load(name: str) -> Chain:
    """The arm as a chain from its root link to ``flange``, with its limits.

    Units: m, rad, rad/s, rad/s^2, N m; a limit that is not public is infinite.
    ValueError where no arm of that name is shipped; for a file of your own use ``Chain.from_urdf``.
    """
    return Chain.from_urdf(str(path(name)), tip="flange")


def home(name: str) -> NDArray[np.float64]:
    """Joint angles (n,) [rad] of a pose inside the limits and away from singularities.

    A new array each time. ValueError where no arm of that name is shipped.
    """
    _check(name)
    table = json.loads((resources.files(__name__) / "homes.json").read_text(encoding="utf-8"))
    return np.array(table[name], dtype=np.float64)


def _check(name: str) -> None:
    shipped = names()
    if name in shipped:
        return
    near = difflib.get_close_matches(str(name).lower(), shipped, n=1, cutoff=0.4)
    hint = f"; did you mean {near[0]!r}?" if near else "."
    raise ValueError(f"no arm named {name!r} is shipped{hint} There are: {', '.join(shipped)}")
