"""A scripted demonstrator with the noise of a hand.

What the demonstrator does is a function of the observation: it looks at the cup, the gripper and the goal, so that it
recovers from a push, from a cup that it did not get, and from a cup that it dropped. All that it remembers is the noise
of its hand and how long it pauses.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from sigmaik._types import Array

from .episode import FPS, Action, layout, rotation_6d, rotation_of_6d
from .motion import difference, rotations, shorten
from .scene import CUP, GRIPPER, Task
from .world import AT_GOAL

__all__ = ["STEADY", "Demonstrator", "Hand"]

#: Opening of a gripper that holds the cup.
_HOLDS = 2.0 * CUP.radius / GRIPPER.stroke
#: [m] of the point before the cup, and beside whose axis the tool goes ahead.
_BEFORE, _BESIDE = 0.09, 0.008
#: [m] within which the tool is at the cup, along and across, so that the gripper closes, and within which a gripper
#: that is as wide as the cup has the cup.
_AT, _KEEP = 0.006, 0.02
#: [m] by which a cup is lifted on its way, and the horizontal distance from the goal at which it goes down.
_LIFT, _DOWN = 0.06, 0.01
#: [m] above its shelf from which a cup is carried away.
_CLEAR = 0.02
#: [m] above its place at which a cup is let go.
_LET_GO = 0.006
#: [rad] of rotation within which the tool goes ahead.
_TURNED = 0.12


@dataclass(frozen=True)
class Hand:
    """The noise of a hand, and what happens to it on purpose."""

    speed: float = 0.25  #: [m/s] of the wish
    turning: float = 1.0  #: [rad/s]
    tremor: float = 0.004  #: [m] standard deviation of the filtered noise, away from the cup and the goal
    tilt: float = 0.02  #: [rad] likewise
    steady: float = 0.25  #: part of the noise that is left near the cup and the goal: the hand takes care there
    memory: float = 0.8  #: of the noise, from an action to the next
    pauses: float = 0.01  #: probability that a pause begins, per action
    pause: float = 0.5  #: [s] mean of a pause
    pushes: float = 0.012  #: probability that the hand slips, per action
    push: float = 0.04  #: [m] by which it then goes aside
    misses: float = 0.1  #: probability that the gripper closes on nothing on its way to the cup, per episode


#: A hand without noise.
STEADY = Hand(tremor=0.0, tilt=0.0, pauses=0.0, pushes=0.0, misses=0.0)


class Demonstrator:
    """Gives the actions of one environment.

    demonstrator = Demonstrator(env.task, seed=3)
    action = demonstrator(state)
    """

    def __init__(self, task: Task, action: Action = "pose", seed: int = 0, hand: Hand | None = None) -> None:
        """hand: None: the default noise."""
        self._task, self._action, self._hand = task, action, Hand() if hand is None else hand
        self._rng = np.random.default_rng([seed, 0xFE7C])
        self._parts = layout(task.chain.dof)
        self._noise: Array = np.zeros(6)
        self._paused = self._slips = 0
        self._aside: Array = np.zeros(3)
        self._misses = self._rng.uniform() < self._hand.misses
        self._shuts = 0

    def __call__(self, state: NDArray[np.float32]) -> NDArray[np.float32]:
        """The action (A,) for a state (S,)."""
        pose, opening, cup, goal = self._seen(state)
        target, grip, care = self._wish(pose, opening, cup, goal)
        hand = self._hand
        way = shorten(difference(pose, target), hand.speed / FPS, hand.turning / FPS)
        way, grip = self._disturb(way, grip, care)
        if self._action == "twist":
            return np.asarray(np.clip(np.append(way * FPS, grip), -1.0, 1.0), dtype=np.float32)
        rotation = rotations(way[3:]) @ pose[:3, :3]
        return np.concatenate([pose[:3, 3] + way[:3], rotation_6d(rotation), [grip]]).astype(np.float32)

    def _seen(self, state: NDArray[np.float32]) -> tuple[Array, float, Array, Array]:
        parts, seen = self._parts, state.astype(np.float64)
        pose = np.eye(4)
        pose[:3, 3], pose[:3, :3] = seen[parts.tool], rotation_of_6d(seen[parts.rotation])
        return pose, float(seen[parts.gripper][0]), seen[parts.cup], seen[parts.goal]

    def _wish(self, pose: Array, opening: float, cup: Array, goal: Array) -> tuple[Array, float, bool]:
        """Where the tool should be, the gripper's opening, and whether the hand takes care. No noise, no memory."""
        task, tool = self._task, pose[:3, 3]
        hold = task.hold(cup)
        # The cup in the axes of a tool that holds it: ahead is z, to the fingers y, along the cup about x.
        off = hold[:3, :3].T @ (cup - tool)
        across = float(np.hypot(off[0], off[1]))
        turned = float(np.linalg.norm(difference(pose, hold)[3:]))
        if (
            np.linalg.norm((cup - goal)[:2]) < 0.8 * AT_GOAL
            and abs(cup[2] - goal[2]) < _LET_GO
            and opening > _HOLDS + 0.03
        ):
            return self._back(pose, hold), 1.0, False  # done
        if max(abs(off[2]), across) < _KEEP and _HOLDS - 0.015 < opening < _HOLDS + 0.015:
            return self._carry(pose, cup, goal)
        if max(abs(off[2]), across) < _AT and opening > _HOLDS:
            return hold, 0.0, True
        if opening < 0.95:
            # Closed on nothing, or not yet open: away from the cup, and open.
            return self._back(pose, hold), 1.0, False
        if across > _BESIDE and off[2] < _BEFORE or turned > _TURNED:
            return self._back(pose, hold), 1.0, False
        return hold, 1.0, off[2] < 0.04

    def _back(self, pose: Array, hold: Array) -> Array:
        before = hold.copy()
        before[:3, 3] -= _BEFORE * hold[:3, 2]
        return before

    def _carry(self, pose: Array, cup: Array, goal: Array) -> tuple[Array, float, bool]:
        over = float(np.linalg.norm((goal - cup)[:2]))
        above = float(cup[2] - goal[2])
        if over < 0.5 * AT_GOAL and above < _LET_GO:
            return pose, 1.0, True
        stands = float(self._task.support(cup)) + 0.5 * CUP.height
        if over > 0.15 and cup[2] - stands < _CLEAR:
            # Up and back at once: straight up may be out of reach.
            outwards = np.array([cup[0], cup[1], 0.0]) / max(float(np.hypot(cup[0], cup[1])), 1e-9)
            target = self._task.hold(cup + np.array([0.0, 0.0, _LIFT]) - _LIFT * outwards)
            target[:3, 3] += pose[:3, 3] - cup
            return target, 0.0, False
        there = goal.copy()
        low = over < _DOWN or (above < _LIFT and over < 2.0 * _DOWN)
        if not low:
            there[2] = max(goal[2] + _LIFT, min(cup[2], goal[2] + 2.0 * _LIFT))
        target = self._task.hold(there)
        # The cup should be there, not the tool.
        target[:3, 3] += pose[:3, 3] - cup
        # On the way the tool turns with the azimuth of where it is.
        now = np.arctan2(cup[1], cup[0])
        then = np.arctan2(goal[1], goal[0])
        if abs(now - then) > 0.2:
            target[:3, :3] = self._task.rotation(cup + 0.3 * (there - cup))
        return target, 0.0, low

    def _disturb(self, way: Array, grip: float, care: bool) -> tuple[Array, float]:
        """The hand's noise on the way of an action."""
        hand, rng = self._hand, self._rng
        fresh = rng.normal(size=6) * np.sqrt(1.0 - hand.memory**2)
        self._noise = hand.memory * self._noise + fresh
        part = hand.steady if care else 1.0
        way = way + part * np.repeat([hand.tremor, hand.tilt], 3) * np.clip(self._noise, -2.0, 2.0)
        starts_pause, slips, aside = rng.uniform() < hand.pauses, rng.uniform() < hand.pushes, rng.normal(size=3)
        if self._paused == 0 and starts_pause:
            self._paused = 1 + int(rng.exponential(hand.pause * FPS))
        if self._slips == 0 and slips and not care:
            self._slips, self._aside = 4, hand.push * aside / max(float(np.linalg.norm(aside)), 1e-9)
        if self._paused:
            self._paused -= 1
            return 0.0 * way, grip
        if self._slips:
            self._slips -= 1
            way[:3] += self._aside / 4.0
        return way, self._slip_of_gripper(grip, care)

    def _slip_of_gripper(self, grip: float, care: bool) -> float:
        """Closes the gripper too early, once, in the episodes that show how to open it again."""
        if self._misses and care and grip == 1.0:
            self._misses, self._shuts = False, 6
        if self._shuts:
            self._shuts -= 1
            return 0.0
        return grip
