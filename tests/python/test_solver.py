"""VelocitySolver and Spectrum from Python: numpy as the oracle, masks and frames, status of the answer."""

import numpy as np
import pytest
from all_methods import METHODS

import sigmaik as sk


def random_rotation(rng):
    Q = np.linalg.qr(rng.normal(size=(3, 3)))[0]
    return Q * np.linalg.det(Q)


# Spectrum ----------


def test_spectrum_is_numpys_for_every_size():
    rng = np.random.default_rng(1)
    for m in range(1, 7):
        for n in range(1, 17):
            k = min(m, n)
            for _ in range(10):
                J = rng.normal(size=(m, n)) * 10 ** rng.uniform(-100, 100)
                U, sigma, V = sk.Spectrum().decompose(J)
                assert (U.shape, sigma.shape, V.shape) == ((m, m), (k,), (n, k))
                np.testing.assert_allclose(sigma, np.linalg.svd(J, compute_uv=False), rtol=0, atol=1e-14 * sigma[0])
                np.testing.assert_allclose(U.T @ U, np.eye(m), atol=1e-14)
                np.testing.assert_allclose(V.T @ V, np.eye(k), atol=1e-14)
                np.testing.assert_allclose(U[:, :k] * sigma @ V.T, J, rtol=0, atol=1e-14 * sigma[0])


def test_spectrum_of_zero_and_of_integers():
    U, sigma, V = sk.Spectrum().decompose(np.zeros((6, 7)))
    np.testing.assert_array_equal(sigma, np.zeros(6))
    np.testing.assert_array_equal(U, np.eye(6))
    np.testing.assert_array_equal(V, np.eye(7, 6))
    U, sigma, V = sk.Spectrum().decompose([[3, 0], [0, 0]])
    np.testing.assert_array_equal(sigma, [3, 0])
    np.testing.assert_array_equal(np.abs(V), np.eye(2))


def test_spectrum_starts_warm():
    rng = np.random.default_rng(2)
    A, B = rng.normal(size=(2, 6, 7))
    spectrum = sk.Spectrum()
    last, cold, warm = None, [], []
    for t in np.arange(0, 1, 1e-3):
        J = np.cos(t) * A + np.sin(t) * B
        U, sigma, V = spectrum.decompose(J)
        fresh = sk.Spectrum()
        fresh.decompose(J)
        cold.append(fresh.sweeps)
        np.testing.assert_allclose(U[:, :6] * sigma @ V.T, J, rtol=0, atol=1e-14 * sigma[0])
        if last is not None:
            warm.append(spectrum.sweeps)
            assert np.max(np.abs(U - last)) < 0.1
        last = U
    assert np.mean(warm) < 3.5 < np.mean(cold)
    assert np.max(warm) <= 5


# Frames and masks ----------


@pytest.mark.parametrize("frame", ["base", "tool"])
def test_every_mask(frame):
    rng = np.random.default_rng(3)
    for bits in range(1, 64):
        mask = [bool(bits >> i & 1) for i in range(6)]
        J, twist, R = rng.normal(size=(6, 7)), rng.normal(size=6), random_rotation(rng)
        turn = np.kron(np.eye(2), R.T) if frame == "tool" else np.eye(6)
        rows = turn[mask]
        weights = np.array([1, 1, 1, 0.4, 0.4, 0.4])[mask]
        solver = sk.VelocitySolver(sk.DampedLeastSquares(0.3), 0.4, mask, frame)
        s = solver.solve(J, twist, rotation=R)
        A = weights[:, None] * (rows @ J)
        expected = A.T @ np.linalg.solve(A @ A.T + 0.09 * np.eye(len(A)), weights * (rows @ twist))
        np.testing.assert_allclose(s.qdot, expected, rtol=0, atol=1e-12)
        np.testing.assert_allclose(s.singular_values, np.linalg.svd(A, compute_uv=False), atol=1e-13)
        np.testing.assert_allclose(s.achieved_twist, J @ s.qdot, atol=1e-13)
        assert s.directions.shape == (sum(mask), sum(mask))
        assert s.singular.shape == (sum(mask),)
        # The mask's rows may be taken out beforehand.
        if bits != 63:
            t = solver.solve(rows @ J, rows @ twist)
            np.testing.assert_allclose(t.qdot, expected, rtol=0, atol=1e-12)
            np.testing.assert_allclose(t.achieved_twist, rows @ J @ s.qdot, atol=1e-13)


def test_masks_may_be_booleans_integers_or_floats():
    J, twist = np.random.default_rng(4).normal(size=(6, 7)), np.arange(6.0)
    answers = [
        sk.VelocitySolver(sk.JParse(), mask=mask).solve(J, twist).qdot
        for mask in ([1, 1, 1, 0, 0, 0], (True,) * 3 + (False,) * 3, np.array([1.0, 1, 1, 0, 0, 0]))
    ]
    np.testing.assert_array_equal(answers[0], answers[1])
    np.testing.assert_array_equal(answers[0], answers[2])


