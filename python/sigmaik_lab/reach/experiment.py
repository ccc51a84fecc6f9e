"""The closed loop: a servo follows a path, and every sample is recorded.

    from sigmaik_lab.reach.methods import parse_method
    from sigmaik_lab.reach.experiment import load, run
    from sigmaik_lab.reach.summary import summarize

    experiment = load("ufactory_xarm7", "extended-line")
    done = run(experiment, parse_method("jparse", experiment.settings), velocity_limits=True)
    for row in summarize(done):
        print(row.waypoint, row.position_error)

The paths and settings are those of the J-PARSE paper (Guptasarma et al.) for the xArm7, the Gen3 and the PUMA 560, see
`paths` and `settings`. `sigmaik reach` is the same on the command line. Units: m, rad, s.
"""

from __future__ import annotations

import math
import pathlib
from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

import sigmaik as sk
from sigmaik._types import Array
from sigmaik.methods import NamedMethod

from . import paths
from .settings import ReachSettings, dwell, published

__all__ = ["Experiment", "Run", "load", "run"]


@dataclass(frozen=True)
class Experiment:
    """An arm, a path and the servo's settings: everything but the method."""

    robot: str  #: name of the shipped arm, or of the URDF file
    chain: sk.Chain
    path: paths.Path
    settings: ReachSettings
    start: Array  #: (n,) [rad or m]
    posture: Array  #: q_nominal (n,) [rad or m]

    @property
    def samples(self) -> int:
        """Number of control cycles."""
        return sum(self.cycles(segment) for segment in self.path.segments)

    def cycles(self, segment: paths.Segment) -> int:
        """Number of control cycles in a segment, at least one."""
        return max(1, round(segment.duration * self.settings.rate))

    def targets(self) -> Iterator[tuple[int, Array]]:
        """For every control cycle its segment's index, and the target's pose (4, 4)."""
        for i, segment in enumerate(self.path.segments):
            for j in range(self.cycles(segment)):
                yield i, segment.target(j / self.settings.rate) if segment.pose is None else segment.pose


@dataclass(frozen=True)
class Run:
    """Time series of a method. Sample k is the state at t[k], and the command from t[k] to the next sample."""

    experiment: Experiment
    method: NamedMethod
    velocity_limits: bool  #: whether the arm's joint speed limits were held
    t: Array  #: (N,) [s]
    segment: NDArray[np.int32]  #: (N,) index into experiment.path.segments
    q: Array  #: (N, n) [rad or m]
    qdot: Array  #: (N, n) commanded [rad/s or m/s]
    target: Array  #: (N, 3) position of the target [m]
    pose_error: Array  #: (N, 6) target minus tip [m, rad], base axes
    singular_values: Array  #: (N, min(6, n)), largest first
    status: NDArray[np.int8]  #: (N,) sigmaik.Status
    scale: Array  #: (N,) the part of the command that the speed limits left, 1 is the whole command

    @property
    def position_error(self) -> Array:
        """(N,) [m], the paper's equation 65."""
        norm: Array = np.linalg.norm(self.pose_error[:, :3], axis=1)
        return norm

    @property
    def orientation_error(self) -> Array:
        """(N,) [rad], angle of the rotation that is left, the paper's equation 66."""
        norm: Array = np.linalg.norm(self.pose_error[:, 3:], axis=1)
        return norm

    @property
    def tip(self) -> Array:
        """(N, 3) position of the tip [m]."""
        return self.target - self.pose_error[:, :3]

    @property
    def inverse_condition(self) -> Array:
        """(N,) σ_min/σ_max."""
        s = self.singular_values
        return np.divide(s[:, -1], s[:, 0], out=np.zeros(len(s)), where=s[:, 0] > 0.0)

    @property
    def joint_speed(self) -> Array:
        """(N,) the largest |q̇| of all joints [rad/s, or m/s]."""
        largest: Array = np.max(np.abs(self.qdot), axis=1)
        return largest

    @property
    def deviation(self) -> Array | None:
        """(N,) distance from the path's line [m]; None where the path has no line."""
        line = self.experiment.path.line
        return None if line is None else line.deviation(self.tip)


