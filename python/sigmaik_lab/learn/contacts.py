"""The task in physics: drives with torque limits follow the commands, and friction holds the cup. Needs mujoco."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from sigmaik._types import Array

from .drives import Drive
from .episode import Action
from .model import TIMESTEP, scene_model
from .scene import CUP, GRIPPER, Draw, Task
from .world import AT_GOAL, World

__all__ = ["ContactWorld"]

#: [1/s] by which the drives' position errors become velocity.
_POSITION_GAIN = 25.0
#: [rad] by which a cup may lean and stands, and beyond which it has fallen over; [m/s] of a cup that stands.
_STANDS, _FELL, _SLOW = 0.2, 1.0, 0.05
#: [m] that a standing cup may be above its shelf, and below which it has fallen down.
_ON_SHELF, _BELOW = 0.01, 0.05


class ContactWorld(World):
    """One arm in MuJoCo. The servo's commands are those of the kinematic world: the servo does not see what physics
    makes of them; observations are what physics does."""

    def __init__(self, task: Task, drive: Drive, action: Action) -> None:
        import mujoco  # type: ignore[import-untyped]

        super().__init__(task, drive, action, 1)
        self._scene = scene_model(task, contacts=True)
        self._data = mujoco.MjData(self._scene.model)
        model = self._scene.model
        self._geoms = {name: model.body(name).geomadr[0] for name in ("left", "right", "cup")}
        self._commanded = 1.0
        self._last_command = np.zeros(task.chain.dof)

    def reset(self, draws: Sequence[Draw | None]) -> None:
        import mujoco

        (draw,) = draws
        if draw is None:
            return
        scene, data = self._scene, self._data
        mujoco.mj_resetData(scene.model, data)
        data.qpos[scene.arm] = draw.start
        data.qpos[scene.fingers] = 0.5 * GRIPPER.stroke
        data.qpos[scene.cup : scene.cup + 7] = [*draw.cup, 1.0, 0.0, 0.0, 0.0]
        data.mocap_pos[scene.goal] = [*draw.goal[:2], 0.0]
        mujoco.mj_forward(scene.model, data)
        self._commanded, self._last_command = 1.0, draw.start.copy()
        super().reset(draws)
        self._look()

    def _handle(self, path: Array, command: Array) -> tuple[Array, Array]:
        import mujoco

        scene, data, dt = self._scene, self._data, self.drive.dt
        before = self._last_command
        physics = round(dt / TIMESTEP)
        travel = GRIPPER.speed * TIMESTEP
        for q in path[:, 0]:
            velocity = (q - before) / dt
            for k in range(physics):
                self._commanded += float(np.clip(command[0] - self._commanded, -travel, travel))
                # Where the command is at the end of this step of physics, as `sk.sim.execute` drives velocities.
                wanted = before + (k + 1) * TIMESTEP * velocity
                data.ctrl[scene.arm] = velocity + _POSITION_GAIN * (wanted - data.qpos[scene.arm])
                data.ctrl[scene.fingers] = 0.5 * GRIPPER.stroke * self._commanded
                mujoco.mj_step(scene.model, data)
            before = q
        self._last_command = before.copy()
        self._look()
        return data.qpos[scene.arm][None].copy(), data.qvel[scene.arm][None].copy()

    def _look(self) -> None:
        """What is seen of the gripper and the cup."""
        scene, data = self._scene, self._data
        self.opening[0] = np.clip(data.qpos[scene.fingers].sum() / GRIPPER.stroke, 0.0, 1.0)
        self.cup[0] = data.qpos[scene.cup : scene.cup + 3]
        self.cup_quaternion_wxyz[0] = data.qpos[scene.cup + 3 : scene.cup + 7]
        touched = self._touching()
        support = float(self.task.support(self.cup[0]))
        lean = float(np.arccos(np.clip(data.body("cup").xmat[8], -1.0, 1.0)))
        bottom = self.cup[0, 2] - 0.5 * CUP.height - support
        speed = float(np.linalg.norm(data.qvel[scene.cup_dof : scene.cup_dof + 3]))
        self.held[0] = touched == {"left", "right"} and self._commanded < self.opening[0] + 0.05
        stands = lean < _STANDS and abs(bottom) < _ON_SHELF and speed < _SLOW and not touched
        at_goal = np.linalg.norm((self.cup[0] - self.goal[0])[:2]) < AT_GOAL
        self.placed[0] = bool(stands and at_goal)
        self.lost[0] = bool(lean > _FELL or bottom < -_BELOW)

    def _touching(self) -> set[str]:
        """The fingers that touch the cup."""
        names = {self._geoms[name]: name for name in ("left", "right")}
        cup = self._geoms["cup"]
        pairs = [tuple(pair) for pair in self._data.contact.geom]
        return {names[a + b - cup] for a, b in pairs if cup in (a, b) and a + b - cup in names}
