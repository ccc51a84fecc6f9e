"""Costs of joint positions written in Python."""

from __future__ import annotations

from typing import Protocol

import numpy as np
from numpy.typing import ArrayLike, NDArray

__all__ = ["BatchCost"]


class BatchCost(Protocol):
    """A smooth cost of joint positions, of many configurations at once, for `costs=(…)` of `gradient` and `stochastic`.

    Any object with `value` is such a cost; its class need not derive from this class. Where the object has a method
    ``gradient(q: (B, n)) -> (B, n)``, too, planners call this method. Otherwise gradients are central differences with
    steps of 6e-6 max(1, |q_j|): 2n values for each gradient, all in one call. At a state on a limit these differences
    ask for values one step beyond the limit.

    Each call gets an array q of its own. Planners call without holding locks, but with the GIL, on the thread that
    asked for the plan; an object that several planning threads share must allow calls from all these threads.
    """

    def value(self, q: NDArray[np.float64], /) -> ArrayLike:
        """Costs (B,) at q (B, n) [rad or m], all finite."""
        ...
