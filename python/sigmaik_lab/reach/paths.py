"""Paths of the tip: waypoints that are held for a time, and slow sines along a line.

Positions in m and rotations in the base frame; roll, pitch, yaw [rad] turn about the fixed axes x, y, z in
that order (R = Rz(yaw) Ry(pitch) Rx(roll), as in URDF).

The figures of the J-PARSE paper's paths come from the paper and from its authors' public code
(github.com/armlabstanford/jparse), where the text gives them; the others were chosen here and are marked
*ours*.
"""

from __future__ import annotations

import csv
import json
import math
import pathlib
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

import sigmaik as sk
from sigmaik._types import Array

__all__ = ["Line", "Path", "Segment", "names", "named", "read_waypoints", "rotation_rpy"]
#: [s] for each waypoint in the paper's simulations.
DWELL = 14.3


@dataclass(frozen=True)
class Segment:
    """A stretch of time with a target of its own."""

    name: str
    duration: float  #: [s]
    target: Callable[[float], Array]  #: time since the segment's start [s] to the target pose (4, 4)
    pose: Array | None = None  #: the pose (4, 4), where the target does not move

    @classmethod
    def hold(cls, name: str, pose: Array, duration: float) -> Segment:
        """A pose held for a time: the target steps to this pose."""
        return cls(name, duration, lambda _: pose, pose)


@dataclass(frozen=True)
class Line:
    """A straight line, from which deviations are measured."""

    point: Array  #: (3,) [m]
    direction: Array  #: (3,) of length one

    def deviation(self, positions: Array) -> Array:
        """Distances (N,) [m] of positions (N, 3) from the line."""
        offset = positions - self.point
        along = offset @ self.direction
        distance: Array = np.linalg.norm(offset - along[:, None] * self.direction, axis=1)
        return distance


@dataclass(frozen=True)
class Path:
    """Targets over time."""

    name: str
    segments: tuple[Segment, ...]
    description: str = ""
    line: Line | None = None  #: where the target moves along a line
    start: tuple[float, ...] | None = None  #: (n,) [rad] where the arm starts, if the path asks for it
    posture: tuple[float, ...] | None = None  #: q_nominal (n,) [rad], if the path asks for it

    @property
    def duration(self) -> float:
        """[s]"""
        return sum(segment.duration for segment in self.segments)

    def with_dwell(self, duration: float) -> Path:
        """The same waypoints, each held for a time [s]. ValueError where the target moves."""
        if self.moves:
            raise ValueError(f"the target of '{self.name}' moves, and waits nowhere")
        return replace(self, segments=tuple(replace(segment, duration=duration) for segment in self.segments))

    @property
    def moves(self) -> bool:
        """Whether the target moves within a segment."""
        return any(segment.pose is None for segment in self.segments)


def rotation_rpy(roll: float, pitch: float, yaw: float) -> Array:
    """Rz(yaw) Ry(pitch) Rx(roll), (3, 3), from angles [rad]."""
    cr, sr = math.cos(roll), math.sin(roll)
    cp, sp = math.cos(pitch), math.sin(pitch)
    cy, sy = math.cos(yaw), math.sin(yaw)
    return np.array(
        [
            [cy * cp, cy * sp * sr - sy * cr, cy * sp * cr + sy * sr],
            [sy * cp, sy * sp * sr + cy * cr, sy * sp * cr - cy * sr],
            [-sp, cp * sr, cp * cr],
        ]
    )


def make_pose(position: Sequence[float] | Array, rotation: Array) -> Array:
    """(4, 4) from a position (3,) [m] and a rotation (3, 3)."""
    pose = np.eye(4)
    pose[:3, :3] = rotation
    pose[:3, 3] = position
    return pose


def _waypoints(name: str, positions: Sequence[tuple[float, float, float]], rotation: Array, description: str) -> Path:
    segments = tuple(
        Segment.hold(f"({x:g},{y:g},{z:g})", make_pose((x, y, z), rotation), DWELL) for x, y, z in positions
    )
    return Path(name, segments, description)


def _sine_line(
    name: str,
    centre: Array,
    direction: Sequence[float],
    amplitude: float,
    period: float,
    cycles: int,
    description: str,
    start: tuple[float, ...] | None = None,
    posture: tuple[float, ...] | None = None,
) -> Path:
    """Target on a line through the centre pose (4, 4): amplitude · cos(2πt/period), which starts at rest."""
    unit = np.asarray(direction, dtype=np.float64)

    def target(t: float) -> Array:
        pose = centre.copy()
        pose[:3, 3] += amplitude * math.cos(2.0 * math.pi * t / period) * unit
        return pose

    segments = tuple(Segment(f"cycle {i + 1}", period, target) for i in range(cycles))
    return Path(name, segments, description, Line(centre[:3, 3].copy(), unit), start, posture)


