"""A recording: every cycle of a servo, with everything that a replay needs.

A recording as an npz file (numpy.load reads the file, without pickles) has an array of N rows for each field of
`ServoLoop.read`:

    cycle, time [s], command (0 hold, 1 pose, 2 twist, 3 stale), configuration, state (sigmaik.LoopState; -1
    in recordings of before), restarted, status (sigmaik.Status),
    q (N, n), qdot (N, n), target (N, 4, 4), pose (N, 4, 4), pose_error (N, 6), asked_twist (N, 6),
    achieved_twist (N, 6), singular_values (N, min(6, n)), singular (bits), singular_directions (N, 6, 6),
    limiting_joints (bits), scale, guide (sigmaik.GuideState), guide_joints (bits)

and joint_names, lower, upper, velocity, acceleration (n,) (the limits that the servo held), home (n,), before (2, n)
(q and q̇ before the first cycle), urdf (the arm's text), and meta: JSON with robot, base, tip, dt, settings (a
configuration's number to its settings) and version.

A recording as a parquet file (extra `viewer`) has a row for each cycle, and columns for tools of imitation learning:

    timestamp [s] from 0, frame_index, episode_index, observation.state (n,) q, observation.velocity (n,) q̇,
    action (6,) the twist that was asked for [v; ω], pose (16,) the tip's, row by row, command, status, guide (text)

with the same meta in the schema's metadata.
"""

from __future__ import annotations

import dataclasses
import enum
import json
import math
import pathlib
import zipfile
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, BinaryIO

import numpy as np
from numpy.typing import NDArray

import sigmaik as sk
from sigmaik._extras import need
from sigmaik._types import Array
from sigmaik.files import write_atomically

from .settings import Settings

__all__ = ["Arm", "Episode"]
Samples = NDArray[np.void]

_LIMITS = ("lower", "upper", "velocity", "acceleration")
#: Fields that older recordings do not have, with type, shape of a row, and value there.
_LATER: dict[str, tuple[str, tuple[int, ...], float]] = {
    "singular_directions": ("<f8", (6, 6), math.nan),
    "state": ("i1", (), -1),
    "guide": ("i1", (), int(sk.GuideState.OFF)),
    "guide_joints": ("<u2", (), 0),
}


@dataclass(frozen=True)
class Arm:
    """The arm of a recording."""

    name: str
    urdf: str  #: text
    chain: sk.Chain  #: with the limits that the servo kept
    home: Array  #: (n,) the posture [rad or m]


