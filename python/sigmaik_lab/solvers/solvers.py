"""Solvers by name: PositionIk, iterations of our rules, and other libraries'.

A solver is a class with `solve(target, start)`: joint positions (n,) that bring the tip to the position `target` (3,),
from the start (n,). Only the packages of a solver that is asked for are imported.
"""

from __future__ import annotations

import importlib
import os
import tempfile
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np

import sigmaik as sk
from sigmaik._extras import need
from sigmaik._types import Array
from sigmaik_lab.arrival.peers.urdf import chain_urdf

__all__ = ["SOLVERS", "Solver", "SolverEntry", "check_solver", "make_solver"]

TOLERANCE = 1e-6  #: [m] at which an iteration ends
ITERATIONS = 300  #: the most of them
SHORTENED = 0.1  #: [m] The error of an iteration of a rule is shortened to this length (Buss, clamping).


class Solver(Protocol):
    def solve(self, target: Array, start: Array) -> Array:
        """Joint positions (n,) for the tip's position `target` (3,), from `start` (n,); the best there is."""


class PositionIkSolver:
    """PositionIk of the position alone. near: the solution nearest to the start in travel time; else any solution."""

    def __init__(self, chain: sk.Chain, near: bool = True) -> None:
        self._near = near
        self._ik = sk.PositionIk(chain, mask=(1, 1, 1, 0, 0, 0))

    def solve(self, target: Array, start: Array) -> Array:
        pose = np.eye(4)
        pose[:3, 3] = target
        return self._ik.solve(pose, near=start if self._near else None).q


class RuleSolver:
    """q ← clip(q + rule(J, e)), with the error e shortened, and q cut to the joint ranges."""

    def __init__(self, chain: sk.Chain, rule: str) -> None:
        self._chain, self._solver = chain, sk.VelocitySolver(sk.methods.parse(rule))

    def solve(self, target: Array, start: Array) -> Array:
        chain, limits = self._chain, self._chain.limits
        q = np.clip(start, limits.lower, limits.upper)
        for _ in range(ITERATIONS):
            error = target - chain.pose(q)[:3, 3]
            length = float(np.linalg.norm(error))
            if length < TOLERANCE:
                break
            J = chain.jacobian(q)[:3]
            step = self._solver.solve(J, error * min(1.0, SHORTENED / length)).qdot
            q = np.clip(q + step, limits.lower, limits.upper)
        return q


class PlacoSolver:
    """PlaCo's position task, iterated within its joint limits."""

    def __init__(self, chain: sk.Chain) -> None:
        placo: Any = importlib.import_module("placo")
        with tempfile.TemporaryDirectory() as folder:
            self._robot = placo.RobotWrapper(_saved(chain, folder), placo.Flags.ignore_collisions)
        self._solver = placo.KinematicsSolver(self._robot)
        self._solver.mask_fbase(True)
        self._task = self._solver.add_position_task(chain.tip, np.zeros(3))
        self._task.configure("tip", "soft", 1.0)
        # PlaCo's guide: a small regularization where the tasks leave joints free.
        self._solver.add_regularization_task(1e-6)
        self._names, self._limits, self._tip = chain.joint_names, chain.limits, chain.tip

    def solve(self, target: Array, start: Array) -> Array:
        for name, value in zip(self._names, np.clip(start, self._limits.lower, self._limits.upper), strict=True):
            self._robot.set_joint(name, value)
        self._task.target_world = target
        for _ in range(ITERATIONS):
            self._robot.update_kinematics()
            if np.linalg.norm(self._robot.get_T_world_frame(self._tip)[:3, 3] - target) < TOLERANCE:
                break
            self._solver.solve(True)
        q: Array = self._robot.state.q[7:].copy()
        return q


class OptikSolver:
    """OptIK in its mode "speed" of its README, with no weight on the orientation; where it finds nothing, the start."""

    def __init__(self, chain: sk.Chain) -> None:
        optik: Any = importlib.import_module("optik")
        with tempfile.TemporaryDirectory() as folder:
            self._robot = optik.Robot.from_urdf_file(_saved(chain, folder), chain.base, chain.tip)
        self._robot.set_parallelism(1)
        self._config = optik.SolverConfig(max_time=0.1, tol_f=1e-12, angular_weight=[0.0, 0.0, 0.0])
        self._limits = chain.limits

    def solve(self, target: Array, start: Array) -> Array:
        pose = np.eye(4)
        pose[:3, 3] = target
        start = np.clip(start, self._limits.lower, self._limits.upper)
        found = self._robot.ik(self._config, pose, start)
        return start if found is None else np.array(found[0])


def _saved(chain: sk.Chain, folder: str) -> str:
    file = os.path.join(folder, "robot.urdf")
    with open(file, "w", encoding="utf-8") as stream:
        stream.write(chain_urdf(chain))
    return file


@dataclass(frozen=True)
class SolverEntry:
    """A solver of `SOLVERS`."""

    about: str
    make: Callable[[sk.Chain], Solver]
    modules: tuple[str, ...] = ()  #: packages that the solver needs


def _rule(name: str) -> SolverEntry:
    return SolverEntry(f"{ITERATIONS} iterations of {sk.methods.TITLES[name]}", lambda chain: RuleSolver(chain, name))


SOLVERS: dict[str, SolverEntry] = {
    "PositionIk": SolverEntry("sk.PositionIk, near the start", PositionIkSolver),
    "PositionIk-any": SolverEntry("the same, any solution", lambda chain: PositionIkSolver(chain, near=False)),
    **{name: _rule(name) for name in ("pinv", "dls", "adaptive-dls", "sdls", "jparse", "safety")},
    "placo": SolverEntry(f"{ITERATIONS} iterations of PlaCo's position task", PlacoSolver, ("placo",)),
    "optik": SolverEntry("OptIK, mode speed, 0.1 s at most", OptikSolver, ("optik",)),
}


def check_solver(name: str) -> None:
    """ValueError where no solver has this name; MissingPackage where its packages are not installed."""
    if name not in SOLVERS:
        raise ValueError(f"no solver '{name}'; there are {', '.join(SOLVERS)}")
    need(*SOLVERS[name].modules)


def make_solver(name: str, chain: sk.Chain) -> Solver:
    check_solver(name)
    return SOLVERS[name].make(chain)
