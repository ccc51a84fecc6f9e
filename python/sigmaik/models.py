"""Arms from other model files than URDF: xacro, MuJoCo's MJCF, and the names of the package robot_descriptions.

Each function makes a URDF, which `Chain.from_urdf` reads. The packages that do the work are optional
(``pip install 'sigmaik[models]'``), and are imported where they are used.
"""

from __future__ import annotations

import importlib
import os
import pkgutil
from collections.abc import Iterator, Mapping
from typing import Any
from xml.etree import ElementTree

import numpy as np
from numpy.typing import ArrayLike

from ._core import Chain, Error
from ._extras import need
from ._types import Array

__all__ = ["disabled_pairs", "from_description", "from_mjcf", "from_xacro", "urdf_of_mjcf", "urdf_of_xacro"]


def from_xacro(
    path: str | os.PathLike[str],
    arguments: Mapping[str, str] | None = None,
    *,
    base: str | None = None,
    tip: str | None = None,
    acceleration: ArrayLike | None = None,
) -> Chain:
    """An arm from a xacro file.

    arguments: of the file's ``<xacro:arg>``, by name.
    base, tip, acceleration: as for `Chain.from_urdf`.

    Raises MissingPackage, a ValueError with the command that installs xacrodoc, where that is missing, and Error where
    the file cannot be expanded or is no usable arm.
    """
    return Chain.from_urdf(urdf_of_xacro(path, arguments), base, tip, acceleration)


def urdf_of_xacro(path: str | os.PathLike[str], arguments: Mapping[str, str] | None = None) -> str:
    """The URDF that a xacro file expands to; see `from_xacro`."""
    need("xacrodoc")
    import xacrodoc  # type: ignore[import-not-found, import-untyped, unused-ignore]

    if not os.path.isfile(path):
        raise Error(f"xacro '{os.fspath(path)}': no such file")
    given = {name: str(value) for name, value in (arguments or {}).items()}
    try:
        document = xacrodoc.XacroDoc.from_file(os.fspath(path), subargs=given)
        return str(document.to_urdf_string(use_protocols=True))
    except Exception as error:  # xacro's own errors have no common class
        raise Error(f"xacro '{os.fspath(path)}': {error}") from error


def from_description(name: str, *, base: str | None = None, tip: str | None = None) -> Chain:
    """An arm by a name of the package robot_descriptions, such as "ur5e" or "ur5e_description".

    The package downloads the description when it is first asked for. Its URDF is taken, else its xacro, else its MJCF.

    Raises MissingPackage where robot_descriptions is missing, and Error with similar names where there is no such name.
    """
    need("robot_descriptions")
    import robot_descriptions  # type: ignore[import-not-found, import-untyped, unused-ignore]

    known = {module.name for module in pkgutil.iter_modules(robot_descriptions.__path__)}
    found = next((n for n in (name, f"{name}_description", f"{name}_mj_description") if n in known), None)
    if found is None or not found.endswith("_description"):
        raise Error(f"robot_descriptions has no '{name}'{_similar(name, known)}")
    module = importlib.import_module(f"robot_descriptions.{found}")
    if hasattr(module, "URDF_PATH"):
        return Chain.from_urdf(module.URDF_PATH, base, tip)
    if hasattr(module, "XACRO_PATH"):
        return from_xacro(module.XACRO_PATH, getattr(module, "XACRO_ARGS", None), base=base, tip=tip)
    return from_mjcf(module.MJCF_PATH, base=base, tip=tip)


def _similar(name: str, known: set[str]) -> str:
    import difflib

    close = difflib.get_close_matches(f"{name}_description", [n for n in known if n.endswith("_description")], 3)
    return f"; similar names: {', '.join(close)}" if close else ""


def from_mjcf(
    source: str | os.PathLike[str],
    *,
    base: str | None = None,
    tip: str | None = None,
    acceleration: ArrayLike | None = None,
) -> Chain:
    """An arm from an MJCF file, or its text, through MuJoCo's own loader.

    base, tip: names of bodies; by default the world, and the only body without children. q is MuJoCo's qpos.

    Hinges and slides are read, with range, inertias, equality constraints of two joints (as mimic joints), and the
    limits of force of joints and of their motors. MJCF has no limits of speed: `Chain.with_limits` gives them.

    Raises MissingPackage where MuJoCo is missing, and Error where the file is no usable arm.
    """
    return Chain.from_urdf(urdf_of_mjcf(source), base, tip, acceleration)


