"""What holds for every arm: random chains of 1 to 9 joints, prismatic ones included, made as URDF text."""

import all_methods
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp
from scipy.spatial.transform import Rotation

import sigmaik as sk

METHODS = [*all_methods.METHODS, sk.PseudoInverse(0.05), sk.AdaptiveDampedLeastSquares(relative=False)]
# Rules that do the command in full along the directions that they treat as regular.
EXACT = [m for m in METHODS if not isinstance(m, (sk.DampedLeastSquares, sk.SelectivelyDampedLeastSquares))]


def vec(x):
    return " ".join(f"{v:.17g}" for v in x)


def random_urdf(rng, n, prismatic=0.2, size=1.0, base=None, signs=None):
    """URDF of a chain of n joints from 'base' to 'tool'; the same draws for other sizes, bases and signs."""
    xyz = rng.uniform(-0.5, 0.5, (n + 2, 3)) * size
    rpy = rng.uniform(-3, 3, (n + 2, 3))
    axes = rng.normal(size=(n, 3))
    types = np.where(rng.random(n) < prismatic, "prismatic", "continuous")
    if rng.random() < 0.3:
        axes, rpy = np.eye(3)[rng.integers(0, 3, n)], rpy.round() * np.pi / 2  # as arms are
    if signs is not None:
        axes = axes * signs[:, None]
    turn = Rotation.identity() if base is None else base
    mount = f'<origin xyz="0 0 0" rpy="{vec(turn.as_euler("xyz"))}"/>'
    links = ["base", *(f"l{i}" for i in range(-1, n)), "tool"]
    joints = [f'<joint name="mount" type="fixed"><parent link="base"/><child link="l-1"/>{mount}</joint>']
    for i in range(n):
        limit = '<limit lower="-10" upper="10" velocity="1000" effort="1"/>' if types[i] == "prismatic" else ""
        joints.append(
            f'<joint name="j{i}" type="{types[i]}"><parent link="l{i - 1}"/><child link="l{i}"/>'
            f'<origin xyz="{vec(xyz[i])}" rpy="{vec(rpy[i])}"/><axis xyz="{vec(axes[i])}"/>{limit}</joint>'
        )
    joints.append(
        f'<joint name="tool" type="fixed"><parent link="l{n - 1}"/><child link="tool"/>'
        f'<origin xyz="{vec(xyz[n])}" rpy="{vec(rpy[n])}"/></joint>'
    )
    return "<robot name='random'>" + "".join(f'<link name="{x}"/>' for x in links) + "".join(joints) + "</robot>"


def chains(seed, count, **options):
    for i in range(count):
        n = 1 + i % 9
        rng = np.random.default_rng([seed, i])
        yield rng, sk.Chain.from_urdf(random_urdf(rng, n, **options)), rng.uniform(-3, 3, n)


def on_edge(solution, *thresholds):
    """Whether a singular value is so close to a threshold that rounding chooses the side."""
    sigma = solution.singular_values
    return any(np.any(np.abs(sigma / max(sigma[0], 1e-300) - t) < 1e-9) for t in thresholds)


def test_jacobian_and_its_derivative_by_differences():
    h = 1e-6
    for _, chain, q in chains(1, 90):
        J, dJ = chain.jacobian(q), chain.jacobian_gradient(q)
        T = chain.pose(q)
        for k in range(chain.dof):
            step = h * np.eye(chain.dof)[k]
            ahead, behind = chain.pose(q + step), chain.pose(q - step)
            np.testing.assert_allclose((ahead[:3, 3] - behind[:3, 3]) / (2 * h), J[:3, k], rtol=0, atol=1e-8)
            omega = sk.rotation_log(ahead[:3, :3] @ behind[:3, :3].T) / (2 * h)
            np.testing.assert_allclose(omega, J[3:, k], rtol=0, atol=1e-8)
            difference = (chain.jacobian(q + step) - chain.jacobian(q - step)) / (2 * h)
            np.testing.assert_allclose(difference, dJ[k], rtol=0, atol=1e-8)
        np.testing.assert_allclose(T[:3, :3].T @ T[:3, :3], np.eye(3), atol=1e-14)


