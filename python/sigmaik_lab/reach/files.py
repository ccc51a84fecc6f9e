"""Runs as files, each written whole or not at all.

A run is an npz file with the arrays

    t (N,) [s]   segment (N,)   q (N, n)   qdot (N, n)   target (N, 3) [m]   pose_error (N, 6) [m, rad]
    singular_values (N, min(6, n))   status (N,)   scale (N,)

as in `Run`, and with robot, path, method, velocity_limits, joint_names, segment_names, velocity (n,) (the
arm's speed limits), settings (JSON) and version. numpy.load(file) reads the file, without pickles. A run can
also be a CSV file with a line per sample and the columns

    t, segment, q_<joint>…, qdot_<joint>…, target_x, target_y, target_z, error_x, error_y, error_z,
    error_rx, error_ry, error_rz, sigma_1…, status, scale
"""

from __future__ import annotations

import dataclasses
import json
import pathlib
from collections.abc import Callable
from typing import BinaryIO

import numpy as np

import sigmaik as sk
from sigmaik.files import write_atomically
from sigmaik_lab.csv_file import write_csv

from .experiment import Run

__all__ = ["save_run"]


def save_run(run: Run, file: str | pathlib.Path, form: str = "npz") -> pathlib.Path:
    """Time series of a run, see above. Returns the file's path."""
    return write_atomically(pathlib.Path(file), lambda stream: _WRITERS[form](run, stream))


def _npz(run: Run, stream: BinaryIO) -> None:
    e = run.experiment
    np.savez_compressed(
        stream,
        t=run.t,
        segment=run.segment,
        q=run.q,
        qdot=run.qdot,
        target=run.target,
        pose_error=run.pose_error,
        singular_values=run.singular_values,
        status=run.status,
        scale=run.scale,
        robot=np.array(e.robot),
        path=np.array(e.path.name),
        method=np.array(run.method.label),
        velocity_limits=np.array(run.velocity_limits),
        joint_names=np.array(e.chain.joint_names),
        segment_names=np.array([segment.name for segment in e.path.segments]),
        velocity=np.array(e.chain.limits.velocity),
        settings=np.array(json.dumps(dataclasses.asdict(e.settings))),
        version=np.array(sk.__version__),
    )


def _csv(run: Run, stream: BinaryIO) -> None:
    names = run.experiment.chain.joint_names
    columns = ["t", "segment", *(f"q_{name}" for name in names), *(f"qdot_{name}" for name in names)]
    columns += [f"target_{axis}" for axis in "xyz"]
    columns += [f"error_{axis}" for axis in ("x", "y", "z", "rx", "ry", "rz")]
    columns += [f"sigma_{i + 1}" for i in range(run.singular_values.shape[1])] + ["status", "scale"]
    rows = (
        [t, segment, *q, *qdot, *target, *error, *sigma, status, scale]
        for t, segment, q, qdot, target, error, sigma, status, scale in zip(
            run.t.tolist(),
            run.segment.tolist(),
            run.q.tolist(),
            run.qdot.tolist(),
            run.target.tolist(),
            run.pose_error.tolist(),
            run.singular_values.tolist(),
            run.status.tolist(),
            run.scale.tolist(),
            strict=True,
        )
    )
    write_csv(stream, columns, rows)


_WRITERS: dict[str, Callable[[Run, BinaryIO], None]] = {"npz": _npz, "csv": _csv}
