"""Where the links of a robot description are: the frames of stamped commands, without TF."""

from __future__ import annotations

import xml.etree.ElementTree as ET
from collections.abc import Mapping
from typing import NamedTuple

import numpy as np

from sigmaik._core import Chain, Error, Segment, rotation_exp
from sigmaik._types import Array

__all__ = ["Frames", "rotation_of"]

_QUATERNION_ROUNDING = 0.01  # of a length of 1, as Chain.from_urdf takes it
_MOVING = ("revolute", "continuous", "prismatic")


class _Joint(NamedTuple):
    name: str
    kind: str
    origin: Array
    axis: Array


class _Mimic(NamedTuple):
    joint: str
    multiplier: float
    offset: float


class Frames:
    """The links of a URDF, as frames of commands for one arm.

    Frames are the base link (also ""), the links of the arm with its tip, and every other link of the same description:
    a camera at the wrist, the table that the arm stands on, a finger. A leading slash is left out. Links of the arm are
    where the chain says, with the chain's tool, locked joints and mimic joints. Where the arm and the rest of the
    description have a link of the same name (such as "tool"), the name means the arm's link.
    """

    def __init__(self, chain: Chain, description: str) -> None:
        """description: the URDF's text. Error where the text is no XML, or does not have the arm's base link."""
        try:
            robot = ET.fromstring(description)
        except ET.ParseError as error:
            raise Error(f"the robot description is no XML: {error}") from None
        self._base = chain.base
        self._segments = chain.segments
        self._links = {link.get("name", "") for link in robot.findall("link")}
        if chain.base not in self._links:
            raise Error(f"there is no link {chain.base!r}, the arm's base, in the robot description")
        self._above: dict[str, tuple[str, ET.Element]] = {}  # of a link: its parent, and the joint in between
        self._mimics: dict[str, _Mimic] = {}
        for joint in robot.findall("joint"):
            parent, child = joint.find("parent"), joint.find("child")
            if parent is None or child is None:
                continue
            self._above[child.get("link", "")] = parent.get("link", ""), joint
            mimic = joint.find("mimic")
            if mimic is not None:
                self._mimics[joint.get("name", "")] = _mimic(mimic)
        self._locked: set[str] = set()
        self._shared = {chain.base, *self._links_of_both()}
        self._follow_the_chain()

    def _links_of_both(self) -> list[str]:
        """The links of the arm that are links of the description, too: a tool of `with_tool` is none."""
        both, parent = [], self._base
        for segment in self._segments:
            above = self._above.get(segment.link_name)
            if above is None or (above[0], above[1].get("name")) != (parent, segment.joint_name):
                break
            joint = _read(above[1])
            if joint.kind == "fixed" and not np.allclose(joint.origin, segment.origin, rtol=0.0, atol=1e-9):
                break
            if segment.type == "fixed" and joint.kind != "fixed":
                self._locked.add(segment.joint_name)
            parent = segment.link_name
            both.append(parent)
        return both

    def _follow_the_chain(self) -> None:
        """The chain's joints mimic what the chain says: a joint that mimics a joint beside the arm moves by itself."""
        for segment in self._segments:
            self._mimics.pop(segment.joint_name, None)
            if segment.mimic is not None:
                self._mimics[segment.joint_name] = _Mimic(*segment.mimic)
        self._follows = {segment.joint_name for segment in self._segments if segment.mimic is not None}

    def pose(self, frame: str, positions: Mapping[str, float]) -> Array:
        """(4, 4) pose of a frame in the arm's base.

        positions: [rad or m] of the joints by their names. A mimic joint of the arm follows from its joint; so does a
        mimic joint beside the arm that is missing. Other joints on the way that are missing count as zero.

        Error where the description has no link of this name, or where the link's place does not follow from positions:
        beyond a floating or planar joint, or beyond a mimic of a locked joint that is missing.
        """
        if not isinstance(frame, str):
            raise Error(f"a frame is the name of a link, not {frame!r}")
        name = frame.lstrip("/")
        if name in ("", self._base):
            return np.eye(4)
        arm = self._arm(positions)
        if name in arm:
            return arm[name]
        if name not in self._links:
            raise Error(f"there is no link {name!r} in the robot description")
        way, link = self._way_up(name, self._shared)
        if link in self._shared:
            return arm[link] @ self._along(way, positions)
        over, top = self._way_up(self._base, set())
        if top != link:
            raise Error(f"link {name!r} is not connected to the arm's base {self._base!r}")
        # Joints above both links cancel; one of them may be floating.
        while way and over and way[0] is over[0]:
            way, over = way[1:], over[1:]
        return np.array(np.linalg.solve(self._along(over, positions), self._along(way, positions)))

    def _arm(self, positions: Mapping[str, float]) -> dict[str, Array]:
        """Poses of the arm's links in its base."""
        pose = np.eye(4)
        poses = {self._base: pose}
        for segment in self._segments:
            pose = pose @ self._placed(_joint(segment), positions)
            poses[segment.link_name] = pose
        return poses

    def _way_up(self, link: str, until: set[str]) -> tuple[list[ET.Element], str]:
        """The joints above a link, the uppermost first, up to one of these links or to a root; and that link."""
        way: list[ET.Element] = []
        while link not in until and link in self._above:
            link, joint = self._above[link]
            way.insert(0, joint)
            if len(way) > len(self._above):
                raise Error(f"the links above {link!r} form a ring")
        return way, link

    def _along(self, way: list[ET.Element], positions: Mapping[str, float]) -> Array:
        pose = np.eye(4)
        for joint in way:
            pose = pose @ self._placed(_read(joint), positions)
        return pose

    def _placed(self, joint: _Joint, positions: Mapping[str, float]) -> Array:
        """(4, 4) pose of a joint's link in its parent link."""
        pose = np.eye(4)
        if joint.kind in _MOVING:
            way = joint.axis * self._position(joint.name, positions)
            if joint.kind == "prismatic":
                pose[:3, 3] = way
            else:
                pose[:3, :3] = rotation_exp(way)
        elif joint.kind != "fixed":
            raise Error(f"joint {joint.name!r} is {joint.kind}: where its link is does not follow from the joints")
        return np.array(joint.origin @ pose)

    def _position(self, name: str, positions: Mapping[str, float]) -> float:
        """[rad or m] of a joint. Error where nothing says its position."""
        multiplier, offset, first = 1.0, 0.0, name
        for _ in range(len(self._mimics) + 1):
            if name in positions and name not in self._follows:
                return multiplier * positions[name] + offset
            mimic = self._mimics.get(name)
            if mimic is None:
                if name in self._locked:
                    raise Error(f"joint {first!r} mimics {name!r}, which is locked, and whose position is not measured")
                return offset
            if not np.isfinite([mimic.multiplier, mimic.offset]).all():
                raise Error(f"joint {name!r} of the robot description: multiplier or offset of its mimic is no number")
            offset += multiplier * mimic.offset
            multiplier *= mimic.multiplier
            name = mimic.joint
        raise Error(f"joint {first!r} mimics itself in the end")


