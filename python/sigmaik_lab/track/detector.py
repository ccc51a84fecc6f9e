"""The detector: a tag's pose out of a picture, by OpenCV. Needs cv2."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

from sigmaik._types import Array

from .lens import Lens

__all__ = ["CELLS", "Detector", "tag_cells"]

#: Cells of a side of the tag, its black border among them.
CELLS = 8
#: Of the family tag36h11, the AprilTag that most programs print.
_FAMILY, _NUMBER = cv2.aruco.DICT_APRILTAG_36h11, 0


def tag_cells() -> NDArray[np.bool_]:
    """(8, 8) which cells of the tag are black, from above, left to right."""
    return np.asarray(
        cv2.aruco.generateImageMarker(cv2.aruco.getPredefinedDictionary(_FAMILY), _NUMBER, CELLS) < 128, dtype=np.bool_
    )


class Detector:
    """Finds the tag in pictures of a lens. The detector knows the picture, the lens and the tag's size, and no more."""

    def __init__(self, lens: Lens) -> None:
        options = cv2.aruco.DetectorParameters()
        options.cornerRefinementMethod = cv2.aruco.CORNER_REFINE_SUBPIX
        self._detector = cv2.aruco.ArucoDetector(cv2.aruco.getPredefinedDictionary(_FAMILY), options)
        self._matrix = lens.matrix
        half = 0.5 * lens.tag
        self._corners = np.array([[-half, half, 0.0], [half, half, 0.0], [half, -half, 0.0], [-half, -half, 0.0]])

    def find(self, picture: NDArray[np.uint8]) -> tuple[Array, Array] | None:
        """The tag's pose (4, 4) in the camera, and its corners (4, 2) in the picture [pixels]; None without a tag.

        picture: (height, width, 3) RGB

        Camera: x to the right, y down, z ahead. Tag: x to the right, y up, z out of the print. A flat tag has two poses
        that look nearly alike (Collins and Bartoli 2014); the one that fits the corners better is taken.
        """
        grey = cv2.cvtColor(picture, cv2.COLOR_RGB2GRAY)
        found, numbers, _ = self._detector.detectMarkers(grey)
        if numbers is None:
            return None
        at = np.flatnonzero(np.ravel(numbers) == _NUMBER)
        if len(at) != 1:
            return None
        corners = np.asarray(found[at[0]], dtype=np.float64).reshape(4, 2)
        count, turns, places, _ = cv2.solvePnPGeneric(
            self._corners, corners, self._matrix, None, flags=cv2.SOLVEPNP_IPPE_SQUARE
        )
        if not count:
            return None
        pose = np.eye(4)
        pose[:3, :3] = cv2.Rodrigues(turns[0])[0]
        pose[:3, 3] = np.ravel(places[0])
        if not np.all(np.isfinite(pose)) or pose[2, 3] <= 0.0:
            return None
        return pose, corners