def urdf_of_mjcf(source: str | os.PathLike[str]) -> str:
    """A URDF of the bodies and joints of an MJCF file, or of its text; see `from_mjcf`."""
    need("mujoco")
    import mujoco  # type: ignore[import-untyped, unused-ignore]

    text = os.fspath(source)
    try:
        if text.lstrip().startswith("<"):
            model = mujoco.MjModel.from_xml_string(text)
        else:
            model = mujoco.MjModel.from_xml_path(text)
    except (ValueError, OSError) as error:
        raise Error(f"MJCF: {error}") from error
    robot = ElementTree.Element("robot", name="mjcf", version="1.1")
    names = [model.body(i).name or f"body{i}" for i in range(model.nbody)]
    for body in range(model.nbody):
        _add_body(robot, model, names, body)
    return ElementTree.tostring(robot, encoding="unicode")


def _numbers(values: ArrayLike) -> str:
    return " ".join(repr(float(x)) for x in np.asarray(values, dtype=np.float64).ravel())


def _add_link(robot: ElementTree.Element, name: str) -> ElementTree.Element:
    return ElementTree.SubElement(robot, "link", name=name)


def _add_joint(robot: ElementTree.Element, name: str, kind: str, ends: tuple[str, str], at: tuple[Array, Array]) -> Any:
    """ends: parent and child. at: position, and quaternion wxyz."""
    joint = ElementTree.SubElement(robot, "joint", name=name, type=kind)
    ElementTree.SubElement(joint, "parent", link=ends[0])
    ElementTree.SubElement(joint, "child", link=ends[1])
    position, quaternion = at
    ElementTree.SubElement(
        joint,
        "origin",
        xyz=_numbers(position),
        quat_xyzw=_numbers(np.roll(quaternion / np.linalg.norm(quaternion), -1)),
    )
    return joint


_ONE = np.array([1.0, 0.0, 0.0, 0.0])


def _add_body(robot: ElementTree.Element, model: Any, names: list[str], body: int) -> None:
    """A body's link, and its joints: each is a link of its own at the joint's anchor, the body follows the last."""
    link = _add_link(robot, names[body])
    if body == 0:
        return
    _add_inertia(link, model, body)
    parent, position, quaternion = names[model.body_parentid[body]], model.body_pos[body], model.body_quat[body]
    first, count = model.body_jntadr[body], model.body_jntnum[body]
    anchor = np.zeros(3)
    for joint in range(first, first + count):
        name = _joint_name(model, names, joint)
        offset = model.jnt_pos[joint] - anchor
        at = position + _rotated(quaternion, offset), quaternion
        _add_moving(robot, model, names, joint, (parent, f"{name}/link"), at)
        _add_link(robot, f"{name}/link")
        parent, position, quaternion, anchor = f"{name}/link", np.zeros(3), _ONE, model.jnt_pos[joint]
    _add_joint(robot, f"{names[body]}/mount", "fixed", (parent, names[body]), (position - anchor, quaternion))


def _joint_name(model: Any, names: list[str], joint: int) -> str:
    return model.joint(joint).name or f"{names[model.jnt_bodyid[joint]]}/joint{joint}"


def _rotated(quaternion: Array, vector: Array) -> Array:
    import mujoco

    out = np.zeros(3)
    mujoco.mju_rotVecQuat(out, np.asarray(vector, dtype=np.float64), np.asarray(quaternion, dtype=np.float64))
    return out


def _add_moving(
    robot: ElementTree.Element,
    model: Any,
    names: list[str],
    joint: int,
    ends: tuple[str, str],
    at: tuple[Array, Array],
) -> None:
    import mujoco

    kinds = {int(mujoco.mjtJoint.mjJNT_HINGE): "revolute", int(mujoco.mjtJoint.mjJNT_SLIDE): "prismatic"}
    kind = kinds.get(int(model.jnt_type[joint]), "floating")  # a free or a ball joint, which the reader refuses
    limited = bool(model.jnt_limited[joint])
    if kind == "revolute" and not limited:
        kind = "continuous"
    # At qpos0 the bodies stand as the file says.
    zero, axis = float(model.qpos0[model.jnt_qposadr[joint]]), model.jnt_axis[joint]
    position, quaternion = at
    if kind == "prismatic":
        position = position - _rotated(quaternion, zero * axis)
    elif kind != "floating" and zero != 0.0:
        turn, whole = np.zeros(4), np.zeros(4)
        mujoco.mju_axisAngle2Quat(turn, axis, -zero)
        mujoco.mju_mulQuat(whole, quaternion, turn)
        quaternion = whole
    name = ends[1].removesuffix("/link")
    element = _add_joint(robot, name, kind, ends, (position, quaternion))
    ElementTree.SubElement(element, "axis", xyz=_numbers(axis))
    limit = {"velocity": "inf", "effort": repr(_effort(model, joint))}
    if kind != "continuous":
        lower, upper = model.jnt_range[joint] if limited else (-np.inf, np.inf)
        limit.update(lower=repr(float(lower)), upper=repr(float(upper)))
    ElementTree.SubElement(element, "limit", limit)
    for mimic in _mimics(model, names, joint):
        ElementTree.SubElement(element, "mimic", mimic)