def test_regular_directions_are_exact():
    for rng, chain, q in chains(2, 450):
        J, twist, posture = chain.jacobian(q), rng.normal(size=6), rng.normal(size=chain.dof)
        length_scale = 10 ** rng.uniform(-1, 1)
        weights = np.array([1, 1, 1, length_scale, length_scale, length_scale])
        for method in EXACT:
            s = sk.VelocitySolver(method, length_scale).solve(
                J, twist, None if isinstance(method, (sk.JacobianProjection, sk.PseudoInverse)) else posture
            )
            if isinstance(method, sk.AdaptiveDampedLeastSquares) and np.any(s.singular):
                s = sk.VelocitySolver(method, length_scale).solve(J, twist)
            missed = weights * (s.achieved_twist - twist)
            regular = s.directions[:, ~s.singular]
            atol = 1e-11 * (1 + s.singular_values[0] * np.linalg.norm(s.qdot))
            np.testing.assert_allclose(regular.T @ missed, 0, rtol=0, atol=atol)


def test_the_base_frame_does_not_matter():
    for i in range(150):
        n = 1 + i % 9
        turn = Rotation.random(random_state=i)
        q, x, posture = (np.random.default_rng([4, i, j]).normal(size=k) for j, k in enumerate((n, 6, n)))
        one = sk.Chain.from_urdf(random_urdf(np.random.default_rng([3, i]), n))
        other = sk.Chain.from_urdf(random_urdf(np.random.default_rng([3, i]), n, base=turn))
        R = turn.as_matrix()
        np.testing.assert_allclose(other.pose(q)[:3], R @ one.pose(q)[:3], atol=1e-12)
        for method in METHODS:
            a = sk.VelocitySolver(method, 0.3).solve(one.jacobian(q), x, posture)
            b = sk.VelocitySolver(method, 0.3).solve(other.jacobian(q), np.kron(np.eye(2), R) @ x, posture)
            sigma = a.singular_values
            # Too close to a singularity or a threshold, rounding decides.
            if on_edge(a, 0.05, 0.1, 0.2) or sigma[-1] < 1e-6 * sigma[0]:
                continue
            np.testing.assert_allclose(a.qdot, b.qdot, rtol=0, atol=1e-7 * (1 + np.linalg.norm(a.qdot)))
            np.testing.assert_array_equal(a.singular, b.singular)
            # The mask in tool axes, too.
            mask = [1, 1, 1, 1, 1, 0]
            a = sk.VelocitySolver(method, 0.3, mask, "tool")
            b = sk.VelocitySolver(method, 0.3, mask, "tool")
            s = a.solve(one.jacobian(q), x, rotation=one.pose(q)[:3, :3])
            t = b.solve(other.jacobian(q), np.kron(np.eye(2), R) @ x, rotation=other.pose(q)[:3, :3])
            if not on_edge(s, 0.05, 0.1, 0.2) and s.singular_values[-1] > 1e-6 * s.singular_values[0]:
                np.testing.assert_allclose(s.qdot, t.qdot, rtol=0, atol=1e-7 * (1 + np.linalg.norm(s.qdot)))


def test_the_joints_signs_do_not_matter():
    for i in range(150):
        n = 1 + i % 9
        rng = np.random.default_rng([5, i])
        signs = rng.choice([-1.0, 1.0], n)
        one = sk.Chain.from_urdf(random_urdf(np.random.default_rng([6, i]), n))
        other = sk.Chain.from_urdf(random_urdf(np.random.default_rng([6, i]), n, signs=signs))
        q, x, posture = rng.normal(size=n), rng.normal(size=6), rng.normal(size=n)
        for method in METHODS:
            a = sk.VelocitySolver(method).solve(one.jacobian(q), x, posture)
            b = sk.VelocitySolver(method).solve(other.jacobian(signs * q), x, signs * posture)
            if on_edge(a, 0.05, 0.1, 0.2) or a.singular_values[-1] < 1e-6 * a.singular_values[0]:
                continue
            np.testing.assert_allclose(signs * b.qdot, a.qdot, rtol=0, atol=1e-7 * (1 + np.linalg.norm(a.qdot)))