# --- xArm7

_DOWN = rotation_rpy(math.pi, 0.0, 0.0)


def _xarm7_line(_: sk.Chain) -> Path:
    return _waypoints(
        "extended-line",
        ((1.0, 0.0, 0.5), (0.5, 0.0, 0.5), (0.0, 0.0, 0.5)),
        _DOWN,
        "out of reach, well inside, low rank",
    )


def _xarm7_ellipse(_: sk.Chain) -> Path:
    return _waypoints(
        "extended-ellipse",
        ((0.55, 0.0, 0.3), (0.4, 0.8, 0.3), (0.25, 0.0, 0.3), (0.4, -0.8, 0.3)),
        _DOWN,
        "the second and the fourth are out of reach",
    )


def _xarm7_overhead(_: sk.Chain) -> Path:
    return _waypoints(
        "overhead",
        ((0.15, 0.0, 0.5), (0.0, 0.0, 0.5), (-0.15, 0.0, 0.5), (0.0, 0.0, 0.5)),
        _DOWN,
        "to and fro over the base: the axis of joint 1 is crossed",
    )


def _xarm7_overhead_line(_: sk.Chain) -> Path:
    # 0.05 Hz in the authors' launch file.
    return _sine_line(
        "overhead-line",
        make_pose((0.0, 0.0, 0.5), _DOWN),
        (1.0, 0.0, 0.0),
        amplitude=0.15,
        period=20.0,
        cycles=3,
        description="a sine along x over the base, crossing the axis of joint 1 twice a cycle",
    )


# --- Gen3

_FORWARD = rotation_rpy(math.pi / 2.0, 0.0, math.pi / 2.0)


def _gen3_line(_: sk.Chain) -> Path:
    return _waypoints(
        "extended-line",
        ((1.1, 0.0, 0.7), (0.6, 0.0, 0.7), (0.1, 0.0, 0.7)),
        _FORWARD,
        "out of reach, well inside, low rank",
    )


def _gen3_internal(_: sk.Chain) -> Path:
    """Axes 1 and 3 in line (q2 = 0). All figures are *ours*.

    The Jacobian loses rank there only where q3 = ±π/2, too. Therefore joints 1 and 3 of the published posture are
    turned by a quarter turn against each other; with q2 = 0 the pose is still the published pose. Axis 2 then swings
    the arm sideways, through q2 = 0 in the middle of the line. x and z are those of such a pose with the elbow at
    q4 = −2.
    """
    return _sine_line(
        "internal-singularity",
        make_pose((0.442, 0.0, 0.575), _FORWARD),
        (0.0, 1.0, 0.0),
        amplitude=0.15,
        period=40.0,
        cycles=3,
        description="a slow sine along y; axes 1 and 3 line up twice a cycle",
        start=(1.4984, -0.3567, 1.5465, -1.9067, -0.2933, 0.3235, 1.4916),
        posture=(math.pi / 2.0, 0.0, math.pi / 2.0, -2.27, 0.0, 0.96, 1.57),
    )


# --- PUMA 560

#: Lengths of the shipped PUMA 560 [m]: upper arm, offset at the elbow, forearm.
_PUMA_A2, _PUMA_A3, _PUMA_D4 = 0.4318, 0.0203, 0.4318
#: q3 with the arm stretched: the wrist's centre is then farthest from the shoulder.
_PUMA_STRETCHED = -math.atan2(_PUMA_D4, _PUMA_A3)


def _puma_shoulder_lock(q3: float) -> float:
    """q2 [rad] that brings the wrist's centre over the shoulder, into the plane of axes 1 and 2.

    The wrist's centre then lies 0.15 m (the arm's shoulder offset) beside axis 1, and cannot come closer.
    """
    a = _PUMA_A2 + _PUMA_A3 * math.cos(q3) - _PUMA_D4 * math.sin(q3)
    b = -_PUMA_A3 * math.sin(q3) - _PUMA_D4 * math.cos(q3)
    return math.atan2(a, -b)