def rotation_of(xyzw: Array) -> Array:
    """(3, 3) rotation of a unit quaternion."""
    x, y, z, w = xyzw
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
            [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
            [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
        ]
    )


def _joint(segment: Segment) -> _Joint:
    return _Joint(segment.joint_name, segment.type, segment.origin, segment.axis)


def _read(element: ET.Element) -> _Joint:
    """Error where the joint's numbers are wrong: read where a frame needs them, and not before."""
    name, kind = element.get("name", ""), element.get("type", "")
    try:
        axis = np.zeros(3)
        if kind in _MOVING:
            axis = _numbers(element.find("axis"), "xyz", 3, "1 0 0")
            length = float(np.linalg.norm(axis))
            if length == 0.0:
                raise Error("the axis is zero")
            axis = axis / length
        return _Joint(name, kind, _origin(element.find("origin")), axis)
    except Error as error:
        raise Error(f"joint {name!r} of the robot description: {error}") from None


def _mimic(element: ET.Element) -> _Mimic:
    try:
        multiplier = float(element.get("multiplier", "1"))
        offset = float(element.get("offset", "0"))
    except ValueError:
        multiplier = offset = np.nan
    return _Mimic(element.get("joint", ""), multiplier, offset)


def _numbers(element: ET.Element | None, attribute: str, count: int, default: str) -> Array:
    text = default if element is None else element.get(attribute, default)
    try:
        values = np.array([float(part) for part in text.split()])
    except ValueError:
        values = np.empty(0)
    if values.shape != (count,) or not np.all(np.isfinite(values)):
        raise Error(f"{attribute} = {text!r} needs {count} finite numbers")
    return values


def _origin(origin: ET.Element | None) -> Array:
    pose = np.eye(4)
    pose[:3, 3] = _numbers(origin, "xyz", 3, "0 0 0")
    if origin is not None and origin.get("quat_xyzw") is not None:  # URDF 1.1
        if origin.get("rpy") is not None:
            raise Error("its origin gives both rpy and quat_xyzw")
        xyzw = _numbers(origin, "quat_xyzw", 4, "")
        length = float(np.linalg.norm(xyzw))
        if abs(length - 1.0) > _QUATERNION_ROUNDING:
            raise Error(f"quat_xyzw has the length {length:g}, not 1: no rotation")
        pose[:3, :3] = rotation_of(xyzw / length)
        return pose
    roll, pitch, yaw = _numbers(origin, "rpy", 3, "0 0 0")
    pose[:3, :3] = rotation_exp([0.0, 0.0, yaw]) @ rotation_exp([0.0, pitch, 0.0]) @ rotation_exp([roll, 0.0, 0.0])
    return pose