def load(
    robot: str,
    path: str | pathlib.Path | paths.Path,
    settings: ReachSettings | None = None,
    base: str | None = None,
    tip: str | None = None,
    setting: str = "simulated",
    **changes: object,
) -> Experiment:
    """An experiment by the names of its parts.

    robot: a shipped arm, or a URDF file
    path: a name from `names(robot)`, a file of waypoints (CSV or JSON, see `read_waypoints`), or a Path
    settings: by default the published ones of the arm, with the path's own start and posture
    base, tip: link names; by default the URDF's root, and its only leaf
    setting: which of the published settings, see `settings.SETTINGS`; "real" also waits longer at each waypoint
    changes: settings by name, which replace all of these where they are not None
    ValueError where a part is unknown, or of the wrong size for the arm.
    """
    label, chain, home, _ = sk.robots.open(robot, base, tip)
    if not isinstance(path, paths.Path):
        if pathlib.Path(path).suffix.lower() in (".csv", ".json") or pathlib.Path(path).is_file():
            path = paths.read_waypoints(path)
        else:
            path = paths.named(str(path), label, chain, home)
    if settings is None:
        settings = published(label, setting).with_(start=path.start, posture=path.posture)
        waits = dwell(setting)
        path = path if waits is None else path.with_dwell(waits)
    settings = settings.with_(**changes)
    for name in ("rate", "gain_linear", "gain_angular", "max_position_error", "max_orientation_error"):
        value = getattr(settings, name)
        if not 0.0 < value < math.inf:
            raise ValueError(f"{name} must be positive and finite, not {value:g}")
    start = _sized("start", settings.start, home, chain)
    posture = _sized("posture", settings.posture, start, chain)
    return Experiment(label, chain, path, settings, start, posture)


def run(
    experiment: Experiment,
    method: NamedMethod,
    velocity_limits: bool = False,
    progress: Callable[[int], None] | None = None,
) -> Run:
    """Runs the loop: a kinematic simulation, in which the arm moves at the commanded velocity for 1/rate (Euler).

    velocity_limits: hold the arm's joint speed limits by slowing all joints together; False is as published
    progress: called with the number of cycles done since the last call, about ten times a second of simulated
        time
    """
    s = experiment.settings
    servo = sk.Servo(
        experiment.chain,
        method.method,
        dt=1.0 / s.rate,
        gain_linear=s.gain_linear,
        gain_angular=s.gain_angular,
        max_linear_error=s.max_position_error,
        max_angular_error=s.max_orientation_error,
        soft_start=0.0,
        posture=experiment.posture,
        posture_gain=s.posture_gain,
        posture_max_speed=s.posture_max_speed,
        position_limits=False,
        velocity_limits=velocity_limits,
        acceleration_limits=False,
        jerk_limits=False,
        on_limit="scale",
        length_scale=s.length_scale,
    )
    servo.reset(experiment.start)

    n, dof = experiment.samples, experiment.chain.dof
    t = np.arange(n) / s.rate
    index = np.empty(n, dtype=np.int32)
    q, qdot = np.empty((n, dof)), np.empty((n, dof))
    target, error = np.empty((n, 3)), np.empty((n, 6))
    singular_values = np.empty((n, min(6, dof)))
    status, scale = np.empty(n, dtype=np.int8), np.empty(n)

    stride = max(1, round(s.rate / 10.0))
    state = experiment.start
    for k, (i, pose) in enumerate(experiment.targets()):
        step = servo.update(pose)
        index[k], q[k], target[k] = i, state, pose[:3, 3]
        state = step.q
        qdot[k], error[k], scale[k] = step.qdot, step.pose_error, step.scale
        singular_values[k], status[k] = step.singular_values, int(step.status)
        if progress is not None and (k + 1) % stride == 0:
            progress(stride)
    return Run(experiment, method, velocity_limits, t, index, q, qdot, target, error, singular_values, status, scale)


def _sized(name: str, values: tuple[float, ...] | None, default: Array, chain: sk.Chain) -> Array:
    if values is None:
        return default
    if len(values) != chain.dof:
        raise ValueError(f"{name} has {len(values)} values, but the arm has {chain.dof} joints")
    if not all(map(math.isfinite, values)):
        raise ValueError(f"{name} must be finite")
    return np.array(values, dtype=np.float64)
