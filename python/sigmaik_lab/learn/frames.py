"""An episode as a table of frames at an even rate, and back. Needs pyarrow, and Pillow where there are images."""

from __future__ import annotations

import io
import json
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

import sigmaik as sk
from sigmaik._types import Array

from .episode import Episode, columns, rotation_6d, rotation_of_6d
from .statistics import Stats, column_stats, image_stats

__all__ = ["IMAGE", "Features", "episode_of", "features_of", "frame_columns", "frames_table", "resample", "stats_of"]

#: The column of images.
IMAGE = "observation.images.front"
#: A column's name to its dtype, shape and names, as meta/info.json has them.
Features = dict[str, dict[str, Any]]

#: [frames] by which times may differ from an even rate; more is interpolated.
_EVEN = 1e-3


def features_of(
    state_names: Sequence[str], action_names: Sequence[str], images: tuple[int, int, int] | None
) -> Features:
    """The columns of a data set; the last five are those that every LeRobot data set has."""
    found: Features = {
        "observation.state": {"dtype": "float32", "shape": [len(state_names)], "names": list(state_names)},
        "action": {"dtype": "float32", "shape": [len(action_names)], "names": list(action_names)},
    }
    if images is not None:
        found[IMAGE] = {"dtype": "image", "shape": list(images), "names": ["height", "width", "channels"]}
    found["phase"] = {"dtype": "string", "shape": [1], "names": None}
    found["next.success"] = {"dtype": "bool", "shape": [1], "names": None}
    found["timestamp"] = {"dtype": "float32", "shape": [1], "names": None}
    for name in ("frame_index", "episode_index", "index", "task_index"):
        found[name] = {"dtype": "int64", "shape": [1], "names": None}
    return found


def resample(episode: Episode, fps: float, state_names: Sequence[str], action_names: Sequence[str]) -> Episode:
    """The episode at an even rate of its clock, from its first time on.

    Numbers are interpolated linearly, 6-D rotations are made rotations again, and commands of a gripper, phases and
    images are those of the last row before. Error where times do not rise, or two rows are more than a frame apart:
    what happened between them is not known.
    """
    times = np.asarray(episode.times, dtype=np.float64)
    steps = np.diff(times)
    if not np.isfinite(times).all() or (steps <= 0.0).any():
        raise sk.Error("the times of an episode must rise")
    if (steps > (1.0 + _EVEN) / fps).any():
        row = int(np.argmax(steps))
        raise sk.Error(f"rows {row} and {row + 1} are {steps[row]:.3f} s apart, more than a frame at {fps:g} Hz")
    frames = np.arange(int(np.floor((times[-1] - times[0]) * fps + _EVEN)) + 1)
    grid = times[0] + frames / fps
    if len(grid) == len(times) and np.abs(grid - times).max() * fps <= _EVEN:
        return episode
    before = np.clip(np.searchsorted(times, grid + _EVEN / fps, side="right") - 1, 0, len(times) - 1)

    def between(values: NDArray[np.float32], names: Sequence[str]) -> NDArray[np.float32]:
        out = np.stack([np.interp(grid, times, column) for column in values.T], axis=1)
        held = columns(names, "gripper.command")
        out[:, held] = values[before][:, held]
        rotation = columns(names, "tool.r")
        if len(rotation) == 6:
            out[:, rotation] = rotation_6d(rotation_of_6d(out[:, rotation]))
        return out.astype(np.float32)

    return Episode(
        times=grid,
        state=between(episode.state, state_names),
        action=between(episode.action, action_names),
        phase=episode.phase[before],
        success=episode.success,
        images=None if episode.images is None else episode.images[before],
        scene=episode.scene,
    )


