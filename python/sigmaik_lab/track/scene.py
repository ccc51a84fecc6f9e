"""What a rendered camera looks at: an arm, a hand that holds a tag, and a ball that passes. Needs mujoco and cv2."""

from __future__ import annotations

from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

import sigmaik as sk
from sigmaik._types import Array
from sigmaik.sim.model import arm_spec, compiled, draw_arm, quaternion
from sigmaik_lab.opengl import choose_opengl, open_renderer

from .lens import Lens

__all__ = ["BALL", "Scene", "look_at"]

BALL = 0.05  #: [m] radius of the ball
#: Cells of white paper around the tag, and [m] its thickness and that of the print.
_MARGIN, _PAPER, _PRINT = 1.5, 0.004, 2e-4
_GREY, _BLUE, _SKIN, _BALL = (0.82, 0.83, 0.85), (0.25, 0.35, 0.55), (0.85, 0.65, 0.5), (0.8, 0.3, 0.1)
_GROUND = (0.45, 0.5, 0.52)


def look_at(eye: Array, point: Array) -> Array:
    """(4, 4) pose of a camera at `eye` (3,), level, with `point` (3,) ahead. x to the right, y down, z ahead."""
    ahead = (point - eye) / np.linalg.norm(point - eye)
    right = np.cross(ahead, [0.0, 0.0, 1.0])
    right /= np.linalg.norm(right)
    pose = np.eye(4)
    pose[:3, :3] = np.stack([right, np.cross(ahead, right), ahead], axis=1)
    pose[:3, 3] = eye
    return pose


