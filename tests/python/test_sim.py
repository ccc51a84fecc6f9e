"""Arms in MuJoCo: what drives, limits, friction, noise and delay do, and planned motions in physics."""

from __future__ import annotations

import csv
import importlib.util
import math

import numpy as np
import pytest

import sigmaik as sk
from sigmaik.sim import Simulation, execute
from sigmaik_lab.__main__ import main

pytest.importorskip("mujoco")

PENDULUM = """<robot name="pendulum"><link name="a"/><link name="b"><inertial><origin xyz="0 0 -0.5"/><mass value="2"/>
<inertia ixx="0.1" iyy="0.1" izz="0.01" ixy="0" ixz="0" iyz="0"/></inertial></link>
<joint name="j" type="revolute"><parent link="a"/><child link="b"/><axis xyz="0 1 0"/>
<limit lower="-1" upper="1" velocity="3" effort="20"/></joint></robot>"""
INERTIA = 0.1 + 2.0 * 0.25  # about the joint


@pytest.fixture(scope="module")
def panda():
    return sk.robots.load("franka_panda"), sk.robots.home("franka_panda")


@pytest.fixture(scope="module")
def plan(panda):
    arm, home = panda
    goal = home + np.array([0.8, 0.5, -0.4, 0.6, 0.5, 0.7, -0.9])
    found = sk.planning.time_optimal(arm, home, goal, time_weight=600.0)
    assert found.status == "optimal"
    return found


@pytest.fixture(scope="module")
def pendulum():
    return sk.Chain.from_urdf(PENDULUM)


# --- the physics


def test_free_fall_keeps_its_energy(pendulum):
    simulation = Simulation(pendulum, actuation="torque", timestep=1e-4, control_period=1e-2)
    simulation.reset([0.9])

    def energy():
        return 0.5 * INERTIA * simulation.qdot[0] ** 2 - 2.0 * 9.80665 * 0.5 * math.cos(simulation.q[0])

    begin = energy()
    for _ in range(300):
        simulation.step([0.0])
        assert energy() == pytest.approx(begin, abs=2e-3)
    assert simulation.t == pytest.approx(3.0)


def test_frictions_and_armature(pendulum):
    def after(tau, **options):
        still = {"gravity": (0.0, 0.0, 0.0), "actuation": "torque", "timestep": 1e-4, "control_period": 1e-2}
        simulation = Simulation(pendulum, **still, **options)
        simulation.reset([0.0])
        for _ in range(100):
            simulation.step([tau])
        return simulation.qdot[0]

    assert after(0.6) == pytest.approx(0.6 / INERTIA, rel=1e-6)
    assert after(0.6, armature=0.4) == pytest.approx(0.6, rel=1e-6)
    assert after(0.6, coulomb_friction=0.3) == pytest.approx(0.3 / INERTIA, rel=1e-2)
    assert abs(after(0.25, coulomb_friction=0.3)) < 1e-2
    decay = 1.0 - math.exp(-2.0 / INERTIA)
    assert after(0.6, viscous_friction=2.0) == pytest.approx(0.3 * decay, rel=1e-3)


def test_effort_limits_hold_and_are_counted(pendulum):
    simulation = Simulation(pendulum, actuation="torque", gravity=(0.0, 0.0, 0.0))
    simulation.reset([0.0])
    simulation.step([100.0])
    assert simulation.qdot[0] == pytest.approx(20.0 / INERTIA * 1e-3, rel=1e-9)
    assert simulation.saturated.tolist() == [1.0]
    assert simulation.peak_torque.tolist() == [20.0]
    simulation.step([19.9])
    assert simulation.saturated.tolist() == [0.0]
    strong = Simulation(pendulum, actuation="torque", gravity=(0.0, 0.0, 0.0), effort_limits=False)
    strong.reset([0.0])
    strong.step([100.0])
    assert strong.qdot[0] == pytest.approx(100.0 / INERTIA * 1e-3, rel=1e-9)
    assert strong.saturated.tolist() == [0.0]


def test_position_stops(pendulum):
    for stops in (False, True):
        simulation = Simulation(pendulum, gravity=(0.0, 0.0, 0.0), position_stops=stops)
        simulation.reset([0.8])
        for _ in range(1000):
            simulation.step([0.5])
        assert (simulation.q[0] < 1.05) == stops


