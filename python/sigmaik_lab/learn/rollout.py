"""Lets a policy or the demonstrator drive held-out scenes under a rule, and keeps what the arm did.

All scenes of a piece step together in a `FetchVector`. A piece of work is a `Piece`: it can be pickled, so that an
executor may run it anywhere.
"""

from __future__ import annotations

import hashlib
import json
import pathlib
from dataclasses import asdict, dataclass
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from sigmaik.files import write_atomically

from .episode import PHASES
from .scene import Region

__all__ = ["DEMONSTRATOR", "Piece", "Rollout", "Rollouts", "digest", "load_rollouts", "roll", "save_rollouts"]

Floats = NDArray[np.float32]

#: The name of the scripted demonstrator in place of a policy's file.
DEMONSTRATOR = "demonstrator"


@dataclass(frozen=True)
class Piece:
    """Some scenes, and who drives the arm there."""

    policy: str  #: file of a policy, or DEMONSTRATOR
    rule: str | None  #: as `Fetch` takes it
    seeds: tuple[int, ...]  #: of the scenes
    robot: str = "ufactory_xarm7"
    region: Region = "edge"
    execute: int = 4  #: actions of a chunk that are done before the policy looks again
    denoise: int = 10  #: steps of DDIM
    noise: float = 0.5  #: standard deviation of the noise that chunks are made of; 1 as in training
    max_steps: int = 300


@dataclass(frozen=True)
class Rollout:
    """What happened in one scene. Row k is after action k; the first row of `tool` is before all actions."""

    seed: int
    reached: int  #: number of phases of PHASES that are behind the arm
    success: bool
    lost: bool  #: the cup fell
    limits_broken: int  #: cycles beyond a limit
    tool: Floats  #: (T + 1, 3) [m] tool positions, base frame
    sigma: Floats  #: (T + 1,) σ_min/σ_max
    asked: Floats  #: (T, 6) mean [v; ω] of the action's target
    achieved: Floats  #: (T, 6) likewise of the tool

    @property
    def steps(self) -> int:
        return len(self.asked)


@dataclass(frozen=True)
class Rollouts:
    """The rollouts of a piece."""

    piece: Piece
    digest: str  #: of the policy's file
    rollouts: tuple[Rollout, ...]


class _Driver(Protocol):
    """Gives actions for all scenes at once."""

    def act(self, step: int, states: Floats) -> Floats: ...


class _PolicyDriver:
    """A policy with a receding horizon: a new chunk every `execute` actions."""

    def __init__(self, piece: Piece) -> None:
        import torch

        from .policy import load_policy

        # A rollout is one of many that run side by side.
        torch.set_num_threads(1)
        self._policy, self._piece = load_policy(piece.policy), piece
        if self._policy.robot != piece.robot:
            raise ValueError(f"{piece.policy} was trained on {self._policy.robot}, not on {piece.robot}")
        # Noise of its own for each scene, so that a scene's answer does not depend on its neighbours.
        self._rngs = [np.random.default_rng([seed, 0xD1FF]) for seed in piece.seeds]
        self._chunk: Floats = np.empty(0, dtype=np.float32)

    def act(self, step: int, states: Floats) -> Floats:
        if step % self._piece.execute == 0:
            shape = self._policy.scale.said_mean.shape
            noise = np.stack([rng.standard_normal(shape, dtype=np.float32) for rng in self._rngs])
            self._chunk = self._policy.chunks(states, self._piece.noise * noise, self._piece.denoise)
        return self._chunk[:, step % self._piece.execute]


class _DemonstratorDriver:
    def __init__(self, piece: Piece) -> None:
        from .demonstrator import Demonstrator
        from .scene import task

        found = task(piece.robot, piece.region)
        self._demonstrators = [Demonstrator(found, seed=seed) for seed in piece.seeds]

    def act(self, step: int, states: Floats) -> Floats:
        return np.stack([one(state) for one, state in zip(self._demonstrators, states, strict=True)])