class Scene:
    """A MuJoCo model with two cameras: "eye", which looks at the tag, and "view", which shows arm and hand."""

    def __init__(self, chain: sk.Chain, lens: Lens, eye: Array, on_wrist: bool, outside: Array, size: float) -> None:
        """eye: (4, 4) pose of the camera, in the tip's frame (on_wrist) or in the base's. outside: (4, 4) likewise in
        the base, of the camera that shows the scene. size: [m] of the arm's reach.

        OSError where no OpenGL is found.
        """
        choose_opengl()
        import mujoco  # type: ignore[import-untyped]

        from .detector import CELLS, tag_cells

        n = chain.dof
        none = np.zeros(n)
        joints = {"viscous_friction": none, "coulomb_friction": none, "armature": none}
        arm = arm_spec(chain, None, np.full(n, np.inf), False, joints, np.zeros(3), 1e-3)
        spec, world = arm.spec, arm.spec.worldbody
        draw_arm(arm.bodies, world, 0.04 * size, _GREY)
        tool = arm.bodies[-1]
        if np.linalg.norm(arm.tip[:3, 3]) > 1e-3:
            _add(
                tool,
                mujoco.mjtGeom.mjGEOM_CAPSULE,
                [0.025 * size, 0.0, 0.0],
                _GREY,
                fromto=[0.0] * 3 + [*arm.tip[:3, 3]],
            )
        place = (arm.tip if on_wrist else np.eye(4)) @ eye @ np.diag([1.0, -1.0, -1.0, 1.0])  # MuJoCo's looks along −z
        holder = tool if on_wrist else world
        holder.add_camera(name="eye", pos=place[:3, 3], quat=quaternion(place[:3, :3]), fovy=lens.view)
        # The camera's own case is behind the pinhole.
        _add(holder, mujoco.mjtGeom.mjGEOM_BOX, [0.03, 0.015, 0.012], _BLUE, place, [0.0, 0.0, 0.02])
        place = outside @ np.diag([1.0, -1.0, -1.0, 1.0])
        world.add_camera(name="view", pos=place[:3, 3], quat=quaternion(place[:3, :3]), fovy=40.0)

        hand = world.add_body(name="hand", mocap=True)
        cell = lens.tag / CELLS
        side = 0.5 * lens.tag + _MARGIN * cell
        _add(hand, mujoco.mjtGeom.mjGEOM_BOX, [side, side, 0.5 * _PAPER], (0.95,) * 3, at=[0.0, 0.0, -0.5 * _PAPER])
        for row, black in enumerate(tag_cells()):
            edges = np.flatnonzero(np.diff(np.concatenate([[0], black, [0]]).astype(int))).reshape(-1, 2)
            for begin, end in edges.tolist():
                at = [(0.5 * (begin + end) - 0.5 * CELLS) * cell, (0.5 * CELLS - row - 0.5) * cell, 0.0]
                _add(
                    hand,
                    mujoco.mjtGeom.mjGEOM_BOX,
                    [0.5 * (end - begin) * cell, 0.5 * cell, _PRINT],
                    (0.03,) * 3,
                    at=at,
                )
        _add(hand, mujoco.mjtGeom.mjGEOM_ELLIPSOID, [0.045, 0.05, 0.03], _SKIN, at=[0.0, -side, -0.03])
        arm_end = [0.0, -side - 0.03, -0.04, 0.0, -side - 0.25, -0.2]
        _add(hand, mujoco.mjtGeom.mjGEOM_CAPSULE, [0.03, 0.0, 0.0], _BLUE, fromto=arm_end)
        ball = world.add_body(name="ball", mocap=True)
        _add(ball, mujoco.mjtGeom.mjGEOM_SPHERE, [BALL, 0.0, 0.0], _BALL)
        _add(world, mujoco.mjtGeom.mjGEOM_PLANE, [6.0, 6.0, 0.1], _GROUND, at=[0.0, 0.0, -0.6])
        light = mujoco.mjtLightType.mjLIGHT_DIRECTIONAL
        world.add_light(type=light, pos=[0.0, 0.0, 3.0], dir=[0.0, 0.3, -1.0], specular=[0.0, 0.0, 0.0])
        spec.visual.headlight.ambient = [0.45, 0.45, 0.45]
        spec.visual.headlight.diffuse = [0.4, 0.4, 0.4]
        spec.visual.headlight.specular = [0.0, 0.0, 0.0]
        spec.stat.extent, spec.stat.center = 2.0, [0.0, 0.0, 0.5]  # z from 0.02 m to 100 m
        arm.inertias.clear()
        self._model: Any = compiled(arm)
        self._data = mujoco.MjData(self._model)
        self._lens = lens
        self._hand, self._ball = (int(self._model.body(name).mocapid[0]) for name in ("hand", "ball"))
        self._hand_body = int(self._model.body("hand").id)
        self._eye = int(self._model.camera("eye").id)
        self._renderers = {"eye": open_renderer(self._model, lens.height, lens.width, False)}

    def place(self, q: Array, hand: Array, ball: Array) -> None:
        """Puts arm (n,), tag (4, 4) and ball (3,) to their places."""
        import mujoco

        data = self._data
        data.qpos[:] = q
        data.mocap_pos[self._hand], data.mocap_quat[self._hand] = hand[:3, 3], quaternion(hand[:3, :3])
        data.mocap_pos[self._ball] = ball
        mujoco.mj_kinematics(self._model, data)
        mujoco.mj_camlight(self._model, data)

    def draw(self, camera: Literal["eye", "view"]) -> NDArray[np.uint8]:
        """(height, width, 3) RGB, of the scene as it is placed."""
        if camera not in self._renderers:
            self._renderers[camera] = open_renderer(self._model, self._lens.height, self._lens.width, False)
        renderer = self._renderers[camera]
        renderer.update_scene(self._data, camera=camera)
        return np.array(renderer.render())

    def why_not(self) -> str:
        """Why the tag may not be found in the scene as it is placed; for the tables, and not for the arm.

        "turned": the print faces away, by 70° at least. "outside": a corner is outside the picture. "covered": a thing
        is before a corner or the centre. "": none of these.
        """
        import mujoco

        data, lens = self._data, self._lens
        frame = data.cam_xmat[self._eye].reshape(3, 3) @ np.diag([1.0, -1.0, -1.0])
        eye, turn = np.array(data.cam_xpos[self._eye]), data.xmat[self._hand_body].reshape(3, 3)
        half = 0.5 * lens.tag
        corners = [data.xpos[self._hand_body] + turn @ [half * x, half * y, 0.0] for x in (-1, 1) for y in (-1, 1)]
        centre = np.mean(corners, axis=0)
        away = (eye - centre) / np.linalg.norm(eye - centre)
        if float(away @ turn[:, 2]) < np.cos(np.radians(70.0)):
            return "turned"
        for corner in corners:
            x, y, z = lens.matrix @ frame.T @ (corner - eye)
            if z <= 0.0 or not (0.0 <= x / z <= lens.width - 1) or not (0.0 <= y / z <= lens.height - 1):
                return "outside"
        hit = np.zeros(1, dtype=np.int32)
        for point in (centre, *(centre + 0.95 * (corner - centre) for corner in corners)):
            distance = mujoco.mj_ray(self._model, data, eye, point - eye, None, 1, -1, hit)
            if distance >= 0.0 and self._model.geom_bodyid[hit[0]] != self._hand_body:
                return "covered"
        return ""

    def close(self) -> None:
        """Frees the renderers."""
        for renderer in self._renderers.values():
            renderer.close()


def _add(
    body: Any,
    kind: Any,
    size: list[float],
    colour: tuple[float, ...],
    place: Array | None = None,
    at: list[float] | None = None,
    fromto: list[float] | None = None,
) -> None:
    """A shape without mass, that touches nothing and is matt."""
    options: dict[str, Any] = {"fromto": fromto} if fromto is not None else {}
    if fromto is None:
        frame = np.eye(4) if place is None else place
        options = {
            "pos": frame[:3, :3] @ np.array(at or [0.0, 0.0, 0.0]) + frame[:3, 3],
            "quat": quaternion(frame[:3, :3]),
        }
    body.add_geom(type=kind, size=size, rgba=[*colour, 1.0], contype=0, conaffinity=0, mass=0.0, **options)
