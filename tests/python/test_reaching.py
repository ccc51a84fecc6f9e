"""The reaching benchmark."""

import csv

import numpy as np
import pytest

import sigmaik as sk
from sigmaik_lab.reaching import experiment as rc


@pytest.mark.parametrize("robot", rc.ROBOTS)
def test_planners_beat_the_straight_line_by_the_papers_margins(robot):
    runs = []
    for number in range(25):
        chain, start, goal = rc.task(robot, 0, number)
        runs += [rc.solve_task(chain, start, goal, m, number) for m in ("straight", "gradient", "stochastic")]
    line, *planned = rc.summarize_runs(runs)
    paper_line, paper = rc.PAPER[robot]["straight"], rc.PAPER[robot]["stochastic"]
    for summary in planned:
        assert summary.lambda_1 / line.lambda_1 >= paper[0] / paper_line[0]
        assert summary.m / line.m >= paper[1] / paper_line[1]
        assert summary.kappa - line.kappa <= paper[2] - paper_line[2]
        assert summary.length <= 1.4 * line.length
        assert summary.arrived == 1.0


def test_metrics_of_a_straight_line():
    chain, start, goal = rc.task("ur10", 0, 0)
    run = rc.solve_task(chain, start, goal, "straight")
    q = start + np.linspace(0, 1, rc.POINTS)[:, None] * (goal - start)
    eigenvalues = np.linalg.eigvalsh(chain.jacobian(q) @ chain.jacobian(q).transpose(0, 2, 1))
    assert run.length == pytest.approx(np.linalg.norm(goal - start))
    assert run.lambda_1 == pytest.approx(eigenvalues[:, 0].mean(), rel=1e-6)
    assert run.m == pytest.approx(np.mean(sk.indices.evaluate(chain, q, "manipulability")), rel=1e-9)
    assert run.acceleration == pytest.approx(0.0, abs=1e-6)


def test_task_priority_follows_the_tool():
    chain, start, goal = rc.task("kuka_lbr_iiwa_14_r820", 0, 3)
    path = rc._task_priority(chain, start, goal)
    assert np.all(path >= chain.limits.lower)
    assert np.all(path <= chain.limits.upper)
    assert path[0] == pytest.approx(start)


def test_tasks_are_seeded_and_inside():
    for robot in rc.ROBOTS:
        chain, start, goal = rc.task(robot, 1, 2)
        again = rc.task(robot, 1, 2)
        assert np.array_equal(start, again[1])
        for q in (start, goal):
            assert np.all(q >= chain.limits.lower)
            assert np.all(q <= chain.limits.upper)
        assert not np.array_equal(start, rc.task(robot, 1, 3)[1])


def test_command(tmp_path, capsys):
    from sigmaik_lab.__main__ import main

    command = ["reaching", "--robot", "ur10", "--tasks", "2", "--out", str(tmp_path)]
    assert main(command) == 0
    out = capsys.readouterr().out
    assert "paper" in out
    assert out.splitlines()[-1] == str(tmp_path / "reaching.csv")
    with open(tmp_path / "reaching.csv", newline="") as stream:
        rows = list(csv.DictReader(stream))
    assert [row["method"] for row in rows] == list(rc.METHODS)
    assert main([*command, "--method", "luck"]) == 2
    assert main([*command, "--tasks", "0"]) == 2
    assert main([*command, "--robot", "nobody"]) == 2
