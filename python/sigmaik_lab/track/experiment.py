"""A target that moves: scripted, recorded, or a hand-held marker before a camera, and an arm that follows.

The camera makes samples that are late and noisy, some missing and some wrong; a `sigmaik.TargetStream` makes targets
of these samples, and a `sigmaik.Servo` at 1 kHz, with all limits on, follows. The poses of the camera in the base, and
of the marker on the hand, are exact. The simulation is kinematic: the arm moves at the commanded velocity for 1/rate.

Units: m, rad, s.
"""

from __future__ import annotations

import math
import pathlib
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Literal, cast

import numpy as np
from numpy.typing import NDArray

import sigmaik as sk
from sigmaik._types import Array
from sigmaik.methods import NamedMethod

from .camera import Camera, Frame, see
from .target import TARGETS, asked_speed, play, reachable_poses, read_recording, scripted

__all__ = [
    "MODES",
    "RETURN",
    "START",
    "Follow",
    "TrackExperiment",
    "TrackSettings",
    "Variant",
    "follow",
    "load_track",
]
Bools = NDArray[np.bool_]

#: Ways to make targets of samples.
MODES: dict[str, str] = {
    "true": "the target's pose and twist, known without a camera: the bound",
    "raw": "each sample goes to the servo as it comes, and stays until the next",
    "hold": "TargetStream, at the last sample",
    "interpolate": "TargetStream, through the samples, late",
    "predict": "TargetStream, where a Kalman filter expects it now",
}
START = 1.0  #: [s] that are not judged: the servo's soft start
#: [s] that are not judged after the gap, and after the target was out of reach: the tip's way back to the target.
RETURN = 2.0
#: Limits for joints whose description has none: few descriptions have jerk limits, and some no acceleration limits.
ACCELERATION, JERK = 20.0, 1000.0


@dataclass(frozen=True)
class TrackSettings:
    """Rate, gains and duration of the loop, filters of the stream, and limits that replace those of the arm."""

    rate: float = 1000.0  #: [Hz]
    duration: float = 20.0  #: [s] of a target of pace 1; of a recording, all of it
    #: Speed of a target that is not recorded, as a part of the hand's own; None: 1, or less where the arm is too slow.
    pace: float | None = None
    seed: int = 0
    guided: bool = True  #: the elbow keeps its side
    gain_linear: float = 10.0  #: [1/s]
    gain_angular: float = 10.0  #: [1/s]
    posture_gain: float = 0.0  #: [1/s] towards home, where the arm is redundant
    smoothing: float = 0.05  #: [s] of the stream
    latency: float | None = None  #: [s] of "interpolate"; None: the camera's delay, and two pictures and a half
    max_speed: float = 1.5  #: [m/s] of the stream
    max_angular_speed: float = 4.0  #: [rad/s]
    acceleration: float | None = None  #: limit of all joints; None: the arm's own, or ACCELERATION where it has none
    jerk: float | None = None  #: limit of all joints; None: the arm's own, or JERK where it has none


@dataclass(frozen=True)
class TrackExperiment:
    """An arm, a target's motion, and the camera that sees the target."""

    robot: str
    target: str
    chain: sk.Chain
    start: Array  #: (n,)
    settings: TrackSettings
    camera: Camera
    poses: Array  #: (N, 4, 4) the target, each cycle
    twists: Array  #: (N, 6) on its way to the next cycle
    reachable: Bools  #: (N,)
    gap: tuple[float, float]  #: [s] from, to: no samples; both the duration where there is none
    frames: tuple[Frame, ...]
    pace: float  #: of the target; 1 for a recording
    asked_speed: float  #: part of the joints' velocity limits that the target asks for within reach, at the most

    @property
    def t(self) -> Array:
        """(N,) [s]"""
        return np.arange(len(self.poses)) / self.settings.rate

    @property
    def judged(self) -> Bools:
        """(N,) where errors count: not at the start, nor where the stream has stopped, nor on the way back."""
        begin, end = self.gap
        return (self.t >= START) & ((self.t < begin) | (self.t > end + RETURN)) & ~self.returning

    @property
    def back(self) -> NDArray[np.intp]:
        """Cycles in which the target comes back within reach."""
        return np.flatnonzero(~self.reachable[:-1] & self.reachable[1:]) + 1

    @property
    def returning(self) -> Bools:
        """(N,) whether the target is within reach, and was out of reach less than RETURN before."""
        out = np.zeros(len(self.poses), dtype=np.bool_)
        for k in self.back:
            out[k : k + round(RETURN * self.settings.rate)] = True
        return out & self.reachable


