"""The Monte Carlo study: repeatable, resumable, on any executor."""

import concurrent.futures
import math
import subprocess
import sys

import numpy as np
import pytest

import sigmaik as sk
from sigmaik_lab.montecarlo import experiment as mc
from sigmaik_lab.montecarlo.paper import PAPER

STUDY = mc.MonteCarlo("franka_panda", samples=20, seed=3)


def timeless(rows):
    return [{**vars(row), "solve_time": 0.0} for row in rows]


@pytest.fixture(scope="module")
def expected():
    return [row for sample in range(STUDY.samples) for row in mc.solve_sample(STUDY, sample)]


def test_metrics(expected):
    chain = STUDY.chain()
    start, goal = mc.sample_pair(STUDY, chain, 0)
    assert min(sk.indices.manipulability(chain.jacobian(q)) for q in (start, goal)) >= 1e-4
    plan = sk.planning.time_optimal(chain, start, goal, time_weight=600.0, between_nodes=False)
    row = expected[0]
    m = sk.indices.evaluate(chain, plan.q, "manipulability")
    path = chain.pose(plan.q)[:, :3, 3]
    assert (row.sample, row.objective, row.status) == (0, "none", "optimal")
    assert row.duration == plan.duration
    assert (row.m_min, row.m_max) == (m.min(), m.max())
    assert row.m_avg == pytest.approx(m.mean())
    assert row.l_p == pytest.approx(sum(np.linalg.norm(b - a) for a, b in zip(path, path[1:], strict=False)))
    assert row.m_dense == plan.clearance.min_manipulability <= row.m_min + 1e-12
    turns = [
        np.linalg.norm(sk.rotation_log(b @ a.T))
        for a, b in zip(*(chain.pose(plan.q)[s, :3, :3] for s in (slice(-1), slice(1, None))), strict=True)
    ]
    assert row.angle == pytest.approx(sum(turns))


def test_shepperd():
    rng = np.random.default_rng(0)
    vectors = rng.normal(size=(500, 3)) * rng.uniform(0, 2, (500, 1))
    rotations = np.array([sk.rotation_exp(v) for v in vectors])
    q = mc.shepperd(rotations)
    assert np.linalg.norm(q, axis=1) == pytest.approx(np.ones(500))
    assert np.all(q[np.arange(500), np.abs(q).argmax(axis=1)] > 0.0)
    w, v = q[:, 0], q[:, 1:]
    angles = 2.0 * np.arctan2(np.linalg.norm(v, axis=1), w)
    for rotation, axis, angle in zip(rotations, v, angles, strict=True):
        again = sk.rotation_exp(axis / np.linalg.norm(axis) * angle)
        assert again == pytest.approx(rotation, abs=1e-12)


def test_here(tmp_path, expected):
    done = []
    rows = mc.run_study(STUDY, tmp_path / "a.csv", advance=done.append)
    assert timeless(rows) == timeless(expected)
    assert sum(done) == STUDY.samples
    study, again = mc.read_rows(tmp_path / "a.csv")
    assert study["robot"] == "franka_panda"
    assert again == rows


@pytest.mark.parametrize("kind", [concurrent.futures.ThreadPoolExecutor, concurrent.futures.ProcessPoolExecutor])
def test_executors(tmp_path, expected, kind):
    with kind(2) as executor:
        rows = mc.run_study(STUDY, tmp_path / "a.csv", executor, jobs=2)
    assert timeless(rows) == timeless(expected)


def test_dask(tmp_path, expected):
    distributed = pytest.importorskip("distributed")
    with (
        distributed.LocalCluster(
            n_workers=2, threads_per_worker=1, dashboard_address=None, host="127.0.0.1"
        ) as cluster,
        distributed.Client(cluster) as client,
    ):
        rows = mc.run_study(STUDY, tmp_path / "a.csv", client.get_executor(), jobs=2)
        assert timeless(rows) == timeless(expected)
        # And by the command, given the address.
        command = ["montecarlo", "--robot", "franka_panda", "--samples", "4", "--no-plot", "--out", str(tmp_path / "b")]
        run = subprocess.run(
            [sys.executable, "-m", "sigmaik_lab", *command, "--dask", cluster.scheduler_address],
            capture_output=True,
            text=True,
            timeout=120,
        )
        assert run.returncode == 0, run.stderr
        assert run.stdout.splitlines()[-1] == str(tmp_path / "b" / "franka_panda-montecarlo-w600.csv")


