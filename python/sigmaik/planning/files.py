"""Pictures and files of trajectories: the functions that `Trajectory.plot`, `save` and `load` call."""

from __future__ import annotations

import json
import os
import pathlib

import numpy as np

from sigmaik._core import Chain, Clearance, Crossing, Error, Trajectory
from sigmaik._extras import need
from sigmaik._types import Array
from sigmaik.files import write_atomically

__all__ = ["load", "plot", "save"]

ARRAYS = ("t", "q", "qdot", "qddot")
NUMBERS = ("duration", "cost", "solve_time", "iterations", "starts", "cubic")


def plot(trajectory: Trajectory, file: str | os.PathLike[str], chain: Chain | None) -> pathlib.Path:
    """Writes `figure.trajectory_figure` as PNG."""
    path = pathlib.Path(file)
    if path.suffix.lower() != ".png":
        raise Error(f"{path} must end in .png")
    need("matplotlib")
    from sigmaik._plotting import save_figure

    from .figure import trajectory_figure

    return save_figure(trajectory_figure(trajectory, chain), path)


def save(trajectory: Trajectory, file: str | os.PathLike[str]) -> pathlib.Path:
    """Writes the text that C++ reads for .csv, else an npz file."""
    path = pathlib.Path(file)
    if path.suffix.lower() == ".csv":
        path.parent.mkdir(parents=True, exist_ok=True)
        trajectory._save_text(str(path))
        return path
    arrays: dict[str, Array] = {name: getattr(trajectory, name) for name in ARRAYS}
    about = {name: getattr(trajectory, name) for name in NUMBERS} | {"status": str(trajectory.status)}
    near = trajectory.clearance
    if near is not None:
        arrays |= {
            "clearance_t": near.t,
            "clearance_manipulability": near.manipulability,
            "clearance_psi": near.psi,
        }
        crossings = [
            {"name": c.name, "t": c.t, "q": c.q.tolist(), "psi": c.psi, "avoidable": c.avoidable}
            for c in near.crossings
        ]
        about["clearance"] = {"names": near.names, "crossings": crossings}
    text = np.array(json.dumps(about))
    return write_atomically(
        path,
        lambda stream: np.savez_compressed(stream, about=text, **arrays),  # type: ignore[arg-type]
    )


def load(file: str | os.PathLike[str]) -> Trajectory:
    """Reads a file of either kind."""
    path = pathlib.Path(file)
    if path.suffix.lower() == ".csv":
        return Trajectory._load_text(str(path))
    try:
        with np.load(path, allow_pickle=False) as data:
            about = json.loads(str(data["about"]))
            arrays = {name: data[name] for name in ARRAYS}
            near = about.pop("clearance", None)
            if near is not None:
                near = Clearance(
                    data["clearance_t"],
                    data["clearance_manipulability"],
                    near["names"],
                    data["clearance_psi"],
                    [Crossing(**crossing) for crossing in near["crossings"]],
                )
        return Trajectory(**arrays, **about, clearance=near)
    except (KeyError, TypeError, ValueError) as error:
        raise Error(f"{path} is not the file of a trajectory") from error
