"""An arm as a URDF that can be drawn, with simple shapes for the links whose meshes are missing."""

from __future__ import annotations

import io
import math
import pathlib
import xml.etree.ElementTree as ElementTree
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

import sigmaik as sk
from sigmaik._types import Array

from .meshes import MeshFiles

if TYPE_CHECKING:
    import viser

__all__ = ["RobotView", "drawable"]


class RobotView:
    """An arm in viser's scene."""

    def __init__(
        self,
        server: viser.ViserServer,
        source: pathlib.Path,
        chain: sk.Chain,
        packages: Mapping[str, str | pathlib.Path] | None = None,
        name: str = "/arm",
    ) -> None:
        """packages: name to folder of further packages that may have meshes. Error where a mesh is elsewhere."""
        import yourdfpy
        from viser import transforms
        from viser.extras import ViserUrdf

        handler = MeshFiles(source, packages)
        text, self.missing = drawable(source.read_text(encoding="utf-8"), handler)
        try:
            urdf = yourdfpy.URDF.load(io.BytesIO(text.encode()), filename_handler=handler, load_collision_meshes=False)
        except Exception as error:  # readers of meshes raise nearly anything
            raise sk.Error(f"{source} cannot be drawn: {type(error).__name__}: {error}") from None
        # The axes of the scene are those of the chain's base, which can differ from the root of the URDF.
        root = np.linalg.inv(np.asarray(urdf.get_transform(chain.base)))
        server.scene.add_frame(
            name, show_axes=False, position=root[:3, 3], wxyz=transforms.SO3.from_matrix(root[:3, :3]).wxyz
        )
        self._view = ViserUrdf(server, urdf, root_node_name=name)
        joints = {joint: i for i, joint in enumerate(chain.joint_names)}
        self._order = [joints.get(joint, -1) for joint in urdf.actuated_joint_names]
        self._shown: Array | None = None

    def show(self, q: Array) -> None:
        """Draws the arm at q (n,); all joints outside the chain stay at 0."""
        if self._shown is not None and np.array_equal(q, self._shown):
            return
        self._shown = q.copy()
        padded = np.append(q, 0.0)
        self._view.update_cfg(padded[self._order])


def drawable(urdf: str, handler: Any) -> tuple[str, list[str]]:
    """A URDF's text with shapes for all its links, and the meshes that were not found.

    handler: from a mesh's name to its file. Links whose meshes are not found get their collision shapes, where these
    are boxes, cylinders or spheres, else sticks to the joints that they carry.
    """
    robot = ElementTree.fromstring(urdf)
    missing = []
    for link in robot.findall("link"):
        for visual in link.findall("visual"):
            mesh = visual.find("geometry/mesh")
            if mesh is None:
                continue
            name = mesh.get("filename") or ""
            if not pathlib.Path(handler(name)).is_file():
                missing.append(name)
                link.remove(visual)
        if link.find("visual") is None:
            for collision in link.findall("collision"):
                if collision.find("geometry/mesh") is None:
                    visual = ElementTree.fromstring(ElementTree.tostring(collision))
                    visual.tag = "visual"
                    link.append(visual)
        if link.find("visual") is None:
            for joint in robot.findall("joint"):
                parent = joint.find("parent")
                if parent is not None and parent.get("link") == link.get("name"):
                    _add_stick(link, joint)
    return ElementTree.tostring(robot, encoding="unicode"), missing


def _add_stick(link: ElementTree.Element, joint: ElementTree.Element) -> None:
    origin = joint.find("origin")
    to = [float(x) for x in ((origin.get("xyz") if origin is not None else None) or "0 0 0").split()]
    length = math.hypot(*to)
    shapes = [("sphere", {"radius": "0.04"}, (0.0, 0.0, 0.0), (0.0, 0.0))]
    if length > 1e-3:
        middle = (to[0] / 2.0, to[1] / 2.0, to[2] / 2.0)
        lean = (math.acos(to[2] / length), math.atan2(to[1], to[0]))
        shapes.append(("cylinder", {"radius": "0.025", "length": repr(length)}, middle, lean))
    for shape, sizes, at, (pitch, yaw) in shapes:
        visual = ElementTree.SubElement(link, "visual")
        place = {"xyz": " ".join(map(repr, at)), "rpy": f"0 {pitch!r} {yaw!r}"}
        ElementTree.SubElement(visual, "origin", place)
        ElementTree.SubElement(ElementTree.SubElement(visual, "geometry"), shape, sizes)
