"""Every rule against its formula, on LAPACK's decomposition, and against the matrix forms of the papers."""

import functools
import itertools

import numpy as np
import pytest

import sigmaik as sk

CASES = 1000
EYE = np.eye(6)


def orthonormal(rng, m, k):
    return np.linalg.qr(rng.normal(size=(m, k)))[0]


def with_singular_values(rng, m, n, sigma):
    k = len(sigma)
    return orthonormal(rng, m, k) * sigma @ orthonormal(rng, n, k).T


def random_singular_values(rng, k):
    """Well apart, repeated, at a threshold, tiny and zero; the largest is 1."""
    sigma = [1.0]
    for _ in range(k - 1):
        sigma.append(
            [
                sigma[-1],
                0.0,
                0.1 * (1 + rng.choice([-1, 1]) * 10 ** rng.uniform(-9, -1)),
                10 ** rng.uniform(-11, -1),
                rng.uniform(0.02, 1.0),
                rng.uniform(0.02, 1.0),
            ][rng.integers(6)]
        )
    return np.sort(sigma)[::-1]


@functools.cache
def problems(seed, wide=False):
    """J (m, n), twist (m,), posture (n,) of every size and degeneracy."""
    rng = np.random.default_rng(seed)
    found = []
    for _ in range(CASES):
        m = rng.integers(1, 7)
        n = rng.integers(m if wide else 1, 17)
        sigma = random_singular_values(rng, min(m, n)) * 10 ** rng.uniform(-2, 2)
        found.append(
            (
                with_singular_values(rng, m, n, sigma),
                rng.normal(size=m) * 10 ** rng.uniform(-3, 3),
                rng.normal(size=n),
            )
        )
    return found


def well_posed(J, threshold=0.1, least=1e-5):
    """Whether a rule that jumps at the threshold has a well-defined answer.

    Directions of singular values closer than `least` mix by rounding/least. That does not matter where a rule
    treats these directions alike, but matters where they are on different sides of a jump.
    """
    sigma = np.linalg.svd(J, compute_uv=False)
    sigma = sigma / sigma[0]
    above, below = sigma[sigma > threshold], sigma[sigma <= threshold]
    return not above.size or not below.size or above[-1] - below[0] > least


def by_singular_direction(J, twist, posture, rule):
    """The design's sum, with rule(σ_i, σ, u_i) → (inverse, projector, K); K (m,) weighs the command."""
    U, sigma, Vt = np.linalg.svd(J)
    qdot = np.zeros(J.shape[1])
    projector = np.eye(J.shape[1])
    for i, s in enumerate(sigma):
        inverse, p, gains = rule(s, sigma)
        qdot += inverse * (U[:, i] @ (gains * twist)) * Vt[i]
        projector -= p * np.outer(Vt[i], Vt[i])
    return qdot, projector @ posture


def damped(s, square):
    return (s / (s * s + square), s * s / (s * s + square)) if s > 0 else (0.0, 0.0)


def gains(m, linear, angular):
    return np.array([linear] * 3 + [angular] * 3)[:m]


def pseudo_inverse(tolerance):
    return lambda s, all_: (1 / s, 1.0, 1.0) if s > tolerance * all_[0] else (0.0, 0.0, 1.0)


def dls(damping):
    return lambda s, all_: (*damped(s, damping**2), 1.0)


def numerical_filtering(damping, epsilon, relative):
    def rule(s, all_):
        unit = all_[0] if relative else 1.0
        near = max(0.0, 1 - (s / (epsilon * unit)) ** 2)
        return *damped(s, near * (damping * unit) ** 2), 1.0

    return rule


def smallest_singular_value(damping, epsilon, relative):
    def rule(s, all_):
        unit = all_[0] if relative else 1.0
        near = max(0.0, 1 - (all_[-1] / (epsilon * unit)) ** 2)
        return *damped(s, near * (damping * unit) ** 2), 1.0

    return rule


def manipulability(damping, threshold, relative):
    def rule(s, all_):
        unit = all_[0] if relative else 1.0
        w = np.prod(all_ / unit)
        near = max(0.0, 1 - w / threshold) ** 2
        return *damped(s, near * (damping * unit) ** 2), 1.0

    return rule