def puma_locks() -> Mapping[str, Array]:
    """Configurations (6,) [rad] of the PUMA waypoints, *ours*: name to q."""
    return {
        "regular": np.array([0.0, math.pi / 4.0, -math.pi, 0.0, math.pi / 4.0, 0.0]),
        "shoulder lock": np.array([0.0, _puma_shoulder_lock(-2.6), -2.6, 0.0, 0.8, 0.0]),
        "vertical": np.array([0.0, math.pi / 2.0, _PUMA_STRETCHED, 0.0, 0.8, 0.0]),
        "horizontal": np.array([0.0, 0.0, _PUMA_STRETCHED, 0.0, 0.0, 0.0]),
    }


def _puma_waypoints(chain: sk.Chain) -> Path:
    """(a) regular, (b) shoulder lock, (c) vertical: shoulder and elbow, (d) horizontal: elbow and wrist, (a).

    The order is the paper's, the figures are *ours*: each target is the pose at such a configuration, so that the
    arm can reach the target, and the lock is exact. Each target lasts 30 s, because near an elbow lock the error
    falls as 1/t.
    """
    locks = puma_locks()
    order = [*locks, "regular"]
    segments = tuple(Segment.hold(name, chain.pose(locks[name]), 30.0) for name in order)
    return Path(
        "shoulder-elbow-wrist",
        segments,
        "shoulder lock, shoulder and elbow lock, elbow and wrist lock, and back",
        start=(0.2, 0.9, -2.9, 0.2, 1.0, 0.1),
    )


#: Wrist lock in the middle of the PUMA's slow line: θ5 = 0, forearm and tool 30° below the horizontal.
PUMA_WRIST_LOCK = np.radians([0.0, 75.0, -195.0, 90.0, 0.0, -90.0])


def _puma_wrist_lock(chain: sk.Chain) -> Path:
    """θ5 = 0 twice a cycle. All figures are *ours*.

    x, z and the orientation are those of a configuration at the lock. θ4 = 90° puts axis 5 into
    the arm's upright plane, so that joint 5 turns against joint 1 as y moves, and θ5 changes its sign.
    """
    return _sine_line(
        "wrist-lock",
        chain.pose(PUMA_WRIST_LOCK),
        (0.0, 1.0, 0.0),
        amplitude=0.3,
        period=40.0,
        cycles=3,
        description="a slow sine along y; axes 4 and 6 line up twice a cycle",
        start=(0.6111, 1.3091, -3.4035, 1.7272, 0.5271, -1.4143),
    )


# --- any arm


def _generic_line(chain: sk.Chain, home: Array) -> Path:
    """Out of reach, home, and half the way in, at home's height and orientation. *Ours*, for any arm."""
    pose = chain.pose(home)
    position, rotation = pose[:3, 3], pose[:3, :3]
    radius = math.hypot(position[0], position[1])
    outward = position[:2] / radius if radius > 1e-3 else np.array([1.0, 0.0])
    generator = np.random.default_rng(0)
    reach = max(float(np.linalg.norm(chain.pose(_random(chain, generator))[:3, 3])) for _ in range(500))
    segments = []
    for name, r in (("out of reach", 1.2 * reach), ("home", radius), ("half way in", 0.5 * radius)):
        target = make_pose((*(r * outward), position[2]), rotation)
        segments.append(Segment.hold(name, target, DWELL))
    return Path("extended-line", tuple(segments), "out of reach, home, and half the way in")


def _random(chain: sk.Chain, generator: np.random.Generator) -> Array:
    q: Array = chain.random_configuration(generator)
    return q


_PATHS: dict[str, dict[str, Callable[[sk.Chain], Path]]] = {
    "ufactory_xarm7": {
        "extended-line": _xarm7_line,
        "extended-ellipse": _xarm7_ellipse,
        "overhead": _xarm7_overhead,
        "overhead-line": _xarm7_overhead_line,
    },
    "kinova_gen3_7dof": {"extended-line": _gen3_line, "internal-singularity": _gen3_internal},
    "puma560": {"shoulder-elbow-wrist": _puma_waypoints, "wrist-lock": _puma_wrist_lock},
}
_ALIASES = {("puma560", "slow-line"): "wrist-lock", ("kinova_gen3_7dof", "slow-line"): "internal-singularity"}


def names(robot: str) -> tuple[str, ...]:
    """Names of the paths that there are for an arm. Every arm has "extended-line"."""
    return tuple({**_PATHS.get(robot, {}), "extended-line": None})


