"""Indices of Jacobians: definitions, singularities, gradients, batches."""

import math
import threading

import numpy as np
import pytest
import scipy.linalg

import sigmaik as sk

NAMES = ("manipulability", "condition_number", "min_singular_value", "geometry_aware")
#: With five joints an arm is singular everywhere.
ARMS = [name for name in sk.robots.names() if name != "so101"]


def random_jacobians(count, seed=0):
    rng = np.random.default_rng(seed)
    for _ in range(count):
        m = rng.integers(1, 7)
        yield rng.normal(size=(m, rng.integers(m, 17)))


def test_definitions():
    for jacobian in random_jacobians(300):
        gram = jacobian @ jacobian.T
        sigma = np.linalg.svd(jacobian, compute_uv=False)
        assert sk.indices.manipulability(jacobian) == pytest.approx(math.sqrt(np.linalg.det(gram)), rel=1e-8)
        assert sk.indices.condition_number(jacobian) == pytest.approx(np.linalg.cond(jacobian), rel=1e-10)
        assert sk.indices.min_singular_value(jacobian) == pytest.approx(sigma[-1], rel=1e-10)
        log = scipy.linalg.logm(gram / 2.5)
        assert sk.indices.geometry_aware(jacobian, 2.5) == pytest.approx(np.sum(log**2), rel=1e-7)


def test_geometry_aware_of_a_general_reference():
    rng = np.random.default_rng(1)
    for jacobian in random_jacobians(100, 1):
        m = len(jacobian)
        a = rng.normal(size=(m, m + 1))
        reference = a @ a.T
        expected = np.sum(np.log(scipy.linalg.eigvalsh(jacobian @ jacobian.T, reference)) ** 2)
        assert sk.indices.geometry_aware(jacobian, reference) == pytest.approx(expected, rel=1e-6)
        assert sk.indices.geometry_aware(jacobian, 3.0 * np.eye(m)) == pytest.approx(
            sk.indices.geometry_aware(jacobian, 3.0), rel=1e-9
        )


def test_default_scale_is_that_of_a_chain():
    for name in ("ur10", "kuka_lbr_iiwa_14_r820", "kinova_jaco2_7dof_spherical"):
        assert sk.indices.reference_scale(sk.robots.load(name)) == sk.indices.DEFAULT_SCALE == 6.0
    # Weighed so that its rotations count twice, an arm is as good as longer.
    arm, q = sk.robots.load("ur10"), sk.robots.home("ur10")
    k = sk.indices.reference_scale(arm, 2.0)
    rng = np.random.default_rng(0)
    jacobian = arm.jacobian(np.array([arm.random_configuration(rng) for _ in range(2000)]))
    jacobian[:, 3:] *= 2.0
    assert k > np.linalg.norm(jacobian, 2, axis=(1, 2)).max() ** 2 > 6.0
    expected = sk.indices.geometry_aware(arm.jacobian(q), k, 2.0)
    assert sk.indices.evaluate(arm, q, "geometry_aware", length_scale=2.0) == expected


@pytest.mark.parametrize("name", ARMS)
def test_infinite_at_singularities_of_the_arms(name):
    arm = sk.robots.load(name)
    q = sk.singularities.search.singular_configurations(arm, 20)[0]
    assert sk.indices.condition_number(arm.jacobian(q)) > 1e9
    assert sk.indices.evaluate(arm, q, "min_singular_value") < 1e-9
    for index in NAMES:
        assert np.all(np.isfinite(sk.indices.gradient(arm, q, index)))
    flat = np.zeros((6, arm.dof))
    assert sk.indices.geometry_aware(flat) == sk.indices.condition_number(flat) == math.inf
    assert sk.indices.manipulability(flat) == sk.indices.min_singular_value(flat) == 0.0


def test_five_joints_are_singular_everywhere():
    arm, rng = sk.robots.load("so101"), np.random.default_rng(0)
    for _ in range(20):
        q = arm.random_configuration(rng)
        assert sk.indices.evaluate(arm, q, "condition_number") == math.inf
        assert sk.indices.evaluate(arm, q, "geometry_aware") == math.inf
        assert sk.indices.evaluate(arm, q, "manipulability") == 0.0
        assert sk.indices.evaluate(arm, q, "min_singular_value") == 0.0
        for index in NAMES:
            assert np.all(np.isfinite(sk.indices.gradient(arm, q, index)))


