"""The rendered camera's lens and shutter, and the size of the tag."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from sigmaik._types import Array

__all__ = ["Lens"]


@dataclass(frozen=True)
class Lens:
    """A pinhole without distortion, and a shutter that exposes all pixels at once.

    The defaults have about the view of the colour pictures of the RealSense D415, which the J-PARSE paper has on the
    wrist: 68° × 42°.
    """

    width: int = 424  #: [pixels]
    height: int = 240  #: [pixels]
    view: float = 42.0  #: [°] from the lower edge of the picture to the upper one
    exposure: float = 0.01  #: [s]
    parts: int = 4  #: renderings whose mean is a picture
    tag: float = 0.1  #: [m] side of the tag's black square
    #: [°] of the tag, from the direction to the camera. Where a tag faces a camera exactly, two poses look alike.
    tilt: float = 25.0

    @property
    def focal_length(self) -> float:
        """[pixels]"""
        return 0.5 * self.height / math.tan(math.radians(0.5 * self.view))

    @property
    def matrix(self) -> Array:
        """(3, 3) of the projection; the first pixel's centre is at (0, 0)."""
        f = self.focal_length
        return np.array([[f, 0.0, 0.5 * self.width - 0.5], [0.0, f, 0.5 * self.height - 0.5], [0.0, 0.0, 1.0]])

    def check(self) -> None:
        """ValueError where a part is wrong."""
        for name, low, high in (
            ("width", 32, 4096),
            ("height", 32, 4096),
            ("view", 5.0, 150.0),
            ("exposure", 0.0, 0.5),
            ("tag", 1e-3, 1.0),
            ("tilt", -80.0, 80.0),
        ):
            if not low <= getattr(self, name) <= high:
                raise ValueError(f"{name} must be in [{low:g}, {high:g}], not {getattr(self, name):g}")

    def moments(self) -> Array:
        """(parts,) [s] of the renderings, from the middle of the exposure."""
        moments: Array = ((np.arange(self.parts) + 0.5) / self.parts - 0.5) * self.exposure
        return moments
