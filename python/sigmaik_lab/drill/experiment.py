"""Every method drives arms through their singularities, as a user does with the gizmo; recordings give the figures."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from sigmaik import methods
from sigmaik._types import Array
from sigmaik.teleop import Episode, Session, Settings

__all__ = ["ROBOTS", "Drill", "drill"]

ROBOTS = ("ufactory_xarm7", "kinova_gen3_7dof", "franka_panda", "ur10", "puma560")


@dataclass(frozen=True)
class Drill:
    """One arm, one method."""

    robot: str
    method: str
    cycles: int
    smallest_ratio: float  #: of σ_min/σ_max on the way
    largest_speed: float  #: of |q̇|/limit on the way
    broken: int  #: joints times cycles beyond a position, velocity or acceleration limit
    error: float  #: [m] from the tool to its target at the end, which is home
    episode: Episode


def drill(
    robots: Sequence[str] = ROBOTS,
    names: Sequence[str] = methods.ALL,
    seconds: float = 3.0,
    rate: float = 500.0,
    progress: Callable[[float], None] | None = None,
    base: str | None = None,
    tip: str | None = None,
) -> list[Drill]:
    """Drives all arms at once, each with every method, in real time: four targets, each for `seconds`.

    The targets are: beyond reach ahead; on the other side of the base's axis, past the shoulder's singularity; beyond
    reach above; and home.

    robots: shipped arms or URDF files, between the links base and tip; names: methods
    progress: called with the part that is done
    """
    sessions = [
        # The guide would lead the joints past the singularities that the methods are to pass.
        Session(
            robot,
            base=base,
            tip=tip,
            settings=Settings(method=method, guided=False, singular_posture=True),
            rate=rate,
            pose_timeout=10.0,
        )
        for robot in robots
        for method in names
    ]
    homes = [session.chain.pose(session.home) for session in sessions]
    try:
        for session in sessions:
            session.__enter__()
        for session in sessions:
            session.start_recording()
        ways = [_targets(home) for home in homes]
        begun = time.monotonic()
        for leg in range(4):
            for session, way in zip(sessions, ways, strict=True):
                session.follow(way[leg])
            while (passed := time.monotonic() - begun) < (leg + 1) * seconds:
                for session in sessions:
                    session.read()
                if progress is not None:
                    progress(passed / (4.0 * seconds))
                time.sleep(0.1)
        episodes = [session.stop_recording() for session in sessions]
    finally:
        for session in sessions:
            session.__exit__()
    return [_drill(session, home, episode) for session, home, episode in zip(sessions, homes, episodes, strict=True)]


def _targets(home: Array) -> list[Array]:
    ahead, across, above = home.copy(), home.copy(), home.copy()
    ahead[:2, 3] *= 4.0
    across[:2, 3] *= -1.0
    above[2, 3] += 3.0
    return [ahead, across, above, home]


def _drill(session: Session, home: Array, episode: Episode) -> Drill:
    sigma = episode["singular_values"]
    sigma = sigma[np.isfinite(sigma).all(axis=1)]
    return Drill(
        session.name,
        session.settings.method,
        len(episode),
        float((sigma[:, -1] / sigma[:, 0]).min()),
        float((np.abs(episode["qdot"]) / session.chain.limits.velocity).max()),
        sum(episode.broken_limits().values()),
        float(np.linalg.norm(episode["pose"][-1][:3, 3] - home[:3, 3])),
        episode,
    )
