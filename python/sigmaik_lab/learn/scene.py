"""The task's geometry for an arm: where cups and goals are drawn, how the tool holds a cup, where the arm starts."""

from __future__ import annotations

import dataclasses
import functools
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np

import sigmaik as sk
from sigmaik._types import Array

__all__ = ["CUP", "GRIPPER", "REGIONS", "Cup", "Draw", "Gripper", "Region", "Task", "task"]

Region = Literal["edge", "overhead"]
REGIONS: tuple[Region, ...] = ("edge", "overhead")

#: [rad/s²] of joints whose model has no acceleration limit, as in `sk.Servo`.
_ASSUMED_ACCELERATION = 10.0
#: [m] radius of the discs in which cups and goals are drawn, as in the paper.
_SPREAD = 0.05
#: [m] the cups' disc has its centre this much inside the end of reach; a cup that is drawn nearer to the end than the
#: second length, or farther from the end than the third one, is drawn again: the arm is singular for all cups.
_INSIDE, _LEAST_INSIDE, _MOST_INSIDE = 0.01, 0.003, 0.017
#: [m] from one pose to the next on the way to the end of reach, and at the end of the search.
_COARSE, _FINE = 0.02, 1e-4
#: [rad or m] by which a joint may differ from one pose to the next.
_JUMP = 0.5
#: [rad] of the tool's axis below the horizontal: the first that an arm can do is taken.
_PITCHES = {"edge": (0.35, 0.7, 0.0, 1.1), "overhead": (0.0, 0.35)}
#: Height of the shelf of an overhead cup above the shoulder, as a part of the lengths of all links together.
_OVERHEAD = 0.3
#: [m] height of the other shelves.
_SHELF = 0.02
#: [rad] azimuth of the goal's disc, and its distance from axis 1 as a part of the reach: the first that the arm can do.
_GOAL_AZIMUTH, _GOAL_PARTS = 1.0, (0.5, 0.55, 0.6, 0.65, 0.7)
#: Distances from axis 1, as parts of the lengths of all links together, at which the search begins.
_STARTS = (0.35, 0.45, 0.55)
#: Distance of the first pose of an episode from axis 1, as a part of the reach.
_START = 0.65
#: [s] a cycle of the servo that tries whether the arm can do the task, its cycles for each part, and [m] the error at
#: which the servo has arrived.
_CYCLE, _CYCLES, _ARRIVED = 0.01, 1000, 0.003
#: [m] by which a cup is lifted, which must be possible at the goal.
_LIFT = 0.08


@dataclass(frozen=True)
class Gripper:
    """A parallel gripper. Its frame is the tool: z points ahead, y from finger to finger, the origin is between the
    fingertips. The sizes are those of the xArm gripper, rounded."""

    length: float = 0.17  #: [m] from the flange to the tool's origin
    stroke: float = 0.085  #: [m] between the fingertips of an open gripper
    speed: float = 2.0  #: [1/s] of the opening
    mass: float = 0.8  #: [kg]
    depth: float = 0.015  #: [m] along z within which the fingers meet the middle of the cup
    height: float = 0.035  #: [m] along x, likewise


@dataclass(frozen=True)
class Cup:
    """A cylinder that stands on its bottom. Positions are those of its centre."""

    radius: float = 0.03  #: [m]
    height: float = 0.12  #: [m]
    mass: float = 0.1  #: [kg]


GRIPPER = Gripper()
CUP = Cup()


@dataclass(frozen=True)
class Draw:
    """What is drawn for one episode."""

    cup: Array  #: (3,) centre [m], base frame
    goal: Array  #: (3,) centre [m]
    start: Array  #: (n,) joint positions [rad or m]


