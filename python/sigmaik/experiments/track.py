"""A target that moves: scripted, recorded, or a hand-held marker before a camera, and an arm that follows.

What the camera sees becomes samples, late, noisy, some missing and some wrong; a `sigmaik.TargetStream` makes targets
of them, and a `sigmaik.Servo` at 1 kHz, with all limits on, follows. The camera knows where it is: its own place, and
the marker's on the hand, are exact. A kinematic simulation: the arm does what it is told for 1/rate.

Units: m, rad, s.
"""

from __future__ import annotations

import csv
import dataclasses
import json
import math
import pathlib
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import BinaryIO, Literal, cast

import numpy as np
from numpy.typing import NDArray

import sigmaik as sk
from sigmaik._types import Array

from .methods import NamedMethod
from .paths import make_pose, rotation_rpy
from .storage import write_atomically, write_csv

__all__ = [
    "MODES",
    "TARGETS",
    "Camera",
    "Follow",
    "TrackExperiment",
    "TrackSettings",
    "TrackSummary",
    "Variant",
    "follow",
    "load_track",
    "read_recording",
    "save_follow",
    "save_track_summary",
    "summarize_track",
]
Bools = NDArray[np.bool_]

#: Names of targets, and what they are. All begin and end at the arm's home, and at rest.
TARGETS: dict[str, str] = {
    "marker": "hand-held: wanders and turns, goes 0.15 m out of reach, and comes back",
    "circle": "0.1 m of radius, upright, across the arm's plane",
    "line": "0.2 m to both sides",
    "eight": "a lying eight, 0.2 m to both sides",
    "out-and-back": "straight out, 0.15 m beyond reach, and back",
}
#: How samples become targets.
MODES: dict[str, str] = {
    "true": "the target's pose and twist, known without a camera: the bound",
    "raw": "each sample goes to the servo as it comes, and stays until the next",
    "hold": "TargetStream, at the last sample",
    "interpolate": "TargetStream, through the samples, late",
    "predict": "TargetStream, where a Kalman filter expects it now",
}
BEYOND = 0.15  #: [m] out of reach
START = 1.0  #: [s] that are not judged: the servo's soft start
#: [s] that are not judged after the gap, and after the target was out of reach: the way back to it.
RETURN = 2.0
BACK = 0.1  #: [m]: so near the tip is back, whatever its lag
#: Within reach is what a servo without limits of speed comes this close to [m, rad].
NEAR = (2e-3, 1e-2)
#: Beyond a limit by less, of the limit, is rounding: that of finite differences.
TOLERANCE = 1e-7
#: The least limits that are missing are given: arms' descriptions seldom have jerk, and some no acceleration.
ACCELERATION, JERK = 20.0, 1000.0


@dataclass(frozen=True)
class Camera:
    """How the target is seen."""

    rate: float = 30.0  #: [Hz]
    noise: float = 2e-3  #: [m] standard deviation of the marker's place, each axis
    rotation_noise: float = 1e-2  #: [rad] of its orientation
    dropout: float = 0.1  #: share of the pictures without a marker
    delay: float = 0.05  #: [s] from the picture to the sample
    outliers: float = 0.03  #: share of the samples that are elsewhere, or turned over
    #: [m] from the marker to the target, along the marker's z: noise of the orientation becomes noise of the position.
    offset: float = 0.15
    gap: tuple[float, float] | None = (0.8, 1.5)  #: from this part of the time the stream stops for so long [s]


@dataclass(frozen=True)
class TrackSettings:
    """How the loop runs, and for how long."""

    rate: float = 1000.0  #: [Hz]
    duration: float = 20.0  #: [s]; of a recording, all of it
    seed: int = 0
    gain_linear: float = 5.0  #: [1/s]
    gain_angular: float = 5.0  #: [1/s]
    posture_gain: float = 0.0  #: [1/s] towards home, where the arm is redundant
    smoothing: float = 0.05  #: [s] of the stream
    latency: float | None = None  #: [s] of "interpolate"; None: the camera's delay, and two pictures and a half
    max_speed: float = 1.5  #: [m/s] of the stream
    max_angular_speed: float = 4.0  #: [rad/s]
    acceleration: float | None = None  #: limit of all joints; None: the arm's own, or ACCELERATION where it has none
    jerk: float | None = None  #: limit of all joints; None: the arm's own, or JERK where it has none


