"""Runs as files, each written whole or not at all."""

from __future__ import annotations

import dataclasses
import json
import pathlib
from typing import BinaryIO

import numpy as np

import sigmaik as sk
from sigmaik.files import write_atomically

from .experiment import Follow

__all__ = ["save_follow"]


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
