"""Recordings of `sigmaik teleop` as a data set: on the loop's clock, and cut where nobody knows what happened."""

from __future__ import annotations

import argparse
import time

import numpy as np
import pytest

import sigmaik as sk
from sigmaik.teleop import Episode as Recording
from sigmaik.teleop import Session

pytest.importorskip("pyarrow")

from sigmaik_lab.learn import dataset, export
from sigmaik_lab.learn.episode import columns, rotation_6d
from sigmaik_lab.learn.recordings import action_columns, pieces, state_columns

FPS = 10


@pytest.fixture(scope="module")
def recording():
    with Session("ur10", rate=250.0) as session:
        session.start_recording()
        deadline = time.monotonic() + 30.0
        while session.recorded < 250:
            assert time.monotonic() < deadline
            session.twist([0.0, 0.0, 0.05, 0.0, 0.0, 0.1])
            session.read()
            time.sleep(0.02)
        found = session.stop_recording()
    # A clock without gaps: a machine that is busy leaves cycles out.
    samples = found.samples.copy()
    samples["time"] = 3.0 + found.dt * np.arange(len(samples))
    samples["cycle"] = 100 + np.arange(len(samples))
    samples["restarted"] = False
    return Recording(samples, found.arm, found.dt, found.settings, found.before)


def changed(recording, **fields):
    samples = recording.samples.copy()
    for name, value in fields.items():
        samples[name] = value
    return Recording(samples, recording.arm, recording.dt, recording.settings, recording.before)


def test_frames_are_those_of_the_loops_clock(recording):
    (episode,) = pieces(recording, "a.npz", FPS, "pose")
    each = round(1.0 / (FPS * recording.dt))
    rows = each * np.arange(len(episode.times))
    assert len(rows) == (len(recording) - 1) // each
    np.testing.assert_allclose(episode.times, 0.1 * np.arange(len(rows)))
    names = state_columns(recording)
    assert episode.state.shape[1] == len(names)
    q = columns(names, "")[10 : 10 + recording.arm.chain.dof]
    np.testing.assert_allclose(episode.state[:, q], recording["q"][rows], atol=1e-6)
    pose = recording["pose"]
    np.testing.assert_allclose(episode.state[:, :3], pose[rows, :3, 3], atol=1e-6)
    np.testing.assert_allclose(episode.state[:, 3:9], rotation_6d(pose[rows, :3, :3]), atol=1e-6)
    jacobian = recording.arm.chain.jacobian(recording["q"][0])
    jacobian[3:] *= recording.arm.chain.characteristic_length
    sigma = np.linalg.svd(jacobian, compute_uv=False)
    assert episode.state[0, names.index("sigma_ratio")] == pytest.approx(sigma[-1] / sigma[0], abs=1e-6)
    # The pose action is the tool a frame later.
    np.testing.assert_allclose(episode.action[:, :3], pose[rows + each, :3, 3], atol=1e-6)
    assert set(episode.phase) <= {"twist", "hold", "stale", "changing_branch"}


def test_twist_actions_move_as_far_as_what_was_asked(recording):
    (episode,) = pieces(recording, "a.npz", FPS, "twist")
    each = round(1.0 / (FPS * recording.dt))
    asked = recording["asked_twist"][1 : each * len(episode.times) + 1]
    np.testing.assert_allclose(episode.action.sum(axis=0) / FPS, asked.sum(axis=0) * recording.dt, atol=1e-6)
    assert action_columns("twist") == ["tool.vx", "tool.vy", "tool.vz", "tool.wx", "tool.wy", "tool.wz"]


def test_recordings_are_cut_where_the_clock_has_a_gap(recording):
    clock, cycle = recording["time"].copy(), recording["cycle"].copy()
    clock[80:] += 0.5  # cycles that were left out, longer than a frame
    late = changed(recording, time=clock)
    first, second = pieces(late, "a.npz", FPS, "pose")
    np.testing.assert_allclose(first.state[0, :3], recording["pose"][0, :3, 3], atol=1e-6)
    np.testing.assert_allclose(second.state[0, :3], recording["pose"][80, :3, 3], atol=1e-6)
    assert (first.scene["part"], second.scene["part"]) == (0, 1)
    clock = recording["time"].copy()
    clock[80:] += 0.05  # within a frame
    assert len(list(pieces(changed(recording, time=clock), "a.npz", FPS, "pose"))) == 1
    cycle[120:] += 3  # samples that were lost
    assert len(list(pieces(changed(recording, cycle=cycle), "a.npz", FPS, "pose"))) == 2
    restarted = recording["restarted"].copy()
    restarted[10] = True  # the first part has less than two frames
    assert len(list(pieces(changed(recording, restarted=restarted), "a.npz", FPS, "pose"))) == 1


def test_the_guides_way_is_marked(recording):
    guide = recording["guide"].copy()
    guide[100:150] = int(sk.GuideState.CHANGING_BRANCH)
    (episode,) = pieces(changed(recording, guide=guide), "a.npz", FPS, "pose")
    assert [k for k, phase in enumerate(episode.phase) if phase == "changing_branch"] == [4, 5]


def test_a_folder_of_recordings_becomes_a_data_set_once(recording, tmp_path, capsys):
    recording.save(tmp_path / "episode-0000.npz")
    parser = argparse.ArgumentParser()
    export.options(parser)
    words = [str(tmp_path), "--out", str(tmp_path / "d"), "--action", "twist", "--task", "reach up"]
    assert export.run(parser.parse_args(words)) == 0
    recording.save(tmp_path / "episode-0001.npz")
    assert export.run(parser.parse_args(words)) == 0  # adds what is new
    assert capsys.readouterr().out.split()[-1] == str(tmp_path / "d")
    found = dataset.read(tmp_path / "d")
    assert [episode.scene["recording"] for episode in found] == ["episode-0000.npz", "episode-0001.npz"]
    facts = dataset.info(tmp_path / "d")
    assert facts["robot_type"] == "ur10"
    assert facts["features"]["action"]["names"] == action_columns("twist")
    (tmp_path / "empty").mkdir()
    with pytest.raises(ValueError, match="no recording"):
        export.run(parser.parse_args([str(tmp_path / "empty"), "--out", str(tmp_path / "e")]))
