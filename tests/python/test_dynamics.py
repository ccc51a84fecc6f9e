"""The dynamics against Pinocchio, on every shipped arm whose inertias are known."""

import numpy as np
import pytest

import sigmaik as sk

ARMS = [name for name in sk.robots.names() if name != "kuka_kr6_r900"]


@pytest.mark.parametrize("name", ARMS)
def test_against_pinocchio(name):
    pin = pytest.importorskip("pinocchio")
    arm = sk.robots.load(name)
    # Continuous joints are angles here and points on a circle there.
    model = pin.buildModelFromUrdf(str(sk.robots.path(name)))
    data = model.createData()
    model.gravity.linear = np.array([0.0, 0.0, -9.80665])
    dynamics = sk.Dynamics(arm)
    rng = np.random.default_rng(0)
    for _ in range(20):
        q, qdot = arm.random_configuration(rng), rng.normal(size=arm.dof)
        theirs = np.concatenate(
            [
                [np.cos(x), np.sin(x)] if kind == "continuous" else [x]
                for x, kind in zip(q, arm.joint_types, strict=True)
            ]
        )
        mass = pin.crba(model, data, theirs)
        mass = np.triu(mass) + np.triu(mass, 1).T
        gravity = pin.computeGeneralizedGravity(model, data, theirs)
        bias = pin.nonLinearEffects(model, data, theirs, qdot)
        scale = np.abs(mass).max() + np.abs(bias).max()
        np.testing.assert_allclose(dynamics.mass_matrix(q), mass, atol=1e-10 * scale)
        np.testing.assert_allclose(dynamics.gravity(q), gravity, atol=1e-10 * scale)
        np.testing.assert_allclose(dynamics.coriolis(q, qdot) + gravity, bias, atol=1e-10 * scale)


def test_no_inertias():
    with pytest.raises(sk.Error, match="joint_a1.*inertia"):
        sk.Dynamics(sk.robots.load("kuka_kr6_r900"))


def test_wrong_sizes():
    dynamics = sk.Dynamics(sk.robots.load("franka_panda"))
    with pytest.raises(sk.Error, match="shape"):
        dynamics.mass_matrix(np.zeros(6))
