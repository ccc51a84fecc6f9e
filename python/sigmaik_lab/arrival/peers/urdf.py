"""A chain as a URDF: the model of every peer."""

from __future__ import annotations

import math
import xml.etree.ElementTree as ET

import numpy as np

import sigmaik as sk
from sigmaik._types import Array

__all__ = ["chain_urdf"]

_FAR = 1e4  #: [rad or m] the range of a joint without position limits
_FAST = 1e3  #: [rad/s or m/s] the velocity limit of a joint without one


def chain_urdf(chain: sk.Chain) -> str:
    """The chain's joints, links and limits from base to tip, with an inertia that MuJoCo accepts, and no shapes.

    A continuous joint is a revolute joint with a very wide range, because a continuous joint has two coordinates in
    Pinocchio. Roll, pitch and yaw are exact to rounding, except within 1e-8 of pitch ±90°, where an error of 1e-8 rad
    can occur.
    """
    robot = ET.Element("robot", name="arm")
    _add_link(robot, chain.base)
    parent, number = chain.base, 0
    for segment in chain.segments:
        kind = "revolute" if segment.type == "continuous" else segment.type
        joint = ET.SubElement(robot, "joint", name=segment.joint_name, type=kind)
        ET.SubElement(joint, "parent", link=parent)
        ET.SubElement(joint, "child", link=segment.link_name)
        xyz, rpy = segment.origin[:3, 3], roll_pitch_yaw(segment.origin[:3, :3])
        ET.SubElement(joint, "origin", xyz=_text(xyz), rpy=_text(rpy))
        if segment.type != "fixed":
            limits = chain.limits
            ET.SubElement(joint, "axis", xyz=_text(segment.axis))
            ET.SubElement(
                joint,
                "limit",
                lower=_text([max(limits.lower[number], -_FAR)]),
                upper=_text([min(limits.upper[number], _FAR)]),
                velocity=_text([min(limits.velocity[number], _FAST)]),
                effort="1000",
            )
            number += 1
        parent = segment.link_name
        _add_link(robot, parent)
    return ET.tostring(robot, encoding="unicode")


def _add_link(robot: ET.Element, name: str) -> None:
    inertial = ET.SubElement(ET.SubElement(robot, "link", name=name), "inertial")
    ET.SubElement(inertial, "mass", value="1")
    ET.SubElement(inertial, "inertia", ixx="0.1", iyy="0.1", izz="0.1", ixy="0", ixz="0", iyz="0")


def _text(values: Array | list[float]) -> str:
    return " ".join(repr(float(value)) for value in values)


def roll_pitch_yaw(rotation: Array) -> Array:
    """Angles of R = Rz(yaw) Ry(pitch) Rx(roll)."""
    level = math.hypot(rotation[0, 0], rotation[1, 0])
    pitch = math.atan2(-rotation[2, 0], level)
    if level > 1e-8:
        roll = math.atan2(rotation[2, 1], rotation[2, 2])
        return np.array([roll, pitch, math.atan2(rotation[1, 0], rotation[0, 0])])
    return np.array([math.atan2(-rotation[1, 2], rotation[1, 1]), pitch, 0.0])
