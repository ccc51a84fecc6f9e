"""A pose that the tip is to take, checked once: at the border where the pose comes in."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

import sigmaik as sk
from sigmaik._types import Array

__all__ = ["FARTHEST", "TargetPose"]

FARTHEST = 100.0
"""[m] A target with a larger coordinate is a mistake."""


@dataclass(frozen=True)
class TargetPose:
    """A checked pose of the tip in the base. Build one with `of`, `from_page` or `moved_to`, which check."""

    matrix: Array  #: (4, 4) [m]

    @staticmethod
    def of(target: ArrayLike | TargetPose) -> TargetPose:
        """Checks a pose (4, 4). ValueError if the pose is not finite, not a rigid transform, or too far away."""
        if isinstance(target, TargetPose):
            return target
        pose: Array = np.array(target, dtype=np.float64)
        if pose.shape != (4, 4) or not np.isfinite(pose).all():
            raise ValueError("the target must be a 4×4 pose of finite numbers")
        if np.abs(pose[:3, 3]).max() > FARTHEST:
            raise ValueError(f"the target is more than {FARTHEST:g} m away")
        sk.pose_error(pose, pose)  # refuses what is not a rigid transform
        return TargetPose(pose)

    @staticmethod
    def from_page(position: Any, wxyz: Any) -> TargetPose:
        """Checks a position (3,) [m] and a unit quaternion wxyz (4,), as the page sends them. ValueError as in `of`."""
        from viser import transforms

        position, wxyz = np.array(position, dtype=np.float64), np.array(wxyz, dtype=np.float64)
        finite = np.isfinite(position).all() and np.isfinite(wxyz).all()
        if position.shape != (3,) or wxyz.shape != (4,) or not finite:
            raise ValueError("the page's target is not three and four finite numbers")
        size = np.linalg.norm(wxyz)
        if abs(size - 1.0) > 1e-3:
            raise ValueError(f"the page's target has a quaternion of length {size:g}")
        pose: Array = np.eye(4)
        pose[:3, :3] = transforms.SO3(wxyz=wxyz / size).as_matrix()
        pose[:3, 3] = position
        return TargetPose.of(pose)

    def moved_to(self, position: Any) -> TargetPose:
        """The same orientation at another position (3,) [m]. ValueError as in `of`."""
        moved: Array = np.array(position, dtype=np.float64)
        if moved.shape != (3,):
            raise ValueError("the target's position must be three finite numbers")
        pose = self.matrix.copy()
        pose[:3, 3] = moved
        return TargetPose.of(pose)