def test_velocity_loops(panda):
    arm, home = panda
    simulation = Simulation(arm)
    simulation.reset(home)
    asked = np.array([0.2, -0.1, 0.2, 0.1, -0.3, 0.2, 0.3])
    for _ in range(500):
        simulation.step(asked)
    assert np.abs(simulation.qdot - asked).max() < 0.02
    for _ in range(1000):
        simulation.step(np.zeros(7))
    assert np.abs(simulation.qdot).max() < 1e-3
    # Cut at the speed limits.
    for _ in range(300):
        simulation.step([100.0, 0, 0, 0, 0, 0, 0])
    assert simulation.qdot[0] == pytest.approx(arm.limits.velocity[0], rel=0.05)


@pytest.mark.parametrize("name", [name for name in sk.robots.names() if name != "kuka_kr6_r900"])
def test_no_motions_error_decays_more_slowly_than_promised(name):
    # K_v = ω max M_ii, so M⁻¹ K_v has no eigenvalue below ω/n wherever no M_ii is above that maximum.
    arm = sk.robots.load(name)
    simulation = Simulation(arm, bandwidth=100.0)
    gain = simulation.model.actuator_gainprm[:, 0]
    dynamics = sk.Dynamics(arm)
    rng = np.random.default_rng(7)
    for _ in range(200):
        mass = dynamics.mass_matrix(arm.random_configuration(rng))
        margin = max(1.0, float((np.diag(mass) / (gain / 100.0)).max()))
        rates = np.linalg.eigvals(np.linalg.solve(mass, np.diag(gain))).real
        assert rates.min() >= 100.0 / arm.dof / margin
        assert margin < 1.2  # 256 configurations show nearly the largest


def test_hold_under_gravity_with_what_the_drives_do_not_know(panda):
    arm, home = panda
    for options, drop in (({}, 1e-6), ({"payload": sk.Inertia(2.0)}, 0.05), ({"gravity_compensation": False}, 0.3)):
        simulation = Simulation(arm, **options)
        simulation.reset(home)
        for _ in range(1500):
            simulation.step(np.zeros(7))
        assert np.abs(simulation.q - home).max() < drop
        assert np.abs(simulation.qdot).max() < 1e-2  # the integral holds the arm against any unknown load


# --- what is measured


def test_noise_and_delay(panda):
    arm, home = panda
    simulation = Simulation(arm, position_noise=1e-3, velocity_noise=2e-2, delay=3, seed=4)
    true, seen = [], []
    measured = simulation.reset(home)
    for k in range(600):
        true.append((simulation.t, simulation.q, simulation.qdot))
        assert measured.t == pytest.approx(max(0, k - 3) * 1e-3)
        seen.append(measured)
        measured = simulation.step(np.full(7, 0.3 * math.sin(0.02 * k)))
    dq = np.array([seen[k].q - true[k - 3][1] for k in range(3, 600)])
    dqdot = np.array([seen[k].qdot - true[k - 3][2] for k in range(3, 600)])
    assert dq.std() == pytest.approx(1e-3, rel=0.05)
    assert dqdot.std() == pytest.approx(2e-2, rel=0.05)
    assert abs(dq.mean()) < 1e-4


def test_the_seed_decides(panda):
    arm, home = panda

    def end(seed):
        simulation = Simulation(arm, position_noise=1e-3, coulomb_friction=0.5, seed=seed)
        results = []
        for _ in range(2):  # and reset starts the noise anew
            measured = simulation.reset(home)
            for _ in range(100):
                measured = simulation.step(2.0 * (home + 0.1 - measured.q))
            results.append(simulation.q)
        assert np.array_equal(*results)
        return results[0]

    assert np.array_equal(end(1), end(1))
    assert not np.array_equal(end(1), end(2))


# --- planned motions