@dataclass(frozen=True)
class _Frame:
    stamp: float  #: [s] when the picture was taken
    arrival: float  #: [s] when the sample comes
    pose: Array  #: (4, 4) of the target, as seen
    outlier: bool


@dataclass(frozen=True)
class TrackExperiment:
    """An arm, a target's motion, and how it is seen."""

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
    frames: tuple[_Frame, ...]

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
        """(N,) within reach, and out of it less than RETURN before."""
        out = np.zeros(len(self.poses), dtype=np.bool_)
        for k in self.back:
            out[k : k + round(RETURN * self.settings.rate)] = True
        return out & self.reachable


@dataclass(frozen=True)
class Variant:
    """What is compared: a rule, a mode, with the target's twist fed forward or not, with outliers or without."""

    method: NamedMethod
    mode: str
    feedforward: bool
    outliers: bool = True

    @property
    def label(self) -> str:
        return f"{self.method.label}, {self.mode}{', feed-forward' if self.feedforward else ''}"


@dataclass(frozen=True)
class Follow:
    """What came out. Sample k is the state before cycle k, and the cycle's command."""

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
        """(N,) [m] from the tip to where the target truly is."""
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


@dataclass(frozen=True)
class TrackSummary:
    """One variant. NaN where there is nothing to say. Errors are against the true target, where judged."""

    method: str
    mode: str
    feedforward: bool
    position_mean: float  #: [m] within reach
    position_95: float  #: 95 % of the time it is less
    position_max: float
    orientation_mean: float  #: [rad] within reach
    orientation_95: float
    orientation_max: float
    outside_mean: float  #: [m] while the target is out of reach
    outside_max: float
    return_time: float  #: [s] after the target is back within reach, until the tip stays near; the longest
    delay: float  #: [s] by which the tip's velocity is most like the target's, within reach
    tip_jerk_rms: float  #: [m/s³]
    tip_jerk_max: float
    joint_jerk_rms: float  #: [rad/s³]
    joint_jerk_max: float
    broken: int  #: limits, joints times cycles
    speed: float  #: the largest part of a joint's limit
    acceleration: float
    jerk: float
    margin: float  #: [rad or m] the least distance from a position limit
    accepted: int  #: samples
    refused: int  #: outliers, late ones and such as are none
    wrong: int  #: outliers that came; 0 in "true"
    moved_by_outliers: float  #: [m] the tip, against the same run without them; NaN where that was not run
    drift: float  #: [m] of the tip in the gap, from half a second after the stream is stale


# --- the target


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
    for name in ("rate", "duration", "gain_linear", "gain_angular"):
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

    if target in TARGETS:
        if s.duration < 4.0:
            raise ValueError(f"duration must be at least 4 s, not {s.duration:g}")
        t = np.arange(round(s.duration * s.rate) + 1) / s.rate
        poses = _scripted(target, chain, home, t, s.seed)
    elif pathlib.Path(target).is_file():
        times, recorded = read_recording(target)
        t = np.arange(math.floor((times[-1] - times[0]) * s.rate + 1e-9) + 1) / s.rate
        if len(t) < 2 * START * s.rate:
            raise ValueError(f"recording '{target}' must last {2 * START:g} s at least")
        poses = _play(times - times[0], recorded, t)
        target = pathlib.Path(target).stem
    else:
        raise ValueError(f"no target '{target}', and no such file; there are {', '.join(TARGETS)}")
    twists = np.array([sk.pose_error(a, b) for a, b in zip(poses[:-1], poses[1:], strict=True)]) * s.rate
    poses, t = poses[:-1], t[:-1]
    end = len(t) / s.rate
    gap = (end, end)
    if camera.gap is not None:
        gap = (camera.gap[0] * end, min(end, camera.gap[0] * end + camera.gap[1]))
    reachable = _reachable(chain, home, poses, s.rate)
    frames = tuple(_see(poses, s, camera, gap))
    return TrackExperiment(label, target, chain, home, s, camera, poses, twists, reachable, gap, frames)


