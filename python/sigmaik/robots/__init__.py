"""Arms shipped with the package, as URDF files.

    >>> import sigmaik as sk
    >>> chain = sk.robots.load("ufactory_xarm7")
    >>> q = sk.robots.home("ufactory_xarm7")
    >>> arm = sk.robots.open("arm.urdf")          # a name, or a file of your own: arm.chain, arm.home

The first lines of each file say where its figures come from, and what a user must know before using the file.
The tip of every arm is its link ``flange``, and the base is the root link. ``flange`` is the mechanical flange; where a
hand belongs to the arm (Jaco 2, SO-101), it is the frame between the fingers.
"""

from __future__ import annotations

import difflib
import json
import os
from importlib import resources
from pathlib import Path
from typing import NamedTuple

import numpy as np

from sigmaik._core import Chain, Error
from sigmaik._types import Array

__all__ = ["Arm", "home", "load", "names", "open", "path"]

_SUFFIX = ".urdf"


class Arm(NamedTuple):
    """An arm, shipped or of a file, with a configuration to start from."""

    name: str
    """Name of the shipped arm, or of the file without its suffix."""
    chain: Chain
    home: Array
    """(n,) [rad or m] inside the limits and away from singularities."""
    path: Path
    """Path of the URDF file."""


def names() -> tuple[str, ...]:
    """Names of the shipped arms, sorted."""
    files = (entry.name for entry in resources.files(__name__).iterdir())
    return tuple(sorted(f.removesuffix(_SUFFIX) for f in files if f.endswith(_SUFFIX)))


def path(name: str) -> Path:
    """Path of the arm's URDF file. Error where no arm of that name is shipped."""
    _check(name)
    return Path(str(resources.files(__name__) / (name + _SUFFIX)))


def load(name: str) -> Chain:
    """The arm as a chain from its root link to ``flange``, with its limits.

    Units: m, rad, rad/s, rad/s^2, rad/s^3, N m; a limit that is not public is infinite.
    Error where no arm of that name is shipped; for a file of your own use ``Chain.from_urdf``.
    """
    return Chain.from_urdf(str(path(name)), tip="flange")


def home(name: str) -> Array:
    """Joint angles (n,) [rad] of a pose inside the limits and away from singularities.

    A new array each time. Error where no arm of that name is shipped.
    """
    _check(name)
    table = json.loads((resources.files(__name__) / "homes.json").read_text(encoding="utf-8"))
    return np.array(table[name], dtype=np.float64)


def open(arm: str | os.PathLike[str], base: str | None = None, tip: str | None = None) -> Arm:
    """A shipped arm by its name, or the arm of a URDF file by its path.

    base, tip: link names; by default the root and the only leaf, for a shipped arm the root and ``flange``

    The home of a file, and of a shipped arm between other links, is the middle of the joint ranges; where the arm is
    singular there, home is the best conditioned of 32 random configurations (with fixed seeds). Error where no arm
    and no file has this name, or where the file describes no chain.
    """
    if arm in names():
        name, file = str(arm), path(str(arm))
        if base is None and tip is None:
            return Arm(name, load(name), home(name), file)
    else:
        file = Path(arm)
        name = file.stem
        if not file.is_file():
            raise Error(f"no shipped arm and no URDF file {str(arm)!r}; shipped are {', '.join(names())}")
    chain = Chain.from_urdf(str(file), base=base, tip=tip)
    return Arm(name, chain, _middle(chain), file)


def _middle(chain: Chain) -> Array:
    lower, upper = chain.limits.lower, chain.limits.upper
    bounded = np.isfinite(lower) & np.isfinite(upper)
    middle = np.where(bounded, 0.5 * (np.where(bounded, lower, 0.0) + np.where(bounded, upper, 0.0)), 0.0)
    if _inverse_condition(chain, middle) > 0.02:
        return middle
    return max((chain.random_configuration(seed) for seed in range(32)), key=lambda q: _inverse_condition(chain, q))


def _inverse_condition(chain: Chain, q: Array) -> float:
    sigma = np.linalg.svd(chain.jacobian(q), compute_uv=False)
    return float(sigma[-1] / sigma[0]) if sigma[0] > 0.0 else 0.0


def _check(name: str) -> None:
    shipped = names()
    if name in shipped:
        return
    near = difflib.get_close_matches(str(name).lower(), shipped, n=1, cutoff=0.4)
    hint = f"; did you mean {near[0]!r}?" if near else "."
    raise Error(f"no arm named {name!r} is shipped{hint} There are: {', '.join(shipped)}")