@dataclass(frozen=True)
class Variant:
    """One of the variants compared: a rule, a mode, with feed-forward or without, with outliers or without."""

    method: NamedMethod
    mode: str
    feedforward: bool
    outliers: bool = True

    @property
    def label(self) -> str:
        return f"{self.method.label}, {self.mode}{', feed-forward' if self.feedforward else ''}"


@dataclass(frozen=True)
class Follow:
    """Time series of a variant. Sample k is the state before cycle k, and the command of cycle k."""

    experiment: TrackExperiment
    variant: Variant
    q: Array  #: (N + 1, n)
    qdot: Array  #: (N, n)
    tips: Array  #: (N + 1, 4, 4)
    asked: Array  #: (N, 3) place that the servo was sent to [m]
    stale: Bools  #: (N,) the stream had stopped
    counts: dict[str, int]  #: of the stream's samples, as sigmaik.SampleCounts

    @property
    def position_error(self) -> Array:
        """(N,) [m] from the tip to the true target."""
        error: Array = np.linalg.norm(self.experiment.poses[:, :3, 3] - self.tips[:-1, :3, 3], axis=1)
        return error

    @property
    def orientation_error(self) -> Array:
        """(N,) [rad]"""
        chord = np.linalg.norm(self.experiment.poses[:, :3, :3] - self.tips[:-1, :3, :3], axis=(1, 2))
        angle: Array = 2.0 * np.arcsin(np.minimum(1.0, chord / math.sqrt(8.0)))
        return angle

    @property
    def tip_jerk(self) -> Array:
        """(N − 2,) [m/s³] length of the third difference of the tip's place."""
        jerk: Array = np.linalg.norm(np.diff(self.tips[:, :3, 3], 3, axis=0), axis=1) * self.experiment.settings.rate**3
        return jerk

    @property
    def acceleration(self) -> Array:
        """(N, n) of the command, from rest."""
        out: Array = np.diff(self.qdot, axis=0, prepend=0.0) * self.experiment.settings.rate
        return out

    @property
    def jerk(self) -> Array:
        """(N, n) of the command, from rest."""
        out: Array = np.diff(self.acceleration, axis=0, prepend=0.0) * self.experiment.settings.rate
        return out


def load_track(
    robot: str,
    target: str = "marker",
    settings: TrackSettings | None = None,
    camera: Camera | None = None,
    base: str | None = None,
    tip: str | None = None,
) -> TrackExperiment:
    """The experiment with a shipped arm or a URDF file, and a target of `TARGETS` or a recording's file.

    ValueError where a part is wrong.
    """
    s, camera = settings or TrackSettings(), camera or Camera()
    for name in ("rate", "duration", "gain_linear", "gain_angular", *(("pace",) if s.pace is not None else ())):
        if not 0.0 < getattr(s, name) < math.inf:
            raise ValueError(f"{name} must be positive and finite, not {getattr(s, name):g}")
    for name in ("rate", "noise", "rotation_noise", "delay"):
        least = 1e-3 if name == "rate" else 0.0
        if not least <= getattr(camera, name) < math.inf:
            raise ValueError(f"camera's {name} must be at least {least:g} and finite, not {getattr(camera, name):g}")
    for name in ("dropout", "outliers"):
        if not 0.0 <= getattr(camera, name) < 1.0:
            raise ValueError(f"{name} must be in [0, 1), not {getattr(camera, name):g}")
    if s.seed < 0:
        raise ValueError("seed must not be negative")
    label, chain, home, _ = sk.robots.open(robot, base, tip)
    for name, own, spare in (("acceleration", s.acceleration, ACCELERATION), ("jerk", s.jerk, JERK)):
        limit = np.asarray(getattr(chain.limits, name))
        if own is not None and not own > 0.0:
            raise ValueError(f"{name} must be positive, not {own:g}")
        limit = np.where(np.isfinite(limit), limit, spare) if own is None else np.full(chain.dof, own)
        chain = chain.with_limits(**{name: limit})

    pace, asked = 1.0, None
    if target in TARGETS:
        if s.duration < 4.0:
            raise ValueError(f"duration must be at least 4 s, not {s.duration:g}")
        if s.pace is not None:
            pace = s.pace
        else:
            t = np.arange(round(s.duration * 100.0) + 1) / 100.0
            poses = scripted(target, chain, home, t, s.seed)
            asked = asked_speed(chain, home, poses, reachable_poses(chain, home, poses, 100.0), 100.0)
            pace = 1.0 if asked <= 1.0 else 1.0 / asked
        t = np.arange(round(s.duration / pace * s.rate) + 1) / s.rate
        poses = scripted(target, chain, home, t * pace, s.seed)
    elif pathlib.Path(target).is_file():
        times, recorded = read_recording(target)
        t = np.arange(math.floor((times[-1] - times[0]) * s.rate + 1e-9) + 1) / s.rate
        if len(t) < 2 * START * s.rate:
            raise ValueError(f"recording '{target}' must last {2 * START:g} s at least")
        poses = play(times - times[0], recorded, t)
        target = pathlib.Path(target).stem
    else:
        raise ValueError(f"no target '{target}', and no such file; there are {', '.join(TARGETS)}")
    twists = np.array([sk.pose_error(a, b) for a, b in zip(poses[:-1], poses[1:], strict=True)]) * s.rate
    poses, t = poses[:-1], t[:-1]
    end = len(t) / s.rate
    gap = (end, end)
    if camera.gap is not None:
        gap = (camera.gap[0] * end, min(end, camera.gap[0] * end + camera.gap[1]))
    reachable = reachable_poses(chain, home, poses, s.rate)
    if asked is None:
        asked = asked_speed(chain, home, poses, reachable, s.rate)
    else:
        asked *= pace
    frames = tuple(see(poses, s.rate, s.seed, camera, gap))
    return TrackExperiment(label, target, chain, home, s, camera, poses, twists, reachable, gap, frames, pace, asked)