@pytest.mark.parametrize("size", [1000.0, 0.1, 3.0, 10.0])
def test_metres_or_millimetres_small_arms_or_large(size):
    for i in range(60):
        n = 1 + i % 9
        rng = np.random.default_rng([7, i])
        one = sk.Chain.from_urdf(random_urdf(np.random.default_rng([8, i]), n, prismatic=0.0))
        other = sk.Chain.from_urdf(random_urdf(np.random.default_rng([8, i]), n, prismatic=0.0, size=size))
        q, x, posture = rng.normal(size=n), rng.normal(size=6), rng.normal(size=n)
        scaled = x * [size, size, size, 1, 1, 1]
        for method in METHODS:
            if isinstance(method, sk.AdaptiveDampedLeastSquares) and not method.relative:
                continue
            same = sk.DampedLeastSquares(method.damping * size) if isinstance(method, sk.DampedLeastSquares) else method
            a = sk.VelocitySolver(method, 0.4).solve(one.jacobian(q), x, posture)
            b = sk.VelocitySolver(same, 0.4 * size).solve(other.jacobian(q), scaled, posture)
            if on_edge(a, 0.05, 0.1, 0.2) or a.singular_values[-1] < 1e-6 * a.singular_values[0]:
                continue
            np.testing.assert_allclose(b.qdot, a.qdot, rtol=0, atol=1e-7 * (1 + np.linalg.norm(a.qdot)))
            assert a.status == b.status


def test_jparse_with_equal_gains_never_increases_the_error():
    """d/dt eᵀe ≤ 0 towards a static target (eq. 37): e_oᵀ ω = −½ d/dt |e_o|² for axis-angle vectors."""
    dt = 1e-7
    for rng, chain, q in chains(9, 450):
        target = chain.pose(q + rng.choice([0.01, 0.3]) * rng.normal(size=chain.dof))
        if rng.random() < 0.3:
            target[:3, 3] += rng.normal(size=3)  # out of reach
        k = rng.uniform(0.2, 4)
        method = sk.JParse(rng.uniform(0.01, 1), k, k, continuous=bool(rng.integers(2)))
        servo = sk.Servo(
            chain,
            method,
            dt,
            soft_start=0,
            max_linear_error=1e9,
            max_angular_error=1e9,
            velocity_limits=False,
        )
        servo.reset(q)
        e = sk.pose_error(chain.pose(q), target)
        if np.linalg.norm(e[3:]) > 3:
            continue
        step = servo.update(target)
        np.testing.assert_array_equal(step.pose_error, e)
        before = e @ e
        after = np.sum(sk.pose_error(servo.pose, target) ** 2)
        rate = -2 * e @ step.achieved_twist
        assert rate <= 1e-12 * before
        speed = np.linalg.norm(step.qdot)
        assert after - before <= 50 * (dt * speed) ** 2 * (1 + before) + 1e-14
        assert abs((after - before) / dt - rate) <= 1e-3 * (1 + speed) ** 2 * (1 + before)


def test_no_rule_exceeds_its_bound_on_the_way_through_singularities():
    """Arms that sweep through stretched and folded poses."""
    for name in sk.robots.names():
        chain = sk.robots.load(name)
        rng = np.random.default_rng(10)
        for _ in range(3):
            a, b = rng.normal(size=(2, chain.dof))
            solvers = [sk.VelocitySolver(m) for m in METHODS]
            for t in np.linspace(-1, 1, 41):
                J = chain.jacobian(a * t + b * t * t)  # through q = 0
                x = rng.normal(size=6)
                norm, largest = np.linalg.norm(x), np.linalg.norm(J, 2)
                for method, solver in zip(METHODS, solvers, strict=True):
                    s = solver.solve(J, x)
                    assert np.all(np.isfinite(s.qdot))
                    if isinstance(method, sk.PseudoInverse):
                        bound = norm / (method.tolerance * largest)
                    elif isinstance(method, sk.DampedLeastSquares):
                        bound = norm / (2 * method.damping)
                    elif isinstance(method, sk.SelectivelyDampedLeastSquares):
                        assert np.max(np.abs(s.qdot)) <= method.max_speed * (1 + 1e-14)
                        continue
                    elif isinstance(method, sk.JParse):
                        gain = max(1, method.gain_linear, method.gain_angular)
                        bound = norm / (method.gamma * largest) * (1 if gain == 1 else np.hypot(1, gain))
                    elif isinstance(method, sk.AdaptiveDampedLeastSquares):
                        continue
                    else:
                        bound = norm / (method.gamma * largest)
                    assert np.linalg.norm(s.qdot) <= bound * (1 + 1e-12)