def roll(piece: Piece) -> Rollouts:
    """Drives all scenes of a piece, each to its end. ValueError where the policy is for another arm."""
    from .vector import FetchVector

    driver: _Driver = _DemonstratorDriver(piece) if piece.policy == DEMONSTRATOR else _PolicyDriver(piece)
    size = len(piece.seeds)
    env = FetchVector(size, piece.robot, piece.rule, region=piece.region, max_steps=piece.max_steps)
    states, info = env.reset(seed=list(piece.seeds))
    tool, sigma = [env.world.pose[:, :3, 3].copy()], [info["sigma_ratio"]]
    asked, achieved = [], []
    ends = np.full(size, -1)
    last: dict[str, NDArray[Any]] = {}
    for step in range(piece.max_steps):
        states, _, terminated, truncated, info = env.step(driver.act(step, states))
        tool.append(env.world.pose[:, :3, 3].copy())
        sigma.append(info["sigma_ratio"])
        asked.append(info["asked_twist"])
        achieved.append(info["achieved_twist"])
        ended = (terminated | truncated) & (ends < 0)
        for name in ("reached", "success", "lost", "limits_broken"):
            last.setdefault(name, info[name].copy())[ended] = info[name][ended]
        ends[ended] = step + 1
        if (ends >= 0).all():
            break
    found = []
    for b, seed in enumerate(piece.seeds):
        end = int(ends[b])
        found.append(
            Rollout(
                seed=seed,
                reached=PHASES.index(str(last["reached"][b])) + 1 if last["reached"][b] else 0,
                success=bool(last["success"][b]),
                lost=bool(last["lost"][b]),
                limits_broken=int(last["limits_broken"][b]),
                tool=np.array([row[b] for row in tool[: end + 1]], dtype=np.float32),
                sigma=np.array([row[b] for row in sigma[: end + 1]], dtype=np.float32),
                asked=np.array([row[b] for row in asked[:end]], dtype=np.float32),
                achieved=np.array([row[b] for row in achieved[:end]], dtype=np.float32),
            )
        )
    return Rollouts(piece, digest(piece.policy), tuple(found))


def digest(policy: str) -> str:
    """Tells a policy's file from another file of the same name."""
    if policy == DEMONSTRATOR:
        return ""
    return hashlib.sha256(pathlib.Path(policy).read_bytes()).hexdigest()[:16]


# --- files

_SERIES = ("tool", "sigma", "asked", "achieved")
_NUMBERS = ("seed", "reached", "success", "lost", "limits_broken")


def save_rollouts(done: Rollouts, file: pathlib.Path) -> pathlib.Path:
    """Writes an npz file: arrays of all rollouts one after the other, and their lengths. Returns the path."""
    arrays: dict[str, Any] = {name: np.array([getattr(r, name) for r in done.rollouts]) for name in _NUMBERS}
    arrays |= {name: np.concatenate([getattr(r, name) for r in done.rollouts]) for name in _SERIES}
    arrays["steps"] = np.array([r.steps for r in done.rollouts])
    arrays["meta"] = np.array(json.dumps({"piece": asdict(done.piece), "digest": done.digest}))
    return write_atomically(file, lambda stream: np.savez_compressed(stream, **arrays))


def load_rollouts(file: pathlib.Path) -> Rollouts:
    """Reads a file of `save_rollouts`. ValueError where the file is none."""
    try:
        with np.load(file) as data:
            arrays = {name: data[name] for name in data.files}
        meta = json.loads(str(arrays["meta"]))
        piece = Piece(**{**meta["piece"], "seeds": tuple(meta["piece"]["seeds"])})
        ends = np.cumsum(arrays["steps"])
        parts = {}
        for name in _SERIES:
            one_more = np.arange(1, len(ends)) if name in ("tool", "sigma") else 0
            parts[name] = np.split(arrays[name], ends[:-1] + one_more)
        found = [
            Rollout(*(arrays[name][k].item() for name in _NUMBERS), *(parts[name][k] for name in _SERIES))
            for k in range(len(ends))
        ]
    except (KeyError, TypeError, ValueError, EOFError) as error:
        raise ValueError(f"{file} is not a file of rollouts: {error}") from None
    return Rollouts(piece, str(meta["digest"]), tuple(found))
