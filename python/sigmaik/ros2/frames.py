"""Where the links of a robot description are: the frames of stamped commands, without TF."""

from __future__ import annotations

import xml.etree.ElementTree as ET
from collections.abc import Mapping
from typing import NamedTuple

import numpy as np

from sigmaik._core import Chain, Error, rotation_exp
from sigmaik._types import Array

__all__ = ["Frames"]


class _Joint(NamedTuple):
    name: str
    kind: str
    parent: str
    origin: Array
    axis: Array


class Frames:
    """The links of a URDF, as frames of commands for one arm.

    Frames are the base link (also ""), the tip link, and every other link of the same description: a camera at the
    wrist, the table that the arm stands on, a finger. A leading slash is left out.
    """

    def __init__(self, chain: Chain, description: str) -> None:
        """description: the URDF's text. Error where the text is no XML."""
        self._chain = chain
        self._joints: dict[str, _Joint] = {}
        try:
            robot = ET.fromstring(description)
        except ET.ParseError as error:
            raise Error(f"the robot description is no XML: {error}") from None
        for joint in robot.iter("joint"):
            parent, child = joint.find("parent"), joint.find("child")
            if parent is None or child is None:  # such as the joints of a <transmission>
                continue
            axis = joint.find("axis")
            self._joints[child.get("link", "")] = _Joint(
                joint.get("name", ""),
                joint.get("type", "fixed"),
                parent.get("link", ""),
                _origin(joint.find("origin")),
                _numbers("1 0 0" if axis is None else axis.get("xyz", "1 0 0")),
            )
        self._links = {link.get("name", "") for link in robot.findall("link")}

    def pose(self, frame: str, positions: Mapping[str, float]) -> Array:
        """(4, 4) pose of a frame in the arm's base.

        positions: [rad or m] of the joints by their names; joints of the way that are missing count as zero.

        Error where the description has no link of this name.
        """
        name = frame.lstrip("/")
        if name in ("", self._chain.base):
            return np.eye(4)
        if name not in self._links:
            raise Error(f"there is no link {name!r} in the robot description")
        base, link = self._in_root(self._chain.base, positions), self._in_root(name, positions)
        return np.array(np.linalg.solve(base, link))

    def _in_root(self, link: str, positions: Mapping[str, float]) -> Array:
        pose = np.eye(4)
        for _ in range(len(self._joints) + 1):  # a description whose links form a ring is no chain
            joint = self._joints.get(link)
            if joint is None:
                return pose
            pose = joint.origin @ _moved(joint, positions.get(joint.name, 0.0)) @ pose
            link = joint.parent
        raise Error(f"the links above {link!r} form a ring")


def _numbers(text: str) -> Array:
    values = np.array([float(part) for part in text.split()])
    if values.shape != (3,) or not np.all(np.isfinite(values)):
        raise Error(f"three numbers are needed, not {text!r}")
    return values


def _origin(origin: ET.Element | None) -> Array:
    pose = np.eye(4)
    if origin is not None:
        roll, pitch, yaw = _numbers(origin.get("rpy", "0 0 0"))
        pose[:3, :3] = rotation_exp([0.0, 0.0, yaw]) @ rotation_exp([0.0, pitch, 0.0]) @ rotation_exp([roll, 0.0, 0.0])
        pose[:3, 3] = _numbers(origin.get("xyz", "0 0 0"))
    return pose


def _moved(joint: _Joint, position: float) -> Array:
    pose = np.eye(4)
    length = float(np.linalg.norm(joint.axis))
    if joint.kind in ("revolute", "continuous") and length > 0.0:
        pose[:3, :3] = rotation_exp(joint.axis / length * position)
    elif joint.kind == "prismatic" and length > 0.0:
        pose[:3, 3] = joint.axis / length * position
    return pose
