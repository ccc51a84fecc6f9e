"""A simulated camera, which sees a target late and with noise, in some pictures not at all, and in some wrongly."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

import sigmaik as sk
from sigmaik._types import Array

__all__ = ["Camera", "Frame", "see"]


@dataclass(frozen=True)
class Camera:
    """The camera's rate, noise, delay and faults."""

    rate: float = 30.0  #: [Hz]
    noise: float = 2e-3  #: [m] standard deviation of the marker's place, each axis
    rotation_noise: float = 1e-2  #: [rad] of its orientation
    dropout: float = 0.1  #: share of the pictures without a marker
    delay: float = 0.05  #: [s] from the picture to the sample
    outliers: float = 0.03  #: share of the samples that are elsewhere, or turned over
    #: [m] from the marker to the target, along the marker's z: noise of the orientation becomes noise of the position.
    offset: float = 0.15
    gap: tuple[float, float] | None = (0.8, 1.5)  #: the stream stops after this part of the time, for this time [s]


@dataclass(frozen=True)
class Frame:
    """A sample that a picture gave."""

    stamp: float  #: [s] when the picture was taken
    arrival: float  #: [s] when the sample comes
    pose: Array  #: (4, 4) of the target, as seen
    outlier: bool


def see(poses: Array, rate: float, seed: int, camera: Camera, gap: tuple[float, float]) -> list[Frame]:
    """The samples that the camera makes of poses (N, 4, 4) at a rate [Hz]; none in the gap between two times [s]."""
    rng = np.random.default_rng([seed, 2])
    to_target = np.eye(4)
    to_target[2, 3] = camera.offset
    to_marker = np.linalg.inv(to_target)
    frames = []
    for i in range(math.floor((len(poses) - 1) / rate * camera.rate) + 1):
        stamp = i / camera.rate
        # Every picture draws all random numbers, so that the missing pictures do not depend on the other options.
        noise, turn = rng.normal(size=3), rng.normal(size=3)
        missing, wrong, flipped = rng.random(3)
        off, axis = rng.normal(size=3), rng.normal(size=3)
        distance, angle = rng.uniform(0.1, 0.5), rng.uniform(1.0, 3.0)
        if missing < camera.dropout or gap[0] <= stamp < gap[1]:
            continue
        marker = poses[min(len(poses) - 1, round(stamp * rate))] @ to_marker
        marker[:3, 3] += camera.noise * noise
        marker[:3, :3] = sk.rotation_exp(camera.rotation_noise * turn) @ marker[:3, :3]
        outlier = bool(wrong < camera.outliers)
        if outlier and flipped < 0.5:
            marker[:3, :3] = sk.rotation_exp(angle * axis / np.linalg.norm(axis)) @ marker[:3, :3]
        elif outlier:
            marker[:3, 3] += distance * off / np.linalg.norm(off)
        frames.append(Frame(stamp, stamp + camera.delay, marker @ to_target, outlier))
    return frames