SMOOTH = [
    sk.DampedLeastSquares(0.2),
    sk.JParse(),
    sk.JParse(0.2, 2.0, 0.5),
    sk.AdaptiveDampedLeastSquares(damping=0.1, threshold=0.1),
    sk.AdaptiveDampedLeastSquares("smallest_singular_value", damping=0.2, threshold=0.2),
]


@pytest.mark.parametrize("method", SMOOTH, ids=repr)
def test_smooth_rules_are_smooth_along_an_arms_motion(method):
    """On a path with half the step, the steps of the answer have half the length: the answer has no jump anywhere."""
    for name in ("ufactory_xarm7", "puma560", "kinova_gen3_7dof"):
        chain = sk.robots.load(name)
        rng = np.random.default_rng(11)
        for _ in range(2):
            a, b, x = rng.normal(size=chain.dof), rng.normal(size=chain.dof), rng.normal(size=6)

            def steps(count, chain=chain, a=a, b=b, x=x):
                solver = sk.VelocitySolver(method)
                qdot = [solver.solve(chain.jacobian(a * t + b * t * t), x).qdot for t in np.linspace(-0.5, 1, count)]
                return np.linalg.norm(np.diff(qdot, axis=0), axis=1).max()

            coarse, fine = steps(2001), steps(8001)
            assert fine < 0.4 * coarse


finite = st.floats(-1e150, 1e150, allow_subnormal=True)
shapes = st.tuples(st.integers(1, 6), st.integers(1, 16))


@given(st.data())
@settings(max_examples=300, deadline=None, derandomize=True)
def test_whatever_the_numbers_the_answer_is_finite_or_refused(data):
    m, n = data.draw(shapes)
    J = data.draw(hnp.arrays(float, (m, n), elements=finite))
    x = data.draw(hnp.arrays(float, m, elements=finite))
    posture = data.draw(st.none() | hnp.arrays(float, n, elements=finite))
    for method in METHODS:
        solver = sk.VelocitySolver(method)
        answers = []
        for _ in range(2):
            solver.reset()
            try:
                s = solver.solve(J, x, posture)
            except sk.Error as error:
                answers.append(str(error))
                continue
            for array in (s.qdot, s.achieved_twist, s.singular_values, s.directions):
                assert np.all(np.isfinite(array))
            assert np.all(np.diff(s.singular_values) <= 0)
            assert s.status <= sk.Status.DAMPED
            answers.append(s.qdot.tobytes())
        assert answers[0] == answers[1]
        assert isinstance(answers[0], bytes) or "too large" in answers[0]


@given(hnp.arrays(float, shapes, elements=st.integers(-2, 2).map(float)), st.integers(0, 10))
@settings(max_examples=500, deadline=None, derandomize=True)
def test_small_integers_are_the_degenerate_case(J, scale):
    """Repeated and zero singular values, equal and zero rows and columns."""
    J = J * 10.0 ** (-scale)
    U, sigma, V = sk.Spectrum().decompose(J)
    k = len(sigma)
    np.testing.assert_allclose(U[:, :k] * sigma @ V.T, J, rtol=0, atol=2e-14 * max(sigma[0], 1e-300))
    np.testing.assert_allclose(U.T @ U, np.eye(len(U)), atol=2e-14)
    np.testing.assert_allclose(V.T @ V, np.eye(k), atol=2e-14)
    np.testing.assert_allclose(sigma, np.linalg.svd(J, compute_uv=False), rtol=0, atol=2e-14 * max(sigma[0], 1e-300))
