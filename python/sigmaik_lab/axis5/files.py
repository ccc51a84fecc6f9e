"""Tracks and their summaries as files, each written whole or not at all."""

from __future__ import annotations

import dataclasses
import json
import pathlib
from collections.abc import Callable, Iterable
from typing import BinaryIO

import numpy as np
from numpy.typing import NDArray

import sigmaik as sk
from sigmaik._types import Array
from sigmaik.files import write_atomically
from sigmaik_lab.csv_file import save_csv, write_csv

from .experiment import ROBOT, Track
from .summary import Summary

__all__ = ["save_summary", "save_track"]


def save_track(track: Track, file: str | pathlib.Path, form: str = "npz") -> pathlib.Path:
    """Time series as npz or CSV. Returns the file's path.

    npz: t, clock (N,) [s]   q, qdot, qddot (N, 6) [rad, rad/s, rad/s²]   error, path_error (N, 6) [m, rad]
    time_scale, optimised, error_active, exact_met (N,), and robot, example, variant, finished, joint_names,
    velocity, acceleration (6,) (the arm's limits), settings (JSON) and version. CSV: the same series.
    """
    writers: dict[str, Callable[[Track, BinaryIO], None]] = {"npz": _npz, "csv": _csv}
    return write_atomically(pathlib.Path(file), lambda stream: writers[form](track, stream))


def save_summary(rows: Iterable[Summary], file: str | pathlib.Path) -> pathlib.Path:
    """Summaries as CSV: a line per variant, SI units; a column per field, or one a joint: speed_ratio_1, …"""
    lines: list[list[object]] = []
    columns: list[str] = []
    for row in rows:
        line: list[object] = []
        columns = []
        for name, value in dataclasses.asdict(row).items():
            if isinstance(value, tuple):
                columns += [f"{name}_{j + 1}" for j in range(len(value))]
                line += value
            else:
                columns.append(name)
                line.append(value)
        lines.append(line)
    return save_csv(file, columns, lines)


def _series(track: Track) -> dict[str, Array | NDArray[np.bool_]]:
    return {
        "t": track.t,
        "clock": track.clock,
        "q": track.q,
        "qdot": track.qdot,
        "qddot": track.qddot,
        "error": track.error,
        "path_error": track.path_error,
        "time_scale": track.time_scale,
        "optimised": track.optimised,
        "error_active": track.error_active,
        "exact_met": track.exact_met,
    }


def _npz(track: Track, stream: BinaryIO) -> None:
    chain, settings = track.motion.chain, dataclasses.asdict(track.settings)
    settings |= {name: getattr(track.motion, name) for name in ("distance", "duration", "offset")}
    facts = {
        "robot": ROBOT,
        "example": track.motion.example,
        "variant": track.variant,
        "finished": track.finished,
        "joint_names": chain.joint_names,
        "velocity": chain.limits.velocity,
        "acceleration": chain.limits.acceleration,
        "settings": json.dumps(settings),
        "version": sk.__version__,
    }
    arrays: dict[str, NDArray[np.generic]] = {name: np.asarray(value) for name, value in facts.items()}
    np.savez_compressed(stream, **_series(track), **arrays)  # type: ignore[arg-type]


def _csv(track: Track, stream: BinaryIO) -> None:
    columns: list[str] = []
    blocks = []
    for name, values in _series(track).items():
        if values.ndim == 1:
            columns.append(name)
        else:
            ends = ("x", "y", "z", "rx", "ry", "rz") if "error" in name else track.motion.chain.joint_names
            columns += [f"{name}_{end}" for end in ends]
        blocks.append(values.reshape(len(values), -1).astype(np.float64))
    write_csv(stream, columns, np.hstack(blocks).tolist())