def test_computed_torque_with_the_true_model(panda, plan):
    arm, _ = panda
    errors = []
    for period in (2e-3, 1e-3, 5e-4):
        simulation = Simulation(arm, actuation="torque", timestep=period / 4, control_period=period)
        done = execute(simulation, plan)
        errors.append(done.max_error)
        assert done.saturated == 0.0
        assert done.final_error < 1e-6
        assert done.max_effort < 1.0
    # The remaining error comes from holding the torque over a period, and is of first order in the period.
    assert errors[1] < 5e-4
    assert errors[0] / errors[2] == pytest.approx(4.0, rel=0.4)
    velocity = execute(Simulation(arm), plan)
    assert errors[1] < 0.1 * velocity.max_error < 1e-2


def test_payload_unknown_and_known(panda, plan):
    arm, _ = panda
    load = sk.Inertia(1.0, (0.0, 0.0, 0.05))
    unknown, known = (
        execute(Simulation(arm, actuation="torque", payload=load), plan, control)
        for control in (None, sk.ComputedTorque(arm, payload=load))
    )
    assert known.max_error < 5e-4
    # At rest e = d/ω², where M d is the missing torque.
    end = plan.q[-1]
    loaded, bare = sk.Dynamics(arm, payload=load), sk.Dynamics(arm)
    q = unknown.q[-1]
    missing = np.linalg.solve(bare.mass_matrix(q), loaded.gravity(q) - bare.gravity(q))
    np.testing.assert_allclose(end - q, missing / 20.0**2, atol=0.02 * np.abs(missing).max() / 20.0**2)
    assert unknown.final_error < unknown.max_error < 1.0
    assert np.abs(unknown.qdot[-1]).max() < 1e-2
    assert np.array_equal(unknown.planned[-1], end)


def test_saturation_is_told(panda, plan):
    arm, _ = panda
    weak = arm.with_limits(effort=0.5 * arm.limits.effort)
    fast = plan.retimed(0.2 * plan.duration)
    done = execute(Simulation(weak, actuation="torque"), fast, sk.ComputedTorque(weak))
    assert done.saturated > 0.01
    assert done.max_effort == pytest.approx(1.0)
    assert done.max_error > 1e-2
    assert done.final_error < 1e-3


def test_late_and_noisy_measurements(panda, plan):
    arm, _ = panda
    for actuation in ("velocity", "torque"):
        simulation = Simulation(
            arm, actuation=actuation, delay=2, position_noise=1e-4, velocity_noise=1e-3, coulomb_friction=0.05
        )
        assert execute(simulation, plan).max_error < 0.05


# --- refusals


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"actuation": "position"}, "actuation"),
        ({"timestep": 0.0}, "timestep"),
        ({"timestep": 3e-4}, "does not divide"),
        ({"timestep": 2e-3}, "does not divide"),
        ({"control_period": math.nan}, "control_period"),
        ({"bandwidth": -1.0}, "bandwidth"),
        ({"integral_rate": -1.0}, "integral_rate"),
        ({"coulomb_friction": [1.0, 2.0]}, "coulomb_friction has shape"),
        ({"viscous_friction": -1.0}, "viscous_friction"),
        ({"armature": math.inf}, "armature"),
        ({"position_noise": -1e-3}, "position_noise"),
        ({"delay": -1}, "delay"),
        ({"delay": 1.5}, "whole number"),
        ({"payload": sk.Inertia(-1.0)}, "payload"),
        ({"gravity": (0.0, 1.0)}, "gravity"),
    ],
)
def test_bad_options(panda, options, message):
    with pytest.raises(sk.Error, match=message):
        Simulation(panda[0], **options)


def test_bad_commands(panda, plan):
    arm, home = panda
    simulation = Simulation(arm)
    for command, message in ((np.zeros(6), "shape"), (np.full(7, math.nan), "not finite"), (1.0, "shape")):
        with pytest.raises(sk.Error, match=message):
            simulation.step(command)
    with pytest.raises(sk.Error, match="q has shape"):
        simulation.reset(home[:6])
    with pytest.raises(sk.Error, match="inertia"):
        Simulation(sk.robots.load("kuka_kr6_r900"))
    with pytest.raises(ValueError, match="takes no torques"):
        execute(simulation, plan, sk.ComputedTorque(arm))
    with pytest.raises(ValueError, match="joints"):
        execute(Simulation(sk.robots.load("puma560")), plan)
    with pytest.raises(ValueError, match="settle"):
        execute(simulation, plan, settle=-1.0)


