"""Episodes as a data set in the LeRobot format v3.0, which `LeRobotDataset` loads. Needs pyarrow.

    data/chunk-000/file-000.parquet           a row for each frame, episodes one after the other
    meta/episodes/chunk-000/file-000.parquet  a row for each episode: where its frames are, its scene, its statistics
    meta/tasks.parquet                        the text of each task
    meta/stats.json                           statistics of each column over all episodes
    meta/info.json                            the rate, the columns and their names, totals

A data set is what meta/info.json describes. An episode that a `Writer` was given is at once a file of its own in the
folder `.staged`. `Writer.close` packs these episodes into new files, and writes meta/info.json last, so that a program
that ends in the middle loses no episode that was added.
"""

from __future__ import annotations

import json
import pathlib
import shutil
from collections.abc import Mapping, Sequence
from typing import Any

import sigmaik as sk
from sigmaik._extras import need
from sigmaik.files import write_atomically

from .episode import Episode
from .frames import IMAGE, Features, episode_of, features_of, frame_columns, frames_table, stats_of
from .statistics import Stats, aggregate_stats

__all__ = ["VERSION", "Writer", "count", "info", "read", "statistics"]

#: Of the format.
VERSION = "v3.0"
_CHUNK = "chunk-{chunk_index:03d}/file-{file_index:03d}.parquet"
_DATA, _EPISODES = f"data/{_CHUNK}", f"meta/episodes/{_CHUNK}"
_INFO, _STATS, _TASKS, _STAGED = "meta/info.json", "meta/stats.json", "meta/tasks.parquet", ".staged"
#: Files of a chunk, and megabytes of a file, as LeRobot has them.
_FILES, _MEGABYTES = 1000, 100
#: The name that pandas gives to a column of row names.
_INDEX = "__index_level_0__"