@dataclass(frozen=True)
class Task:
    """The task of one arm in one region. Base frame; z is up and axis 1 passes through the base's origin."""

    robot: str
    region: Region
    chain: sk.Chain  #: from the base to the tool, all acceleration limits finite
    start: Array  #: (n,) joint positions
    cup: Array  #: (3,) centre of the cups' disc, at the height of a cup's centre
    goal: Array  #: (3,) likewise for goals
    pitch: float  #: [rad] of the tool's axis below the horizontal
    turn: float  #: 0 or π [rad] about the tool's axis, the nearer one to the arm's home
    reach: float  #: [m] from axis 1 to the end of reach at the cups' height and the tool's rotation

    def rotation(self, point: Array) -> Array:
        """(…, 3, 3) of a tool that holds a cup at a point (…, 3): the tool points away from axis 1."""
        return _rotation(np.arctan2(point[..., 1], point[..., 0]), self.pitch, self.turn)

    def hold(self, point: Array) -> Array:
        """(…, 4, 4) the pose of a tool that holds a cup at a point (…, 3)."""
        pose = np.zeros((*point.shape[:-1], 4, 4))
        pose[..., :3, :3], pose[..., :3, 3], pose[..., 3, 3] = self.rotation(point), point, 1.0
        return pose

    def support(self, point: Array) -> Array:
        """(…) height [m] of what a cup at (…, 3) stands on: the shelf of the disc that is nearer."""
        to_cup = np.linalg.norm(point[..., :2] - self.cup[:2], axis=-1)
        to_goal = np.linalg.norm(point[..., :2] - self.goal[:2], axis=-1)
        return np.asarray(np.where(to_cup < to_goal, self.cup[2], self.goal[2]) - 0.5 * CUP.height)

    def draw(self, rng: np.random.Generator, options: dict[str, Any] | None = None) -> Draw:
        """Draws an episode. options: "cup" and "goal" (3,) take the place of what is drawn. ValueError for others."""
        drawn = {"cup": self._reachable_cup(rng), "goal": self.goal + _in_disc(rng)}
        start = self.start + np.clip(rng.normal(0.0, 0.01, self.chain.dof), -0.02, 0.02)
        limits = self.chain.limits
        start = np.clip(start, limits.lower, limits.upper)
        for name, value in (options or {}).items():
            if name not in drawn:
                raise ValueError(f"a scene has no option '{name}'; there are {', '.join(drawn)}")
            drawn[name] = np.array(value, dtype=np.float64).reshape(3)
        return Draw(drawn["cup"], drawn["goal"], start)

    def _reachable_cup(self, rng: np.random.Generator) -> Array:
        while True:
            cup = self.cup + _in_disc(rng)
            if _LEAST_INSIDE <= self.reach - np.hypot(cup[0], cup[1]) <= _MOST_INSIDE:
                return cup


def _in_disc(rng: np.random.Generator) -> Array:
    radius, angle = _SPREAD * np.sqrt(rng.uniform()), rng.uniform(0.0, 2.0 * np.pi)
    return np.array([radius * np.cos(angle), radius * np.sin(angle), 0.0])


def _rotation(azimuth: Array, pitch: float, turn: float) -> Array:
    c, s = np.cos(azimuth), np.sin(azimuth)
    zero = np.zeros_like(c)
    z = np.stack([np.cos(pitch) * c, np.cos(pitch) * s, zero - np.sin(pitch)], axis=-1)
    y = np.stack([-s, c, zero], axis=-1) * np.cos(turn)
    return np.stack([np.cross(y, z), y, z], axis=-1)


@functools.lru_cache(maxsize=32)
def task(robot: str, region: Region = "edge") -> Task:
    """The task of an arm, a shipped one or of a URDF file.

    The end of reach is searched: from a pose near the home, outwards at a fixed rotation, as far as position inverse
    kinematics finds a solution next to the last one. ValueError where no such pose is found, or the region is none.
    """
    if region not in REGIONS:
        raise ValueError(f"no region '{region}'; there are {', '.join(REGIONS)}")
    arm = sk.robots.open(robot)
    place = np.eye(4)
    place[2, 3] = GRIPPER.length
    # A block of the gripper's size, half its length behind the fingertips.
    tensor = GRIPPER.mass / 12.0 * np.diag([0.03, 0.03, 0.02])
    chain = arm.chain.with_tool(place, sk.Inertia(GRIPPER.mass, [0.0, 0.0, -0.5 * GRIPPER.length], tensor))
    limits = chain.limits
    chain = chain.with_limits(
        acceleration=np.where(np.isfinite(limits.acceleration), limits.acceleration, _ASSUMED_ACCELERATION)
    )
    for pitch in _PITCHES[region]:
        found = _place(Task(arm.name, region, chain, arm.home, np.zeros(3), np.zeros(3), pitch, 0.0, 0.0))
        if found is not None:
            return found
    raise ValueError(f"{arm.name} with a gripper finds no way to cups and goals of the region '{region}'")