def test_the_extra_is_named(panda, monkeypatch):
    find = importlib.util.find_spec
    monkeypatch.setattr(importlib.util, "find_spec", lambda name: None if name == "mujoco" else find(name))
    with pytest.raises(sk.Error, match="mujoco is not installed; pip install 'mujoco>=3' brings it"):
        Simulation(panda[0])


# --- the reaching experiments


@pytest.fixture(scope="module")
def reaching():
    """A second at a pose out of reach, and one at a pose well inside."""
    from sigmaik_lab.reach import experiment as ex
    from sigmaik_lab.reach import paths

    arm = sk.robots.load("ufactory_xarm7")
    start = np.array(ex.published("ufactory_xarm7").start)
    far, near = arm.pose(start), arm.pose(start)
    far[:3, 3] = (1.0, 0.0, 0.5)
    near[:3, 3] += (0.05, 0.05, 0.05)
    path = paths.Path("two", (paths.Segment.hold("near", near, 2.0), paths.Segment.hold("far", far, 1.0)))
    return ex.load("ufactory_xarm7", path, start=tuple(start))


@pytest.mark.parametrize("actuation", ["velocity", "torque"])
@pytest.mark.parametrize("feedback", ["reference", "measured"])
def test_reaching_in_physics(reaching, actuation, feedback):
    from sigmaik_lab.physical_arm import PhysicsSettings
    from sigmaik_lab.reach import experiment as ex
    from sigmaik_lab.reach import physics
    from sigmaik_lab.reach.methods import parse_method

    method = parse_method("jparse", reaching.settings)
    settings = PhysicsSettings(actuation=actuation, feedback=feedback)
    run = physics.run_physics(reaching, method, True, settings)
    # Without physics the answer is that of `run`, to the last digit.
    alone = ex.run(reaching, method, True)
    assert np.array_equal(run.kinematic.q, alone.q)
    near, far = physics.summarize_physics(run)
    assert near.physical_position_error < 1e-3
    assert near.physical_position_error == pytest.approx(near.position_error, abs=1e-3)
    assert far.physical_position_error == pytest.approx(far.position_error, rel=0.05)
    assert 0.0 < far.max_effort <= 1.0 + 1e-9
    assert 1e-3 < far.max_tip_distance < 0.3
    assert math.isnan(near.tripped)
    again = physics.run_physics(reaching, method, True, settings)
    assert np.array_equal(run.physical.q, again.physical.q)


def test_the_measured_loop_is_the_servos_law(reaching):
    # The drives are perfect and run at the method's rate: the only difference is the time that they take to follow.
    from sigmaik.sim import Measurement
    from sigmaik_lab.reach import experiment as ex
    from sigmaik_lab.reach.methods import parse_method
    from sigmaik_lab.reach.physics import _Measured

    for name in ("jparse", "dls", "pinv"):
        method = parse_method(name, reaching.settings)
        for limits in (False, True):
            loop = _Measured(reaching, method, limits)
            run = ex.run(reaching, method, limits)
            poses = [pose for _, pose in reaching.targets()]
            for k in range(0, len(run.t), 7):
                if not np.isfinite(run.q[k]).all() or np.abs(run.qdot[k]).max() > 100.0:
                    continue
                qdot, _, scale = loop.update(Measurement(0.0, run.q[k], np.zeros(7)), poses[k])
                np.testing.assert_allclose(qdot, run.qdot[k], atol=1e-6 * (1.0 + np.abs(qdot).max()))
                assert scale == pytest.approx(run.scale[k], abs=1e-6)


def test_drives_trip(reaching):
    from sigmaik_lab.physical_arm import PhysicsSettings
    from sigmaik_lab.reach import physics
    from sigmaik_lab.reach.methods import parse_method

    method = parse_method("jparse", reaching.settings)
    run = physics.run_physics(reaching, method, False, PhysicsSettings(trip=0.2))
    assert run.tripped > 0.0
    after = run.physical.t > run.tripped
    assert np.array_equal(run.physical.q[after], np.broadcast_to(run.physical.q[-1], run.physical.q[after].shape))
    assert not run.physical.qdot[after].any()
    assert not run.effort[after].any()


