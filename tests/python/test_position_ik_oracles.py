"""PositionIk against other people's solvers: each pose that one of these solves inside the limits, PositionIk solves
too, and the other's own forward kinematics say that the answer is right."""

import importlib.util
from pathlib import Path

import numpy as np
import pytest

import sigmaik as sk

spec = importlib.util.spec_from_file_location(
    "position_ik_peers", Path(__file__).parents[2] / "bench" / "position_ik_peers.py"
)
peers = importlib.util.module_from_spec(spec)
spec.loader.exec_module(peers)

MODULES = {"optik": "optik", "TRAC-IK": "pytracik", "toolbox LM": "roboticstoolbox", "ssik": "ssik"}
ARMS = ["ur10", "kuka_kr6_r900", "franka_panda", "ufactory_xarm7", "kinova_gen3_7dof"]


@pytest.fixture(params=ARMS, scope="module")
def arm(request, tmp_path_factory):
    return peers.Arm(request.param, Path(sk.robots.path(request.param)), "flange", tmp_path_factory.mktemp("urdf"))


def poses(arm, count, beyond=0.0, seed=1):
    """Poses of random configurations; `beyond` [rad]: so far outside the limits, too."""
    rng = np.random.default_rng(seed)
    return arm.chain.pose(rng.uniform(arm.lower - beyond, arm.upper + beyond, (count, arm.chain.dof)))


@pytest.mark.filterwarnings("ignore")
@pytest.mark.parametrize("oracle", MODULES)
def test_each_pose_that_an_oracle_solves_is_solved(arm, oracle):
    pytest.importorskip(MODULES[oracle])
    solve = peers.SOLVERS[oracle][0](arm)
    ik = sk.PositionIk(arm.chain)
    count = 0
    for pose in poses(arm, 40 if oracle != "ssik" else 10, beyond=0.5):  # some have no solution inside the limits
        if not arm.solved(solve(pose), pose):
            continue
        count += 1
        found = ik.solve(pose)
        assert found.status == sk.PositionIkStatus.OK
        assert arm.solved(found.q, pose)
    assert count > 0


def test_forward_kinematics_of_optik_agree(arm):
    optik = pytest.importorskip("optik")
    robot = optik.Robot.from_urdf_file(str(arm.urdf), arm.base, arm.tip)
    ik = sk.PositionIk(arm.chain)
    for pose in poses(arm, 30):
        assert np.abs(np.array(robot.fk(ik.solve(pose).q.tolist())) - pose).max() < 2e-6


def test_forward_kinematics_of_ssik_agree(arm):
    ssik = pytest.importorskip("ssik")
    manipulator = ssik.Manipulator.from_urdf(arm.urdf, base=arm.base, ee=arm.tip)
    ik = sk.PositionIk(arm.chain)
    for pose in poses(arm, 30):
        assert np.abs(manipulator.fk(ik.solve(pose).q) - pose).max() < 2e-6


def test_every_branch_that_ssik_finds_is_found():
    ssik = pytest.importorskip("ssik")
    arm = sk.robots.load("ur10")
    manipulator = ssik.Manipulator.from_urdf(sk.robots.path("ur10"), base=arm.base, ee=arm.tip)
    ik = sk.PositionIk(arm)
    rng = np.random.default_rng(2)
    for pose in arm.pose(rng.uniform(-np.pi, np.pi, (20, 6))):
        ours = ik.solve_all(pose)
        for theirs in manipulator.solve(pose, respect_limits=False):
            turned = (ours - theirs.q + np.pi) % (2 * np.pi) - np.pi
            assert np.abs(turned).max(axis=1).min() < 1e-2