def _scripted(target: str, chain: sk.Chain, home: Array, t: Array, seed: int) -> Array:
    pose = chain.pose(home)
    out = np.broadcast_to(pose, (len(t), 4, 4)).copy()
    radius = math.hypot(pose[0, 3], pose[1, 3])
    outward = np.array([pose[0, 3], pose[1, 3], 0.0]) / radius if radius > 1e-3 else np.array([1.0, 0.0, 0.0])
    up = np.array([0.0, 0.0, 1.0])
    across = np.cross(up, outward)
    duration = float(t[-1])
    # Whole rounds of about 5 s, up to speed in the first second and down in the last.
    ramp = np.clip(np.minimum(t, duration - t), 0.0, 1.0)
    pace = np.cumsum(_step(ramp))
    turn = 2.0 * math.pi * max(1, round(duration / 5.0)) * (pace - pace[0]) / (pace[-1] - pace[0])
    rng = np.random.default_rng([seed, 1])
    excursion = _excursion(chain, home, outward)
    if target == "circle":
        out[:, :3, 3] += 0.1 * (np.outer(np.sin(turn), across) + np.outer(np.cos(turn) - 1.0, up))
    elif target == "line":
        out[:, :3, 3] += 0.2 * np.outer(np.sin(turn), across)
    elif target == "eight":
        out[:, :3, 3] += np.outer(0.2 * np.sin(turn), across) + np.outer(0.08 * np.sin(2.0 * turn), outward)
    elif target == "out-and-back":
        # sin⁴: out for a tenth of the way's time, at rest at the ends.
        out[:, :3, 3] += np.outer(excursion * np.sin(0.5 * turn / max(1, round(duration / 10.0))) ** 2, outward)
    else:
        hand = _wander(rng, t, 6) * _step(ramp)[:, None]
        out[:, :3, 3] += 0.05 * (hand[:, :1] * outward + hand[:, 1:2] * across + hand[:, 2:3] * up)
        # Out of reach and back between a quarter and six tenths of the time: 2 s out, a stay, 2 s back.
        begin, end = 0.25 * duration, 0.6 * duration
        way = min(2.5, 0.4 * (end - begin))
        u = np.clip(np.minimum(t - begin, end - t) / way, 0.0, 1.0)
        out[:, :3, 3] += np.outer(excursion * _step(u), outward)
        for k in range(len(t)):
            out[k, :3, :3] = sk.rotation_exp(0.12 * hand[k, 3:]) @ pose[:3, :3]
    return out


def _step(u: Array) -> Array:
    """From 0 to 1 with no speed and no acceleration at both ends."""
    step: Array = u**3 * (10.0 - 15.0 * u + 6.0 * u * u)
    return step


def _wander(rng: np.random.Generator, t: Array, columns: int) -> Array:
    """Smooth motion (N, columns) about 0, of variance near 1: what a hand does, at 0.1 to 0.7 Hz."""
    frequency = rng.uniform(0.1, 0.7, size=(8, columns))
    phase = rng.uniform(0.0, 2.0 * math.pi, size=(8, columns))
    waves: Array = np.sin(2.0 * math.pi * frequency * t[:, None, None] + phase).sum(axis=1) / 2.0
    return waves


def read_recording(file: str | pathlib.Path) -> tuple[Array, Array]:
    """Times (M,) [s] and poses (M, 4, 4) of a recorded target.

    CSV: a header line with the columns t [s], x, y, z [m], roll, pitch, yaw [rad, fixed axes], in any order; lines that
    start with # are comments. npz: arrays t (M,) and pose (M, 4, 4).

    ValueError, with the file and what is wrong, where times do not rise, or something is missing or not a number.
    """
    file = pathlib.Path(file)
    try:
        if file.suffix.lower() == ".npz":
            with np.load(file) as arrays:
                times, poses = np.asarray(arrays["t"], dtype=np.float64), np.asarray(arrays["pose"], dtype=np.float64)
            if times.ndim != 1 or poses.shape != (len(times), 4, 4):
                raise ValueError(f"t {times.shape} and pose {poses.shape} must be (M,) and (M, 4, 4)")
        else:
            with file.open(encoding="utf-8", newline="") as stream:
                lines = [line for line in stream if line.strip() and not line.lstrip().startswith("#")]
            rows = list(csv.DictReader(lines, skipinitialspace=True))
            columns = ("t", "x", "y", "z", "roll", "pitch", "yaw")
            table = np.array([[float(row[c]) for c in columns] for row in rows]).reshape(-1, 7)
            times = table[:, 0]
            poses = np.array([make_pose(r[1:4], rotation_rpy(*r[4:])) for r in table])
    except (OSError, KeyError, TypeError, ValueError) as error:
        what = f"no {error}" if isinstance(error, KeyError) else str(error)
        raise ValueError(f"recording '{file}': {what}") from None
    if len(times) < 2 or not np.all(np.isfinite(times)) or not np.all(np.diff(times) > 0.0):
        raise ValueError(f"recording '{file}': there must be two times at least, finite and rising")
    for i, pose in enumerate(poses):
        try:
            sk.pose_error(pose, pose)
        except sk.Error as error:
            raise ValueError(f"recording '{file}', sample {i + 1}: {error}") from None
    return times, poses