class Writer:
    """Adds episodes to a data set, a new one or one that is there already.

    path: folder. fps: [Hz] of the frames. robot: name of the arm. state_names, action_names: of the entries of states
    and actions. images: (height, width, 3) of the episodes' images; None: without images. task: what episodes show.
    Error where the folder has a data set of another rate, arm, shape or name; MissingPackage without pyarrow.
    """

    def __init__(
        self,
        path: str | pathlib.Path,
        fps: int,
        robot: str,
        state_names: Sequence[str],
        action_names: Sequence[str],
        images: tuple[int, int, int] | None = None,
        task: str = "fetch the cup and place it at the goal",
    ) -> None:
        need("pyarrow", *(["PIL"] if images is not None else []))
        self.path, self.fps, self.robot, self.task = pathlib.Path(path), fps, robot, task
        self.features = features_of(state_names, action_names, images)
        self._info = info(self.path) if (self.path / _INFO).exists() else None
        self._clean()
        self._rows = [json.loads(_notes(file)["episode"]) for file in self._waiting()]
        self._check()
        tasks = _tasks(self.path)
        self._tasks = tasks if task in tasks else [*tasks, task]

    def __len__(self) -> int:
        """Number of episodes, those of the data set and those that were added since."""
        return self._total("episodes") + len(self._rows)

    def scenes(self) -> list[dict[str, Any]]:
        """The scenes of all episodes, those that wait included."""
        files = sorted(self.path.glob("meta/episodes/*/*.parquet"))
        rows = [row for file in files for row in _read(file).to_pylist()] + self._rows
        return [json.loads(row["scene"]) for row in rows]

    def add(self, episode: Episode) -> None:
        """Adds an episode, on disk when the call returns. Error where its shapes, numbers or times do not fit."""
        number, first = len(self), self._total("frames") + sum(row["length"] for row in self._rows)
        found = frame_columns(episode, self.fps, self.features, number, first, self._tasks.index(self.task))
        length = len(found["index"])
        row = {
            "episode_index": number,
            "tasks": [self.task],
            "length": length,
            "dataset_from_index": first,
            "dataset_to_index": first + length,
            "success": bool(episode.success),
            "scene": json.dumps(episode.scene, default=_plain),
            "stats": stats_of(found),
        }
        notes = {"episode": json.dumps(row), "writer": json.dumps(self._facts())}
        table = frames_table(found, self.features).replace_schema_metadata(notes)
        _write(self.path / _STAGED / f"episode-{number:06d}.parquet", table)
        self._rows.append(row)

    def close(self) -> None:
        """Packs all episodes that were added into the data set. Error where there is no episode at all."""
        if not len(self):
            raise sk.Error(f"{self.path}: a data set needs an episode")
        if self._rows:
            _write(self.path / _TASKS, _tasks_table(self._tasks))
            self._pack()
            self._describe()
        shutil.rmtree(self.path / _STAGED, ignore_errors=True)

    def _total(self, what: str) -> int:
        return 0 if self._info is None else int(self._info[f"total_{what}"])

    def _waiting(self) -> list[pathlib.Path]:
        return sorted((self.path / _STAGED).glob("episode-*.parquet"))

    def _facts(self) -> dict[str, Any]:
        return {"fps": self.fps, "robot_type": self.robot, "features": self.features}

    def _check(self) -> None:
        waiting = self._waiting()
        known = self._info or (json.loads(_notes(waiting[0])["writer"]) if waiting else self._facts())
        for name, value in self._facts().items():
            if known.get(name) != value:
                raise sk.Error(f"{self.path} has a data set with another {name.removesuffix('_type')} already")

    def _clean(self) -> None:
        """Removes what is left of a program that ended within `close`."""
        import pyarrow.parquet as parquet

        for file in self._waiting():
            if int(file.stem.removeprefix("episode-")) < self._total("episodes"):
                file.unlink()
        for pattern in ("data/*/*.parquet", "meta/episodes/*/*.parquet"):
            for file in self.path.glob(pattern):
                if parquet.read_table(file, columns=["episode_index"])[0][0].as_py() >= self._total("episodes"):
                    file.unlink()

    def _pack(self) -> None:
        """Writes the frames of the episodes that wait into new files, and adds the files' numbers to the rows."""
        import pyarrow as pa

        number = len(list(self.path.glob("data/*/*.parquet")))
        group: list[Any] = []
        for row, file in zip(self._rows, self._waiting(), strict=True):
            table = _read(file).replace_schema_metadata(None)
            if group and sum(t.nbytes for t in group) + table.nbytes > _MEGABYTES * 2**20:
                _write(self.path / _file(_DATA, number), pa.concat_tables(group))
                number, group = number + 1, []
            row["data/chunk_index"], row["data/file_index"] = divmod(number, _FILES)
            group.append(table)
        _write(self.path / _file(_DATA, number), pa.concat_tables(group))

    def _describe(self) -> None:
        """Writes the episodes' rows, the statistics and, last, meta/info.json."""
        number = len(list(self.path.glob("meta/episodes/*/*.parquet")))
        for row in self._rows:
            row["meta/episodes/chunk_index"], row["meta/episodes/file_index"] = divmod(number, _FILES)
        _write(self.path / _file(_EPISODES, number), _episodes_table(self._rows))
        # From the rows of all episodes, so that a `close` that is done again counts no episode twice.
        _write_json(self.path / _STATS, aggregate_stats(_episode_stats(self.path, self.features)))
        episodes = len(self)
        frames = self._total("frames") + sum(row["length"] for row in self._rows)
        self._info = {
            "codebase_version": VERSION,
            "robot_type": self.robot,
            "total_episodes": episodes,
            "total_frames": frames,
            "total_tasks": len(self._tasks),
            "chunks_size": _FILES,
            "data_files_size_in_mb": _MEGABYTES,
            "video_files_size_in_mb": 2 * _MEGABYTES,
            "fps": self.fps,
            "splits": {"train": f"0:{episodes}"},
            "data_path": _DATA,
            "video_path": None,
            "features": self.features,
        }
        self._rows = []
        _write_json(self.path / _INFO, self._info)


# --- reading


def info(path: str | pathlib.Path) -> dict[str, Any]:
    """meta/info.json of a data set. Error where the folder has none, or of another version."""
    file = pathlib.Path(path) / _INFO
    try:
        found: dict[str, Any] = json.loads(file.read_text(encoding="utf-8"))
        version = found["codebase_version"]
    except (OSError, ValueError, KeyError, TypeError):
        raise sk.Error(f"{path} is no data set: {file} cannot be read") from None
    if version != VERSION:
        raise sk.Error(f"{path} is a data set of version {version}, not {VERSION}")
    return found


def statistics(path: str | pathlib.Path) -> dict[str, Stats]:
    """meta/stats.json of a data set: column to its statistics."""
    found: dict[str, Stats] = json.loads((pathlib.Path(path) / _STATS).read_text(encoding="utf-8"))
    return found


def count(path: str | pathlib.Path) -> int:
    """The number of episodes in a folder, those that wait to be packed included; 0 where there is no data set."""
    folder = pathlib.Path(path)
    closed = int(info(folder)["total_episodes"]) if (folder / _INFO).exists() else 0
    waiting = (int(f.stem.removeprefix("episode-")) for f in (folder / _STAGED).glob("episode-*.parquet"))
    return closed + sum(number >= closed for number in waiting)