def jparse(m, gamma, linear, angular, continuous, singular_posture=False):
    K = gains(m, linear, angular)

    def rule(s, all_):
        threshold = gamma * all_[0]
        if s > threshold:
            return 1 / s, 1.0, 1.0
        share = s / threshold
        return s / threshold**2, share**2 if singular_posture else 1.0, (share + (1 - share) * K) if continuous else K

    return rule


def projection(gamma, p):
    return lambda s, all_: (1 / s, 1.0, 1.0) if s > gamma * all_[0] else (0.0, p, 1.0)


def safety(gamma):
    return lambda s, all_: (1 / max(s, gamma * all_[0]), 1.0, 1.0)


TABLE = {
    "pseudo-inverse": (lambda m: sk.PseudoInverse(0.1), lambda m: pseudo_inverse(0.1)),
    "pseudo-inverse, default": (lambda m: sk.PseudoInverse(), lambda m: pseudo_inverse(1e-12)),
    "dls": (lambda m: sk.DampedLeastSquares(0.2), lambda m: dls(0.2)),
    "numerical filtering": (
        lambda m: sk.AdaptiveDampedLeastSquares("numerical_filtering"),
        lambda m: numerical_filtering(0.1, 0.1, True),
    ),
    "numerical filtering, absolute": (
        lambda m: sk.AdaptiveDampedLeastSquares(damping=0.2, threshold=0.7, relative=False),
        lambda m: numerical_filtering(0.2, 0.7, False),
    ),
    "smallest singular value": (
        lambda m: sk.AdaptiveDampedLeastSquares("smallest_singular_value"),
        lambda m: smallest_singular_value(0.1, 0.1, True),
    ),
    "smallest singular value, absolute": (
        lambda m: sk.AdaptiveDampedLeastSquares("smallest_singular_value", 0.2, 0.7, False),
        lambda m: smallest_singular_value(0.2, 0.7, False),
    ),
    "manipulability": (
        lambda m: sk.AdaptiveDampedLeastSquares("manipulability"),
        lambda m: manipulability(0.1, 1e-3, True),
    ),
    "manipulability, absolute": (
        lambda m: sk.AdaptiveDampedLeastSquares("manipulability", 0.2, 0.05, False),
        lambda m: manipulability(0.2, 0.05, False),
    ),
    "J-PARSE": (lambda m: sk.JParse(), lambda m: jparse(m, 0.1, 1, 1, True)),
    "J-PARSE, gains": (lambda m: sk.JParse(0.1, 2.0, 0.5), lambda m: jparse(m, 0.1, 2, 0.5, True)),
    "J-PARSE, published": (
        lambda m: sk.JParse(0.1, 2.0, 0.5, continuous=False),
        lambda m: jparse(m, 0.1, 2, 0.5, False),
    ),
    "J-PARSE, posture": (
        lambda m: sk.JParse(singular_posture=True),
        lambda m: jparse(m, 0.1, 1, 1, True, True),
    ),
    "projection": (lambda m: sk.JacobianProjection(), lambda m: projection(0.1, 0.0)),
    "safety": (lambda m: sk.JacobianSafety(), lambda m: safety(0.1)),
    "safety projection": (lambda m: sk.JacobianSafetyProjection(), lambda m: projection(0.1, 1.0)),
}


# Rules that jump at a threshold, and where.
JUMPS = {
    "pseudo-inverse": 0.1,
    "pseudo-inverse, default": 1e-12,
    "J-PARSE, published": 0.1,
    "projection": 0.1,
    "safety projection": 0.1,
}


