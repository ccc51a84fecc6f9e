"""Against the J-PARSE authors' own package (PyPI: jparse-robotics), wherever it is defined.

The package's JParseCore computes J_s⁺ J_p J_p⁺ + J_s⁺ U_s Φ U_sᵀ K: K weighs the command's rows, as here.
The package's answer is not defined

- where a dropped direction survives in the rounding of the products: numpy's pinv then inverts this direction;
- for γ = 1, which the package refuses;
- in its null space where σ_i = 0, because v_i is then any vector that LAPACK gives.
"""

import numpy as np
import pytest

import sigmaik as sk

jparse_robotics = pytest.importorskip("jparse_robotics")

pytestmark = pytest.mark.filterwarnings("ignore:the matrix subclass:PendingDeprecationWarning")

CASES = 1000


def orthonormal(rng, m, k):
    return np.linalg.qr(rng.normal(size=(m, k)))[0]


def random_jacobian(rng, m, n, gamma):
    """Some singular values below the threshold, some at it, some repeated, some all but zero."""
    sigma = np.array(
        [
            [rng.uniform(0.02, 1), gamma * (1 + rng.choice([-1, 1]) * 1e-3), 10 ** rng.uniform(-9, -1), 0.7][
                rng.integers(4)
            ]
            for _ in range(m)
        ]
    )
    sigma[0] = 1.0
    return orthonormal(rng, m, m) * np.sort(sigma)[::-1] @ orthonormal(rng, n, m).T * 10 ** rng.uniform(-1, 1)


def defined(core, J, gamma):
    """Whether the package's inverse of its J_p has the rank that J_p is meant to have."""
    U, sigma, Vt = np.linalg.svd(J, full_matrices=False)
    regular = sigma > gamma * sigma[0]
    J_p = core._svd_compose(U[:, regular], list(sigma[regular]), np.linalg.svd(J)[2])
    return np.linalg.norm(np.linalg.pinv(J_p), 2) < 2 / (gamma * sigma[0])


def problems(seed, m=6):
    rng = np.random.default_rng(seed)
    for _ in range(CASES):
        n = rng.integers(m, 10)
        gamma = rng.uniform(0.05, 0.5)
        J = random_jacobian(rng, m, n, gamma)
        core = jparse_robotics.JParseCore(gamma=gamma)
        if defined(core, J, gamma):
            yield rng, core, J, gamma


def test_qdot_and_null_space():
    compared = projectors = 0
    for rng, core, J, gamma in problems(1):
        matrix, null_space = core.compute(J, return_nullspace=True)
        twist, posture = rng.normal(size=6), rng.normal(size=J.shape[1])
        scale = 1 / (gamma * np.linalg.norm(J, 2))
        for continuous in (True, False):  # the same thing for unit gains
            solver = sk.VelocitySolver(sk.JParse(gamma, continuous=continuous))
            qdot = solver.solve(J, twist).qdot
            np.testing.assert_allclose(qdot, matrix @ twist, rtol=0, atol=1e-9 * scale * np.linalg.norm(twist))
            if np.linalg.cond(J) < 1e6:
                rest = solver.solve(J, twist, posture).qdot - qdot
                np.testing.assert_allclose(rest, null_space @ posture, rtol=0, atol=1e-8)
                projectors += 1
        compared += 1
    assert compared > 0.9 * CASES
    assert projectors > 0.2 * CASES


def test_gains_of_linear_and_angular_rows():
    compared = 0
    for rng, core, J, gamma in problems(2):
        linear, angular = rng.uniform(0, 3, 2)
        matrix = core.compute(
            J,
            singular_direction_gain_position=linear,
            singular_direction_gain_angular=angular,
            position_dimensions=3,
            angular_dimensions=3,
        )
        twist = rng.normal(size=6)
        qdot = sk.VelocitySolver(sk.JParse(gamma, linear, angular, continuous=False)).solve(J, twist).qdot
        sigma = np.linalg.svd(J, compute_uv=False)
        # Singular directions are weighed, the others are not: close by the threshold they mix.
        scale = max(1, linear, angular) / (gamma * sigma[0])
        np.testing.assert_allclose(qdot, matrix @ twist, rtol=0, atol=1e-9 * scale * np.linalg.norm(twist))
        compared += 1
    assert compared > 0.9 * CASES


@pytest.mark.parametrize("m", [1, 2, 3, 4, 5])
def test_fewer_rows(m):
    for rng, core, J, gamma in problems(3, m):
        matrix = core.compute(
            J,
            singular_direction_gain_position=2.0,
            singular_direction_gain_angular=0.5,
            position_dimensions=min(m, 3),
            angular_dimensions=max(m - 3, 0),
        )
        twist = rng.normal(size=m)
        qdot = sk.VelocitySolver(sk.JParse(gamma, 2.0, 0.5, continuous=False)).solve(J, twist).qdot
        scale = 2 / (gamma * np.linalg.norm(J, 2))
        np.testing.assert_allclose(qdot, matrix @ twist, rtol=0, atol=1e-9 * scale * np.linalg.norm(twist))


def test_dls_and_pseudo_inverse():
    for rng, core, J, _ in problems(4):
        twist, posture = rng.normal(size=6), rng.normal(size=J.shape[1])
        damping = rng.uniform(0.05, 1.0)
        matrix, null_space = core.damped_least_squares(J, damping, return_nullspace=True)
        qdot = sk.VelocitySolver(sk.DampedLeastSquares(damping)).solve(J, twist, posture).qdot
        expected = matrix @ twist + null_space @ posture
        np.testing.assert_allclose(qdot, expected, rtol=0, atol=1e-9 * np.linalg.norm(twist) / damping)
        if np.linalg.cond(J) < 1e4:
            expected = core.pinv(J) @ twist
            qdot = sk.VelocitySolver(sk.PseudoInverse()).solve(J, twist).qdot
            np.testing.assert_allclose(qdot, expected, rtol=1e-8, atol=1e-8 * np.linalg.norm(expected))


def test_shipped_arms_at_zero_and_at_home():
    compared = 0
    for name in sk.robots.names():
        chain = sk.robots.load(name)
        rng = np.random.default_rng(5)
        for q in [np.zeros(chain.dof), sk.robots.home(name), *rng.uniform(-2, 2, (20, chain.dof))]:
            J = chain.jacobian(q)
            core = jparse_robotics.JParseCore(gamma=0.1)
            if not defined(core, J, 0.1):
                continue
            twist = rng.normal(size=6)
            qdot = sk.VelocitySolver(sk.JParse(0.1)).solve(J, twist).qdot
            np.testing.assert_allclose(qdot, core.compute(J) @ twist, rtol=0, atol=1e-9)
            compared += 1
    assert compared > 150
