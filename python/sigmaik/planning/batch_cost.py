"""Costs of joint positions written in Python."""

from __future__ import annotations

from typing import Protocol

import numpy as np
from numpy.typing import ArrayLike, NDArray

__all__ = ["BatchCost"]


class BatchCost(Protocol):
    """A smooth cost of joint positions, asked for many at once: what `costs=(…)` of `gradient` and `stochastic` takes.

    Any object with `value`; it need not derive from this. With a method ``gradient(q: (B, n)) -> (B, n)`` too it is
    asked for gradients, else these are central differences with steps of 6e-6 max(1, |q_j|), 2n values a gradient, all
    in one call. Differences of states on a limit reach beyond it by a step.

    q is an array of its own at each call. Planners call without holding locks, but with the GIL, on the thread that
    asked for the plan; one object for several planning threads must bear that.
    """

    def value(self, q: NDArray[np.float64], /) -> ArrayLike:
        """Costs (B,) at q (B, n) [rad or m], all finite."""
        ...