def _place(task: Task) -> Task | None:
    """The task with its discs and its start; None where the arm cannot do the task at this pitch."""
    span = sum(float(np.linalg.norm(segment.origin[:3, 3])) for segment in task.chain.segments)
    low = 0.5 * CUP.height + _SHELF
    height = low if task.region == "edge" else low + _shoulder(task.chain) + _OVERHEAD * span
    found = _end_of_reach(task, height, span)
    if found is None:
        return None
    task = found
    ik = sk.PositionIk(task.chain)
    for part in _GOAL_PARTS:
        away = part * task.reach
        goal = np.array([away * np.cos(_GOAL_AZIMUTH), away * np.sin(_GOAL_AZIMUTH), low])
        corners = [
            goal + [_SPREAD * x, _SPREAD * y, z] for x, y, z in ((1, 0, 0), (-1, 0, 0), (0, 1, 0), (0, -1, _LIFT))
        ]
        if all(ik.solve(task.hold(p), near=task.start).status == sk.PositionIkStatus.OK for p in corners):
            placed = dataclasses.replace(task, goal=goal)
            if _servo_arrives(placed):
                return placed
    return None


def _servo_arrives(task: Task) -> bool:
    """Whether the library's default servo comes from the start to the cup, and with the cup to the goal."""
    servo = sk.Servo(task.chain, None, _CYCLE)
    servo.reset(task.start)
    up = np.array([0.0, 0.0, _LIFT])
    for point in (task.cup, task.goal + up, task.goal):
        target = task.hold(point)
        for _ in range(_CYCLES):
            error = servo.update(target).pose_error
            if np.linalg.norm(error[:3]) < _ARRIVED:
                break
        else:
            return False
    return True


def _shoulder(chain: sk.Chain) -> float:
    """[m] height of the second movable joint where all joints are at zero."""
    height, movable = 0.0, 0
    for segment in chain.segments:
        height += float(segment.origin[2, 3])
        movable += segment.type != "fixed"
        if movable == 2:
            break
    return height


def _end_of_reach(task: Task, height: float, span: float) -> Task | None:
    """The task with its start, its reach, its turn, and its cups just inside the end of reach."""
    ik = sk.PositionIk(task.chain)
    best: tuple[float, float, float, Array] | None = None
    for part in _STARTS:
        for turn in (0.0, np.pi):
            posed = dataclasses.replace(task, turn=turn)
            solved = ik.solve(posed.hold(np.array([part * span, 0.0, height])), near=task.start)
            away = float(np.abs(solved.q - task.start).max())
            if solved.status == sk.PositionIkStatus.OK and (best is None or away < best[0]):
                best = (away, part * span, turn, np.array(solved.q))
    if best is None:
        return None
    _, distance, turn, start = best
    posed = dataclasses.replace(task, turn=turn, start=start)
    q, step = start, _COARSE
    while step >= _FINE:
        solved = ik.solve(posed.hold(np.array([distance + step, 0.0, height])), near=q)
        if solved.status == sk.PositionIkStatus.OK and np.abs(solved.q - q).max() < _JUMP:
            distance, q = distance + step, np.array(solved.q)
        else:
            step *= 0.5
    cup = np.array([distance - _INSIDE, 0.0, height])
    before = ik.solve(posed.hold(np.array([_START * distance, 0.0, height + _LIFT])), near=start)
    if before.status == sk.PositionIkStatus.OK:
        start = np.array(before.q)
    return dataclasses.replace(posed, start=start, cup=cup, reach=distance)
