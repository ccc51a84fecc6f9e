"""Whether a recording is one: what can be judged and replayed, and what is refused, with the reason."""

from __future__ import annotations

import enum
import math
from collections.abc import Collection
from typing import Any

import numpy as np
from numpy.typing import NDArray

import sigmaik as sk
from sigmaik._types import Array

__all__ = ["LONGEST_CYCLE", "check_motion", "check_samples", "fit_samples", "sample_dtype"]
Samples = NDArray[np.void]

#: [s] the longest cycle of a servo that a recording may have.
LONGEST_CYCLE = 1.0

#: Fields that older recordings do not have, with their value there.
_LATER = {"singular_directions": math.nan, "state": -1, "guide": int(sk.GuideState.OFF), "guide_joints": 0}
_NAMED: dict[str, type[enum.IntEnum]] = {
    "state": sk.LoopState,
    "status": sk.Status,
    "command": sk.LoopCommand,
    "guide": sk.GuideState,
}
#: Fields that have numbers in every cycle. The others are NaN where no rule has run.
_FINITE = ("time", "q", "qdot", "target", "pose", "pose_error", "asked_twist", "achieved_twist", "scale")


def sample_dtype(chain: sk.Chain) -> np.dtype[Any]:
    """The type of a sample of this arm, as `ServoLoop.read` gives samples."""
    # Without limits: a servo warns of limits that the arm does not have.
    servo = sk.Servo(chain, position_limits=False, velocity_limits=False, acceleration_limits=False, jerk_limits=False)
    servo.reset(chain.random_configuration(0))
    dtype: np.dtype[Any] = sk.ServoLoop(servo, history=2).read().dtype
    return dtype


def fit_samples(arrays: dict[str, NDArray[Any]], chain: sk.Chain) -> Samples:
    """(N,) the arrays of a file as samples of an arm. Error where an array is missing, or has another type or shape."""
    dtype = sample_dtype(chain)
    assert dtype.names is not None
    missing = [name for name in dtype.names if name not in arrays and name not in _LATER]
    if missing:
        raise sk.Error(f"it has no {', '.join(missing)}")
    cycles = arrays["cycle"]
    samples: Samples = np.empty(len(cycles) if cycles.ndim else 0, dtype)
    for name in dtype.names:
        field = dtype[name]
        shape = (len(samples), *field.shape)
        values = arrays.get(name)
        if values is None:
            samples[name] = _LATER[name]
            continue
        if values.shape != shape:
            raise sk.Error(f"{name} has shape {values.shape}, and an arm of {chain.dof} joints needs {shape}")
        numbers = "f" if field.base.kind == "f" else "b" if field.base.kind == "b" else "iu"
        if values.dtype.kind not in numbers:
            raise sk.Error(f"{name} has the type {values.dtype}, not {field.base}")
        samples[name] = values
        if field.base.kind in "iu" and not np.array_equal(samples[name], values):
            raise sk.Error(f"{name} has a number that is no {field.base}")
    return samples


def check_motion(samples: Samples, dt: float, configurations: Collection[int]) -> None:
    """Error where limits cannot be judged: no cycle, dt, NaN, cycles that go back, unknown configurations."""
    if not 0.0 < dt <= LONGEST_CYCLE:  # NaN as well
        raise sk.Error(f"dt = {dt:g} s is not above 0 and at most {LONGEST_CYCLE:g} s")
    if len(samples) == 0:
        raise sk.Error("it has no cycle")
    for name in ("q", "qdot"):
        _require_finite(samples, name)
    if samples["cycle"][0] < 0 or (np.diff(samples["cycle"]) <= 0).any():
        raise sk.Error("the numbers of its cycles do not grow")
    unknown = set(np.unique(samples["configuration"]).tolist()) - set(configurations)
    if unknown:
        raise sk.Error(f"it has no settings of configuration {min(unknown)}")


def check_samples(
    samples: Samples, dt: float, configurations: Collection[int], home: Array, before: tuple[Array, Array]
) -> None:
    """Error where a recording can be neither judged nor drawn nor replayed, with the field and the first cycle."""
    check_motion(samples, dt, configurations)
    for name in _FINITE:
        _require_finite(samples, name)
    for name, values in _NAMED.items():
        known = np.isin(samples[name], [_LATER.get(name, 0), *(int(value) for value in values)])
        if not known.all():
            at = int(np.argmin(known))
            raise sk.Error(
                f"{name} {int(samples[name][at])} in row {at} is none of {', '.join(v.name for v in values)}"
            )
    if (np.diff(samples["time"]) < 0.0).any():
        raise sk.Error("its clock goes back")
    for name in ("pose", "target"):
        _require_poses(samples[name], name)
    dof = samples["q"].shape[1]
    for name, joints in (("home", home), ("before", before[0]), ("before", before[1])):
        if np.shape(joints) != (dof,) or not np.isfinite(joints).all():
            raise sk.Error(f"{name} must be {dof} finite numbers")
    if np.isinf(samples["singular_values"]).any() or (samples["singular_values"] < 0.0).any():
        raise sk.Error("singular_values has a number that is infinite or negative")


def _require_finite(samples: Samples, name: str) -> None:
    bad = ~np.isfinite(samples[name]).reshape(len(samples), -1).all(axis=1)
    if bad.any():
        raise sk.Error(f"{name} has {int(bad.sum())} rows that are not finite; the first is row {int(np.argmax(bad))}")


def _require_poses(poses: Array, name: str) -> None:
    rotation = poses[:, :3, :3]
    off = np.abs(rotation @ rotation.transpose(0, 2, 1) - np.eye(3)).max(axis=(1, 2))
    bad = ~(off < 1e-6) | (np.abs(poses[:, 3] - (0.0, 0.0, 0.0, 1.0)).max(axis=1) > 1e-9)
    bad |= np.linalg.det(rotation) < 0.0
    if bad.any():
        raise sk.Error(f"{name} in row {int(np.argmax(bad))} is no pose")
