"""Position IK beside the peers that are installed, by the protocol of TRAC-IK (Beeson and Ames, Humanoids 2015).

Each arm gets random configurations, evenly within its position limits, and every solver the poses of these, one after
the other, from the same start (the middle of the limits). An answer counts where the arm's kinematics say that it is
within the tolerance in each row, inside the limits, and took no more than 5 ms of each thread. Times are the process's
CPU time, so that other work on the machine matters little; TRAC-IK has two threads, whose times add up. Solvers take
turns, pose by pose, so that a machine that changes its speed does so for all. A solver that has used up its time on an
arm gets no more poses there; the table then says how many it had. Two peers stop by the clock on the wall: on a busy
machine give them more with --patience, and their answers still have to come within 5 ms of CPU time to count.
"""

from __future__ import annotations

import argparse
import importlib
import importlib.metadata
import json
import tempfile
import time
import warnings
import xml.etree.ElementTree as ET
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

import sigmaik as sk

TOLERANCE = 1e-5  # m and rad, in each row; an answer counts up to twice this, as peers measure errors differently
SLACK = 1e-6  # rad: some peers round limits to single precision
ALLOWED = 5e-3  # s of CPU time, of each thread
THREADS = {"TRAC-IK": 2}

# Foreign arms: package, file, tip
FOREIGN = [
    ("example-robot-data", "ur_description/urdf/ur5_robot.urdf", "ee_link"),
    ("example-robot-data", "z1_description/urdf/z1.urdf", "gripperStator"),
    ("example-robot-data", "baxter_description/urdf/baxter.urdf", "left_gripper"),
    ("example-robot-data", "talos_data/robots/talos_left_arm.urdf", "gripper_left_motor_double_link"),
    ("rtb-data", "abb_irb140_description/urdf/irb140.urdf", "tool0"),
    ("rtb-data", "kuka_kr210/urdf/kr210l150.urdf", "tool0"),
]


def foreign() -> dict[str, tuple[Path, str]]:
    """The foreign arms that are installed: {name: (URDF, tip)}."""
    found = {}
    for package, name, tip in FOREIGN:
        try:
            files = importlib.metadata.distribution(package).files or []
        except importlib.metadata.PackageNotFoundError:
            continue
        for file in files:
            if str(file).endswith(name):
                found[Path(name).stem] = (Path(str(file.locate())), tip)
    return found


def bare_urdf(source: Path, tip: str, out: Path) -> str:
    """Writes the chain from the root to `tip`, without shapes and masses, with continuous joints limited to ±π.

    Some peers read no continuous joints. Returns the name of the root.
    """
    robot = ET.parse(source).getroot()
    by_child = {joint.find("child").get("link"): joint for joint in robot.findall("joint")}
    bare, link, joints = ET.Element("robot", name=out.stem), tip, []
    while link in by_child:
        joints.append(by_child[link])
        link = by_child[link].find("parent").get("link")
    ET.SubElement(bare, "link", name=link)
    for joint in reversed(joints):
        ET.SubElement(bare, "link", name=joint.find("child").get("link"))
        kept = ET.SubElement(bare, "joint", name=joint.get("name"), type=joint.get("type"))
        kept.extend(child for child in joint if child.tag in ("origin", "parent", "child", "axis", "limit"))
        if kept.get("type") == "continuous":
            kept.set("type", "revolute")
            limit = kept.find("limit")
            limit = ET.SubElement(kept, "limit", effort="100", velocity="1") if limit is None else limit
            limit.set("lower", str(-np.pi))
            limit.set("upper", str(np.pi))
    ET.ElementTree(bare).write(out)
    return link


class Arm:
    def __init__(self, name: str, source: Path, tip: str, folder: Path, patience: float = ALLOWED) -> None:
        self.name, self.tip, self.patience = name, tip, patience
        self.urdf = folder / f"{name}.urdf"
        self.base = bare_urdf(source, tip, self.urdf)
        self.chain = sk.Chain.from_urdf(self.urdf, self.base, tip)
        self.lower, self.upper = self.chain.limits.lower, self.chain.limits.upper
        self.start = 0.5 * (self.lower + self.upper)

    def solved(self, q: Any, pose: np.ndarray) -> bool:
        if q is None or len(q) != self.chain.dof or not np.all(np.isfinite(q)):
            return False
        q = np.asarray(q)
        if np.any(q < self.lower - SLACK) or np.any(q > self.upper + SLACK):
            return False
        return bool(np.abs(sk.pose_error(self.chain.pose(q), pose)).max() <= 2.0 * TOLERANCE)


Solve = Callable[[np.ndarray], Any]  # pose to joints, or None
Build = Callable[[Arm], Solve]


def sigmaik_first(arm: Arm) -> Solve:
    ik = sk.PositionIk(arm.chain, tolerance=(TOLERANCE, TOLERANCE))
    return lambda pose: ik.solve(pose).q


def sigmaik_near(arm: Arm) -> Solve:
    ik = sk.PositionIk(arm.chain, tolerance=(TOLERANCE, TOLERANCE))
    return lambda pose: ik.solve(pose, near=arm.start).q


def optik(arm: Arm) -> Solve:
    peer = importlib.import_module("optik")
    robot = peer.Robot.from_urdf_file(str(arm.urdf), arm.base, arm.tip)
    robot.set_parallelism(1)
    if np.abs(np.array(robot.fk(arm.start.tolist())) - arm.chain.pose(arm.start)).max() > 1e-6:
        raise ValueError("its forward kinematics are those of another arm")
    config = peer.SolverConfig(
        solution_mode="speed", max_time=arm.patience, max_restarts=10**6, tol_f=0.5 * TOLERANCE**2
    )
    start = arm.start.tolist()

    def solve(pose: np.ndarray) -> Any:
        found = robot.ik(config, pose.tolist(), start)
        return None if found is None else found[0]

    return solve