def _effort(model: Any, joint: int) -> float:
    """[N·m or N], the least of the joint's own limit and that of its motors."""
    import mujoco

    most = np.inf
    if model.jnt_actfrclimited[joint]:
        most = float(np.abs(model.jnt_actfrcrange[joint]).min())
    for motor in range(model.nu):
        on_joint = int(model.actuator_trntype[motor]) == int(mujoco.mjtTrn.mjTRN_JOINT)
        if on_joint and model.actuator_trnid[motor, 0] == joint and model.actuator_forcelimited[motor]:
            gear = abs(float(model.actuator_gear[motor, 0]))
            most = min(most, float(np.abs(model.actuator_forcerange[motor]).min()) * gear)
    return most if most > 0.0 else np.inf


def _mimics(model: Any, names: list[str], joint: int) -> Iterator[dict[str, str]]:
    """Of an equality q1 − q1_0 = a0 + a1 (q2 − q2_0) of two joints; of no other polynomial."""
    import mujoco

    for k in range(model.neq):
        if int(model.eq_type[k]) != int(mujoco.mjtEq.mjEQ_JOINT) or model.eq_obj1id[k] != joint:
            continue
        other, polynomial = int(model.eq_obj2id[k]), model.eq_data[k, :5]
        if other < 0 or not model.eq_active0[k] or np.any(polynomial[2:] != 0.0):
            continue
        zero, zero_of_other = (float(model.qpos0[model.jnt_qposadr[j]]) for j in (joint, other))
        offset = zero + float(polynomial[0]) - float(polynomial[1]) * zero_of_other
        name = _joint_name(model, names, other)
        yield {"joint": name, "multiplier": repr(float(polynomial[1])), "offset": repr(offset)}
        return


def _add_inertia(link: ElementTree.Element, model: Any, body: int) -> None:
    if not model.body_mass[body] > 0.0:
        return
    inertial = ElementTree.SubElement(link, "inertial")
    ElementTree.SubElement(
        inertial,
        "origin",
        xyz=_numbers(model.body_ipos[body]),
        quat_xyzw=_numbers(np.roll(model.body_iquat[body], -1)),
    )
    ElementTree.SubElement(inertial, "mass", value=repr(float(model.body_mass[body])))
    xx, yy, zz = (repr(float(x)) for x in model.body_inertia[body])
    ElementTree.SubElement(inertial, "inertia", ixx=xx, iyy=yy, izz=zz, ixy="0", ixz="0", iyz="0")


def disabled_pairs(source: str | os.PathLike[str]) -> frozenset[tuple[str, str]]:
    """The pairs of links whose collisions an SRDF disables, from a file or from its text.

    Each pair is sorted. Raises Error where the source is no SRDF, or a pair has no names.
    """
    text = os.fspath(source)
    if not text.lstrip("\ufeff \t\r\n").startswith("<"):
        try:
            with open(text, encoding="utf-8") as file:
                text = file.read()
        except (OSError, ValueError) as error:
            raise Error(f"SRDF '{os.fspath(source)}': {error}") from error
    if "<!ENTITY" in text:
        raise Error("SRDF: XML entities are not supported; write their values out")
    try:
        robot = ElementTree.fromstring(text.lstrip("\ufeff \t\r\n"))
    except ElementTree.ParseError as error:
        raise Error(f"SRDF: malformed XML: {error}") from error
    if robot.tag != "robot":
        raise Error(f"not an SRDF: the root element is <{robot.tag}>, not <robot>")
    pairs = set()
    for element in robot.iter("disable_collisions"):
        first, second = element.get("link1"), element.get("link2")
        if not first or not second:
            raise Error("SRDF: <disable_collisions> needs link1 and link2")
        pairs.add((min(first, second), max(first, second)))
    return frozenset(pairs)
