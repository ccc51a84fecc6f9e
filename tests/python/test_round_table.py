"""The arm round a table."""

import numpy as np
import pytest

import sigmaik as sk
from sigmaik_lab.round_table import experiment as at


@pytest.mark.parametrize("seed", range(4))
def test_free_of_collisions_and_further_from_singularities_with_the_index(seed):
    task = at.load(seed)
    with_index, without = (at.plan(task, index, seed) for index in (True, False))
    assert with_index.status != "failed"
    assert without.status != "failed"
    a, b = at.along(task, with_index), at.along(task, without)
    assert a.distance.min() > -1e-3
    assert b.distance.min() > -1e-3
    assert a.m.mean() >= b.m.mean()
    assert a.lambda_1.mean() >= b.lambda_1.mean()
    assert a.kappa.mean() <= b.kappa.mean()
    assert a.q[0] == pytest.approx(task.start)
    assert a.q[-1] == pytest.approx(task.goal, abs=1e-12)


def test_by_the_gradient():
    failed = {}
    for restarts in (0, 4):
        failed[restarts] = []
        for seed in range(24):
            task = at.load(seed)
            plan = sk.planning.gradient(
                task.chain, task.start, task.goal, task.obstacles, spheres=task.spheres, restarts=restarts
            )
            if plan.status == "failed":
                failed[restarts].append(seed)
            else:
                assert at.along(task, plan).distance.min() > -1e-3
    assert failed[0]
    assert failed[4] == []


def test_command(tmp_path, capsys):
    from sigmaik_lab.__main__ import main

    assert main(["table", "--out", str(tmp_path)]) == 0
    out = capsys.readouterr().out
    assert out.splitlines()[-1] == str(tmp_path / "table.png")
    assert (tmp_path / "table.png").stat().st_size > 20_000
    assert main(["table", "--seed", "-1"]) == 2


def test_scene_is_seeded():
    one, two = at.load(3), at.load(3)
    assert np.array_equal(one.start, two.start)
    assert np.array_equal(one.goal, two.goal)