def follow(
    e: TrackExperiment,
    variant: Variant,
    progress: Callable[[int], None] | None = None,
    look: Callable[[int, Array], Sequence[Frame]] | None = None,
) -> Follow:
    """Follows the target. progress: called with the number of cycles since the last call, every 1000 cycles.

    look: a camera in place of the experiment's frames: called in each cycle k with the arm's configuration, it answers
    with the samples that it has taken since the last call.
    """
    if variant.mode not in MODES:
        raise ValueError(f"no mode '{variant.mode}'; there are {', '.join(MODES)}")
    s, camera = e.settings, e.camera
    dt = 1.0 / s.rate
    servo = sk.Servo(
        e.chain,
        variant.method.method,
        dt=dt,
        gain_linear=s.gain_linear,
        gain_angular=s.gain_angular,
        posture_gain=s.posture_gain,
        guided=s.guided,
    )
    servo.reset(e.start)
    stream = None
    if variant.mode not in ("true", "raw"):
        latency = camera.delay + 2.5 / camera.rate if s.latency is None else s.latency
        stream = sk.TargetStream(
            cast(Literal["hold", "interpolate", "predict"], variant.mode),
            max_speed=s.max_speed,
            max_angular_speed=s.max_angular_speed,
            smoothing=s.smoothing,
            latency=latency,
            # Rotation noise moves the target by the lever from the marker.
            noise_linear=max(1e-4, math.hypot(camera.noise, camera.offset * camera.rotation_noise)),
            noise_angular=max(1e-4, camera.rotation_noise),
        )
        stream.reset(servo.pose)
    frames = [] if look is not None else [f for f in e.frames if variant.outliers or not f.outlier]
    n = len(e.poses)
    q, qdot = np.empty((n + 1, e.chain.dof)), np.empty((n, e.chain.dof))
    asked, stale = np.empty((n, 3)), np.zeros(n, dtype=np.bool_)
    q[0] = e.start
    pose, twist = servo.pose, None
    came, newest = 0, 0.0
    for k in range(n):
        now = k * dt
        if look is not None:
            frames.extend(look(k, q[k]))
        while came < len(frames) and frames[came].arrival <= now + 1e-12:
            frame = frames[came]
            came, newest = came + 1, frame.arrival
            if stream is not None:
                stream.push(frame.stamp, frame.pose)
            else:
                pose = frame.pose if variant.mode == "raw" else pose
        if variant.mode == "true":
            pose, twist = e.poses[k], e.twists[k]
        elif stream is not None:
            target = stream.at(now)
            pose, twist = target.pose, target.twist
            stale[k] = target.status == sk.StreamStatus.STALE
        else:
            stale[k] = now - newest > 0.3
        step = servo.update(pose, twist if variant.feedforward else None)
        q[k + 1], qdot[k], asked[k] = step.q, step.qdot, pose[:3, 3]
        if progress is not None and k % 1000 == 999:
            progress(1000)
    names = ("accepted", "relocated", "outliers", "out_of_order", "invalid")
    counts = {name: getattr(stream.counts, name) if stream is not None else 0 for name in names}
    if variant.mode == "raw":
        counts["accepted"] = came
    return Follow(e, variant, q, qdot, e.chain.pose(q), asked, stale, counts)
