"""Targets that move: scripted or recorded, within an arm's reach and outside."""

from __future__ import annotations

import csv
import math
import pathlib
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

import sigmaik as sk
from sigmaik._types import Array
from sigmaik_lab.reach.paths import make_pose, rotation_rpy

__all__ = ["TARGETS", "asked_speed", "play", "reachable_poses", "read_recording", "scripted"]

#: Scripted targets. Every target begins and ends at the arm's home, and at rest.
TARGETS: dict[str, str] = {
    "marker": "hand-held: wanders and turns, goes 0.15 m out of reach, and comes back",
    "circle": "0.1 m of radius, upright, across the arm's plane",
    "line": "0.2 m to both sides",
    "eight": "a lying eight, 0.2 m to both sides",
    "out-and-back": "straight out, 0.15 m beyond reach, and back",
}
BEYOND = 0.15  #: [m] out of reach
#: A pose is within reach where a servo without speed limits comes this close to the pose [m, rad].
NEAR = (2e-3, 1e-2)
STRIDE = 0.02  #: [s] between the poses that are tested


def scripted(target: str, chain: sk.Chain, home: Array, t: Array, seed: int) -> Array:
    """Poses (N, 4, 4) of one of `TARGETS` at times t (N,) [s]."""
    pose = chain.pose(home)
    out = np.broadcast_to(pose, (len(t), 4, 4)).copy()
    radius = math.hypot(pose[0, 3], pose[1, 3])
    outward = np.array([pose[0, 3], pose[1, 3], 0.0]) / radius if radius > 1e-3 else np.array([1.0, 0.0, 0.0])
    up = np.array([0.0, 0.0, 1.0])
    across = np.cross(up, outward)
    duration = float(t[-1])
    # Whole rounds of about 5 s; the target gains speed in the first second and loses speed in the last.
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
    """A step from 0 to 1 with no speed and no acceleration at both ends."""
    step: Array = u**3 * (10.0 - 15.0 * u + 6.0 * u * u)
    return step


def _wander(rng: np.random.Generator, t: Array, columns: int) -> Array:
    """Smooth motion (N, columns) about zero with a variance near 1, at the 0.1 to 0.7 Hz of a human hand."""
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


def play(times: Array, poses: Array, t: Array) -> Array:
    """Poses at t: positions are cubic, with the slopes of central differences; turns between samples are uniform."""
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
    """A test whether a servo with position limits alone, and with time to settle, reaches a pose from home."""
    servo = sk.Servo(
        chain, sk.JParse(gamma=0.02, adaptive=False), dt=0.05, gain_linear=10.0, gain_angular=10.0,
        max_linear_error=0.25, length_scale=1.0, soft_start=0.0,
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


def reachable_poses(chain: sk.Chain, home: Array, poses: Array, rate: float) -> NDArray[np.bool_]:
    """(N,) which of the poses (N, 4, 4) an arm reaches from home, tested every 20 ms."""
    reaches = _reach_test(chain, home)
    stride = max(1, round(STRIDE * rate))
    return np.repeat([reaches(pose) for pose in poses[::stride]], stride)[: len(poses)]


def asked_speed(chain: sk.Chain, home: Array, poses: Array, reachable: NDArray[np.bool_], rate: float) -> float:
    """How fast the target's poses (N, 4, 4) ask the joints to be, as a part of the joints' velocity limits.

    An arm without velocity, acceleration and jerk limits follows the target from home. Where the target is within reach
    and the tip is at the target, J-PARSE (γ = 0.1, not adaptive) maps the target's twist to joint velocities. The
    answer is the largest of these velocities. The answer is 0 where no joint has a velocity limit.
    """
    stride = max(1, round(STRIDE * rate))
    dt, way = stride / rate, poses[::stride]
    servo = sk.Servo(chain, dt=dt, soft_start=0.0, velocity_limits=False, acceleration_limits=False, jerk_limits=False)
    solver = sk.VelocitySolver(sk.JParse(adaptive=False), servo.length_scale)
    servo.reset(home)
    largest = 0.0
    for here, there, within in zip(way[:-1], way[1:], reachable[::stride][:-1], strict=True):
        twist = sk.pose_error(here, there) / dt
        jacobian = chain.jacobian(servo.q)
        error = servo.update(here, twist).pose_error
        if within and np.linalg.norm(error[:3]) < 5.0 * NEAR[0] and np.linalg.norm(error[3:]) < 5.0 * NEAR[1]:
            speed = np.abs(solver.solve(jacobian, twist).qdot)
            largest = max(largest, float(np.max(speed / chain.limits.velocity)))
    return largest


def _excursion(chain: sk.Chain, home: Array, outward: Array) -> float:
    """[m] from home, outward with home's orientation, to BEYOND the first place out of reach."""
    reaches, pose, way = _reach_test(chain, home), chain.pose(home), 0.0
    while reaches(pose) and way < 5.0:
        way += 0.01
        pose[:3, 3] += 0.01 * outward
    return way + BEYOND
