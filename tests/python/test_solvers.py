"""`sigmaik solvers`: positions near singularities, by several solvers."""

import csv
import math
import sys

import numpy as np
import pytest

import sigmaik as sk
from sigmaik_lab.__main__ import main
from sigmaik_lab.solvers.cases import BINS, PANELS, STARTS, STEP, condition_number, draw_cases, position_jacobian
from sigmaik_lab.solvers.experiment import solve_cases, summarize_solvers
from sigmaik_lab.solvers.solvers import SOLVERS, check_solver, make_solver

PANDA = sk.robots.load("franka_panda")
CASES = draw_cases(PANDA, 6, seed=4)


class Answers:
    """A solver with given answers."""

    def __init__(self, answer):
        self.solve = answer


def test_the_cases_are_what_they_say():
    assert {(case.panel, case.group) for case in CASES} == {
        *((panel, group) for panel in ("condition", "amplification") for group in BINS),
        *(("starts", group) for group in STARTS),
    }
    assert set(PANELS) == {case.panel for case in CASES}
    assert len(CASES) == 6 * (2 * len(BINS) + len(STARTS))
    limits = PANDA.limits
    for case in CASES:
        inside = np.all((case.start >= limits.lower) & (case.start <= limits.upper))
        assert inside == (case.group not in ("outside", "zeros"))
        if case.group == "limits":
            assert np.all((case.start == limits.lower) | (case.start == limits.upper))
        if case.panel == "amplification":
            kappa = condition_number(PANDA, case.start)
            assert BINS[case.group][0] <= kappa < BINS[case.group][1]
            step = case.target - PANDA.pose(case.start)[:3, 3]
            assert np.linalg.norm(step) == pytest.approx(STEP)
            # The least way is that of the pseudo-inverse, an independent computation.
            least = np.linalg.norm(np.linalg.pinv(position_jacobian(PANDA, case.start)) @ step)
            assert case.least == pytest.approx(least, rel=1e-6)
    again = draw_cases(PANDA, 6, seed=4)
    assert all(np.array_equal(a.target, b.target) for a, b in zip(CASES, again, strict=True))
    with pytest.raises(ValueError, match="condition number"):
        draw_cases(sk.Chain.from_urdf(_cartesian()), 3, seed=0)


def _cartesian():
    """Three prismatic joints at right angles: the condition number is 1 everywhere."""
    joints = "".join(
        f'<link name="l{i}"/><joint name="j{i}" type="prismatic"><parent link="l{i}"/><child link="l{i + 1}"/>'
        f'<axis xyz="{axis}"/><limit lower="-1" upper="1" velocity="1" effort="1"/></joint>'
        for i, axis in enumerate(("1 0 0", "0 1 0", "0 0 1"))
    )
    return f'<robot name="xyz">{joints}<link name="l3"/></robot>'


def test_answers_are_judged():
    steps = [case for case in CASES if case.panel == "amplification"]
    standing = solve_cases(PANDA, "still", Answers(lambda target, start: start), CASES)
    for row in standing:
        assert row.way == 0.0
        if row.panel == "amplification":  # a step that is not made is not solved, though its error is small
            assert row.error == pytest.approx(STEP)
            assert not row.solved
            assert math.isnan(row.amplification)

    def newton(target, start):
        J = position_jacobian(PANDA, start)
        return start + np.linalg.pinv(J) @ (target - PANDA.pose(start)[:3, 3])

    rows = solve_cases(PANDA, "newton", Answers(newton), [case for case in steps if case.group == "κ < 5"])
    for row in rows:
        if row.solved:
            assert row.ratio == pytest.approx(1.0, abs=1e-6)
    assert any(row.solved for row in rows)
    outside = solve_cases(PANDA, "out", Answers(lambda target, start: np.full(7, 9.0)), CASES)
    assert not any(row.inside or row.solved for row in outside)
    broken = Answers(lambda target, start: 1 / 0)
    assert [r.error for r in solve_cases(PANDA, "broken", broken, CASES)] == [r.error for r in standing]
    nowhere = Answers(lambda target, start: np.full(7, math.nan))
    assert all(row.error == math.inf and not row.solved for row in solve_cases(PANDA, "nan", nowhere, CASES))


@pytest.mark.parametrize("name", ["PositionIk", "PositionIk-any"])
def test_position_ik_solves_all_reachable_targets(name):
    reachable = [case for case in CASES if case.panel != "amplification"]  # a step may lead out of reach
    rows = solve_cases(PANDA, name, make_solver(name, PANDA), reachable)
    assert all(row.solved for row in rows)
    assert max(row.error for row in rows) < 1e-6


@pytest.mark.filterwarnings("ignore::DeprecationWarning")  # of hppfcl, in pinocchio 3
@pytest.mark.parametrize("name", SOLVERS)
def test_solvers_make_small_steps_far_from_singularities(name):
    try:
        solver = make_solver(name, PANDA)
    except sk.Error as missing:
        pytest.skip(str(missing))
    cases = [case for case in CASES if (case.panel, case.group) == ("amplification", "κ < 5")]
    (row,) = summarize_solvers(solve_cases(PANDA, name, solver, cases))
    assert row.solved >= 0.8
    if name != "PositionIk-any":
        assert 0.9 < row.ratio < 3.0


def test_command(tmp_path, capsys, monkeypatch):
    arguments = ["solvers", "--trials", "2", "--solver", "PositionIk,dls", "--out", str(tmp_path)]
    assert main(arguments) == 0
    out = capsys.readouterr().out
    assert out.strip().splitlines()[-1] == str(tmp_path / "franka_panda-solvers.png")
    assert (tmp_path / "franka_panda-solvers.png").stat().st_size > 10_000
    with (tmp_path / "franka_panda-solvers.csv").open() as stream:
        rows = list(csv.DictReader(stream))
    assert len(rows) == 2 * (2 * len(BINS) + len(STARTS))
    assert main([*arguments, "--solver", "magic"]) == 2
    assert "no solver 'magic'" in capsys.readouterr().err
    assert main([*arguments, "--trials", "0"]) == 2
    monkeypatch.setitem(sys.modules, "optik", None)
    with pytest.raises(sk.Error, match="pip install optik-py"):
        check_solver("optik")
