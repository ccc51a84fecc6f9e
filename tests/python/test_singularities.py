"""Known singular sets, potentials, and the search for unknown ones."""

import copy
import math
import pickle

import numpy as np
import pytest

import sigmaik as sk
from sigmaik.singularities.search import singular_configurations

ARMS = sk.singularities.names()


def load(name):
    return sk.robots.load(name), sk.singularities.load(name)


def random_configurations(arm, count, seed=0):
    return np.random.default_rng(seed).uniform(-np.pi, np.pi, (count, arm.dof))


# Points on each set, from the conditions as the paper and its corrections give them: joints are numbered from 1.
def on_iiwa(name, q, rng):
    pick = rng.choice([-np.pi, 0.0, np.pi])
    half = rng.choice([-np.pi / 2, np.pi / 2])
    if name == "elbow":
        q[3] = pick
    elif name == "shoulder":
        q[1], q[2] = pick, half
    elif name == "shoulder-wrist":
        q[1], q[5] = pick, rng.choice([-np.pi, 0.0, np.pi])
    else:
        q[4], q[5] = half, pick
    return q


def on_comau(name, q, rng):
    if name == "wrist":
        q[4] = rng.choice([-np.pi, 0.0, np.pi])
    elif name == "elbow":
        q[2] = math.atan(0.684 / 0.13) - np.pi / 2 + rng.choice([0.0, np.pi])
    else:  # a1 + a2 cos θ2 + a3 cos(θ2 + θ3) + d4 sin(θ2 + θ3) = 0, θ2 = π/2 − q2, θ3 = q3 + π/2
        length = math.hypot(0.13, 0.684)
        while abs(0.15 + 0.59 * math.cos(np.pi / 2 - q[1])) > length:
            q[1] = rng.uniform(-np.pi, np.pi)
        angle = math.acos(-(0.15 + 0.59 * math.cos(np.pi / 2 - q[1])) / length) * rng.choice([-1, 1])
        q[2] = angle + math.atan2(0.684, 0.13) - (np.pi / 2 - q[1]) - np.pi / 2
    return q


def on_panda(name, q, rng):
    d3, d5, a4, a5, a7 = 0.316, 0.384, 0.0825, -0.0825, 0.088

    def parts(q4):
        s, c = math.sin(q4), math.cos(q4)
        p, a = a4 * c + a5 + d3 * s, a5 * s + d3 + d5 * c
        big_c = -a4 - a5 * c + d5 * s
        return p, -a4 * s + d3 * c + d5, big_c, d3 * big_c + a4 * a

    if name == "wrist":  # c5 = 0, s6 K + a7 (P − a5) = 0
        q[4] = rng.choice([-np.pi / 2, np.pi / 2])
        while True:
            p, _, _, k = parts(q[3])
            if abs(a7 * (p - a5)) < abs(k):
                q[5] = math.asin(-a7 * (p - a5) / k)
                q[5] = rng.choice([q[5], np.pi - q[5]])
                return q
            q[3] = rng.uniform(-np.pi, np.pi)
    if name == "elbow":  # s5 = 0, tan q4 = …
        q[3] = math.atan2(a5 * d3 - a4 * d5, d3 * d5 + a4 * a5) + rng.choice([0.0, np.pi])
        q[4] = rng.choice([-np.pi, 0.0, np.pi])
    elif name == "shoulder":  # s2 = 0, g = 0: g = c3 (C F + a4 a7 c5² P) + s3 a5 a7 c5 s5 P
        q[1] = rng.choice([-np.pi, 0.0, np.pi])
        p, _, big_c, k = parts(q[3])
        s5, c5 = math.sin(q[4]), math.cos(q[4])
        f = math.sin(q[5]) * k + a7 * (p - a5)
        q[2] = math.atan2(-(big_c * f + a4 * a7 * c5**2 * p), a5 * a7 * c5 * s5 * p) + rng.choice([0.0, np.pi])
    else:  # q4 = 0, s6 = −a7/(d3 + d5)
        q[3] = 0.0
        q[5] = math.asin(-a7 / (d3 + d5))
        q[5] = rng.choice([q[5], np.pi - q[5]])
    return q


ON = {"kuka_lbr_iiwa_14_r820": on_iiwa, "comau_racer_7_1_4": on_comau, "franka_panda": on_panda}


@pytest.mark.parametrize("name", ARMS)
def test_the_conditions_as_printed_and_corrected_are_the_sets(name):
    arm, sing = load(name)
    rng = np.random.default_rng(0)
    for i, which in enumerate(sing.names):
        q = np.array([ON[name](which, q, rng) for q in random_configurations(arm, 2000, i)])
        assert sing.residuals(q)[:, i].max() < 1e-24
        sigma = np.linalg.svd(arm.jacobian(q), compute_uv=False)
        assert np.max(sigma[:, 5] / sigma[:, 0]) < 1e-10
        assert sing.manipulability(q).max() < 1e-14