def read(path: str | pathlib.Path) -> list[Episode]:
    """The episodes of a data set. Error where the folder has none, or episodes are missing."""
    need("pyarrow")
    import pyarrow as pa

    folder, facts = pathlib.Path(path), info(path)
    if facts["features"].get(IMAGE, {}).get("dtype") == "image":
        need("PIL")
    frames = pa.concat_tables([_read(file) for file in sorted(folder.glob("data/*/*.parquet"))])
    rows = [row for file in sorted(folder.glob("meta/episodes/*/*.parquet")) for row in _read(file).to_pylist()]
    if len(rows) != facts["total_episodes"] or len(frames) != facts["total_frames"]:
        raise sk.Error(
            f"{path} has {len(rows)} episodes and {len(frames)} frames; {_INFO} says "
            f"{facts['total_episodes']} and {facts['total_frames']}"
        )
    rows.sort(key=lambda row: int(row["episode_index"]))
    return [
        episode_of(frames.slice(row["dataset_from_index"], row["length"]), row.get("scene"), row.get("success"))
        for row in rows
    ]


# --- files


def _file(pattern: str, number: int) -> str:
    chunk, file = divmod(number, _FILES)
    return pattern.format(chunk_index=chunk, file_index=file)


def _write(file: pathlib.Path, table: Any) -> None:
    import pyarrow.parquet as parquet

    write_atomically(file, lambda stream: parquet.write_table(table, stream))


def _write_json(file: pathlib.Path, content: object) -> None:
    text = json.dumps(content, indent=4, ensure_ascii=False).encode()
    write_atomically(file, lambda stream: stream.write(text))


def _read(file: pathlib.Path) -> Any:
    import pyarrow.parquet as parquet

    return parquet.ParquetFile(file).read()  # and no column from the names of folders


def _notes(file: pathlib.Path) -> dict[str, str]:
    import pyarrow.parquet as parquet

    return {key.decode(): value.decode() for key, value in (parquet.read_schema(file).metadata or {}).items()}


def _tasks(path: pathlib.Path) -> list[str]:
    if not (path / _TASKS).exists():
        return []
    rows = sorted(_read(path / _TASKS).to_pylist(), key=lambda row: int(row["task_index"]))
    return [row[_INDEX] for row in rows]


def _tasks_table(tasks: Sequence[str]) -> Any:
    """A table that pandas reads with the tasks as row names."""
    import pyarrow as pa

    def column(name: str | None, field: str, kind: str, numpy: str) -> dict[str, Any]:
        return {"name": name, "field_name": field, "pandas_type": kind, "numpy_type": numpy, "metadata": None}

    notes = {
        "index_columns": [_INDEX],
        "column_indexes": [column(None, "None", "unicode", "object")],
        "columns": [column("task_index", "task_index", "int64", "int64"), column(None, _INDEX, "unicode", "object")],
        "creator": {"library": "pyarrow", "version": pa.__version__},
        "pandas_version": "2.0.0",
    }
    table = pa.table({"task_index": pa.array(range(len(tasks)), pa.int64()), _INDEX: pa.array(list(tasks))})
    return table.replace_schema_metadata({"pandas": json.dumps(notes)})


def _episodes_table(rows: Sequence[Mapping[str, Any]]) -> Any:
    """A row for each episode; statistics are columns such as stats/action/mean."""
    import pyarrow as pa

    found = {name: [row[name] for row in rows] for name in rows[0] if name != "stats"}
    for column, stats in rows[0]["stats"].items():
        for name in stats:
            found[f"stats/{column}/{name}"] = [row["stats"][column][name] for row in rows]
    return pa.table(found)


def _episode_stats(path: pathlib.Path, features: Features) -> list[dict[str, Stats]]:
    """The statistics of each episode, as the rows of meta/episodes have them."""
    found = []
    for file in sorted(path.glob("meta/episodes/*/*.parquet")):
        for row in _read(file).to_pylist():
            stats: dict[str, Stats] = {name: {} for name in features}
            for key, value in row.items():
                if key.startswith("stats/"):
                    _, column, name = key.split("/")
                    stats[column][name] = value
            found.append({name: values for name, values in stats.items() if values})
    return found


def _plain(value: Any) -> Any:
    """Arrays and numbers of numpy in a scene, as JSON has them."""
    return value.tolist() if hasattr(value, "tolist") else str(value)
