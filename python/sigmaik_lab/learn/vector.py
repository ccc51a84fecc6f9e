"""Many environments of the task at once, on one batch of servos."""

from __future__ import annotations

from typing import Any

import gymnasium
import numpy as np
from gymnasium.utils import seeding
from gymnasium.vector import AutoresetMode, VectorEnv
from gymnasium.vector.utils import batch_space
from numpy.typing import NDArray

from sigmaik._types import Array

from .drives import make_drive
from .episode import FPS, Action
from .fetch import check_options
from .scene import Draw, Region, task
from .spaces import action_space, information, state_space
from .world import World

__all__ = ["FetchVector"]


class FetchVector(VectorEnv[NDArray[np.float32], NDArray[np.float32], NDArray[Any]]):
    """B environments `Fetch`, kinematic and without images, which step together.

    Environment b does, to the last bit, what a `Fetch` does with the same seed and actions. An environment that ended
    is reset by the next `step`, which ignores its action (Gymnasium's NEXT_STEP). `info` has an array (B, …) for each
    name of `Fetch`'s.
    """

    metadata: dict[str, Any] = {
        "render_modes": [],
        "render_fps": FPS,
        "autoreset_mode": AutoresetMode.NEXT_STEP,
    }

    def __init__(
        self,
        num_envs: int = 1,
        robot: str = "ufactory_xarm7",
        rule: str | None = None,
        action: Action = "pose",
        region: Region = "edge",
        max_steps: int = 300,
        dt: float = 1e-3,
        threads: int = 1,
    ) -> None:
        """num_envs: B ≥ 1. threads: ≥ 1, of the servos; answers do not depend on it. Other options: see `Fetch`."""
        check_options(action, max_steps)
        if num_envs < 1 or threads < 1:
            raise ValueError(f"num_envs = {num_envs} and threads = {threads} must be at least 1")
        self.task, self.num_envs, self._max_steps = task(robot, region), num_envs, max_steps
        self.world = World(self.task, make_drive(self.task.chain, rule, dt, num_envs, threads), action, num_envs)
        self.single_observation_space = state_space(self.task)
        self.single_action_space = action_space(self.task, action)
        self.observation_space = batch_space(self.single_observation_space, num_envs)
        self.action_space = batch_space(self.single_action_space, num_envs)
        self._rngs: list[np.random.Generator] = []
        self._steps = np.zeros(num_envs, dtype=np.int64)
        self._ended = np.zeros(num_envs, dtype=bool)

    def reset(
        self, *, seed: int | list[int | None] | None = None, options: dict[str, Any] | None = None
    ) -> tuple[NDArray[np.float32], dict[str, Any]]:
        """seed: environment b has seed + b; or a list of one for each. options: "cup" and "goal" as for `Fetch`, (3,)
        for all environments or (B, 3)."""
        if isinstance(seed, list):
            seeds = seed
        else:
            seeds = [None if seed is None else int(seed) + b for b in range(self.num_envs)]
        if len(seeds) != self.num_envs:
            raise ValueError(f"{len(seeds)} seeds were given for {self.num_envs} environments")
        for b, value in enumerate(seeds):
            if value is not None or len(self._rngs) <= b:
                self._rngs[b : b + 1] = [seeding.np_random(value)[0]]
        self._start(np.ones(self.num_envs, dtype=bool), options)
        self._ended[:] = False
        return self.world.state(), information(self.world)

    def step(
        self, actions: NDArray[np.float32]
    ) -> tuple[NDArray[np.float32], Array, NDArray[np.bool_], NDArray[np.bool_], dict[str, Any]]:
        if not self._rngs:
            raise gymnasium.error.ResetNeeded("call reset before step")
        actions = np.asarray(actions)
        if actions.shape != self.action_space.shape or not np.isfinite(actions).all():
            raise ValueError(f"actions are {self.action_space.shape} finite numbers")
        self.world.step(actions)
        self._steps += 1
        again = self._ended
        if again.any():
            self._start(again, None)
        info = information(self.world)
        terminated = (info["success"] | info["lost"]) & ~again
        truncated = (self._steps >= self._max_steps) & ~terminated & ~again
        self._ended = terminated | truncated
        return self.world.state(), info["success"].astype(np.float64), terminated, truncated, info

    def _start(self, mask: NDArray[np.bool_], options: dict[str, Any] | None) -> None:
        draws: list[Draw | None] = [None] * self.num_envs
        for b in np.flatnonzero(mask):
            own = {name: np.broadcast_to(value, (self.num_envs, 3))[b] for name, value in (options or {}).items()}
            draws[b] = self.task.draw(self._rngs[b], own)
        self.world.reset(draws)
        self._steps[mask] = 0