def test_resumes_after_an_interruption(tmp_path, expected):
    file = tmp_path / "a.csv"

    class Stop(Exception):
        pass

    done = []

    def stop_after_seven(n):
        done.append(n)
        if sum(done) == 7:
            raise Stop

    with pytest.raises(Stop):
        mc.run_study(STUDY, file, advance=stop_after_seven)
    text = file.read_text()
    assert len(mc.read_rows(file)[1]) == 21
    file.write_text(text[:-30])  # cut within a line, as a crash may
    first = []
    rows = mc.run_study(STUDY, file, advance=first.append)
    assert first[0] == 6
    assert timeless(rows) == timeless(expected)
    kept = file.read_text()
    assert mc.run_study(STUDY, file) == rows
    assert file.read_text() == kept
    # More samples are added, none repeated.
    more = mc.run_study(mc.MonteCarlo("franka_panda", samples=22, seed=3), file)
    assert [row.sample for row in more] == sorted([s for s in range(22)] * 3)
    assert more[: len(rows)] == rows


def test_another_study_is_refused(tmp_path):
    file = tmp_path / "a.csv"
    mc.run_study(mc.MonteCarlo("franka_panda", samples=1), file)
    with pytest.raises(ValueError, match="another study"):
        mc.run_study(mc.MonteCarlo("franka_panda", samples=1, seed=1), file)
    (tmp_path / "b.csv").write_text("something else\n")
    with pytest.raises(ValueError, match="not the file of a study"):
        mc.run_study(STUDY, tmp_path / "b.csv")
    assert (tmp_path / "b.csv").read_text() == "something else\n"


def test_summary(expected):
    failed = mc.Row(99, "none", "failed", math.nan, 0.1, *[math.nan] * 7, 0, 0, math.nan)
    none, manipulability, potential = mc.summarize_study([*expected, failed])
    assert [none.objective, manipulability.objective, potential.objective] == list(mc.OBJECTIVES)
    assert (none.count, none.failed, none.unfinished) == (21, 1, 0)
    durations = [row.duration for row in expected if row.objective == "none"]
    assert none.duration == mc.Mean(pytest.approx(np.mean(durations)), pytest.approx(np.std(durations)))
    assert manipulability.m_avg.mean > potential.m_avg.mean
    assert none.duration.mean < potential.duration.mean < manipulability.duration.mean
    assert all(set(columns) == set(mc.OBJECTIVES) for columns in PAPER.values())


def test_joints_of_many_turns_are_cut_to_one():
    chain = mc.MonteCarlo("comau_racer_7_1_4").chain()
    assert (chain.limits.lower[5], chain.limits.upper[5]) == (-math.pi, math.pi)
    assert chain.limits.upper[4] == sk.robots.load("comau_racer_7_1_4").limits.upper[4]


@pytest.mark.parametrize(
    ("arguments", "text"),
    [
        ({"robot": "nobody"}, "no shipped arm"),
        ({"robot": "ur10"}, "not known"),
        ({"samples": 0}, "samples"),
        ({"objectives": ("speed",)}, "objectives"),
        ({"objectives": ()}, "objectives"),
    ],
)
def test_refusals(arguments, text):
    with pytest.raises(ValueError, match=text):
        mc.MonteCarlo(**arguments)


def test_command(tmp_path, capsys):
    from sigmaik_lab.__main__ import main

    command = ["montecarlo", "--robot", "comau_racer_7_1_4", "--samples", "6", "--jobs", "1", "--out", str(tmp_path)]
    assert main(command) == 0
    out = capsys.readouterr().out
    assert "paper" in out
    assert "must cross" in out
    assert out.splitlines()[-1] == str(tmp_path / "comau_racer_7_1_4-montecarlo-w600.csv")
    assert (tmp_path / "comau_racer_7_1_4-montecarlo-w600.png").stat().st_size > 10_000
    assert main([*command, "--seed", "5"]) == 2
    assert "another study" in capsys.readouterr().err
    assert main(["montecarlo", "--robot", "ur10"]) == 2
    assert main(["montecarlo", "--dask", "tcp://127.0.0.1:1", "--out", str(tmp_path / "x")]) == 2