@pytest.mark.parametrize(
    "mask",
    [
        [0] * 6,
        [1] * 5,
        [1] * 7,
        [1, 1, 1, 0, 0, 2],
        [0.5] * 6,
        "111000",
        [np.nan] * 6,
        [[1] * 6],
        1,
        [-1] * 6,
    ],
)
def test_masks_that_make_no_sense(mask):
    with pytest.raises(sk.Error, match="mask"):
        sk.VelocitySolver(sk.JParse(), mask=mask)


def test_a_tool_frame_needs_a_rotation():
    J, twist = np.ones((6, 7)), np.ones(6)
    solver = sk.VelocitySolver(sk.JParse(), frame="tool")
    with pytest.raises(sk.Error, match="rotation"):
        solver.solve(J, twist)
    for bad in (np.eye(4), 2 * np.eye(3), np.diag([1, 1, -1]), np.full((3, 3), np.nan)):
        with pytest.raises(sk.Error, match="rotation"):
            solver.solve(J, twist, rotation=bad)
    for bad in ("tip", "Base", "", "world"):
        with pytest.raises(sk.Error, match="frame"):
            sk.VelocitySolver(sk.JParse(), frame=bad)


def test_rows_beyond_the_third_are_angular():
    rng = np.random.default_rng(5)
    for m in range(1, 7):
        J, twist = rng.normal(size=(m, 7)), rng.normal(size=m)
        s = sk.VelocitySolver(sk.DampedLeastSquares(0.3), length_scale=0.2).solve(J, twist)
        weights = np.array([1, 1, 1, 0.2, 0.2, 0.2])[:m]
        A = weights[:, None] * J
        expected = A.T @ np.linalg.solve(A @ A.T + 0.09 * np.eye(m), weights * twist)
        np.testing.assert_allclose(s.qdot, expected, rtol=0, atol=1e-12)


# Status of the answer ----------


@pytest.mark.parametrize("method", METHODS, ids=repr)
def test_status_and_achieved_twist(method):
    rng = np.random.default_rng(6)
    seen = set()
    for _ in range(500):
        m, n = rng.integers(1, 7), rng.integers(1, 10)
        J = rng.normal(size=(m, n))
        if rng.random() < 0.5:
            J[-1] = 1e-3 * J[-1] if rng.random() < 0.5 else J[0]
        twist = J @ rng.normal(size=n) if rng.random() < 0.5 else rng.normal(size=m)
        twist *= 10 ** rng.uniform(-3, 0)
        s = sk.VelocitySolver(method).solve(J, twist)
        seen.add(s.status)
        np.testing.assert_allclose(s.achieved_twist, J @ s.qdot, rtol=0, atol=1e-13 * (1 + np.linalg.norm(s.qdot)))
        missed = np.linalg.norm(s.achieved_twist - twist) / np.linalg.norm(twist)
        assert (s.status == sk.Status.OK) == (missed < 1e-9) or 3e-10 < missed < 3e-9
        assert s.status in (sk.Status.OK, sk.Status.DAMPED)
        np.testing.assert_array_equal(s.directions[:, s.singular], s.singular_directions)
        assert s.singular_directions.shape == (m, np.count_nonzero(s.singular))
        np.testing.assert_allclose(s.directions.T @ s.directions, np.eye(m), atol=1e-13)
    if not isinstance(method, sk.DampedLeastSquares):
        assert sk.Status.OK in seen
    assert sk.Status.DAMPED in seen


def test_singular_directions_at_the_edge_of_the_workspace():
    """A stretched planar arm cannot move along itself, and the answer reports this direction."""
    J = np.array([[0.0, 0.0, 0.0], [3.0, 2.0, 1.0]])
    s = sk.VelocitySolver(sk.JParse()).solve(J, [1.0, 1.0])
    assert s.status == sk.Status.DAMPED
    np.testing.assert_array_equal(s.singular, [False, True])
    np.testing.assert_allclose(np.abs(s.singular_directions[:, 0]), [1, 0], atol=1e-15)
    np.testing.assert_allclose(s.achieved_twist, [0, 1], atol=1e-15)
    s = sk.VelocitySolver(sk.JParse()).solve(J, [0.0, 1.0])
    assert s.status == sk.Status.OK


# Arguments ----------


def test_any_layout_and_type():
    rng = np.random.default_rng(7)
    J = rng.normal(size=(6, 7)).astype(np.float32)
    twist = rng.normal(size=6).astype(np.float32)
    posture = rng.normal(size=7).astype(np.float32)

    def solve(*arguments):
        return sk.VelocitySolver(sk.JParse()).solve(*arguments).qdot

    expected = solve(J.astype(float), twist.astype(float), posture.astype(float))
    padded = np.zeros((12, 21))
    padded[::2, ::3] = J
    for same in (
        solve(J, twist, posture),
        solve(J.tolist(), twist.tolist(), tuple(posture.tolist())),
        solve(np.asfortranarray(J), twist, posture),
        solve(padded[::2, ::3], np.repeat(twist, 2)[::2], np.repeat(posture, 3)[::3]),
        solve(J[::-1][::-1], twist[::-1][::-1], posture[::-1][::-1]),
        solve(J.astype(">f8"), twist.astype(np.longdouble), posture.astype("<f4")),
    ):
        np.testing.assert_array_equal(same, expected)
    s = solve([[1, 0], [0, 1]], [1, 2])
    np.testing.assert_array_equal(s, [1, 2])