@dataclass(frozen=True)
class Episode:
    """A recording of a `Session`."""

    samples: Samples  #: (N,) as `ServoLoop.read` gives them
    arm: Arm
    dt: float  #: [s]
    settings: Mapping[int, Settings]  #: of each configuration in `samples`
    before: tuple[Array, Array]  #: q and q̇ (n,) before the first cycle

    def __len__(self) -> int:
        return len(self.samples)

    def __getitem__(self, field: str) -> NDArray[Any]:
        """A field of all samples."""
        values: NDArray[Any] = self.samples[field]
        return values

    @property
    def duration(self) -> float:
        """[s] of the arm's time."""
        return len(self) * self.dt

    @property
    def runs(self) -> list[slice]:
        """Spans without a missing cycle and without a restart of the arm at another place."""
        cuts = np.flatnonzero((np.diff(self["cycle"]) != 1) | self["restarted"][1:]) + 1
        edges = [0, *cuts.tolist(), len(self)]
        return [slice(a, b) for a, b in zip(edges[:-1], edges[1:], strict=True)]

    def broken_limits(self) -> dict[str, int]:
        """The number of joints times cycles beyond a limit by more than rounding, while limits were on.

        The keys are position, velocity and acceleration. The first cycles after a start outside the limits count, too.
        """
        limits = self.arm.chain.limits
        settings = [self.settings[number] for number in self["configuration"].tolist()]
        on = np.array([s.limits for s in settings], dtype=bool)
        assumed = np.array([s.assumed_acceleration for s in settings])[:, None]
        acceleration = np.where(np.isfinite(limits.acceleration), limits.acceleration, assumed)
        q, qdot = self["q"], self["qdot"]
        beyond = (q < limits.lower - 1e-9) | (q > limits.upper + 1e-9)
        fast = np.abs(qdot) > limits.velocity * (1.0 + 1e-9)
        count = {"position": int(beyond[on].sum()), "velocity": int(fast[on].sum()), "acceleration": 0}
        for run in self.runs:
            change = np.abs(np.diff(qdot[run], axis=0)) / self.dt
            hard = change > acceleration[run][1:] * (1.0 + 1e-6)
            # The velocity before the limits were switched on is not bounded by them.
            count["acceleration"] += int(hard[on[run][1:] & on[run][:-1]].sum())
        return count

    def play(self) -> Array:
        """(N, n) the positions that a fresh servo commands for the same commands, cycle by cycle.

        On the machine that made the recording these positions equal the recorded positions, to the bit. ValueError
        where cycles are missing.
        """
        out = np.empty_like(self["q"])
        servo: sk.Servo | None = None
        active, next_cycle = -1, int(self["cycle"][0])
        for k, sample in enumerate(self.samples):
            if sample["cycle"] != next_cycle:
                raise ValueError(f"cycles {next_cycle} to {sample['cycle'] - 1} are missing")
            next_cycle += 1
            number = int(sample["configuration"])
            if number != active:
                fresh = self.settings[number].servo(self.arm.chain, self.dt, self.arm.home)
                if sample["restarted"]:
                    fresh.reset(sample["q"] - self.dt * sample["qdot"])
                elif servo is None:
                    fresh.reset(*self.before)
                else:
                    fresh.continue_from(servo)
                servo, active = fresh, number
            assert servo is not None
            command = sk.LoopCommand(int(sample["command"]))
            if command is sk.LoopCommand.POSE:
                step = servo.update(sample["target"])
            elif command is sk.LoopCommand.TWIST:
                step = servo.update_twist(sample["asked_twist"])
            else:
                step = servo.hold()
            out[k] = step.q
        return out

    # --- files

    def save(self, file: str | pathlib.Path) -> pathlib.Path:
        """Writes an npz file, whole or not at all. Returns its path."""
        return write_atomically(pathlib.Path(file), self._npz)

    def save_parquet(self, file: str | pathlib.Path, episode_index: int = 0) -> pathlib.Path:
        """Writes a parquet file, whole or not at all. Returns its path."""
        need("pyarrow")
        return write_atomically(pathlib.Path(file), lambda stream: self._parquet(stream, episode_index))

    @staticmethod
    def load(file: str | pathlib.Path) -> Episode:
        """Reads an npz file. ValueError where it is no recording."""
        path = pathlib.Path(file)
        try:
            with np.load(path, allow_pickle=False) as data:
                return _episode(data)
        except (KeyError, ValueError, TypeError, EOFError, zipfile.BadZipFile, AttributeError) as error:
            raise ValueError(f"{path}: not a recording of sigmaik: {' '.join(str(error).split())}") from None

    def _meta(self) -> str:
        return json.dumps(
            {
                "robot": self.arm.name,
                "base": self.arm.chain.base,
                "tip": self.arm.chain.tip,
                "dt": self.dt,
                "settings": {str(k): dataclasses.asdict(s) for k, s in self.settings.items()},
                "version": sk.__version__,
            }
        )

    def _npz(self, stream: BinaryIO) -> None:
        assert self.samples.dtype.names is not None
        limits = self.arm.chain.limits
        arrays: dict[str, Any] = {name: self.samples[name] for name in self.samples.dtype.names}
        arrays |= {name: getattr(limits, name) for name in _LIMITS}
        np.savez_compressed(
            stream,
            **arrays,
            before=np.stack(self.before),
            joint_names=np.array(self.arm.chain.joint_names),
            home=self.arm.home,
            urdf=np.array(self.arm.urdf),
            meta=np.array(self._meta()),
        )

    def _parquet(self, stream: BinaryIO, episode_index: int) -> None:
        import pyarrow as pa
        import pyarrow.parquet as parquet

        n = len(self)

        def vectors(values: NDArray[Any]) -> Any:
            flat = pa.array(values.reshape(-1).astype(np.float32))
            return pa.FixedSizeListArray.from_arrays(flat, int(values.size // n))

        def texts(field: str, names: type[enum.IntEnum]) -> Any:
            return pa.DictionaryArray.from_arrays(self[field].astype(np.int8), [name.name.lower() for name in names])

        table = pa.table(
            {
                "timestamp": pa.array((self["cycle"] - self["cycle"][0]) * self.dt),
                "frame_index": pa.array(np.arange(n, dtype=np.int64)),
                "episode_index": pa.array(np.full(n, episode_index, dtype=np.int64)),
                "observation.state": vectors(self["q"]),
                "observation.velocity": vectors(self["qdot"]),
                "action": vectors(self["asked_twist"]),
                "pose": vectors(self["pose"]),
                "command": texts("command", sk.LoopCommand),
                "status": texts("status", sk.Status),
                "guide": texts("guide", sk.GuideState),
            }
        )
        meta = {"sigmaik": self._meta(), "joint_names": json.dumps(list(self.arm.chain.joint_names))}
        parquet.write_table(table.replace_schema_metadata(meta), stream)


def _episode(data: Any) -> Episode:
    meta = json.loads(str(data["meta"]))
    chain = sk.Chain.from_urdf(str(data["urdf"]), base=meta["base"], tip=meta["tip"])
    chain = chain.with_limits(**{name: data[name] for name in _LIMITS})
    # A recording that says nothing of a guide is older than the guide: its servo had none.
    settings = {
        int(number): Settings(**{"guided": False, **values, "mask": tuple(values["mask"])})
        for number, values in meta["settings"].items()
    }
    skip = {*_LIMITS, "before", "joint_names", "home", "urdf", "meta"}
    arrays = {name: data[name] for name in data.files if name not in skip}
    for name, (dtype, shape, empty) in _LATER.items():
        if name not in arrays:
            arrays[name] = np.full((len(arrays["cycle"]), *shape), empty, dtype)
    fields = [(name, values.dtype, values.shape[1:]) for name, values in arrays.items()]
    samples = np.empty(len(arrays["cycle"]), fields)
    for name, values in arrays.items():
        samples[name] = values
    before = data["before"]
    arm = Arm(meta["robot"], str(data["urdf"]), chain, data["home"])
    return Episode(samples, arm, float(meta["dt"]), settings, (before[0], before[1]))
