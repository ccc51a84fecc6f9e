"""The environment sigmaik/Fetch-v0."""

from __future__ import annotations

from typing import Any, Literal, SupportsFloat, TypeAlias

import gymnasium
import numpy as np
from numpy.typing import NDArray

from sigmaik._extras import need
from sigmaik_lab.opengl import choose_opengl

from .drives import make_drive
from .episode import FPS, Action
from .scene import Region, task
from .spaces import IMAGE, action_space, information, one, state_space
from .world import World

__all__ = ["Fetch", "Observation"]

Observation: TypeAlias = "NDArray[np.float32] | dict[str, Any]"

#: Pixels of a side of a picture for people.
_PICTURE = 480


class Fetch(gymnasium.Env[Observation, NDArray[np.float32]]):
    """An arm fetches a cup at the edge of reach, where the arm is singular, and places the cup near the base.

    An action is for 0.1 s: "pose", the place of the tool at the end of that time (position, 6-D rotation) and the
    gripper's opening, or "twist", [v; ω] of the tool and the opening. A servo with all limits makes joint positions of
    an action, every `dt`. An observation is a state (`episode.state_names`), or with image=True a dictionary of state
    and image. The reward is 1 when the cup stands at the goal, else 0. An episode ends then, or when the cup falls;
    it is truncated after max_steps.
    """

    metadata: dict[str, Any] = {"render_modes": ["rgb_array"], "render_fps": FPS}

    def __init__(
        self,
        robot: str = "ufactory_xarm7",
        rule: str | None = None,
        action: Action = "pose",
        region: Region = "edge",
        image: bool = False,
        physics: Literal["kinematic", "mujoco"] = "kinematic",
        max_steps: int = 300,
        dt: float = 1e-3,
        render_mode: str | None = None,
    ) -> None:
        """
        robot: a shipped arm, or the path of a URDF file
        rule: a text of `sk.methods.parse`; or a baseline: "stop" slows down towards a singularity and stands before it,
            "position_ik" solves each action's pose, and moves the joints there inside their velocity limits alone;
            None: the library's default
        region: where the cup is: "edge", at the end of reach and low; "overhead", at the end of reach and high
        physics: "kinematic": the arm is where the servo commands it to be, and a gripper that closes around the cup
            holds it; "mujoco": drives with torque limits follow the commands, and friction holds the cup
        dt: [s] a cycle of the servo: 1, 2, 5 or 10 ms
        render_mode: None or "rgb_array"

        ValueError where an option is wrong or the arm has no such region, MissingPackage where mujoco is needed and not
        installed.
        """
        if physics not in ("kinematic", "mujoco"):
            raise ValueError(f"physics is 'kinematic' or 'mujoco', not '{physics}'")
        check_options(action, max_steps)
        if render_mode not in (None, *self.metadata["render_modes"]):
            raise ValueError(f"render_mode is None or 'rgb_array', not '{render_mode}'")
        if image or render_mode or physics == "mujoco":
            need("mujoco")
            choose_opengl()
        self.task = task(robot, region)
        self.render_mode, self.rule, self._max_steps, self._image = render_mode, rule, max_steps, image
        drive = make_drive(self.task.chain, rule, dt, 1, 1)
        if physics == "mujoco":
            from .contacts import ContactWorld

            self.world: World = ContactWorld(self.task, drive, action)
        else:
            self.world = World(self.task, drive, action, 1)
        self.action_space: gymnasium.spaces.Space[Any] = action_space(self.task, action)
        state = state_space(self.task)
        self.observation_space: gymnasium.spaces.Space[Any] = _with_image(state) if image else state
        self._steps = 0
        self._cameras: dict[int, Any] = {}

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Observation, dict[str, Any]]:
        """options: "cup" and "goal" (3,) [m], base frame, take the place of what is drawn."""
        super().reset(seed=seed)
        self.world.reset([self.task.draw(self.np_random, options)])
        self._steps = 0
        return self._observe(), one(information(self.world))

    def step(self, action: NDArray[np.float32]) -> tuple[Observation, SupportsFloat, bool, bool, dict[str, Any]]:
        action = np.asarray(action)
        if action.shape != self.action_space.shape or not np.isfinite(action).all():
            raise ValueError(f"an action has {self.action_space.shape} finite numbers, not {action!r}")
        self.world.step(action[None])
        self._steps += 1
        info = one(information(self.world))
        ends = info["success"] or info["lost"]
        return self._observe(), float(info["success"]), ends, not ends and self._steps >= self._max_steps, info

    def render(self) -> NDArray[np.uint8] | None:
        """A picture (480, 480, 3) RGB with render_mode="rgb_array", else None."""
        return self._picture(_PICTURE) if self.render_mode == "rgb_array" else None

    def close(self) -> None:
        for camera in self._cameras.values():
            camera.close()
        self._cameras.clear()

    def _observe(self) -> Observation:
        state = self.world.state()[0]
        return {"state": state, "image": self._picture(IMAGE)} if self._image else state

    def _picture(self, size: int) -> NDArray[np.uint8]:
        from .camera import Camera

        if size not in self._cameras:
            self._cameras[size] = Camera(self.task, size, shadows=size == _PICTURE)
        picture: NDArray[np.uint8] = self._cameras[size].picture(self.world, 0)
        return picture


def check_options(action: Action, max_steps: int) -> None:
    """ValueError where an option that all environments share is wrong."""
    if action not in ("pose", "twist"):
        raise ValueError(f"action is 'pose' or 'twist', not '{action}'")
    if max_steps < 1:
        raise ValueError(f"max_steps = {max_steps} must be at least 1")


def _with_image(state: gymnasium.spaces.Box) -> gymnasium.spaces.Dict:
    image = gymnasium.spaces.Box(0, 255, (IMAGE, IMAGE, 3), np.uint8)
    return gymnasium.spaces.Dict({"state": state, "image": image})