@pytest.mark.parametrize(
    ("J", "twist", "posture"),
    [
        ((7, 7), (7,), None),
        ((6, 17), (6,), None),
        ((6, 20), (6,), (20,)),
        ((0, 7), (0,), None),
        ((6, 0), (6,), None),
        ((6,), (6,), None),
        ((1, 6, 7), (6,), None),
        ((6, 7), (7,), None),
        ((6, 7), (5,), None),
        ((6, 7), (6, 1), None),
        ((6, 7), (), None),
        ((6, 7), (20,), None),
        ((6, 7), (6,), (6,)),
        ((6, 7), (6,), (20,)),
        ((6, 7), (6,), (0,)),
        ((6, 7), (6,), (7, 1)),
        ((100, 100), (100,), (100,)),
    ],
)
def test_shapes_that_do_not_fit_are_refused(J, twist, posture):
    solver = sk.VelocitySolver(sk.JParse())
    with pytest.raises(sk.Error, match="shape"):
        solver.solve(np.ones(J), np.ones(twist), None if posture is None else np.ones(posture))


def test_rows_that_do_not_fit_the_mask_are_refused():
    solver = sk.VelocitySolver(sk.JParse(), mask=[1, 1, 1, 0, 0, 0])
    for m in (1, 2, 4, 5):
        with pytest.raises(sk.Error, match="rows"):
            solver.solve(np.ones((m, 7)), np.ones(m))


@pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf])
def test_what_is_not_finite_is_refused_with_its_place(bad):
    rng = np.random.default_rng(8)
    J, twist, posture = rng.normal(size=(6, 7)), rng.normal(size=6), rng.normal(size=7)
    solver, untouched = sk.VelocitySolver(sk.JParse()), sk.VelocitySolver(sk.JParse())
    solver.solve(J, twist)
    untouched.solve(J, twist)
    wrong = J.copy()
    wrong[2, 3] = bad
    with pytest.raises(sk.Error, match=r"J\[2, 3\]"):
        solver.solve(wrong, twist)
    wrong = twist.copy()
    wrong[5] = bad
    with pytest.raises(sk.Error, match=r"twist\[5\]"):
        solver.solve(J, wrong)
    wrong = posture.copy()
    wrong[0] = bad
    with pytest.raises(sk.Error, match=r"posture\[0\]"):
        solver.solve(J, twist, wrong)
    np.testing.assert_array_equal(solver.solve(J, twist, posture).qdot, untouched.solve(J, twist, posture).qdot)


@pytest.mark.parametrize("bad", [0.0, -1.0, np.nan, np.inf])
def test_length_scale_must_be_a_length(bad):
    with pytest.raises(sk.Error, match="length_scale"):
        sk.VelocitySolver(sk.JParse(), length_scale=bad)


def test_too_large_for_numbers():
    solver = sk.VelocitySolver(sk.JParse())
    with pytest.raises(sk.Error, match="too large"):
        solver.solve(1e-90 * np.eye(6), np.full(6, 1e300))
    np.testing.assert_allclose(solver.solve(np.eye(6), np.ones(6)).qdot, np.ones(6))


def test_the_rule_may_be_changed():
    J, twist = np.random.default_rng(9).normal(size=(6, 7)), np.ones(6)
    solver = sk.VelocitySolver(sk.JParse(), length_scale=0.5)
    assert solver.method == sk.JParse()
    assert solver.length_scale == 0.5
    solver.method = sk.DampedLeastSquares(0.3)
    expected = sk.VelocitySolver(sk.DampedLeastSquares(0.3), length_scale=0.5).solve(J, twist).qdot
    np.testing.assert_array_equal(solver.solve(J, twist).qdot, expected)
    with pytest.raises(TypeError):
        solver.method = "JParse"


def test_answers_are_their_own():
    """The answer of one call does not change with the next call."""
    rng = np.random.default_rng(10)
    solver = sk.VelocitySolver(sk.JParse())
    s = solver.solve(rng.normal(size=(6, 7)), rng.normal(size=6))
    qdot, sigma = s.qdot, s.singular_values
    copy = qdot.copy(), sigma.copy()
    solver.solve(rng.normal(size=(6, 7)), rng.normal(size=6))
    np.testing.assert_array_equal(qdot, copy[0])
    np.testing.assert_array_equal(s.qdot, copy[0])
    np.testing.assert_array_equal(s.singular_values, copy[1])
    qdot[:] = 0  # the caller's own array
    np.testing.assert_array_equal(s.qdot, copy[0])
