"""Names of types that the whole package shares."""

from __future__ import annotations

from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

__all__ = ["Array"]

#: An array of real numbers; each signature says its shape and its units.
Array: TypeAlias = NDArray[np.float64]
