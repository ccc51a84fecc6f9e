"""sk.least_squares against independent solvers: scipy's lsq_linear, quadprog (Goldfarb and Idnani), ProxQP."""

import numpy as np
import proxsuite
import pytest
import quadprog
import scipy.optimize

import sigmaik as sk


def bounds(rng, n, width=1.0):
    lower = -width * rng.uniform(0.1, 1.0, n)
    upper = width * rng.uniform(0.1, 1.0, n)
    lower[rng.random(n) < 0.15] = -np.inf
    upper[rng.random(n) < 0.15] = np.inf
    return lower, upper


def test_box_against_scipy():
    rng = np.random.default_rng(0)
    for _ in range(400):
        n = rng.integers(1, 13)
        m = rng.integers(n, 20)  # at least n rows: the answer is unique
        A, b = rng.normal(size=(m, n)), 3 * rng.normal(size=m)
        lower, upper = bounds(rng, n)
        answer = sk.least_squares(A, b, lower=lower, upper=upper)
        oracle = scipy.optimize.lsq_linear(A, b, (lower, upper), method="bvls", tol=1e-14)
        np.testing.assert_allclose(answer.x, oracle.x, atol=1e-9)
        assert answer.status == "optimal"
        assert set(answer.at_lower) <= set(np.flatnonzero(answer.x == lower))
        assert set(answer.at_upper) <= set(np.flatnonzero(answer.x == upper))


def test_box_of_short_rank_against_scipy():
    """Where many answers have one residual, our answer has this residual and is the shortest of the answers tried."""
    rng = np.random.default_rng(1)
    for _ in range(300):
        n = rng.integers(2, 13)
        m = rng.integers(1, n)
        A, b = rng.normal(size=(m, n)), 3 * rng.normal(size=m)
        lower, upper = bounds(rng, n)
        answer = sk.least_squares(A, b, lower=lower, upper=upper)
        oracle = scipy.optimize.lsq_linear(A, b, (lower, upper), method="bvls", tol=1e-14)
        ours, theirs = np.linalg.norm(A @ answer.x - b), np.linalg.norm(A @ oracle.x - b)
        assert ours <= theirs + 1e-9
        if theirs > 1e-6:
            assert ours == pytest.approx(theirs, rel=1e-6)
        assert np.linalg.norm(answer.x) <= np.linalg.norm(oracle.x) + 1e-9


@pytest.mark.parametrize(("solver", "tolerance"), [("quadprog", 1e-8), ("proxqp", 1e-4)])
def test_everything_against_quadratic_programs(solver, tolerance):
    """Feasible problems with all parts at once. ProxQP stops at a residual, quadprog at the answer."""
    rng = np.random.default_rng(2)
    compared = 0
    for _ in range(300):
        n = rng.integers(3, 13)
        p, k = rng.integers(0, min(3, n - 1)), rng.integers(1, 13)
        m = rng.integers(n, 20)
        A, b = rng.normal(size=(m, n)), 5 * rng.normal(size=m)
        inside = rng.uniform(-0.05, 0.05, n)
        C = rng.normal(size=(p, n))
        G = rng.normal(size=(k, n))
        d, h = C @ inside, G @ inside + rng.uniform(0.05, 1.0, k)
        lower, upper = -rng.uniform(0.1, 1, n), rng.uniform(0.1, 1, n)
        parts = {"C": C, "d": d} if p else {}
        answer = sk.least_squares(A, b, lower=lower, upper=upper, G=G, h=h, **parts)
        assert answer.status == "optimal"
        if solver == "quadprog":
            normals = np.vstack([C, -G, np.eye(n), -np.eye(n)]).T
            x = quadprog.solve_qp(A.T @ A, A.T @ b, normals, np.concatenate([d, -h, lower, -upper]), p)[0]
        else:
            result = proxsuite.proxqp.dense.solve(
                A.T @ A, -A.T @ b, C if p else None, d if p else None, np.vstack([G, np.eye(n)]),
                np.concatenate([np.full(k, -1e20), lower]), np.concatenate([h, upper]), eps_abs=1e-9)  # fmt: skip
            if result.info.status != proxsuite.proxqp.PROXQP_SOLVED:
                continue
            x = result.x
        compared += 1
        np.testing.assert_allclose(answer.x, x, atol=tolerance)
        assert answer.violation <= 1e-12
        assert answer.equality_error <= 1e-12
    assert compared >= 290


def test_equalities_that_cannot_be_met_come_first():
    """Lexicographic, against two bounded problems one after the other."""
    rng = np.random.default_rng(3)
    for _ in range(200):
        n = rng.integers(3, 10)
        p = rng.integers(1, 4)
        A, b = rng.normal(size=(n, n)), rng.normal(size=n)
        C, d = rng.normal(size=(p, n)), 30 * rng.normal(size=p)
        lower, upper = -rng.uniform(0.1, 1, n), rng.uniform(0.1, 1, n)
        answer = sk.least_squares(A, b, C=C, d=d, lower=lower, upper=upper)
        first = scipy.optimize.lsq_linear(C, d, (lower, upper), method="bvls", tol=1e-14)
        residual = np.linalg.norm(C @ first.x - d)
        assert answer.equality_error == pytest.approx(residual, rel=1e-9, abs=1e-9)
        assert answer.status == ("infeasible" if residual > 1e-6 else "optimal")


def test_shortest_answer_is_numpys():
    rng = np.random.default_rng(4)
    for _ in range(200):
        m, n = rng.integers(1, 13, 2)
        A, b = rng.normal(size=(m, n)), rng.normal(size=m)
        if rng.random() < 0.5 and min(m, n) > 1:
            A = A[:, :1] @ A[:1, :] + A[:, 1:2] @ A[1:2, :]
        np.testing.assert_allclose(sk.least_squares(A, b).x, np.linalg.lstsq(A, b, rcond=1e-12)[0], atol=1e-8)


def test_refusals():
    A, b = np.eye(3), np.zeros(3)
    cases = [
        (dict(A=A), "given together"),
        (dict(A=A, b=b[:2]), "b"),
        (dict(A=A, b=b, C=np.eye(2), d=[0, 0]), "C"),
        (dict(A=A, b=b, lower=[0, 0]), "lower"),
        (dict(A=A, b=b, lower=[1, 0, 0], upper=[0, 1, 1]), r"lower\[0\]"),
        (dict(A=A, b=b, lower=[np.nan, 0, 0]), r"lower\[0\]"),
        (dict(A=np.eye(30), b=np.zeros(30)), "24"),
        (dict(A=A * np.nan, b=b), "A"),
        (dict(), "nothing"),
        (dict(A="x", b=b), "A"),
        (dict(A=A, b=b, C=np.zeros((9, 3)), d=np.zeros(9)), "C"),
    ]
    for arguments, text in cases:
        with pytest.raises(sk.Error, match=text):
            sk.least_squares(arguments.pop("A", None), arguments.pop("b", None), **arguments)