@pytest.mark.parametrize("name", ARMS)
def test_every_singular_configuration_found_is_on_a_known_set(name):
    arm, sing = load(name)
    for ranges in (arm, arm.with_limits(lower=-np.pi, upper=np.pi)):
        q = singular_configurations(ranges, 3000, 1)
        assert len(q) > 2000
        assert np.sqrt(sing.residuals(q).min(axis=1)).max() < 1e-4


@pytest.mark.parametrize("name", ARMS)
def test_manipulability_in_closed_form(name):
    arm, sing = load(name)
    q = random_configurations(arm, 5000)
    jacobian = arm.jacobian(q)
    expected = np.sqrt(np.maximum(np.linalg.det(jacobian @ jacobian.transpose(0, 2, 1)), 0.0))
    assert sing.manipulability(q) == pytest.approx(expected, abs=1e-12)
    assert sing.manipulability(q) == pytest.approx(sk.indices.evaluate(arm, q, "manipulability"), abs=1e-14)


@pytest.mark.parametrize("name", ARMS)
def test_derivatives_against_differences(name):
    arm, sing = load(name)
    rng = np.random.default_rng(3)
    n = arm.dof
    for trial in range(200):
        q = rng.uniform(-np.pi, np.pi, n)
        if trial % 2:
            q = ON[name](sing.names[trial % len(sing.names)], q, rng) + rng.normal(0.0, 0.03, n)
        options = {"eta1": rng.uniform(0, 8), "eta2": rng.uniform(5, 400), "weights": rng.uniform(0, 2, len(sing))}
        step = 1e-6 * np.eye(n)
        around = np.concatenate([q + step, q - step])
        value = sing.potential(around, **options)
        got, expected = sing.gradient(q, **options), (value[:n] - value[n:]) / 2e-6
        scale = 1e-12 + np.abs(expected).max() + sing.potential(q, **options)
        assert got == pytest.approx(expected, abs=1e-6 * scale)
        slope = sing.gradient(around, **options)
        hessian = sing.hessian(q, **options)
        assert hessian == pytest.approx((slope[:n] - slope[n:]) / 2e-6, abs=1e-6 * (scale + np.abs(hessian).max()) * 10)
        assert np.array_equal(hessian, hessian.T)
        if sing.manipulability(q) > 1e-3:
            m = sing.manipulability(around)
            assert sing.manipulability_gradient(q) == pytest.approx((m[:n] - m[n:]) / 2e-6, abs=1e-7)
            assert sing.manipulability_gradient(q) == pytest.approx(
                sk.indices.gradient(arm, q, "manipulability"), abs=1e-10
            )
            slope = sing.manipulability_gradient(around)
            assert sing.manipulability_hessian(q) == pytest.approx((slope[:n] - slope[n:]) / 2e-6, abs=1e-4)


@pytest.mark.parametrize("name", ARMS)
def test_potential_is_what_is_printed(name):
    arm, sing = load(name)
    for q in random_configurations(arm, 100):
        psi = sing.residuals(q)
        assert np.all(psi >= 0.0)
        squares = np.split(sing.signed_residuals(q) ** 2, np.cumsum(sing.codimensions)[:-1])
        assert psi == pytest.approx([np.sum(part) for part in squares], abs=1e-15)
        assert sing.potential(q) == pytest.approx(np.sum(np.exp(math.log(2400) - 400.0 * psi)), rel=1e-12)


@pytest.mark.parametrize("name", ARMS)
def test_expressions_are_the_numbers(name):
    arm, sing = load(name)
    casadi = pytest.importorskip("casadi")
    x = casadi.SX.sym("q", arm.dof)
    joints = casadi.vertsplit(x)
    symbols = {"sin": casadi.sin, "cos": casadi.cos}
    potential = sk.singularities.symbolic_potential(sing, joints, 3.0, 50.0, exp=casadi.exp, **symbols)
    function = casadi.Function(
        "f",
        [x],
        [
            potential,
            casadi.gradient(potential, x),
            sk.singularities.symbolic_manipulability_squared(sing, joints, **symbols),
        ],
    )
    for q in random_configurations(arm, 200):
        residuals = sk.singularities.symbolic_residuals(sing, list(q))
        assert [len(r) for r in residuals] == list(sing.codimensions)
        assert sum(residuals, []) == pytest.approx(sing.signed_residuals(q), abs=1e-14)
        assert sk.singularities.symbolic_potential(sing, list(q), 3.0, 50.0) == pytest.approx(
            sing.potential(q, 3.0, 50.0)
        )
        value, gradient, square = (np.asarray(casadi.DM(y)).ravel() for y in function(q))
        assert value[0] == pytest.approx(sing.potential(q, 3.0, 50.0), rel=1e-12)
        assert gradient == pytest.approx(sing.gradient(q, 3.0, 50.0), abs=1e-11 * (1.0 + np.abs(gradient).max()))
        assert square[0] == pytest.approx(sing.manipulability(q) ** 2, abs=1e-15)