def _play(times: Array, poses: Array, t: Array) -> Array:
    """Poses at t: cubic in place, with the slopes of central differences, and turning at a constant rate between."""
    place = poses[:, :3, 3]
    slope = np.gradient(place, times, axis=0)
    at = np.clip(np.searchsorted(times, t, side="right") - 1, 0, len(times) - 2)
    step = times[at + 1] - times[at]
    u = np.clip((t - times[at]) / step, 0.0, 1.0)
    u1, h = u[:, None], step[:, None]
    out = np.tile(np.eye(4), (len(t), 1, 1))
    out[:, :3, 3] = (
        (1 + 2 * u1) * (1 - u1) ** 2 * place[at]
        + u1 * (1 - u1) ** 2 * h * slope[at]
        + u1**2 * (3 - 2 * u1) * place[at + 1]
        - u1**2 * (1 - u1) * h * slope[at + 1]
    )
    turns = [sk.rotation_log(b[:3, :3] @ a[:3, :3].T) for a, b in zip(poses[:-1], poses[1:], strict=True)]
    for k, i in enumerate(at):
        out[k, :3, :3] = sk.rotation_exp(u[k] * turns[i]) @ poses[i, :3, :3]
    return out


def _reach_test(chain: sk.Chain, home: Array) -> Callable[[Array], bool]:
    """Whether a servo that knows position limits alone, and has all the time it needs, comes near a pose from home."""
    servo = sk.Servo(
        chain, sk.JParse(gamma=0.02), dt=0.05, gain_linear=10.0, gain_angular=10.0, soft_start=0.0,
        velocity_limits=False, acceleration_limits=False, jerk_limits=False,
    )  # fmt: skip

    def reaches(pose: Array) -> bool:
        servo.reset(home)
        for _ in range(100):
            error = servo.update(pose).pose_error
            if np.linalg.norm(error[:3]) < NEAR[0] and np.linalg.norm(error[3:]) < NEAR[1]:
                return True
        return False

    return reaches


def _reachable(chain: sk.Chain, home: Array, poses: Array, rate: float) -> Bools:
    reaches = _reach_test(chain, home)
    stride = max(1, round(0.02 * rate))
    return np.repeat([reaches(pose) for pose in poses[::stride]], stride)[: len(poses)]


def _excursion(chain: sk.Chain, home: Array, outward: Array) -> float:
    """[m] from home, outward with home's orientation, to BEYOND the first place out of reach."""
    reaches, pose, way = _reach_test(chain, home), chain.pose(home), 0.0
    while reaches(pose) and way < 5.0:
        way += 0.01
        pose[:3, 3] += 0.01 * outward
    return way + BEYOND


# --- the camera


def _see(poses: Array, s: TrackSettings, camera: Camera, gap: tuple[float, float]) -> list[_Frame]:
    rng = np.random.default_rng([s.seed, 2])
    to_target = np.eye(4)
    to_target[2, 3] = camera.offset
    to_marker = np.linalg.inv(to_target)
    frames = []
    for i in range(math.floor((len(poses) - 1) / s.rate * camera.rate) + 1):
        stamp = i / camera.rate
        # All is drawn for every picture, so that the same pictures are missing whatever the others show.
        noise, turn = rng.normal(size=3), rng.normal(size=3)
        missing, wrong, flipped = rng.random(3)
        off, axis = rng.normal(size=3), rng.normal(size=3)
        distance, angle = rng.uniform(0.1, 0.5), rng.uniform(1.0, 3.0)
        if missing < camera.dropout or gap[0] <= stamp < gap[1]:
            continue
        marker = poses[min(len(poses) - 1, round(stamp * s.rate))] @ to_marker
        marker[:3, 3] += camera.noise * noise
        marker[:3, :3] = sk.rotation_exp(camera.rotation_noise * turn) @ marker[:3, :3]
        outlier = bool(wrong < camera.outliers)
        if outlier and flipped < 0.5:
            marker[:3, :3] = sk.rotation_exp(angle * axis / np.linalg.norm(axis)) @ marker[:3, :3]
        elif outlier:
            marker[:3, 3] += distance * off / np.linalg.norm(off)
        frames.append(_Frame(stamp, stamp + camera.delay, marker @ to_target, outlier))
    return frames