def trac_ik(arm: Arm) -> Solve:
    peer = importlib.import_module("pytracik")
    solver = peer.TRAC_IK(
        arm.base, arm.tip, arm.urdf.read_text(), arm.patience, TOLERANCE, peer.SolveType.Speed
    )  # two threads, as TRAC-IK is

    def solve(pose: np.ndarray) -> Any:
        x, y, z, w = quaternion(pose[:3, :3])
        found = peer.ik(solver, arm.start, *pose[:3, 3], x, y, z, w)
        return found[1:] if found[0] >= 0 else None

    return solve


def quaternion(rotation: np.ndarray) -> tuple[float, float, float, float]:
    vector = sk.rotation_log(rotation)
    angle = float(np.linalg.norm(vector))
    x, y, z = vector * (np.sin(0.5 * angle) / angle if angle > 0 else 0.5)
    return x, y, z, float(np.cos(0.5 * angle))


def toolbox(arm: Arm) -> Solve:
    peer = importlib.import_module("roboticstoolbox")
    ets = peer.Robot.URDF(str(arm.urdf)).ets(end=arm.tip)

    def solve(pose: np.ndarray) -> Any:
        found = ets.ik_LM(pose, q0=arm.start, tol=0.5 * TOLERANCE**2, joint_limits=True)
        return found.q if found.success else None

    return solve


def ssik(arm: Arm) -> Solve:
    manipulator = importlib.import_module("ssik").Manipulator.from_urdf(arm.urdf, base=arm.base, ee=arm.tip)

    def solve(pose: np.ndarray) -> Any:
        found = manipulator.solve(pose, max_solutions=1)
        return found[0].q if found else None

    return solve


SOLVERS: dict[str, tuple[Build, str]] = {
    "sigmaik": (sigmaik_first, "sigmaik"),
    "sigmaik near": (sigmaik_near, "sigmaik"),
    "optik": (optik, "optik-py"),
    "TRAC-IK": (trac_ik, "pytracik"),
    "toolbox LM": (toolbox, "roboticstoolbox-python"),
    "ssik": (ssik, "ssik"),
}


def measure(arm: Arm, poses: int, budget: float, seed: int) -> list[dict[str, Any]]:
    rng = np.random.default_rng(seed)
    solvers: dict[str, Solve] = {}
    rows: list[dict[str, Any]] = []
    for name, (build, package) in SOLVERS.items():
        try:
            solvers[name] = build(arm)
        except BaseException as error:  # a peer that is missing, cannot read the arm, or panics
            if isinstance(error, KeyboardInterrupt):
                raise
            rows.append({"arm": arm.name, "solver": name, "skipped": f"{package}: {str(error).splitlines()[0][:60]}"})
    for solve in solvers.values():
        solve(arm.chain.pose(arm.start))  # what is loaded or compiled on the first call
    times: dict[str, list[float]] = {name: [] for name in solvers}
    solved, spent = dict.fromkeys(solvers, 0), dict.fromkeys(solvers, 0.0)
    for q in rng.uniform(arm.lower, arm.upper, (poses, arm.chain.dof)):
        pose = arm.chain.pose(q)
        for name, solve in solvers.items():
            if spent[name] > budget:
                continue
            start = time.process_time()
            answer = solve(pose)
            taken = time.process_time() - start
            times[name].append(taken)
            spent[name] += taken
            solved[name] += taken <= THREADS.get(name, 1) * ALLOWED and arm.solved(answer, pose)
    for name, values in times.items():
        us = 1e6 * np.asarray(values)
        rows.append(
            {
                "arm": arm.name,
                "solver": name,
                "version": importlib.metadata.version(SOLVERS[name][1]),
                "poses": len(values),
                "solved": solved[name],
                "mean_us": float(us.mean()),
                "p99_us": float(np.percentile(us, 99)),
            }
        )
    return rows


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--poses", type=int, default=10000, help="of each arm (%(default)s)")
    parser.add_argument("--budget", type=float, default=60.0, help="[s] of a solver on an arm (%(default)s)")
    parser.add_argument("--arms", nargs="*", help="names (all)")
    parser.add_argument(
        "--patience", type=float, default=ALLOWED, help="[s] on the wall, of optik and TRAC-IK (%(default)s)"
    )
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--json", help="write the figures to this file")
    arguments = parser.parse_args()
    sources = {name: (Path(sk.robots.path(name)), "flange") for name in sk.robots.names()} | foreign()
    warnings.simplefilter("ignore")  # of the peers
    rows = []
    print(f"{'arm':30} {'solver':14} {'poses':>6} {'solved %':>9} {'mean µs':>9} {'p99 µs':>9}")
    with tempfile.TemporaryDirectory() as folder:
        for name, (source, tip) in sources.items():
            if arguments.arms and name not in arguments.arms:
                continue
            arm = Arm(name, source, tip, Path(folder), arguments.patience)
            for row in measure(arm, arguments.poses, arguments.budget, arguments.seed):
                rows.append(row)
                if "skipped" in row:
                    print(f"{name:30} {row['solver']:14} skipped: {row['skipped']}", flush=True)
                    continue
                share = 100 * row["solved"] / row["poses"]
                print(
                    f"{name:30} {row['solver']:14} {row['poses']:6} {share:9.3f} {row['mean_us']:9.1f} "
                    f"{row['p99_us']:9.1f}",
                    flush=True,
                )
    if arguments.json:
        Path(arguments.json).write_text(json.dumps(rows, indent=1))


if __name__ == "__main__":
    main()
