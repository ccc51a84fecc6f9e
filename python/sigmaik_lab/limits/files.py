"""Time series as files, each written whole or not at all."""

from __future__ import annotations

import dataclasses
import json
import pathlib
from collections.abc import Sequence
from typing import BinaryIO

import numpy as np
from numpy.typing import NDArray

import sigmaik as sk
from sigmaik.files import write_atomically

from .experiment import Trace

__all__ = ["save_traces"]


def save_traces(traces: Sequence[Trace], file: str | pathlib.Path) -> pathlib.Path:
    """An npz file of one variant in one scenario, which numpy.load(file) reads.

    Per trial i q_i (N + 1, n), qdot_i (N, n), error_i (N, 6), tip_i (N, 3), rule_i (N, 6), held_i (N,), as in
    `Trace`; trials, phases (JSON), joint_names, limits (5, n: lower, upper, velocity, acceleration, jerk),
    settings (JSON) and version.
    """
    first = traces[0]
    limits = first.experiment.chain.limits
    arrays: dict[str, NDArray[np.generic]] = {}
    for i, trace in enumerate(traces):
        for name in ("q", "qdot", "error", "tip", "rule", "held"):
            arrays[f"{name}_{i}"] = getattr(trace, name)
    arrays["trials"] = np.array([trace.trial.name for trace in traces])
    arrays["phases"] = np.array(
        json.dumps([[dataclasses.astuple(phase) for phase in trace.trial.phases] for trace in traces])
    )
    arrays["joint_names"] = np.array(first.experiment.chain.joint_names)
    arrays["limits"] = np.array(
        [limits.lower, limits.upper, limits.velocity, limits.acceleration, limits.jerk], dtype=np.float64
    )
    arrays["settings"] = np.array(json.dumps(dataclasses.asdict(first.experiment.settings)))
    arrays["version"] = np.array(sk.__version__)

    def write(stream: BinaryIO) -> None:
        np.savez_compressed(stream, **arrays)  # type: ignore[arg-type]

    return write_atomically(pathlib.Path(file), write)