@pytest.mark.parametrize("name", TABLE)
def test_rule_of_the_table(name):
    method, rule = TABLE[name]
    compared = 0
    for J, twist, posture in problems(1):
        m = J.shape[0]
        if name in JUMPS and not well_posed(J, JUMPS[name], 1e-5 if JUMPS[name] > 1e-5 else 1e-14):
            continue
        if name == "safety" and np.linalg.cond(J) > 1e5:
            continue  # at σ_i = 0 the rule's answer changes sign, and depends on the chosen directions
        compared += 1
        solver = sk.VelocitySolver(method(m))
        task, rest = by_singular_direction(J, twist, posture, rule(m))
        # The largest gain of the two: u_iᵀẋ is only as good as |ẋ|, and σ_i as σ_max.
        sigma = np.linalg.svd(J, compute_uv=False)
        inverse, _, K = zip(*(rule(m)(s, sigma) for s in sigma), strict=True)
        # A small σ_i itself is known to σ_max·ε only, and so is its inverse.
        spread = max(g / s if s > 0 else 0.0 for g, s in zip(inverse, sigma, strict=True)) * sigma[0]
        bound = 1e-9 * max(inverse) + 3e-14 * spread
        tolerance = bound * np.linalg.norm(twist) * max(np.max(k) for k in K)
        without = solver.solve(J, twist).qdot
        np.testing.assert_allclose(without, task, rtol=0, atol=tolerance)
        # Directions of σ_i = 0 are not unique, and the posture depends on them.
        with_posture = solver.solve(J, twist, posture).qdot
        if sigma[-1] > 1e-6 * sigma[0]:
            atol = tolerance + 1e-9 * np.linalg.norm(posture)
            np.testing.assert_allclose(with_posture - without, rest, rtol=0, atol=atol)
    assert compared > 0.5 * CASES


def test_pseudo_inverse_is_numpys():
    for J, twist, posture in problems(2):
        qdot = sk.VelocitySolver(sk.PseudoInverse(1e-3)).solve(J, twist, posture).qdot
        sigma = np.linalg.svd(J, compute_uv=False)
        if np.any(np.abs(sigma / sigma[0] - 1e-3) < 1e-9):
            continue
        P = np.linalg.pinv(J, rcond=1e-3)
        expected = P @ twist + (np.eye(J.shape[1]) - P @ J) @ posture
        np.testing.assert_allclose(
            qdot, expected, rtol=0, atol=1e-9 * np.linalg.norm(P, 2) * np.linalg.norm(twist) + 1e-9
        )


def test_dls_is_the_matrix_form():
    for J, twist, posture in problems(3):
        damping = 0.05
        qdot = sk.VelocitySolver(sk.DampedLeastSquares(damping)).solve(J, twist, posture).qdot
        m, n = J.shape
        left = J.T @ np.linalg.inv(J @ J.T + damping**2 * np.eye(m))
        right = np.linalg.inv(J.T @ J + damping**2 * np.eye(n)) @ J.T
        for P in (left, right):
            expected = P @ twist + (np.eye(n) - P @ J) @ posture
            atol = (
                1e-12
                * (1 + np.linalg.norm(J) / damping) ** 2
                * (np.linalg.norm(twist) / damping + np.linalg.norm(posture))
            )
            np.testing.assert_allclose(qdot, expected, rtol=0, atol=atol)


def test_numerical_filtering_is_chiaverinis_matrix_form():
    """Chiaverini 1997, eq. 17, isotropic part left out: Jᵀ(JJᵀ + λ² u_m u_mᵀ)⁻¹, for one small direction."""
    rng = np.random.default_rng(4)
    for _ in range(CASES):
        m = rng.integers(2, 7)
        n = rng.integers(m, 10)
        epsilon, damping = 0.3, rng.uniform(0.05, 0.5)
        sigma = np.sort(rng.uniform(0.31, 1.0, m))[::-1]
        sigma[-1] = rng.choice([rng.uniform(1e-3, 0.29), 10 ** rng.uniform(-4, -1), epsilon])
        J = with_singular_values(rng, m, n, sigma)
        twist, posture = rng.normal(size=m), rng.normal(size=n)
        u = np.linalg.svd(J)[0][:, -1]
        square = max(0.0, 1 - (sigma[-1] / epsilon) ** 2) * damping**2
        P = J.T @ np.linalg.inv(J @ J.T + square * np.outer(u, u))
        method = sk.AdaptiveDampedLeastSquares(damping=damping, threshold=epsilon, relative=False)
        qdot = sk.VelocitySolver(method).solve(J, twist, posture).qdot
        np.testing.assert_allclose(qdot, P @ twist + (np.eye(n) - P @ J) @ posture, rtol=1e-9, atol=1e-9)


