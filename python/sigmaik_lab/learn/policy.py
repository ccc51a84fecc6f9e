"""A diffusion policy: network, noise levels and normalisation in one file. Needs torch."""

from __future__ import annotations

import copy
import dataclasses
import pathlib
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray

import sigmaik as sk
from sigmaik.files import write_atomically

from .diffusion import Diffusion
from .network import NoiseNet
from .windows import FEATURES, WIDTH, absolute_chunks, features

__all__ = ["Policy", "Scale", "Shape", "load_file", "load_policy", "save_file"]

Floats = NDArray[np.float32]

#: Written into files, and raised when they mean something else.
_FILE = "sigmaik policy 1"
#: The least standard deviation by which an entry is divided: entries that hardly vary are not blown up.
_LEAST = 1e-3


@dataclass(frozen=True)
class Shape:
    """What fixes a policy's network and noise levels."""

    horizon: int = 8  #: actions of a chunk
    channels: tuple[int, ...] = (32, 64)  #: of the U-Net's levels
    hidden: int = 128
    levels: int = 100  #: of noise


@dataclass(frozen=True)
class Scale:
    """Mean and standard deviation of the entries of features (D,) and chunks (H, WIDTH), and a chunk's bounds."""

    seen_mean: Floats
    seen_std: Floats
    said_mean: Floats
    said_std: Floats
    most: Floats  #: (H, WIDTH) largest absolute values, in standard deviations

    @staticmethod
    def of(seen: Floats, said: Floats) -> Scale:
        """From features (N, D) and chunks (N, H, WIDTH)."""
        seen_std, said_std = np.maximum(seen.std(axis=0), _LEAST), np.maximum(said.std(axis=0), _LEAST)
        said_mean = said.mean(axis=0)
        most = np.abs((said - said_mean) / said_std).max(axis=0) + 0.05
        return Scale(seen.mean(axis=0), seen_std, said_mean, said_std, most)


@dataclass
class Policy:
    """Chunks of pose actions for observations."""

    robot: str
    shape: Shape
    scale: Scale
    network: NoiseNet
    facts: dict[str, Any] = field(default_factory=dict)  #: how the policy was trained: seed, steps, loss

    @staticmethod
    def make(robot: str, shape: Shape, scale: Scale, seed: int) -> Policy:
        """A policy that is not trained, its weights drawn by the seed."""
        with torch.random.fork_rng(devices=[]):
            torch.manual_seed(seed)
            network = NoiseNet(WIDTH, FEATURES, shape.channels, shape.hidden)
        return Policy(robot, shape, scale, network)

    def chunks(self, states: Floats, noise: Floats, steps: int = 10) -> Floats:
        """(B, H, WIDTH) pose actions in the base, the first one for the observations, states (B, S).

        noise: (B, H, WIDTH) of a normal distribution, which alone decides among the ways that demonstrations show; a
        smaller standard deviation gives ways nearer to the most likely one. steps: of DDIM. The gripper's command is
        the nearer one of 0 and 1, as demonstrations have no others.
        """
        scaled = torch.from_numpy((features(states) - self.scale.seen_mean) / self.scale.seen_std)
        self.network.eval()
        diffusion = Diffusion(self.shape.levels)
        most = torch.from_numpy(self.scale.most)
        found = diffusion.sample(self.network, torch.from_numpy(noise), scaled, steps, most).numpy()
        chunks = absolute_chunks(states, found * self.scale.said_std + self.scale.said_mean)
        chunks[..., -1] = chunks[..., -1] > 0.5
        return chunks

    def with_network(self, network: NoiseNet) -> Policy:
        return dataclasses.replace(self, network=copy.deepcopy(network))

    def state(self) -> dict[str, Any]:
        """What `Policy.of` makes the policy of: texts, numbers and tensors."""
        return {
            "file": _FILE,
            "robot": self.robot,
            "shape": dataclasses.asdict(self.shape),
            "scale": {name: torch.from_numpy(value) for name, value in vars(self.scale).items()},
            "network": self.network.state_dict(),
            "facts": dict(self.facts),
        }

    @staticmethod
    def of(state: dict[str, Any]) -> Policy:
        shape = Shape(**{**state["shape"], "channels": tuple(state["shape"]["channels"])})
        scale = Scale(**{name: value.numpy() for name, value in state["scale"].items()})
        policy = Policy.make(state["robot"], shape, scale, 0)
        policy.network.load_state_dict(state["network"])
        policy.facts = dict(state["facts"])
        return policy

    def save(self, file: str | pathlib.Path) -> pathlib.Path:
        """Writes the policy, whole or not at all. Returns the path."""
        return save_file(self.state(), file)


def save_file(state: dict[str, Any], file: str | pathlib.Path) -> pathlib.Path:
    """Writes texts, numbers and tensors, whole or not at all. Returns the path."""
    return write_atomically(pathlib.Path(file), lambda stream: torch.save(state, stream))


def load_policy(file: str | pathlib.Path) -> Policy:
    """Reads the file of a policy; nothing in the file is run. Error where the file is none."""
    return Policy.of(load_file(file, _FILE))


def load_file(file: str | pathlib.Path, kind: str) -> dict[str, Any]:
    """The content of a file of `save_file`. Error where the file is none, or of another kind."""
    try:
        state = torch.load(file, map_location="cpu", weights_only=True)
        found = state["file"]
    except OSError:
        raise
    except Exception as error:  # a file that is none makes torch raise nearly anything
        raise sk.Error(f"{file} is not a file of a policy: {type(error).__name__}") from None
    if found != kind:
        raise sk.Error(f"{file} is '{found}', not '{kind}'")
    return dict(state)
