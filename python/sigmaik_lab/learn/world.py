"""The task for many arms at once: arms, grippers and cups, without contacts. Environments are thin around it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TypeAlias

import numpy as np
from numpy.typing import ArrayLike, NDArray

from sigmaik._types import Array

from .drives import Drive, sigma_ratio
from .episode import FPS, Action, layout, rotation_6d, rotation_of_6d
from .motion import along, difference, shorten
from .scene import CUP, GRIPPER, Draw, Task

__all__ = ["AT_GOAL", "MOST_ANGULAR", "MOST_LINEAR", "LimitCounts", "World"]

#: [m/s], [rad/s] of a target: a pose action that asks for more is followed as far.
MOST_LINEAR, MOST_ANGULAR = 1.0, 3.0
#: [m] the cup stands at the goal within this distance.
AT_GOAL = 0.03
#: [m] the tool is at the cup, a held cup is at the goal: where the phases change.
_NEAR_CUP, _NEAR_GOAL = 0.05, 0.06
#: [m] from which a cup may fall and still stands, and [rad] by which it may lean.
_FALL, _LEAN = 0.04, 0.35
#: Samples of the gripper in an action.
_SAMPLES = 10
#: Beyond this part of a limit it counts as broken: differences of rounded positions are noisy.
_NOISE = 1e-6
#: Opening by which fingers must be wider than the cup to let the cup go.
_LET_GO = 0.02


Counts: TypeAlias = NDArray[np.int64]
Flags: TypeAlias = NDArray[np.bool_]


@dataclass
class LimitCounts:
    """(B,) cycles in which a joint was beyond a limit, counted from the positions alone."""

    position: Counts
    velocity: Counts
    acceleration: Counts

    @property
    def all(self) -> Counts:
        """(B,) of all kinds together."""
        return self.position + self.velocity + self.acceleration


class World:
    """B arms with grippers, each with a cup and a goal. One `step` is one action."""

    def __init__(self, task: Task, drive: Drive, action: Action, size: int) -> None:
        self.task, self.drive, self.action, self.size = task, drive, action, size
        chain = task.chain
        self._layout = layout(chain.dof)
        self._length = chain.characteristic_length
        self._grasped = CUP.radius * 2.0 / GRIPPER.stroke
        self.target = np.tile(np.eye(4), (size, 1, 1))
        self.pose = self.target.copy()
        self.q = np.zeros((size, chain.dof))
        self.qdot = np.zeros((size, chain.dof))
        self.sigma = np.zeros(size)
        self.opening = np.ones(size)
        self.cup, self.goal, self._offset = np.zeros((size, 3)), np.zeros((size, 3)), np.zeros((size, 3))
        self.cup_quaternion_wxyz = np.tile([1.0, 0.0, 0.0, 0.0], (size, 1))
        self.held, self.lost, self.placed = (np.zeros(size, dtype=bool) for _ in range(3))
        self.reached = np.full(size, -1)  #: the furthest phase, an index of PHASES; −1: none
        self.limits = LimitCounts(*(np.zeros(size, dtype=np.int64) for _ in range(3)))
        self.asked_twist, self.achieved_twist = np.zeros((size, 6)), np.zeros((size, 6))
        self._last = np.zeros((2, size, chain.dof))

    def reset(self, draws: Sequence[Draw | None]) -> None:
        """Starts the arms that have a draw; the others stay as they are."""
        mask = np.array([draw is not None for draw in draws])
        for b, draw in enumerate(draws):
            if draw is not None:
                self.q[b], self.cup[b], self.goal[b] = draw.start, draw.cup, draw.goal
        self.drive.reset(self.q, mask)
        self._last[:, mask] = self.q[mask]
        self.qdot[mask], self.opening[mask], self.reached[mask] = 0.0, 1.0, -1
        self.asked_twist[mask] = self.achieved_twist[mask] = 0.0
        self.held[mask] = self.lost[mask] = self.placed[mask] = False
        for counts in (self.limits.position, self.limits.velocity, self.limits.acceleration):
            counts[mask] = 0
        self._see()
        self.target[mask] = self.pose[mask]
        self.reached = np.maximum(self.reached, np.where(self.phase > 0, 0, -1))

    def step(self, actions: ArrayLike) -> None:
        """One action (B, A) of all arms."""
        action: Array = np.asarray(actions, dtype=np.float64)
        before = self.pose.copy()
        if self.action == "pose":
            asked = np.tile(np.eye(4), (self.size, 1, 1))
            asked[:, :3, 3], asked[:, :3, :3] = action[:, :3], rotation_of_6d(action[:, 3:9])
            way = shorten(difference(self.target, asked), MOST_LINEAR / FPS, MOST_ANGULAR / FPS)
            end = along(self.target, way)
            self.asked_twist = way * FPS
            path = self.drive.follow(self.target, end)
            self.target = end
        else:
            self.asked_twist = action[:, :6].copy()
            path = self.drive.move(self.asked_twist)
        self._count(path)
        self.q, self.qdot = self._handle(path, action[:, -1])
        self._see()
        self.achieved_twist = difference(before, self.pose) * FPS
        self.reached = np.maximum(self.reached, self._progress())

    @property
    def phase(self) -> NDArray[np.intp]:
        """(B,) index of PHASES in which each arm is now."""
        near = np.linalg.norm(self.pose[:, :3, 3] - self.cup, axis=1) < _NEAR_CUP
        over_goal = np.linalg.norm((self.cup - self.goal)[:, :2], axis=1) < _NEAR_GOAL
        return np.select([self.placed | (self.held & over_goal), self.held, near], [3, 2, 1], 0)

    def state(self) -> NDArray[np.float32]:
        """(B, S) float32, as `episode.state_names` names it."""
        parts = self._layout
        state = np.empty((self.size, parts.size), dtype=np.float32)
        state[:, parts.tool] = self.pose[:, :3, 3]
        state[:, parts.rotation] = rotation_6d(self.pose[:, :3, :3])
        state[:, parts.gripper] = self.opening[:, None]
        state[:, parts.cup], state[:, parts.goal] = self.cup, self.goal
        state[:, parts.sigma] = self.sigma[:, None]
        state[:, parts.q], state[:, parts.qdot] = self.q, self.qdot
        return state

    def _see(self) -> None:
        self.pose = self.task.chain.pose(self.q)
        self.sigma = sigma_ratio(self.task.chain, self.q, self._length)

    def _progress(self) -> NDArray[np.intp]:
        """(B,) the phase that is behind the arm: grasp once the cup is held, place once the cup stands at the goal."""
        phase = self.phase
        return np.select([self.placed, self.held & (phase == 3), self.held, phase >= 1], [3, 2, 1, 0], -1)

    def _count(self, path: Array) -> None:
        """Looks for broken limits in the positions (cycles, B, n)."""
        limits, dt = self.task.chain.limits, self.drive.dt
        whole = np.concatenate([self._last, path])
        velocity = np.diff(whole, axis=0) / dt
        acceleration = np.diff(velocity, axis=0) / dt
        more = 1.0 + _NOISE
        beyond = (path < limits.lower - _NOISE) | (path > limits.upper + _NOISE)
        self.limits.position += beyond.any(axis=2).sum(axis=0)
        self.limits.velocity += (np.abs(velocity[1:]) > more * limits.velocity).any(axis=2).sum(axis=0)
        slower = np.abs(velocity[1:]) < np.abs(velocity[:-1])
        most = np.where(slower, limits.deceleration, limits.acceleration)
        self.limits.acceleration += (np.abs(acceleration) > more * most + _NOISE).any(axis=2).sum(axis=0)
        self._last = whole[-2:].copy()

    def _handle(self, path: Array, command: Array) -> tuple[Array, Array]:
        """The gripper and the cup along the way of the arm (cycles, B, n). Returns where the arm is then, q and q̇."""
        each = len(path) // _SAMPLES
        travel = GRIPPER.speed / (FPS * _SAMPLES)
        for q in path[each - 1 :: each]:
            pose = self.task.chain.pose(q)
            wanted = self.opening + np.clip(command - self.opening, -travel, travel)
            closes = (wanted <= self._grasped) & (self.opening >= self._grasped) & ~self.held & ~self.lost
            if closes.any():
                closes &= self._between(pose)
                self._take(pose, closes)
                self.held |= closes
            self.opening = np.where(self.held, np.maximum(wanted, self._grasped), wanted)
            if self.held.any():
                self._carry(pose)
            opens = self.held & (self.opening > self._grasped + _LET_GO)
            if opens.any():
                self.held &= ~opens
                self._let_go(pose, opens)
        return path[-1].copy(), (path[-1] - path[-2]) / self.drive.dt

    def _between(self, pose: Array) -> Flags:
        """(B,) whether the cup is between the fingers, and upright to them."""
        local = np.einsum("bij,bi->bj", pose[:, :3, :3], self.cup - pose[:, :3, 3])
        room = 0.5 * self.opening * GRIPPER.stroke - CUP.radius
        upright = np.abs(pose[:, 2, 1]) < np.sin(_LEAN)  # y of the tool is level
        inside: Flags = (
            upright
            & (np.abs(local[:, 0]) < GRIPPER.height)
            & (np.abs(local[:, 1]) <= np.maximum(room, 0.0) + 1e-3)
            & (np.abs(local[:, 2]) < GRIPPER.depth)
        )
        return inside

    def _take(self, pose: Array, closes: Flags) -> None:
        local = np.einsum("bij,bi->bj", pose[:, :3, :3], self.cup - pose[:, :3, 3])
        local[:, 1] = 0.0  # the fingers push the cup to the middle
        self._offset = np.where(closes[:, None], local, self._offset)

    def _carry(self, pose: Array) -> None:
        carried = pose[:, :3, 3] + np.einsum("bij,bj->bi", pose[:, :3, :3], self._offset)
        self.cup = np.where(self.held[:, None], carried, self.cup)

    def _let_go(self, pose: Array, opens: Flags) -> None:
        """A cup that is let go upright and near its shelf stands there, another one is lost."""
        stands = self.task.support(self.cup) + 0.5 * CUP.height
        fall = self.cup[:, 2] - stands
        lean = np.abs(np.arcsin(np.clip(-pose[:, 2, 2], -1.0, 1.0)) - self.task.pitch)
        good = (fall < _FALL) & (fall > -_FALL) & (lean < _LEAN) & (np.abs(pose[:, 2, 1]) < np.sin(_LEAN))
        self.lost |= opens & ~good
        self.cup[:, 2] = np.where(opens, stands, self.cup[:, 2])
        at_goal = np.linalg.norm((self.cup - self.goal)[:, :2], axis=1) < AT_GOAL
        self.placed |= opens & good & at_goal