def jparse_by_matrices(J, gamma, k):
    """The paper's eq. 21 to 28 with K = kI: J_s⁺ J_p J_p⁺ + J_s⁺ U_s Φ K U_sᵀ; and J_s."""
    U, sigma, Vt = np.linalg.svd(J, full_matrices=False)
    threshold = gamma * sigma[0]
    J_s = U * np.maximum(sigma, threshold) @ Vt
    regular = sigma > threshold
    J_p = U[:, regular] * sigma[regular] @ Vt[regular]
    U_s, phi = U[:, ~regular], sigma[~regular] / threshold
    pinv_s = np.linalg.pinv(J_s)
    pinv_p = np.linalg.pinv(J_p, rcond=gamma / 2)
    return pinv_s @ J_p @ pinv_p + pinv_s @ (U_s * phi * k) @ U_s.T, J_s


@pytest.mark.parametrize("k", [1.0, 2.0, 0.3])
def test_jparse_is_the_papers_matrix_form(k):
    compared = 0
    for J, twist, posture in problems(5, wide=True):
        sigma = np.linalg.svd(J, compute_uv=False)
        if k != 1 and not well_posed(J):
            continue
        method = sk.JParse(0.1, k, k, continuous=False)
        solver = sk.VelocitySolver(method)
        matrix, J_s = jparse_by_matrices(J, 0.1, k)
        scale = 1 / (0.1 * sigma[0])
        qdot = solver.solve(J, twist).qdot
        np.testing.assert_allclose(qdot, matrix @ twist, rtol=0, atol=1e-9 * scale * np.linalg.norm(twist))
        if sigma[-1] > 1e-9 * sigma[0]:
            # Eq. 54: (I − J_s⁺ J_s) q̇_N
            projector = np.eye(J.shape[1]) - np.linalg.pinv(J_s) @ J_s
            rest = solver.solve(J, twist, posture).qdot - qdot
            np.testing.assert_allclose(rest, projector @ posture, rtol=0, atol=1e-6)
            compared += 1
    assert compared > 500


def test_ablations_are_the_papers_matrix_forms():
    """Eq. 62 to 64: J_p⁺; J_s⁺; J_s⁺ J_p J_p⁺, each with its own null space."""
    for J, twist, posture in problems(6, wide=True):
        gamma = 0.1
        U, sigma, Vt = np.linalg.svd(J, full_matrices=False)
        if not well_posed(J):
            continue
        regular = sigma > gamma * sigma[0]
        J_p = U[:, regular] * sigma[regular] @ Vt[regular]
        J_s = U * np.maximum(sigma, gamma * sigma[0]) @ Vt
        pinv_p, pinv_s = np.linalg.pinv(J_p, rcond=gamma / 2), np.linalg.pinv(J_s)
        eye = np.eye(J.shape[1])
        atol = 1e-9 * np.linalg.norm(twist) / (gamma * sigma[0]) + 1e-6
        for method, matrix, inverse_of in [
            (sk.JacobianProjection(gamma), pinv_p, eye - pinv_p @ J_p),
            (sk.JacobianSafety(gamma), pinv_s, eye - pinv_s @ J_s),
            (sk.JacobianSafetyProjection(gamma), pinv_s @ J_p @ pinv_p, eye - pinv_s @ J_s),
        ]:
            if sigma[-1] < 1e-5 * sigma[0]:
                # u_i and v_i of σ_i = 0 are arbitrary: only answers that do not use them can be compared.
                if isinstance(method, sk.JacobianProjection):
                    qdot = sk.VelocitySolver(method).solve(J, twist, posture).qdot
                    np.testing.assert_allclose(qdot, matrix @ twist + inverse_of @ posture, rtol=0, atol=atol)
                continue
            qdot = sk.VelocitySolver(method).solve(J, twist, posture).qdot
            np.testing.assert_allclose(qdot, matrix @ twist + inverse_of @ posture, rtol=0, atol=atol)


