"""The data set: what the LeRobot format v3.0 asks for, at an even rate, and no episode lost."""

from __future__ import annotations

import json

import numpy as np
import pytest

import sigmaik as sk

pytest.importorskip("pyarrow")

import pyarrow as pa
import pyarrow.parquet as parquet

from sigmaik_lab.learn import dataset
from sigmaik_lab.learn.episode import Episode, action_names, state_names
from sigmaik_lab.learn.frames import resample
from sigmaik_lab.learn.statistics import QUANTILES

STATE = state_names([f"joint{k}" for k in range(1, 8)])
ACTION = action_names("pose")
TASK = "fetch the cup and place it at the goal"


def make(seed=0, length=25, images=False):
    rng = np.random.default_rng(seed)
    state = rng.normal(size=(length, len(STATE))).astype(np.float32)
    action = rng.normal(size=(length, len(ACTION))).astype(np.float32)
    phase = np.array(["approach"] * (length // 2) + ["carry"] * (length - length // 2))
    pictures = rng.integers(0, 256, (length, 12, 16, 3), dtype=np.uint8) if images else None
    scene = {"cup": np.array([0.7, 0.0, 0.1]), "seed": seed}
    return Episode(np.arange(length) / 10.0, state, action, phase, seed % 2 == 0, pictures, scene)


def writer(path, images=False, **changes):
    facts = {"fps": 10, "robot": "ufactory_xarm7", "state_names": STATE, "action_names": ACTION} | changes
    return dataset.Writer(path, images=(12, 16, 3) if images else None, **facts)


def write(path, episodes, images=False):
    w = writer(path, images)
    for episode in episodes:
        w.add(episode)
    w.close()
    return path


def same(a, b):
    np.testing.assert_allclose(a.times, b.times, atol=1e-6)
    for name in ("state", "action", "phase"):
        np.testing.assert_array_equal(getattr(a, name), getattr(b, name))
    assert a.success == b.success
    assert (a.images is None) == (b.images is None)
    if a.images is not None:
        np.testing.assert_array_equal(a.images, b.images)
    assert list(b.scene["cup"]) == list(a.scene["cup"])


@pytest.mark.parametrize("images", [False, True])
def test_what_was_written_is_read(tmp_path, images):
    episodes = [make(k, 20 + k, images) for k in range(5)]
    for a, b in zip(episodes, dataset.read(write(tmp_path / "d", episodes, images)), strict=True):
        same(a, b)


# --- the schema, as lerobot 0.4.4 writes it: `create_empty_dataset_info`, `DEFAULT_FEATURES`,
# `get_hf_features_from_features`, `_save_episode_metadata` and `get_feature_stats`

INFO = {
    "codebase_version", "robot_type", "total_episodes", "total_frames", "total_tasks", "chunks_size",
    "data_files_size_in_mb", "video_files_size_in_mb", "fps", "splits", "data_path", "video_path", "features",
}  # fmt: skip
IMAGE = pa.struct([("bytes", pa.binary()), ("path", pa.string())])
ROW = {
    "episode_index": pa.int64(),
    "tasks": pa.list_(pa.string()),
    "length": pa.int64(),
    "data/chunk_index": pa.int64(),
    "data/file_index": pa.int64(),
    "dataset_from_index": pa.int64(),
    "dataset_to_index": pa.int64(),
    "meta/episodes/chunk_index": pa.int64(),
    "meta/episodes/file_index": pa.int64(),
}


def test_folder_has_the_schema_of_the_format(tmp_path):
    folder = write(tmp_path / "d", [make(k, 20 + k, True) for k in range(3)], True)
    facts = json.loads((folder / "meta/info.json").read_text())
    assert set(facts) == INFO
    assert facts["codebase_version"] == "v3.0"
    assert (facts["total_episodes"], facts["total_frames"], facts["total_tasks"]) == (3, 63, 1)
    assert facts["splits"] == {"train": "0:3"}
    assert facts["data_path"] == "data/chunk-{chunk_index:03d}/file-{file_index:03d}.parquet"

    table = parquet.ParquetFile(folder / "data/chunk-000/file-000.parquet").read()
    assert {field.name: field.type for field in table.schema} == {
        "observation.state": pa.list_(pa.float32(), len(STATE)),
        "action": pa.list_(pa.float32(), len(ACTION)),
        "observation.images.front": IMAGE,
        "phase": pa.string(),
        "next.success": pa.bool_(),
        "timestamp": pa.float32(),
        "frame_index": pa.int64(),
        "episode_index": pa.int64(),
        "index": pa.int64(),
        "task_index": pa.int64(),
    }
    assert list(facts["features"]) == table.column_names
    assert facts["features"]["observation.state"] == {"dtype": "float32", "shape": [len(STATE)], "names": STATE}
    assert facts["features"]["observation.images.front"]["shape"] == [12, 16, 3]
    for feature in facts["features"].values():
        assert set(feature) == {"dtype", "shape", "names"}

    assert table["index"].to_pylist() == list(range(63))
    assert table["frame_index"].to_pylist() == [*range(20), *range(21), *range(22)]
    assert table["episode_index"].to_pylist() == [0] * 20 + [1] * 21 + [2] * 22
    frames = np.array(table["frame_index"])
    np.testing.assert_allclose(np.array(table["timestamp"]), frames / 10.0, atol=1e-6)
    assert np.flatnonzero(np.array(table["next.success"])).tolist() == [19, 62]  # the ends of episodes 0 and 2

    rows = parquet.ParquetFile(folder / "meta/episodes/chunk-000/file-000.parquet").read()
    types = {field.name: field.type for field in rows.schema}
    assert ROW.items() <= types.items()
    numbers = [name for name, feature in facts["features"].items() if feature["dtype"] != "string"]
    statistics = {"min", "max", "mean", "std", "count", "q01", "q10", "q50", "q90", "q99"}
    wanted = {f"stats/{name}/{statistic}" for name in numbers for statistic in statistics}
    assert set(types) - set(ROW) == wanted | {"scene", "success"}
    tasks = parquet.read_table(folder / "meta/tasks.parquet")
    assert tasks.to_pylist() == [{"task_index": 0, "__index_level_0__": TASK}]
    assert json.loads(tasks.schema.metadata[b"pandas"])["index_columns"] == ["__index_level_0__"]


def test_statistics_are_those_of_all_frames(tmp_path):
    episodes = [make(k, 30, True) for k in range(4)]
    stats = dataset.statistics(write(tmp_path / "d", episodes, True))
    states = np.concatenate([e.state for e in episodes]).astype(float)
    for name, value in (
        ("min", states.min(0)),
        ("max", states.max(0)),
        ("mean", states.mean(0)),
        ("std", states.std(0)),
    ):
        np.testing.assert_allclose(stats["observation.state"][name], value, atol=1e-9)
    assert stats["observation.state"]["count"] == [120]
    quantiles = np.array([np.quantile(e.state.astype(float), list(QUANTILES.values()), axis=0) for e in episodes])
    for k, name in enumerate(QUANTILES):  # as LeRobot joins them: the mean over the episodes
        np.testing.assert_allclose(stats["observation.state"][name], quantiles[:, k].mean(axis=0), atol=1e-6)
    images = np.concatenate([e.images for e in episodes]) / 255.0
    assert np.shape(stats["observation.images.front"]["mean"]) == (3, 1, 1)
    np.testing.assert_allclose(np.ravel(stats["observation.images.front"]["mean"]), images.mean((0, 1, 2)), atol=1e-9)
    assert np.shape(stats["timestamp"]["mean"]) == (1,)


# --- nothing is lost


def test_added_episodes_survive_and_the_next_writer_goes_on(tmp_path):
    episodes = [make(k, 20) for k in range(6)]
    first = writer(tmp_path / "d")
    for episode in episodes[:2]:
        first.add(episode)
    del first  # a program that ends without close
    assert dataset.count(tmp_path / "d") == 2
    second = writer(tmp_path / "d")
    assert len(second) == 2
    second.add(episodes[2])
    second.close()
    third = writer(tmp_path / "d")
    assert len(third) == dataset.count(tmp_path / "d") == 3
    for episode in episodes[3:]:
        third.add(episode)
    third.close()
    for a, b in zip(episodes, dataset.read(tmp_path / "d"), strict=True):
        same(a, b)
    once = dataset.statistics(write(tmp_path / "once", episodes))
    twice = dataset.statistics(tmp_path / "d")
    for name in ("mean", "std", "q10", "count"):
        np.testing.assert_allclose(once["action"][name], twice["action"][name], atol=1e-12)


@pytest.mark.parametrize(
    "ends_at", ["meta/tasks.parquet", "data", "meta/episodes", "meta/stats.json", "meta/info.json"]
)
def test_a_program_that_ends_within_close_loses_nothing(tmp_path, monkeypatch, ends_at):
    folder = write(tmp_path / "d", [make(0, 20), make(1, 20)])
    broken = writer(folder)
    broken.add(make(2, 20))
    write_whole = dataset.write_atomically

    def ends(file, write):
        if str(file.relative_to(folder)).startswith(ends_at):
            raise KeyboardInterrupt
        return write_whole(file, write)

    monkeypatch.setattr(dataset, "write_atomically", ends)
    if ends_at == "meta/tasks.parquet":
        broken._tasks.append("another task")
    with pytest.raises(KeyboardInterrupt):
        broken.close()
    monkeypatch.undo()
    again = writer(folder)
    assert len(again) == 3
    again.close()
    found = dataset.read(folder)
    assert len(found) == 3
    same(make(2, 20), found[2])
    assert dataset.statistics(folder)["action"]["count"] == [60]


def test_large_data_sets_have_several_files(tmp_path, monkeypatch):
    monkeypatch.setattr(dataset, "_MEGABYTES", 0.01)
    monkeypatch.setattr(dataset, "_FILES", 2)
    episodes = [make(k, 40) for k in range(6)]
    folder = write(tmp_path / "d", episodes)
    assert len(list(folder.glob("data/*/*.parquet"))) == 6
    assert (folder / "data/chunk-002/file-001.parquet").exists()
    for a, b in zip(episodes, dataset.read(folder), strict=True):
        same(a, b)


def test_another_data_set_is_not_continued(tmp_path):
    write(tmp_path / "d", [make()])
    for changes in ({"fps": 20}, {"robot": "ur10"}, {"action_names": action_names("twist")}):
        with pytest.raises(sk.Error, match="another"):
            writer(tmp_path / "d", **changes)


def test_what_does_not_fit_is_refused(tmp_path):
    w = writer(tmp_path / "d")
    with pytest.raises(sk.Error, match="needs an episode"):
        w.close()
    episode = make()
    episode.state = episode.state[:, :-1]
    with pytest.raises(sk.Error, match="shape"):
        w.add(episode)
    episode = make()
    episode.action[3, 2] = np.nan
    with pytest.raises(sk.Error, match="finite"):
        w.add(episode)
    with pytest.raises(sk.Error, match="has images"):
        w.add(make(images=True))
    assert len(w) == 0
    with pytest.raises(sk.Error, match="no data set"):
        dataset.read(tmp_path / "nothing")


# --- the clock


def test_episodes_of_another_clock_are_brought_to_an_even_rate():
    rng = np.random.default_rng(3)
    times = 7.0 + np.cumsum(rng.uniform(0.0005, 0.0015, 3000))
    state = np.zeros((3000, len(STATE)), dtype=np.float32)
    state[:, 0] = 0.2 * (times - times[0])
    state[:, 3:9] = [1, 0, 0, 0, 1, 0]
    action = np.zeros((3000, len(ACTION)), dtype=np.float32)
    action[:, 3:9] = [1, 0, 0, 0, 1, 0]
    action[:, -1] = times > times[1500]
    phase = np.where(times > times[1500], "grasp", "approach")
    even = resample(Episode(times, state, action, phase, True), 10, STATE, ACTION)
    n = int((times[-1] - times[0]) * 10) + 1
    np.testing.assert_allclose(even.times, times[0] + 0.1 * np.arange(n))
    np.testing.assert_allclose(even.state[:, 0], 0.02 * np.arange(n), atol=1e-6)
    np.testing.assert_allclose(even.state[:, 3:9], np.tile([1, 0, 0, 0, 1, 0], (n, 1)), atol=1e-6)
    assert set(np.unique(even.action[:, -1])) == {0.0, 1.0}  # a command is held, and not interpolated
    assert (even.phase == np.where(even.action[:, -1] > 0.5, "grasp", "approach")).all()


def test_gaps_and_clocks_that_go_back_are_refused():
    for times, said in ((np.r_[0:1:0.1, 1.5:2:0.1], "more than a frame"), (np.r_[0:1:0.1, 0.5], "must rise")):
        n = len(times)
        episode = Episode(
            times,
            np.zeros((n, len(STATE)), np.float32),
            np.zeros((n, len(ACTION)), np.float32),
            np.array([""] * n),
            True,
        )
        with pytest.raises(sk.Error, match=said):
            resample(episode, 10, STATE, ACTION)


# --- the real package


def real_package():
    """LeRobotDataset. Its imports take torchvision, whose operators a PyTorch for CPUs may lack; none is used."""
    torch = pytest.importorskip("torch")
    pytest.importorskip("lerobot")
    operators = torch.library.Library("torchvision", "FRAGMENT")
    for name in ("nms", "qnms"):
        operators.define(f"{name}(Tensor dets, Tensor scores, float iou_threshold) -> Tensor")
    module = pytest.importorskip("lerobot.datasets.lerobot_dataset")
    return module.LeRobotDataset, operators


@pytest.mark.filterwarnings("ignore")
@pytest.mark.parametrize("images", [False, True])
def test_lerobot_loads_the_data_set(tmp_path, monkeypatch, images):
    monkeypatch.setenv("HF_HUB_OFFLINE", "1")
    monkeypatch.setenv("HF_HOME", str(tmp_path / "home"))
    reader, _operators = real_package()
    episodes = [make(k, 20 + k, images) for k in range(4)]
    folder = write(tmp_path / "d", episodes[:3], images)
    more = writer(folder, images)
    more.add(episodes[3])
    more.close()
    found = reader("sigmaik/fetch", root=folder, delta_timestamps={"action": [0.0, 0.1, 0.2]})
    assert (found.num_episodes, found.num_frames, found.fps) == (4, 86, 10)
    assert found.meta.robot_type == "ufactory_xarm7"
    k = 0
    for episode in episodes:
        for row in (0, 7, len(episode.times) - 1):
            item = found[k + row]
            np.testing.assert_array_equal(item["observation.state"].numpy(), episode.state[row])
            rows = np.minimum(row + np.arange(3), len(episode.times) - 1)
            np.testing.assert_array_equal(item["action"].numpy(), episode.action[rows])
            assert item["action_is_pad"].tolist() == (row + np.arange(3) >= len(episode.times)).tolist()
            assert item["task"] == TASK
            assert item["phase"] == episode.phase[row]
            if images:
                pixels = item["observation.images.front"].numpy().transpose(1, 2, 0) * 255.0
                np.testing.assert_allclose(pixels, episode.images[row], atol=1e-3)
        k += len(episode.times)
    check_statistics(found, episodes, images)


def check_statistics(found, episodes, images):
    """Ours beside those that LeRobot computes itself, whose quantiles are read off histograms of 5000 bins."""
    from lerobot.datasets.compute_stats import aggregate_stats, get_feature_stats

    parts = []
    for episode in episodes:
        part = {"observation.state": get_feature_stats(episode.state.astype(float), axis=0, keepdims=False)}
        if images:
            pixels = episode.images.transpose(0, 3, 1, 2).astype(float)
            stats = get_feature_stats(pixels, axis=(0, 2, 3), keepdims=True)
            part["observation.images.front"] = {
                name: value if name == "count" else np.squeeze(value / 255.0, axis=0) for name, value in stats.items()
            }
        parts.append(part)
    for name, stats in aggregate_stats(parts).items():
        assert set(stats) == set(found.meta.stats[name])
        for statistic in ("min", "max", "mean", "std", "count"):
            np.testing.assert_allclose(found.meta.stats[name][statistic], stats[statistic], atol=1e-6)
        if images and "images" in name:  # a histogram of many values; of twenty rows a quantile is a matter of taste
            for statistic in QUANTILES:
                np.testing.assert_allclose(found.meta.stats[name][statistic], stats[statistic], atol=0.02)
