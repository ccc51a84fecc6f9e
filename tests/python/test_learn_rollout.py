"""Rollouts: every scene to its end, the same whatever runs beside it, and sums that can be checked by hand."""

from __future__ import annotations

import concurrent.futures
import dataclasses
import math

import numpy as np
import pytest

pytest.importorskip("gymnasium")

from sigmaik_lab.learn import evaluate, show
from sigmaik_lab.learn.episode import PHASES
from sigmaik_lab.learn.rollout import DEMONSTRATOR, Piece, Rollout, Rollouts, load_rollouts, roll, save_rollouts
from sigmaik_lab.learn.summary import ALL_SEEDS, interval, summaries, summarize
from sigmaik_lab.report import Table

SEEDS = tuple(range(evaluate.HELD_OUT, evaluate.HELD_OUT + 4))


@pytest.fixture(scope="module")
def done():
    return roll(Piece(DEMONSTRATOR, "jparse", SEEDS))


def test_every_scene_runs_to_its_end(done):
    assert [r.seed for r in done.rollouts] == list(SEEDS)
    for r in done.rollouts:
        assert r.success == (r.reached == len(PHASES))
        assert r.tool.shape == (r.steps + 1, 3)
        assert r.sigma.shape == (r.steps + 1,)
        assert r.asked.shape == r.achieved.shape == (r.steps, 6)
        assert r.sigma.min() > 0.0
        # The tool's positions are the integral of its achieved twist.
        np.testing.assert_allclose(np.diff(r.tool, axis=0), 0.1 * r.achieved[:, :3], atol=1e-5)
    assert all(r.success and r.limits_broken == 0 for r in done.rollouts)


def test_scenes_do_not_depend_on_the_piece(done):
    alone = roll(Piece(DEMONSTRATOR, "jparse", SEEDS[2:3])).rollouts[0]
    for field in dataclasses.fields(Rollout):
        np.testing.assert_array_equal(getattr(alone, field.name), getattr(done.rollouts[2], field.name))


def test_scenes_that_come_to_no_end_are_cut():
    short = roll(Piece(DEMONSTRATOR, "stop", SEEDS[:2], max_steps=5))
    assert [r.steps for r in short.rollouts] == [5, 5]
    assert not any(r.success for r in short.rollouts)


def test_rollouts_survive_their_file(done, tmp_path):
    again = load_rollouts(save_rollouts(done, tmp_path / "r.npz"))
    assert (again.piece, again.digest) == (done.piece, done.digest)
    for a, b in zip(done.rollouts, again.rollouts, strict=True):
        for field in dataclasses.fields(Rollout):
            np.testing.assert_array_equal(getattr(a, field.name), getattr(b, field.name))
    np.savez(tmp_path / "other.npz", a=np.zeros(3))
    with pytest.raises(ValueError, match="not a file of rollouts"):
        load_rollouts(tmp_path / "other.npz")


# --- sums


def made(seed, reached, success, steps=20, broken=0):
    tool = np.zeros((steps + 1, 3), np.float32)
    asked, achieved = np.zeros((steps, 6), np.float32), np.zeros((steps, 6), np.float32)
    asked[:, 0] = 0.05
    sigma = np.full(steps + 1, 0.1, np.float32)
    sigma[3] = 0.01 * (1 + seed)
    return Rollout(seed, reached, success, False, broken, tool, sigma, asked, achieved)


def test_sums_of_rollouts():
    rows = [made(0, 4, True), made(1, 2, False, 30), made(2, 4, True, 40, 3)]
    s = summarize(("p", "jparse", "edge"), rows)
    assert (s.scenes, s.approach, s.grasp, s.carry, s.place) == (3, 3, 3, 2, 2)
    assert s.median_time == pytest.approx(3.0)
    assert s.lag == pytest.approx(0.05)
    assert s.least_sigma == pytest.approx(0.02)
    assert s.limits_broken == 3
    assert math.isnan(summarize(("p", "stop", "edge"), [made(0, 1, False)]).median_time)


