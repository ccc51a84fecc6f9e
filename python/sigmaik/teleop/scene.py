"""What is drawn in the page's scene: the arm, its target, and what its Jacobian says at the tool."""

from __future__ import annotations

import collections
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

import sigmaik as sk
from sigmaik._types import Array

from .drawing import RobotView
from .session import Session

if TYPE_CHECKING:
    import viser

__all__ = ["Scene", "singular_directions"]

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


def singular_directions(jacobian: Array, gamma: float, length_scale: float) -> tuple[Array, Array, NDArray[np.float64]]:
    """Directions u_i with σ_i ≤ γσ_max: their linear and their angular parts (k, 3), and all σ."""
    weighted = jacobian.copy()
    weighted[3:] *= length_scale
    u, sigma, _ = np.linalg.svd(weighted)
    small = np.flatnonzero(sigma <= gamma * sigma[0])
    return u[:3, small].T, u[3:, small].T, sigma


class Scene:
    """The handles of what is drawn."""

    def __init__(self, server: viser.ViserServer, session: Session) -> None:
        scene = server.scene
        self.reach = _reach(session.chain)
        server.initial_camera.position = tuple(self.reach * np.array([1.0, -1.75, 1.0]))
        server.initial_camera.look_at = tuple(self.reach * np.array([0.55, 0.15, 0.25]))
        scene.add_grid("/ground", 3.0 * self.reach, 3.0 * self.reach, cell_size=0.2, section_size=0.6)
        self.robot = RobotView(server, session.source, session.chain)
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

    def place_target(self, pose: Array) -> None:
        """Puts the gizmo at a pose."""
        _place(self.target, pose)

    def clear_trace(self) -> None:
        self._trace.clear()

    def draw(self, sample: Any, gamma: float, length_scale: float) -> Array:
        """Draws a sample. Returns the singular values (min(6, n),) at its q."""
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

        linear, angular, sigma = singular_directions(jacobian, gamma, length_scale)
        for handle, parts in ((self.linear, linear), (self.angular, angular)):
            shown = parts[np.linalg.norm(parts, axis=1) > 0.1]
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
        return sigma


def _place(handle: Any, pose: Array) -> None:
    from viser import transforms

    handle.position = tuple(pose[:3, 3].tolist())
    handle.wxyz = tuple(transforms.SO3.from_matrix(pose[:3, :3]).wxyz.tolist())


def _reach(chain: sk.Chain) -> float:
    """[m] the farthest of some random tip positions from the base."""
    return max(float(np.linalg.norm(chain.pose(chain.random_configuration(seed))[:3, 3])) for seed in range(200))