def clamp_max_abs(x, bound):
    size = np.max(np.abs(x))
    return x if size <= bound else x * (bound / size)


def sdls(J, e, gamma_max):
    """Buss and Kim 2005, section 4, with one end effector, whose displacement is e."""
    U, sigma, Vt = np.linalg.svd(J, full_matrices=False)
    rho = np.linalg.norm(J, axis=0)
    theta = np.zeros(J.shape[1])
    for i, s in enumerate(sigma):
        if s <= 1e-12 * sigma[0]:
            continue
        alpha = U[:, i] @ e
        N = np.linalg.norm(U[:, i])
        M = np.sum(np.abs(Vt[i]) * rho) / s
        gamma_i = min(1.0, N / M) * gamma_max
        theta += clamp_max_abs(alpha / s * Vt[i], gamma_i)
    return clamp_max_abs(theta, gamma_max)


def test_sdls_is_buss_and_kims():
    rng = np.random.default_rng(7)
    clamped = 0
    for _ in range(CASES):
        m = rng.integers(1, 7)
        n = rng.integers(1, 17)
        k = min(m, n)
        sigma = np.cumprod(rng.uniform(0.1, 0.9, k)) * 10 ** rng.uniform(-1, 1)  # well apart: SDLS depends on the basis
        if rng.random() < 0.3:
            sigma[-1] = 0.0
        J = with_singular_values(rng, m, n, sigma)
        twist = rng.normal(size=m) * 10 ** rng.uniform(-3, 1)
        gamma_max = rng.uniform(0.1, 3.0)
        s = sk.VelocitySolver(sk.SelectivelyDampedLeastSquares(gamma_max)).solve(J, twist)
        np.testing.assert_allclose(s.qdot, sdls(J, twist, gamma_max), rtol=0, atol=1e-9 * gamma_max)
        assert np.max(np.abs(s.qdot)) <= gamma_max * (1 + 1e-15)
        clamped += s.status == sk.Status.DAMPED
    assert clamped > 200


@pytest.mark.parametrize("name", TABLE)
def test_answers_do_not_depend_on_the_signs_and_the_basis_of_the_decomposition(name):
    """A warm start from anywhere gives other signs, and other bases where singular values are equal."""
    method = TABLE[name][0]
    rng = np.random.default_rng(8)
    for _ in range(200):
        m, n = rng.integers(2, 7), rng.integers(2, 10)
        sigma = rng.choice([1.0, 0.65, 0.04], size=min(m, n))
        sigma[0] = 1.0
        J = with_singular_values(rng, m, n, np.sort(sigma)[::-1])
        twist, posture = rng.normal(size=m), rng.normal(size=n)
        solver = sk.VelocitySolver(method(m))
        expected = solver.solve(J, twist, posture)
        for _ in range(5):
            solver.reset()
            for _ in range(rng.integers(1, 4)):
                solver.solve(rng.normal(size=(m, n)), twist)
            s = solver.solve(J, twist, posture)
            np.testing.assert_allclose(s.qdot, expected.qdot, rtol=0, atol=1e-9)
            assert s.status == expected.status
            np.testing.assert_array_equal(s.singular, expected.singular)


def test_gains_act_on_linear_and_angular_rows():
    """Along a singular direction u the command is u · K ẋ, whatever mixture of both u is."""
    rng = np.random.default_rng(9)
    for _ in range(500):
        J = with_singular_values(rng, 6, 7, np.array([1.0, 0.9, 0.8, 0.7, 0.6, 0.05]))
        U, sigma, Vt = np.linalg.svd(J, full_matrices=False)
        for row, linear, angular in itertools.product(range(6), (1.0, 3.0), (1.0, 0.2)):
            s = sk.VelocitySolver(sk.JParse(0.1, linear, angular, continuous=False)).solve(J, EYE[row])
            k = linear if row < 3 else angular
            along = Vt[-1] @ s.qdot
            assert along == pytest.approx(0.05 / 0.1**2 * U[row, -1] * k, abs=1e-10)