def named(name: str, robot: str, chain: sk.Chain, home: Array) -> Path:
    """The path of that name for an arm. ValueError, with the known names, where the arm has no such path.

    robot: name of a shipped arm, or anything else for an arm without figures of its own
    home: configuration (n,) that the generic path is laid around
    """
    known = _PATHS.get(robot, {})
    make = known.get(_ALIASES.get((robot, name), name))
    if make is not None:
        return make(chain)
    if name == "extended-line":
        return _generic_line(chain, home)
    there_are = ", ".join(names(robot))
    raise ValueError(f"no path '{name}' for '{robot}', and no such file; there are {there_are}")


# --- files

COLUMNS = ("x", "y", "z", "roll", "pitch", "yaw", "duration")


def read_waypoints(file: str | pathlib.Path) -> Path:
    """Waypoints from a CSV or JSON file.

    CSV: a header line with the columns x, y, z [m], roll, pitch, yaw [rad, fixed axes], duration [s], in any order,
    and optionally name; lines that start with # are comments.

    JSON: a list of waypoints, or an object whose "waypoints" is such a list. A waypoint is an object with the same
    seven names (and optionally "name"), or a list of the seven numbers in this order.

    ValueError, with the file, the waypoint and the value, where something is missing or not a number.
    """
    file = pathlib.Path(file)
    try:
        text = file.read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as error:
        reason = error.strerror if isinstance(error, OSError) else "not a text file"
        raise ValueError(f"waypoints '{file}': {reason}") from None
    rows = _json_rows(file, text) if file.suffix.lower() == ".json" else _csv_rows(file, text)
    segments = []
    for where, row in rows:
        numbers = [_number(file, where, column, row.get(column)) for column in COLUMNS]
        x, y, z, roll, pitch, yaw, duration = numbers
        if duration <= 0.0:
            raise ValueError(f"waypoints '{file}', {where}: duration must be positive, not {duration:g}")
        name = str(row.get("name") or f"({x:g},{y:g},{z:g})")
        pose = make_pose((x, y, z), rotation_rpy(roll, pitch, yaw))
        segments.append(Segment.hold(name, pose, duration))
    if not segments:
        raise ValueError(f"waypoints '{file}': there are none in it")
    return Path(file.stem, tuple(segments), f"waypoints of {file.name}")


def _csv_rows(file: pathlib.Path, text: str) -> list[tuple[str, Mapping[str, object]]]:
    header: list[str] = []
    rows: list[tuple[str, Mapping[str, object]]] = []
    for number, line in enumerate(text.splitlines(), start=1):
        if not line.strip() or line.lstrip().startswith("#"):
            continue
        cells = [cell.strip() for cell in next(csv.reader([line], skipinitialspace=True))]
        if header:
            rows.append((f"line {number}", dict(zip(header, cells, strict=False))))
        else:
            header = cells
    missing = [column for column in COLUMNS if column not in header]
    if missing:
        raise ValueError(
            f"waypoints '{file}': no column {', '.join(missing)}; the first line names {', '.join(COLUMNS)}"
        )
    return rows


def _json_rows(file: pathlib.Path, text: str) -> list[tuple[str, Mapping[str, object]]]:
    try:
        data = json.loads(text)
    except json.JSONDecodeError as error:
        raise ValueError(f"waypoints '{file}', line {error.lineno}: {error.msg}") from None
    items = data.get("waypoints") if isinstance(data, dict) else data
    if not isinstance(items, list):
        raise ValueError(
            f"waypoints '{file}': a list of waypoints, or an object with the list 'waypoints', is expected"
        )
    rows: list[tuple[str, Mapping[str, object]]] = []
    for i, item in enumerate(items):
        where = f"waypoint {i + 1}"
        if isinstance(item, list):
            if len(item) != len(COLUMNS):
                raise ValueError(f"waypoints '{file}', {where}: {len(item)} numbers; expected {', '.join(COLUMNS)}")
            item = dict(zip(COLUMNS, item, strict=True))
        if not isinstance(item, dict):
            raise ValueError(f"waypoints '{file}', {where}: neither an object nor a list of seven numbers")
        rows.append((where, item))
    return rows


def _number(file: pathlib.Path, where: str, column: str, value: object) -> float:
    if value is None or value == "":
        raise ValueError(f"waypoints '{file}', {where}: {column} is missing")
    try:
        number = float(value) if isinstance(value, (str, int, float)) else math.nan
    except ValueError:
        number = math.nan
    if not math.isfinite(number):
        raise ValueError(f"waypoints '{file}', {where}: {column} must be a finite number, not {value!r}")
    return number