# --- the commands

WAYPOINTS = "x,y,z,roll,pitch,yaw,duration\n0.4,0,0.4,3.14159265,0,0,1\n"


@pytest.fixture
def waypoints(tmp_path):
    file = tmp_path / "way.csv"
    file.write_text(WAYPOINTS)
    return str(file)


def test_reach_command(tmp_path, capsys, waypoints):
    out = tmp_path / "out"
    arguments = ["reach", "--path", waypoints, "--method", "jparse,dls", "--physics", "--out", str(out)]
    assert main(arguments) == 0
    printed = capsys.readouterr().out.splitlines()
    assert printed[-1] == str(out / "ufactory_xarm7-way-velocity.png")
    assert max(map(len, printed[:-3])) <= 80
    assert (out / "ufactory_xarm7-way-velocity.png").stat().st_size > 10_000
    assert len(list(out.glob("*.npz"))) == 8
    with (out / "ufactory_xarm7-way-velocity.csv").open(newline="") as stream:
        rows = list(csv.DictReader(stream))
    assert len(rows) == 4
    assert all(float(row["max_tip_distance"]) > 0.0 for row in rows)
    options = (
        "--physics torque --feedback measured --friction 0.01 --payload 0.5 --noise 1e-4 --velocity-noise 1e-3 "
        "--delay 1 --period 2e-3 --frequency 30 --seed 3 --method all --limits on --format none --no-plot"
    )
    assert main(["reach", "--path", waypoints, "--out", str(out), *options.split()]) == 0
    captured = capsys.readouterr().out
    assert "payload 0.5 kg" in captured
    assert captured.splitlines()[-1] == str(out / "ufactory_xarm7-way-torque-measured.csv")


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["--robot", "kuka_kr6_r900", "--path", "WAYPOINTS"], "inertia"),
        (["--friction", "-1"], "friction"),
        (["--payload", "-1"], "payload"),
        (["--noise", "-1"], "position_noise"),
        (["--delay", "-1"], "delay"),
        (["--period", "0.003"], "does not divide"),
        (["--period", "0"], "timestep = 0"),
        (["--frequency", "0", "--physics", "torque"], "frequency"),
    ],
)
def test_reach_command_refuses(capsys, tmp_path, waypoints, arguments, message):
    arguments = [waypoints if text == "WAYPOINTS" else text for text in arguments]
    command = ["reach", "--method", "dls", "--no-plot", "--physics", "--out", str(tmp_path)]
    assert main([*command, *arguments]) == 2
    assert message in capsys.readouterr().err


def test_execute_command(tmp_path, capsys, plan):
    saved = plan.save(tmp_path / "plan.npz")
    assert main(["execute", "--plan", str(saved), "--payload", "0.5", "--out", str(tmp_path)]) == 0
    assert capsys.readouterr().out.splitlines()[-1] == str(tmp_path / "franka_panda-execute.png")
    with (tmp_path / "franka_panda-execute.csv").open(newline="") as stream:
        rows = {row["variant"]: row for row in csv.DictReader(stream)}
    assert list(rows) == ["payload unknown", "payload known", "velocity loops"]
    assert float(rows["payload known"]["max_error"]) < 1e-3 < float(rows["payload unknown"]["max_error"])
    command = "execute --robot puma560 --motion 3 --pace 0.5 --no-plot --friction 0.01 --out"
    assert main([*command.split(), str(tmp_path)]) == 0
    assert capsys.readouterr().out.splitlines()[-1] == str(tmp_path / "puma560-execute.csv")


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["--robot", "kuka_kr6_r900"], "inertia"),
        (["--pace", "0"], "--pace"),
        (["--plan", "nothing.npz"], "nothing.npz"),
        (["--motion", "-1"], "non-negative"),
        (["--delay", "-2"], "delay"),
    ],
)
def test_execute_command_refuses(capsys, tmp_path, arguments, message):
    assert main(["execute", "--no-plot", "--out", str(tmp_path), *arguments]) == 2
    assert message in capsys.readouterr().err
