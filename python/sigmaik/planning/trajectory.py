"""What planners return: a motion on a grid of times, and how the planning went."""

from __future__ import annotations

import json
import pathlib
from dataclasses import asdict, dataclass, field, fields, replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from sigmaik._extras import need
from sigmaik._types import Array
from sigmaik.files import write_atomically

from .clearance import Clearance, Crossing

if TYPE_CHECKING:
    from sigmaik import Chain

__all__ = ["Trajectory"]


@dataclass(frozen=True)
class Trajectory:
    """Joint positions over time, N samples of n joints, and how they were found.

    Between samples acceleration is constant, or, where `cubic`, changes evenly: `sample` is exact. A failed plan has no
    samples: its arrays are empty.
    """

    t: Array = field(repr=False)
    """(N,) [s]"""
    q: Array = field(repr=False)
    """(N, n) [rad or m]"""
    qdot: Array = field(repr=False)
    """(N, n) [rad/s or m/s]"""
    qddot: Array = field(repr=False)
    """(N, n) [rad/s² or m/s²], of the step that begins at the sample, zero in the last row; where `cubic`, at the
    sample."""
    duration: float
    """[s]; nan where the plan failed. See the planner for what it counts."""
    status: str
    """"optimal", a local minimum; "feasible", within all constraints, but with something left to gain; "failed"."""
    cost: float
    """The planner's objective; nan where the plan failed."""
    solve_time: float
    """[s] of wall-clock time, of the optimiser alone."""
    iterations: int = 0
    """Steps of the optimiser, of all starts."""
    starts: int = 1
    """First guesses tried."""
    cubic: bool = False
    """Whether positions are cubic between samples, as the prior of a Gaussian process has them, or quadratic."""
    clearance: Clearance | None = field(default=None, repr=False)
    """How near singularities it comes, between the samples too; None where the plan failed."""

    def sample(self, t: ArrayLike) -> tuple[Array, Array, Array]:
        """q, q̇, q̈ (M, n) at times t (M,) [s], held at the ends. ValueError where there is nothing to sample."""
        times = np.asarray(t, dtype=np.float64)
        if self.t.size == 0:
            raise ValueError(f"this trajectory is empty: its plan {self.status}")
        if times.ndim != 1 or not np.all(np.isfinite(times)):
            raise ValueError(f"t must be finite and of shape (M,), not {times.shape}")
        k = np.clip(np.searchsorted(self.t, times, side="right") - 1, 0, self.t.size - 1)
        s = (np.clip(times, self.t[0], self.t[-1]) - self.t[k])[:, None]
        q, qdot, qddot = self.q[k], self.qdot[k], self.qddot[k]
        if not self.cubic:
            return q + s * (qdot + 0.5 * s * qddot), qdot + s * qddot, qddot.copy()
        after = np.minimum(k + 1, self.t.size - 1)
        jerk = (self.qddot[after] - qddot) / np.maximum(self.t[after] - self.t[k], 1e-300)[:, None]
        return (
            q + s * (qdot + s * (0.5 * qddot + s * jerk / 6.0)),
            qdot + s * (qddot + 0.5 * s * jerk),
            qddot + s * jerk,
        )

    def retimed(self, duration: float) -> Trajectory:
        """The same path in another time [s], faster or slower everywhere by the same factor."""
        if self.t.size == 0:
            raise ValueError(f"this trajectory is empty: its plan {self.status}")
        if not (np.isfinite(duration) and duration > 0.0):
            raise ValueError(f"duration = {duration} must be finite and greater than 0")
        f = duration / self.duration
        near = self.clearance
        if near is not None:
            crossings = tuple(replace(c, t=c.t * f) for c in near.crossings)
            near = replace(near, t=near.t * f, crossings=crossings)
        return replace(
            self,
            t=self.t * f,
            qdot=self.qdot / f,
            qddot=self.qddot / f**2,
            duration=duration,
            clearance=near,
        )

    def plot(self, file: str | pathlib.Path, chain: Chain | None = None) -> pathlib.Path:
        """Writes a picture, `planning.figure.trajectory_figure`, as PNG, whole or not at all. Returns its path.

        ValueError where there is nothing to draw, the chain has other joints, or the file's name does not end in .png;
        MissingPackage where matplotlib is not installed.
        """
        file = pathlib.Path(file)
        if file.suffix.lower() != ".png":
            raise ValueError(f"{file} must end in .png")
        need("matplotlib")
        from sigmaik._plotting import save_figure

        from .figure import trajectory_figure

        return save_figure(trajectory_figure(self, chain), file)

    def save(self, file: str | pathlib.Path) -> pathlib.Path:
        """Writes an npz file that numpy.load reads without pickles, whole or not at all. Returns its path."""
        arrays: dict[str, Array] = {name: getattr(self, name) for name in _ARRAYS}
        about = {f.name: getattr(self, f.name) for f in fields(self) if f.name not in (*_ARRAYS, "clearance")}
        near = self.clearance
        if near is not None:
            arrays |= {
                "clearance_t": near.t,
                "clearance_manipulability": near.manipulability,
                "clearance_psi": near.psi,
            }
            about["clearance"] = {
                "names": near.names,
                "crossings": [{**asdict(c), "q": c.q.tolist()} for c in near.crossings],
            }
        text = np.array(json.dumps(about))
        return write_atomically(
            pathlib.Path(file),
            lambda stream: np.savez_compressed(stream, about=text, **arrays),  # type: ignore[arg-type]
        )

    @staticmethod
    def load(file: str | pathlib.Path) -> Trajectory:
        """What `save` has written. ValueError where the file is something else."""
        try:
            with np.load(file, allow_pickle=False) as data:
                about = json.loads(str(data["about"]))
                arrays = {name: data[name] for name in _ARRAYS}
                near = about.pop("clearance", None)
                if near is not None:
                    crossings = tuple(Crossing(**{**c, "q": np.array(c["q"])}) for c in near["crossings"])
                    near = Clearance(
                        data["clearance_t"],
                        data["clearance_manipulability"],
                        tuple(near["names"]),
                        data["clearance_psi"],
                        crossings,
                    )
            return Trajectory(**arrays, **about, clearance=near)
        except (KeyError, TypeError, ValueError) as error:
            raise ValueError(f"{file} is not the file of a trajectory") from error


_ARRAYS = ("t", "q", "qdot", "qddot")
