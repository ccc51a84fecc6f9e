"""Pictures of the task, by MuJoCo's offscreen renderer. Needs mujoco, and OpenGL: a GPU's, or Mesa's in software."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from sigmaik_lab.opengl import choose_opengl, open_renderer

from .model import SceneModel, scene_model
from .scene import GRIPPER, Task
from .world import World

__all__ = ["Camera"]


class Camera:
    """Draws environment b of a world."""

    def __init__(self, task: Task, size: int, shadows: bool) -> None:
        """size: pixels of a side. shadows: they take nine tenths of the time where OpenGL is software.

        OSError where no OpenGL is found; the text says what to install.
        """
        choose_opengl()
        import mujoco  # type: ignore[import-untyped]

        self._scene: SceneModel = scene_model(task, contacts=False)
        self._data = mujoco.MjData(self._scene.model)
        self._renderer: Any = open_renderer(self._scene.model, size, size, shadows)

    def picture(self, world: World, b: int) -> NDArray[np.uint8]:
        """(size, size, 3) RGB."""
        import mujoco

        scene, data = self._scene, self._data
        data.qpos[scene.arm] = world.q[b]
        data.qpos[scene.fingers] = 0.5 * GRIPPER.stroke * world.opening[b]
        data.qpos[scene.cup : scene.cup + 3] = world.cup[b]
        data.qpos[scene.cup + 3 : scene.cup + 7] = world.cup_quaternion_wxyz[b]
        data.mocap_pos[scene.goal] = [*world.goal[b, :2], float(world.task.support(world.goal[b])) + 0.001]
        mujoco.mj_kinematics(scene.model, data)
        mujoco.mj_camlight(scene.model, data)
        self._renderer.update_scene(data, camera="view")
        return np.array(self._renderer.render())

    def close(self) -> None:
        """Frees the renderer."""
        self._renderer.close()