def test_batches_and_shapes():
    arm, sing = load("franka_panda")
    q = random_configurations(arm, 50)
    assert len(sing) == 4
    assert sing.dof == 7
    for method, shape in (
        (sing.residuals, (4,)),
        (sing.signed_residuals, (8,)),
        (sing.gradient, (7,)),
        (sing.hessian, (7, 7)),
        (sing.manipulability_gradient, (7,)),
        (sing.manipulability_hessian, (7, 7)),
    ):
        assert method(q[0]).shape == shape
        assert method(q).shape == (50, *shape)
        assert np.array_equal(method(q), [method(x) for x in q])
    for method in (sing.potential, sing.manipulability):
        assert isinstance(method(q[0]), float)
        assert method(q).tolist() == [method(x) for x in q]
    assert all(0 <= j < 7 for joints in sing.joints for j in joints)
    assert all(sing.conditions)


def test_arms_are_recognised():
    same = {"franka_fr3": "franka_panda"}  # by their kinematics
    for name in sk.robots.names():
        found = sk.singularities.of(sk.robots.load(name))
        expected = same.get(name, name)
        assert (found is not None) == (expected in ARMS)
        if found is not None:
            assert found.name == expected
            assert pickle.loads(pickle.dumps(found)).name == copy.copy(found).name == expected


def test_refusals():
    with pytest.raises(ValueError, match="there are those of comau_racer_7_1_4, franka_panda, kuka_lbr_iiwa_14_r820"):
        sk.singularities.load("ur10")
    sing = sk.singularities.load("franka_panda")
    with pytest.raises(ValueError, match="needs"):
        sing.residuals(np.zeros(6))
    with pytest.raises(ValueError, match="finite"):
        sing.potential(np.full(7, np.nan))
    with pytest.raises(ValueError, match="weights"):
        sing.potential(np.zeros(7), weights=[1.0])


# What is found must be this: (codimension, joints from 1).
EXPECTED = {
    "kuka_lbr_iiwa_14_r820": {(1, (4,)), (2, (2, 3)), (2, (2, 6)), (2, (5, 6))},
    "franka_panda": {(2, (4, 5, 6)), (2, (4, 5)), (2, (2, 3, 4, 5, 6))},
    "comau_racer_7_1_4": {(1, (5,)), (1, (3,)), (1, (2, 3))},
    "puma560": {(1, (5,)), (1, (3,)), (1, (2, 3))},
    "ur10": {(1, (5,)), (1, (3,)), (1, (2, 3, 4))},
    "kuka_kr6_r900": {(1, (5,)), (1, (3,)), (1, (2, 3))},
}


@pytest.mark.parametrize("name", EXPECTED)
def test_search_finds_the_sets(name):
    found = sk.singularities.find(sk.robots.load(name), 2000)
    got = {(s.codimension, tuple(j + 1 for j in s.joints)) for s in found}
    assert EXPECTED[name] <= got
    # Other found sets must be rare: sets that the ranges cut off, or sets near points where two sets meet.
    others = sum(s.count for s in found if (s.codimension, tuple(j + 1 for j in s.joints)) not in EXPECTED[name])
    assert others <= 0.02 * sum(s.count for s in found)


def test_search_tells_where_joints_stand():
    found = sk.singularities.find(sk.robots.load("kuka_lbr_iiwa_14_r820"), 1000)
    elbow = next(s for s in found if s.joints == (3,))
    assert elbow.values[3] == pytest.approx((0.0,), abs=1e-6)
    wrist = next(s for s in found if s.joints == (4, 5))
    assert wrist.values[4] == pytest.approx((-np.pi / 2, np.pi / 2), abs=1e-6)
    assert found == sorted(found, key=lambda s: -s.count)
    assert elbow.configurations.shape == (elbow.count, 7)


def test_search_is_repeatable_and_refuses():
    arm = sk.robots.load("ur10")
    assert np.array_equal(singular_configurations(arm, 50, 3), singular_configurations(arm, 50, 3))
    with pytest.raises(ValueError, match="at least 1"):
        sk.singularities.find(arm, 0)