# --- the loop


def follow(e: TrackExperiment, variant: Variant, progress: Callable[[int], None] | None = None) -> Follow:
    """Follows the target. progress: called now and then with the number of cycles since the last call."""
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
    frames = [f for f in e.frames if variant.outliers or not f.outlier]
    n = len(e.poses)
    q, qdot = np.empty((n + 1, e.chain.dof)), np.empty((n, e.chain.dof))
    asked, stale = np.empty((n, 3)), np.zeros(n, dtype=np.bool_)
    q[0] = e.start
    pose, twist = servo.pose, None
    came, newest = 0, 0.0
    for k in range(n):
        now = k * dt
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


# --- figures


def summarize_track(run: Follow, without: Follow | None = None) -> TrackSummary:
    """A variant's figures. without: the same without outliers."""
    e, chain = run.experiment, run.experiment.chain
    limits = chain.limits
    inside, outside = e.judged & e.reachable, e.judged & ~e.reachable
    position, orientation = run.position_error, run.orientation_error
    ratios = [np.abs(run.qdot) / limits.velocity, np.abs(run.acceleration) / limits.acceleration]
    ratios.append(np.abs(run.jerk) / limits.jerk)
    margin = np.minimum(run.q - limits.lower, limits.upper - run.q)
    broken = sum(int((ratio > 1.0 + TOLERANCE).sum()) for ratio in ratios) + int((margin < -TOLERANCE).sum())
    frames = e.frames if run.variant.outliers else [f for f in e.frames if not f.outlier]
    return TrackSummary(
        method=run.variant.method.label,
        mode=run.variant.mode,
        feedforward=run.variant.feedforward,
        position_mean=_mean(position[inside]),
        position_95=_quantile(position[inside]),
        position_max=_largest(position[inside]),
        orientation_mean=_mean(orientation[inside]),
        orientation_95=_quantile(orientation[inside]),
        orientation_max=_largest(orientation[inside]),
        outside_mean=_mean(position[outside]),
        outside_max=_largest(position[outside]),
        return_time=_return_time(run),
        delay=_delay(run),
        tip_jerk_rms=float(np.sqrt(np.mean(run.tip_jerk**2))),
        tip_jerk_max=float(run.tip_jerk.max()),
        joint_jerk_rms=float(np.sqrt(np.mean(run.jerk**2))),
        joint_jerk_max=float(np.abs(run.jerk).max()),
        broken=broken,
        speed=float(ratios[0].max()),
        acceleration=float(ratios[1].max()),
        jerk=float(ratios[2].max()),
        margin=float(margin.min()),
        accepted=run.counts["accepted"],
        refused=run.counts["outliers"] + run.counts["out_of_order"] + run.counts["invalid"],
        wrong=0 if run.variant.mode == "true" else sum(frame.outlier for frame in frames),
        moved_by_outliers=math.nan
        if without is None
        else float(np.linalg.norm(run.tips[:, :3, 3] - without.tips[:, :3, 3], axis=1).max()),
        drift=_drift(run),
    )


