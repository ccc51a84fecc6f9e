"""The dynamics against Pinocchio and MuJoCo, on every shipped arm whose inertias are known, with and without
payload."""

import numpy as np
import pytest

import sigmaik as sk

ARMS = [name for name in sk.robots.names() if name != "kuka_kr6_r900"]
TENSOR = np.array([[0.02, 0.004, -0.002], [0.004, 0.03, 0.003], [-0.002, 0.003, 0.025]])
PAYLOADS = {
    "bare": None,
    "point mass": sk.Inertia(1.5, (0.02, -0.05, 0.1)),
    "body": sk.Inertia(2.5, (0.1, 0.03, -0.06), TENSOR),
}


def states(arm, count=20):
    rng = np.random.default_rng(0)
    for _ in range(count):
        yield arm.random_configuration(rng), *rng.normal(size=(2, arm.dof))


@pytest.mark.parametrize("payload", PAYLOADS)
@pytest.mark.parametrize("name", ARMS)
def test_against_pinocchio(name, payload):
    pin = pytest.importorskip("pinocchio")
    arm, load = sk.robots.load(name), PAYLOADS[payload]
    # Continuous joints are angles here and points on a circle there.
    model = pin.buildModelFromUrdf(str(sk.robots.path(name)))
    model.gravity.linear = np.array([0.0, 0.0, -9.80665])
    if load is not None:
        tip = model.frames[model.getFrameId(arm.tip)]
        body = pin.Inertia(load.mass, load.center_of_mass, load.tensor)
        model.appendBodyToJoint(tip.parentJoint, body, tip.placement)
    data = model.createData()
    dynamics = sk.Dynamics(arm, payload=load)
    for q, qdot, qddot in states(arm):
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
        torque = pin.rnea(model, data, theirs, qdot, qddot)
        np.testing.assert_allclose(dynamics.inverse_dynamics(q, qdot, qddot), torque, atol=1e-10 * scale)


@pytest.mark.parametrize("payload", PAYLOADS)
@pytest.mark.parametrize("name", ARMS)
def test_against_mujoco(name, payload):
    mujoco = pytest.importorskip("mujoco")
    arm, load = sk.robots.load(name), PAYLOADS[payload]
    simulation = sk.sim.Simulation(arm, actuation="torque", payload=load)
    model, data = simulation.model, simulation.data
    dynamics = sk.Dynamics(arm, payload=load)
    mass = np.empty((arm.dof, arm.dof))
    for q, qdot, qddot in states(arm):
        simulation.reset(q, qdot)
        bias = data.qfrc_bias.copy()
        if hasattr(data, "M"):
            mujoco.mj_fullM(model, data, mass)
        else:
            mujoco.mj_fullM(model, mass, data.qM)
        scale = np.abs(mass).max() + np.abs(bias).max()
        np.testing.assert_allclose(dynamics.mass_matrix(q), mass, atol=1e-9 * scale)
        ours = dynamics.coriolis(q, qdot) + dynamics.gravity(q)
        np.testing.assert_allclose(ours, bias, atol=1e-9 * scale)
        torque = mass @ qddot + bias
        np.testing.assert_allclose(dynamics.inverse_dynamics(q, qdot, qddot), torque, atol=1e-9 * scale)
        np.testing.assert_allclose(mass @ dynamics.forward_dynamics(q, qdot, torque), mass @ qddot, atol=1e-9 * scale)
        np.testing.assert_allclose(data.site("tip").xpos, arm.pose(q)[:3, 3], atol=1e-12)
        np.testing.assert_allclose(data.site("tip").xmat.reshape(3, 3), arm.pose(q)[:3, :3], atol=1e-12)


def test_no_inertias():
    with pytest.raises(sk.Error, match="joint_a1.*inertia"):
        sk.Dynamics(sk.robots.load("kuka_kr6_r900"))


def test_wrong_sizes():
    dynamics = sk.Dynamics(sk.robots.load("franka_panda"))
    with pytest.raises(sk.Error, match="shape"):
        dynamics.mass_matrix(np.zeros(6))
    with pytest.raises(sk.Error, match="qddot has shape"):
        dynamics.inverse_dynamics(np.zeros(7), np.zeros(7), np.zeros(6))
    with pytest.raises(sk.Error, match="torque.0. = nan"):
        dynamics.forward_dynamics(np.zeros(7), np.zeros(7), np.full(7, np.nan))


def test_payloads_that_are_no_bodies():
    arm = sk.robots.load("franka_panda")
    for payload, message in (
        (sk.Inertia(-1.0), "mass = -1"),
        (sk.Inertia(1.0, tensor=np.diag([1.0, 1.0, 2.5])), "sum of the other two"),
        (sk.Inertia(1.0, tensor=[[1.0, 0.1, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]), "not symmetric"),
    ):
        with pytest.raises(sk.Error, match=message):
            sk.Dynamics(arm, payload=payload)
    with pytest.raises(sk.Error, match="center_of_mass has shape"):
        sk.Inertia(1.0, (0.0, 0.0))


def test_segments_are_the_chain():
    for name in sk.robots.names():
        arm = sk.robots.load(name)
        q = arm.random_configuration(3)
        pose, moving = np.eye(4), iter(q)
        for s in arm.segments:
            pose = pose @ s.origin
            motion = np.eye(4)
            if s.type == "prismatic":
                motion[:3, 3] = s.axis * next(moving)
            elif s.type != "fixed":
                motion[:3, :3] = sk.rotation_exp(s.axis * next(moving))
            pose = pose @ motion
        assert arm.segments[-1].link_name == arm.tip
        np.testing.assert_allclose(pose, arm.pose(q), atol=1e-12)


def test_computed_torque():
    arm = sk.robots.load("franka_panda")
    control = sk.ComputedTorque(arm, frequency=10.0)
    dynamics = sk.Dynamics(arm)
    for q, qdot, qddot in states(arm):
        e, edot = 1e-3 * qddot, 1e-3 * qdot
        step = control.update(q, 0.1 * qdot, q + e, 0.1 * qdot + edot, 0.1 * qddot)
        assert step.status == sk.Status.OK
        v = dynamics.forward_dynamics(q, 0.1 * qdot, step.torque)
        np.testing.assert_allclose(v, 0.1 * qddot + 20.0 * edot + 100.0 * e, atol=1e-8)
    far = control.update(q, qdot, q + 3.0, qdot, qdot)
    assert far.status == sk.Status.LIMITED
    assert far.limiting_joints
    assert np.all(np.abs(far.torque) <= arm.limits.effort)
    with pytest.raises(sk.Error, match="q_desired"):
        control.update(q, qdot, np.full(7, np.nan), qdot, qdot)
    with pytest.raises(sk.Error, match="frequency"):
        sk.ComputedTorque(arm, frequency=0.0)
