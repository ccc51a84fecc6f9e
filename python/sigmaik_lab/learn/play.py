"""Episodes: the demonstrator drives scenes to their ends, and all that is seen and done is kept."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from .demonstrator import STEADY, Demonstrator, Hand
from .episode import FPS, Action, Episode
from .scene import Region

__all__ = ["DEMONSTRATORS", "Scenes", "demonstrate"]

#: Demonstrators by name.
DEMONSTRATORS: dict[str, Hand] = {"scripted": Hand(), "steady": STEADY}


@dataclass(frozen=True)
class Scenes:
    """What all episodes of a recording have in common: options of `Fetch`."""

    robot: str = "ufactory_xarm7"
    rule: str | None = None
    region: Region = "edge"
    action: Action = "pose"
    physics: Literal["kinematic", "mujoco"] = "kinematic"
    image: bool = False
    max_steps: int = 300

    @property
    def together(self) -> bool:
        """Whether many scenes can step at once: not with physics or images."""
        return self.physics == "kinematic" and not self.image


def demonstrate(scenes: Scenes, seeds: Sequence[int], demonstrator: str = "scripted") -> list[tuple[Episode, int]]:
    """An episode for each seed, and its number of cycles beyond a limit. An episode depends on its own seed alone."""
    hand = DEMONSTRATORS[demonstrator]
    if scenes.together:
        return _together(scenes, seeds, hand)
    return list(_one_by_one(scenes, seeds, hand))


class _Log:
    """The rows of an episode."""

    def __init__(self, scenes: Scenes, seed: int) -> None:
        self._scenes, self._seed = scenes, seed
        self._rows: list[tuple[NDArray[np.float32], NDArray[np.float32], str]] = []
        self._images: list[NDArray[np.uint8]] = []

    def add(
        self,
        state: NDArray[np.float32],
        action: NDArray[np.float32],
        phase: str,
        image: NDArray[np.uint8] | None = None,
    ) -> None:
        self._rows.append((state.copy(), action.copy(), phase))
        if image is not None:
            self._images.append(image)

    def episode(self, success: bool, robot: str, cup: Any, goal: Any) -> Episode:
        states, actions, phases = zip(*self._rows, strict=True)
        s = self._scenes
        return Episode(
            times=np.arange(len(states)) / FPS,
            state=np.array(states),
            action=np.array(actions),
            phase=np.array(phases),
            success=success,
            images=np.array(self._images) if self._images else None,
            scene={
                "cup": np.asarray(cup, dtype=float).tolist(),
                "goal": np.asarray(goal, dtype=float).tolist(),
                "seed": self._seed,
                "robot": robot,
                "rule": s.rule,
                "region": s.region,
                "action": s.action,
                "physics": s.physics,
            },
        )


def _together(scenes: Scenes, seeds: Sequence[int], hand: Hand) -> list[tuple[Episode, int]]:
    from .vector import FetchVector

    size = len(seeds)
    env = FetchVector(
        size, scenes.robot, scenes.rule, action=scenes.action, region=scenes.region, max_steps=scenes.max_steps
    )
    states, info = env.reset(seed=list(seeds))
    cups, goals = env.world.cup.copy(), env.world.goal.copy()
    demonstrators = [Demonstrator(env.task, scenes.action, seed, hand) for seed in seeds]
    logs = [_Log(scenes, seed) for seed in seeds]
    found: dict[int, tuple[Episode, int]] = {}
    actions = np.zeros(env.action_space.shape or (), dtype=np.float32)
    while len(found) < size:
        for b in range(size):
            if b not in found:
                actions[b] = demonstrators[b](states[b])
                logs[b].add(states[b], actions[b], str(info["phase"][b]))
        states, _, terminated, truncated, info = env.step(actions)
        for b in np.flatnonzero(terminated | truncated).tolist():
            if b not in found:
                episode = logs[b].episode(bool(info["success"][b]), env.task.robot, cups[b], goals[b])
                found[b] = (episode, int(info["limits_broken"][b]))
    return [found[b] for b in range(size)]


def _one_by_one(scenes: Scenes, seeds: Sequence[int], hand: Hand) -> Iterator[tuple[Episode, int]]:
    from .fetch import Fetch

    env = Fetch(
        scenes.robot,
        scenes.rule,
        scenes.action,
        scenes.region,
        image=scenes.image,
        physics=scenes.physics,
        max_steps=scenes.max_steps,
    )
    look: Callable[[Any], tuple[Any, Any]] = (
        (lambda seen: (seen["state"], seen["image"])) if scenes.image else (lambda seen: (seen, None))
    )
    for seed in seeds:
        seen, info = env.reset(seed=seed)
        cup, goal = env.world.cup[0].copy(), env.world.goal[0].copy()
        demonstrator = Demonstrator(env.task, scenes.action, seed, hand)
        state, image = look(seen)
        log, ends = _Log(scenes, seed), False
        while not ends:
            action = demonstrator(state)
            log.add(state, action, info["phase"], image)
            seen, _, terminated, truncated, info = env.step(action)
            state, image = look(seen)
            ends = terminated or truncated
        yield log.episode(info["success"], env.task.robot, cup, goal), info["limits_broken"]
    env.close()