def _delay(run: Follow) -> float:
    """[s] the lag of the largest correlation of both velocities, by the parabola through it and its neighbours."""
    e = run.experiment
    rate = e.settings.rate
    stride = max(1, round(rate / 200.0))  # no need for more
    target = np.diff(e.poses[::stride, :3, 3], axis=0)
    tip = np.diff(run.tips[:-1:stride, :3, 3], axis=0)
    counts = (e.judged & e.reachable)[::stride][:-1]
    longest = round(0.8 * rate / stride)
    lags = np.arange(-longest // 8, longest + 1)
    n = len(target)
    likeness = np.full(len(lags), -1.0)
    for i, lag in enumerate(lags.tolist()):
        a, b = max(0, -lag), min(n, n - lag)
        both = counts[a:b] & counts[a + lag : b + lag]
        x, y = target[a:b][both], tip[a + lag : b + lag][both]
        size = math.sqrt(float(np.sum(x * x) * np.sum(y * y)))
        if size > 0.0:
            likeness[i] = float(np.sum(x * y)) / size
    best = int(np.argmax(likeness))
    if not 0 < best < len(lags) - 1 or likeness[best] <= 0.0:
        return math.nan
    before, at, after = (float(x) for x in likeness[best - 1 : best + 2])
    bend = before - 2.0 * at + after
    offset = 0.5 * (before - after) / bend if bend < 0.0 else 0.0
    return (float(lags[best]) + offset) * stride / rate


def _return_time(run: Follow) -> float:
    e = run.experiment
    error, rate = run.position_error, e.settings.rate
    times = [math.nan]
    for k in e.back:
        # Until it leaves again, or the stream stops, 5 s at most.
        until = next(
            (
                j
                for j in range(k, min(len(error), k + round(5.0 * rate)))
                if not e.reachable[j] or j == round(e.gap[0] * rate)
            ),
            None,
        )
        part = error[k : k + round(5.0 * rate) if until is None else until]
        away = np.flatnonzero(part > BACK)
        times.append((int(away[-1]) + 1) / rate if len(away) else 0.0)
    return float(np.nanmax(times)) if len(times) > 1 else math.nan


def _drift(run: Follow) -> float:
    """[m] how far the tip goes in the gap, from half a second after the stream is stale."""
    e = run.experiment
    if run.variant.mode == "true":
        return math.nan
    stopped = run.stale & (e.t >= e.gap[0]) & (e.t < e.gap[1])
    at = np.flatnonzero(stopped)[round(0.5 * e.settings.rate) :]
    if len(at) == 0:
        return math.nan
    return float(np.linalg.norm(run.tips[at, :3, 3] - run.tips[at[0], :3, 3], axis=1).max())


def _mean(values: Array) -> float:
    return float(values.mean()) if len(values) else math.nan


def _quantile(values: Array) -> float:
    return float(np.quantile(values, 0.95)) if len(values) else math.nan


def _largest(values: Array) -> float:
    return float(values.max()) if len(values) else math.nan


# --- files


def save_track_summary(rows: Sequence[TrackSummary], file: pathlib.Path) -> pathlib.Path:
    """A CSV file: a column per field of `TrackSummary`, a line per variant, SI units."""
    names = [field.name for field in dataclasses.fields(TrackSummary)]
    lines = ([getattr(row, name) for name in names] for row in rows)
    return write_atomically(file, lambda stream: write_csv(stream, names, lines))


def save_follow(run: Follow, file: pathlib.Path) -> pathlib.Path:
    """An npz file, which numpy.load(file) reads.

    t (N,), q (N + 1, n), qdot (N, n), tip (N + 1, 4, 4), target (N, 4, 4), asked (N, 3), reachable, judged, stale (N,)
    as in `Follow` and `TrackExperiment`; frames' stamp, arrival, outlier (M,) and seen (M, 4, 4); joint_names, variant,
    settings and camera (JSON), version.
    """
    e = run.experiment

    def write(stream: BinaryIO) -> None:
        np.savez_compressed(
            stream,
            t=e.t,
            q=run.q,
            qdot=run.qdot,
            tip=run.tips,
            target=e.poses,
            asked=run.asked,
            reachable=e.reachable,
            judged=e.judged,
            stale=run.stale,
            stamp=np.array([frame.stamp for frame in e.frames]),
            arrival=np.array([frame.arrival for frame in e.frames]),
            outlier=np.array([frame.outlier for frame in e.frames]),
            seen=np.array([frame.pose for frame in e.frames]).reshape(-1, 4, 4),
            joint_names=np.array(e.chain.joint_names),
            variant=np.array(run.variant.label),
            settings=np.array(json.dumps(dataclasses.asdict(e.settings))),
            camera=np.array(json.dumps(dataclasses.asdict(e.camera))),
            version=np.array(sk.__version__),
        )

    return write_atomically(file, write)