@pytest.mark.parametrize(("name", "joint"), [("kuka_lbr_iiwa_14_r820", 3), ("puma560", 4), ("ur10", 4)])
def test_infinite_up_to_rounding(name, joint):
    arm = sk.robots.load(name)
    rng = np.random.default_rng(0)
    for _ in range(100):
        q = arm.random_configuration(rng)
        q[joint] = 0.0
        assert sk.indices.geometry_aware(arm.jacobian(q)) == math.inf
        assert sk.indices.condition_number(arm.jacobian(q)) == math.inf
        assert np.array_equal(sk.indices.gradient(arm, q, "geometry_aware"), np.zeros(arm.dof))
        q[joint] = 1e-6
        assert sk.indices.geometry_aware(arm.jacobian(q)) < math.inf


def test_fewer_joints_than_rows_is_singular():
    jacobian = np.random.default_rng(0).normal(size=(6, 5))
    assert sk.indices.manipulability(jacobian) == 0.0
    assert sk.indices.geometry_aware(jacobian) == math.inf


@pytest.mark.parametrize("index", NAMES)
@pytest.mark.parametrize("name", ARMS)
def test_gradient_against_differences(name, index):
    arm = sk.robots.load(name)
    rng = np.random.default_rng(2)
    checked = 0
    for _ in range(40):
        q = arm.random_configuration(rng)
        sigma = np.linalg.svd(arm.jacobian(q), compute_uv=False)
        if sigma[-1] < 0.02 or sigma[-2] - sigma[-1] < 0.02 or sigma[0] - sigma[1] < 0.02:
            continue
        checked += 1
        got = sk.indices.gradient(arm, q, index)
        step = 1e-5 * np.eye(arm.dof)
        values = sk.indices.evaluate(arm, np.concatenate([q + step, q - step]), index)
        expected = (values[: arm.dof] - values[arm.dof :]) / 2e-5
        assert got == pytest.approx(expected, rel=1e-6, abs=1e-6 * np.abs(expected).max())
    assert checked > 5


def test_length_scale_weighs_rotations():
    arm = sk.robots.load("ur10")
    q = sk.robots.home("ur10")
    weighted = arm.jacobian(q)
    weighted[3:] *= 0.3
    for index in NAMES:
        got = sk.indices.evaluate(arm, q, index, k=2.0, length_scale=0.3)
        function = getattr(sk.indices, index)
        assert got == pytest.approx(function(weighted, 2.0) if index == "geometry_aware" else function(weighted))


def test_batches():
    arm = sk.robots.load("franka_panda")
    rng = np.random.default_rng(3)
    q = np.array([arm.random_configuration(rng) for _ in range(200)])
    for index in NAMES:
        values = sk.indices.evaluate(arm, q, index, k=6.0)
        assert values.shape == (200,)
        assert values.tolist() == [sk.indices.evaluate(arm, x, index, k=6.0) for x in q]
        gradients = sk.indices.gradient(arm, q, index, k=6.0, threads=2)
        assert gradients.shape == (200, 7)
        assert np.array_equal(gradients, [sk.indices.gradient(arm, x, index, k=6.0) for x in q])
        function = getattr(sk.indices, index)
        assert function(arm.jacobian(q)).shape == (200,)
        assert function(arm.jacobian(q)) == pytest.approx(values, rel=1e-12)
        assert sk.indices.evaluate(arm, np.empty((0, 7)), index).shape == (0,)


def test_batches_let_other_threads_run():
    arm = sk.robots.load("franka_panda")
    q = np.zeros((200_000, 7))
    ticks = []
    done = threading.Event()
    worker = threading.Thread(target=lambda: (sk.indices.evaluate(arm, q, "manipulability"), done.set()))
    worker.start()
    while not done.wait(1e-3):
        ticks.append(1)
    worker.join()
    assert len(ticks) > 3


@pytest.mark.parametrize(
    ("call", "text"),
    [
        (lambda arm: sk.indices.manipulability(np.zeros(6)), "J has shape"),
        (lambda arm: sk.indices.manipulability(np.full((6, 7), np.nan)), "finite"),
        (lambda arm: sk.indices.geometry_aware(np.eye(6), -1.0), "k = -1"),
        (lambda arm: sk.indices.geometry_aware(np.eye(6), np.zeros((6, 6))), "positive definite"),
        (lambda arm: sk.indices.geometry_aware(np.eye(6), np.eye(3)), "rows"),
        (lambda arm: sk.indices.gradient(arm, np.zeros(7), "dexterity"), "must be one of"),
        (lambda arm: sk.indices.gradient(arm, np.zeros(6), "manipulability"), "needs"),
        (lambda arm: sk.indices.evaluate(arm, np.zeros(7), "manipulability", threads=0), "threads"),
        (lambda arm: sk.indices.evaluate(arm, np.zeros(7), "manipulability", length_scale=0.0), "length_scale"),
    ],
)
def test_refusals(call, text):
    with pytest.raises(ValueError, match=text):
        call(sk.robots.load("franka_panda"))