def frame_columns(
    episode: Episode, fps: int, features: Features, number: int, first: int, task: int
) -> dict[str, NDArray[Any]]:
    """The columns of an episode's frames, each (N, …).

    number: of the episode. first: `index` of its first frame. task: number of the task. Error where the episode does
    not have the shapes of `features`, or numbers that are not finite.
    """
    _check(episode, features)
    even = resample(episode, fps, features["observation.state"]["names"], features["action"]["names"])
    n = len(even.times)
    success = np.zeros(n, dtype=bool)
    success[-1] = even.success
    found: dict[str, NDArray[Any]] = {
        "observation.state": even.state.astype(np.float32),
        "action": even.action.astype(np.float32),
    }
    if even.images is not None:
        found[IMAGE] = even.images
    return found | {
        "phase": np.asarray(even.phase, dtype=np.str_),
        "next.success": success,
        "timestamp": (np.arange(n) / fps).astype(np.float32),
        "frame_index": np.arange(n),
        "episode_index": np.full(n, number),
        "index": np.arange(first, first + n),
        "task_index": np.full(n, task),
    }


def stats_of(found: Mapping[str, NDArray[Any]]) -> dict[str, Stats]:
    """The statistics of each column but texts."""
    return {
        name: image_stats(values) if name == IMAGE else column_stats(values)
        for name, values in found.items()
        if values.dtype.kind != "U"
    }


def frames_table(found: Mapping[str, NDArray[Any]], features: Features) -> Any:
    """The columns as an Arrow table with the types of the format."""
    import pyarrow as pa

    arrays, fields = [], []
    for name, feature in features.items():
        values, size = found[name], feature["shape"][0]
        if feature["dtype"] == "image":
            kind = pa.struct([("bytes", pa.binary()), ("path", pa.string())])
            array = pa.array([{"bytes": _png(image), "path": None} for image in values], kind)
        elif values.ndim == 2:
            array = pa.FixedSizeListArray.from_arrays(pa.array(values.reshape(-1)), size)
        else:
            array = pa.array(values.tolist(), pa.type_for_alias(feature["dtype"]))
        arrays.append(array)
        fields.append(pa.field(name, array.type))
    return pa.Table.from_arrays(arrays, schema=pa.schema(fields))


def episode_of(table: Any, scene: str | None, success: bool | None) -> Episode:
    """The episode of a table of its frames. scene: JSON. A data set of others has neither scene nor phases."""
    names = table.column_names

    def matrix(name: str) -> NDArray[np.float32]:
        return np.array(table[name].to_pylist(), dtype=np.float32)

    if success is None:
        success = bool(table["next.success"][-1].as_py()) if "next.success" in names else False
    phase = table["phase"].to_pylist() if "phase" in names else [""] * len(table)
    times: Array = table["timestamp"].to_numpy().astype(np.float64)
    images = np.stack([_pixels(cell["bytes"]) for cell in table[IMAGE].to_pylist()]) if IMAGE in names else None
    return Episode(
        times=times,
        state=matrix("observation.state"),
        action=matrix("action"),
        phase=np.array(phase, dtype=np.str_),
        success=success,
        images=images,
        scene=json.loads(scene) if scene else {},
    )


def _check(episode: Episode, features: Features) -> None:
    n = len(episode.times)
    if n == 0:
        raise sk.Error("an episode needs a frame")
    wanted = {"state": features["observation.state"]["shape"], "action": features["action"]["shape"]}
    for name, shape in wanted.items():
        values = getattr(episode, name)
        if values.shape != (n, *shape):
            raise sk.Error(f"{name} has shape {values.shape}, not {(n, *shape)}")
        if not np.isfinite(values).all():
            raise sk.Error(f"{name} has numbers that are not finite")
    if len(episode.phase) != n:
        raise sk.Error(f"phase has {len(episode.phase)} rows, not {n}")
    has, needs = episode.images is not None, IMAGE in features
    if has != needs:
        raise sk.Error("the episode has images, and the data set has none" if has else "the episode has no images")
    if episode.images is not None and (
        episode.images.shape != (n, *features[IMAGE]["shape"]) or episode.images.dtype != np.uint8
    ):
        raise sk.Error(f"images are uint8 {(n, *features[IMAGE]['shape'])}, not {episode.images.shape}")


def _png(image: NDArray[np.uint8]) -> bytes:
    from PIL import Image

    stream = io.BytesIO()
    Image.fromarray(image).save(stream, format="PNG", compress_level=1)
    return stream.getvalue()


def _pixels(png: bytes) -> NDArray[np.uint8]:
    from PIL import Image

    return np.asarray(Image.open(io.BytesIO(png)).convert("RGB"), dtype=np.uint8)
