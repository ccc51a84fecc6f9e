"""The page's scene: the arm, its target, and at the tool the velocity ellipsoid, singular directions and velocities."""

from __future__ import annotations

import collections
import pathlib
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

import sigmaik as sk
from sigmaik._types import Array

from .drawing import RobotView
from .session import Session
from .settings import Settings

if TYPE_CHECKING:
    import viser

__all__ = ["Scene", "singular_lines", "task_singular_values"]

#: Colours of the tool's trace, by status.
_TRACE = {
    sk.Status.OK: (47, 158, 68),
    sk.Status.DAMPED: (232, 137, 12),
    sk.Status.LIMITED: (214, 51, 108),
}
_TRACE_LENGTH = 240
_ASKED, _ACHIEVED = (34, 139, 230), (47, 158, 68)
_LINEAR, _ANGULAR = (214, 51, 108), (151, 53, 214)
_NOTHING = np.zeros((1, 2, 3), dtype=np.float32)


def singular_lines(directions: Array, length_scale: float) -> tuple[Array, Array]:
    """Linear and angular parts (k, 3) of a sample's singular directions (6, 6), weighted as in the task.

    Parts shorter than a tenth are left out, and so are the columns of NaN that a sample has beyond its directions.
    """
    columns = directions[:, np.isfinite(directions).all(axis=0)]
    linear, angular = columns[:3].T, length_scale * columns[3:].T
    long_linear, long_angular = (part[np.linalg.norm(part, axis=1) > 0.1] for part in (linear, angular))
    return long_linear, long_angular


def task_singular_values(jacobian: Array, rotation: Array, settings: Settings, length_scale: float) -> Array:
    """Singular values of the weighted task Jacobian, for samples that have none; `rotation` (3, 3): tip in base."""
    rows = jacobian.copy()
    if settings.frame == "tool":
        rows[:3], rows[3:] = rotation.T @ rows[:3], rotation.T @ rows[3:]
    rows[3:] *= length_scale
    return np.asarray(np.linalg.svd(rows[list(settings.mask)], compute_uv=False), np.float64)


class Scene:
    """The handles of the drawn objects."""

    def __init__(
        self,
        server: viser.ViserServer,
        session: Session,
        packages: Mapping[str, str | pathlib.Path] | None = None,
    ) -> None:
        scene = server.scene
        self.reach = _reach(session.chain)
        # Near enough for the arm to be large; aimed to its right, where the panel covers the picture.
        server.initial_camera.position = tuple(self.reach * np.array([0.8, -1.2, 0.75]))
        server.initial_camera.look_at = tuple(self.reach * np.array([0.42, 0.05, 0.3]))
        scene.add_grid("/ground", 3.0 * self.reach, 3.0 * self.reach, cell_size=0.2, section_size=0.6)
        self.robot = RobotView(server, session.source, session.chain, packages)
        self.target = scene.add_transform_controls("/target", scale=0.22 * self.reach, depth_test=False, line_width=3.0)
        self.tool = scene.add_frame("/tool", axes_length=0.08 * self.reach, axes_radius=0.006 * self.reach)
        self.ellipsoid = scene.add_icosphere(
            "/ellipsoid", 1.0, color=(116, 192, 252), subdivisions=3, opacity=0.35, cast_shadow=False
        )
        width = 0.008 * self.reach
        self.asked, self.achieved = (
            scene.add_arrows(
                name, _NOTHING, colour, shaft_radius=width, head_radius=2.5 * width, head_length=4.0 * width
            )
            for name, colour in (("/asked", _ASKED), ("/achieved", _ACHIEVED))
        )
        self.linear, self.angular = (
            scene.add_line_segments(name, _NOTHING, colour, thickness=4.0, thickness_units="screen", visible=False)
            for name, colour in (("/singular_linear", _LINEAR), ("/singular_angular", _ANGULAR))
        )
        self.trace = scene.add_line_segments(
            "/trace", _NOTHING, _NOTHING.astype(np.uint8), thickness=3.0, thickness_units="screen"
        )
        self._trace: collections.deque[tuple[Array, tuple[int, int, int]]] = collections.deque(maxlen=_TRACE_LENGTH)
        self._chain, self._ticks = session.chain, 0
        # Directions and joint positions of the last cycle that resolved a twist.
        self._directions, self._resolved_at = np.full((6, 6), np.nan), np.full(session.chain.dof, np.inf)

    def place_target(self, pose: Array) -> None:
        """Puts the gizmo at a pose."""
        _place(self.target, pose)

    def clear_trace(self) -> None:
        self._trace.clear()

    def draw(self, sample: Any, length_scale: float) -> None:
        """Draws a sample. While the arm holds, the singular directions of the last command stay."""
        pose, q = sample["pose"], sample["q"]
        self.robot.show(q)
        _place(self.tool, pose)
        jacobian = self._chain.jacobian(q)
        at = pose[:3, 3]
        size = 0.25 * self.reach

        axes, radii, _ = np.linalg.svd(jacobian[:3])
        if np.linalg.det(axes) < 0.0:
            axes[:, 2] *= -1.0
        ellipsoid: Array = np.eye(4)
        ellipsoid[:3, :3], ellipsoid[:3, 3] = axes, at
        self.ellipsoid.scale = tuple(np.maximum(0.2 * radii, 2e-3 * self.reach).tolist())
        _place(self.ellipsoid, ellipsoid)

        if np.isfinite(sample["singular_values"]).any():
            self._directions, self._resolved_at = sample["singular_directions"].copy(), q.copy()
        elif np.abs(q - self._resolved_at).max() > 0.05:  # the arm was put elsewhere since then
            self._directions = np.full((6, 6), np.nan)
        lines = singular_lines(self._directions, length_scale)
        for handle, shown in zip((self.linear, self.angular), lines, strict=True):
            handle.visible = bool(len(shown))
            if len(shown):
                handle.points = np.stack([at - size * shown, at + size * shown], axis=1).astype(np.float32)
        for arrow, twist in ((self.asked, sample["asked_twist"]), (self.achieved, sample["achieved_twist"])):
            speed = float(np.linalg.norm(twist[:3]))
            arrow.visible = speed > 1e-3
            if arrow.visible:
                arrow.points = np.stack([at, at + 0.8 * twist[:3]])[None].astype(np.float32)

        self._ticks += 1
        colour = _TRACE.get(sk.Status(int(sample["status"])), _TRACE[sk.Status.OK])
        if not self._trace or float(np.linalg.norm(self._trace[-1][0] - at)) > 2e-3 * self.reach:
            self._trace.append((at.copy(), colour))
        if self._ticks % 6 == 0 and len(self._trace) > 1:
            points = np.array([point for point, _ in self._trace], dtype=np.float32)
            colours = np.array([c for _, c in self._trace], dtype=np.uint8)
            self.trace.points = np.stack([points[:-1], points[1:]], axis=1)
            self.trace.colors = np.stack([colours[:-1], colours[1:]], axis=1)


def _place(handle: Any, pose: Array) -> None:
    from viser import transforms

    handle.position = tuple(pose[:3, 3].tolist())
    handle.wxyz = tuple(transforms.SO3.from_matrix(pose[:3, :3]).wxyz.tolist())


def _reach(chain: sk.Chain) -> float:
    """[m] Largest distance of some random tip positions from the base."""
    return max(float(np.linalg.norm(chain.pose(chain.random_configuration(seed))[:3, 3])) for seed in range(200))