def test_the_table_has_all_seeds_together():
    files = [
        Rollouts(Piece(f"out/policy-{k}.pt", rule, (0, 1)), "", (made(0, 4, True), made(1, 4 if k else 1, bool(k))))
        for k in range(2)
        for rule in ("stop", "jparse", None)
    ]
    files.append(Rollouts(Piece(DEMONSTRATOR, "jparse", (0,)), "", (made(0, 4, True),)))
    rows = summaries(files, evaluate.RULES)
    names = [(row.policy, row.rule) for row in rows]
    rules = ["jparse", "default", "stop"]
    assert names == [(p, r) for p in ("policy-0", "policy-1", ALL_SEEDS) for r in rules] + [(DEMONSTRATOR, "jparse")]
    assert [(r.scenes, r.place) for r in rows if r.policy == ALL_SEEDS] == [(4, 3)] * 3
    table = show.results_table(rows)
    assert isinstance(table, Table)
    assert "all of them" in str(table)


def test_the_interval_is_wilsons():
    assert interval(90, 100) == pytest.approx((0.8256, 0.9448), abs=1e-4)  # scipy.stats.binomtest(90, 100)
    assert interval(0, 20)[0] == 0.0
    assert interval(20, 20)[1] == 1.0


# --- the commands


def options(module, *words):
    import argparse

    parser = argparse.ArgumentParser()
    module.options(parser)
    return parser.parse_args(list(words))


def test_evaluate_goes_on_where_it_stopped(tmp_path, monkeypatch):
    words = ["--out", str(tmp_path), "--policy", DEMONSTRATOR, "--scenes", "3", "--max-steps", "4", "--jobs", "1"]
    assert evaluate.run(options(evaluate, *words, "--rule", "jparse")) == 0
    pieces = []
    monkeypatch.setattr(evaluate, "roll", lambda piece: (pieces.append(piece), roll(piece))[1])
    assert evaluate.run(options(evaluate, *words, "--rule", "jparse", "--rule", "default")) == 0
    assert [piece.rule for piece in pieces] == [None]
    assert evaluate.run(options(evaluate, *words[:-4], "--max-steps", "5", "--jobs", "1", "--rule", "jparse")) == 0
    assert len(pieces) == 2  # another question is another piece


def test_show_makes_table_and_picture(tmp_path, capsys):
    pytest.importorskip("matplotlib")
    for rule in ("jparse", "stop"):
        save_rollouts(roll(Piece(DEMONSTRATOR, rule, SEEDS[:2], max_steps=6)), tmp_path / "rollouts" / f"{rule}.npz")
    assert show.run(options(show, "--out", str(tmp_path))) == 0
    assert "demonstrator" in capsys.readouterr().out
    assert (tmp_path / "results.png").stat().st_size > 10_000
    assert len((tmp_path / "results.csv").read_text().splitlines()) == 3
    with pytest.raises(ValueError, match="no rollouts"):
        show.run(options(show, "--out", str(tmp_path / "nothing")))


def test_wrong_options_are_refused(tmp_path):
    for words, said in (
        (("--rule", "jparce"), "unknown method"),
        (("--scenes", "0"), "positive"),
        (("--execute", "0"), "positive"),
    ):
        with pytest.raises((ValueError, TypeError), match=said):
            evaluate.run(options(evaluate, "--out", str(tmp_path), *words))


def test_a_policy_drives_the_same_on_any_executor(tmp_path):
    torch = pytest.importorskip("torch")
    from sigmaik_lab.learn.policy import Policy, Scale, Shape
    from sigmaik_lab.learn.windows import FEATURES, WIDTH

    torch.set_num_threads(1)
    shape = Shape(horizon=4, channels=(8, 8), hidden=8, levels=10)
    rng = np.random.default_rng(0)
    said = rng.normal(scale=0.01, size=(50, 4, WIDTH)).astype(np.float32)
    said[..., 3:9] += [1, 0, 0, 0, 1, 0]
    scale = Scale.of(rng.normal(size=(50, FEATURES)).astype(np.float32), said)
    file = Policy.make("ufactory_xarm7", shape, scale, 0).save(tmp_path / "policy.pt")
    piece = Piece(str(file), "jparse", SEEDS[:2], max_steps=8, execute=2)
    here = roll(piece)
    with concurrent.futures.ThreadPoolExecutor(1) as pool:
        there = pool.submit(roll, piece).result()
    for a, b in zip(here.rollouts, there.rollouts, strict=True):
        np.testing.assert_array_equal(a.tool, b.tool)
    assert here.digest == evaluate.digest(str(file))
    with pytest.raises(ValueError, match="trained on"):
        roll(dataclasses.replace(piece, robot="ur10"))
