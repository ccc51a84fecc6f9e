"""Trains a policy on episodes. Needs torch.

A run that was interrupted ends with the same weights, to the bit, on the same number of threads.

The learning rate rises over the first steps and falls as a cosine to zero at the last; a mean of the weights of all
steps (EMA) is the policy, and not the last step's weights (both as in Chi et al. 2023).
"""

from __future__ import annotations

import copy
import hashlib
import math
import pathlib
import time
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass
from typing import Any

import torch
from torch import Tensor

import sigmaik as sk

from .diffusion import Diffusion
from .episode import Episode
from .network import NoiseNet
from .policy import Policy, Scale, Shape, load_file, save_file
from .windows import WIDTH, windows

__all__ = ["Losses", "Trainer", "Training"]

_FILE = "sigmaik training 1"
#: Steps of rising learning rate, the power by which the mean's memory grows, and its bound.
_WARM, _POWER, _MEMORY = 200, 0.75, 0.9995
#: Episodes that the network is not trained on, of which the second loss is told.
_HELD_OUT = 20


@dataclass(frozen=True)
class Training:
    """How a policy is trained."""

    steps: int = 2500
    batch: int = 256
    rate: float = 1e-3  #: largest learning rate
    decay: float = 1e-4  #: of weights
    seed: int = 0  #: of the weights, the batches and the noise


@dataclass(frozen=True)
class Losses:
    """The noise loss (58) since the last report, and of the mean weights on episodes that are held out."""

    step: int
    train: float
    held_out: float
    seconds: float  #: of all training so far


class Trainer:
    """Trains step by step. `policy` is the policy of the mean weights so far."""

    def __init__(
        self, robot: str, episodes: Sequence[Episode], training: Training | None = None, shape: Shape | None = None
    ) -> None:
        """Error where there are no episodes, or their actions are no poses."""
        if not episodes:
            raise sk.Error("training needs an episode")
        if episodes[0].action.shape[1] != WIDTH:
            raise sk.Error(f"a policy learns pose actions of {WIDTH} numbers, not {episodes[0].action.shape[1]}")
        self.training, self.shape = training or Training(), shape or Shape()
        # One episode in twenty, spread over all, is held out; of few episodes none is.
        held = [e for k, e in enumerate(episodes) if k % _HELD_OUT == _HELD_OUT - 1]
        kept = [e for k, e in enumerate(episodes) if k % _HELD_OUT != _HELD_OUT - 1]
        seen, said = windows(kept, self.shape.horizon)
        self.scale = Scale.of(seen, said)
        self._seen, self._said = self._scaled(kept)
        self._held = self._scaled(held) if held else None
        self.policy = Policy.make(robot, self.shape, self.scale, self.training.seed)
        self.network: NoiseNet = copy.deepcopy(self.policy.network)
        self.diffusion = Diffusion(self.shape.levels)
        self.optimizer = torch.optim.AdamW(
            self.network.parameters(), lr=self.training.rate, weight_decay=self.training.decay
        )
        self.generator = torch.Generator().manual_seed(self.training.seed)
        self.step, self.seconds, self.losses = 0, 0.0, list[Losses]()
        self._sum, self._count = 0.0, 0
        self._frames = len(self._seen)

    def run(
        self,
        file: pathlib.Path | None = None,
        every: int = 200,
        report: Callable[[Losses], None] | None = None,
        until: int | None = None,
    ) -> Policy:
        """Trains to the last step, or to step `until`. Every `every` steps: a line of losses, and a checkpoint.

        file: of the checkpoints; where the file is there, training goes on from it. Error where it is of another run.
        """
        if file is not None and file.exists():
            self._restore(load_file(file, _FILE))
        end = min(self.training.steps, until or self.training.steps)
        started = time.monotonic()
        while self.step < end:
            self._advance()
            if self.step % every == 0 or self.step == self.training.steps:
                self.seconds, started = self.seconds + time.monotonic() - started, time.monotonic()
                self._tell(report)
                if file is not None:
                    save_file(self._state(), file)
        return self.policy

    def _advance(self) -> None:
        self.network.train()
        rows = torch.randint(self._frames, (self.training.batch,), generator=self.generator)
        loss, noise_loss = self.diffusion.losses(self.network, self._said[rows], self._seen[rows], self.generator)
        for group in self.optimizer.param_groups:
            group["lr"] = self.training.rate * self._part(self.step)
        self.optimizer.zero_grad()
        loss.backward()  # type: ignore[no-untyped-call]
        torch.nn.utils.clip_grad_norm_(self.network.parameters(), 1.0)
        self.optimizer.step()
        self.step += 1
        memory = min(_MEMORY, 1.0 - (1.0 + self.step) ** -_POWER)
        with torch.no_grad():
            for mean, new in zip(self.policy.network.parameters(), self.network.parameters(), strict=True):
                mean.lerp_(new, 1.0 - memory)
        self._sum, self._count = self._sum + float(noise_loss), self._count + 1

    def _part(self, step: int) -> float:
        """Of the largest learning rate."""
        warm = min(1.0, (step + 1) / min(_WARM, max(1, self.training.steps // 4)))
        return warm * 0.5 * (1.0 + math.cos(math.pi * step / self.training.steps))

    def _tell(self, report: Callable[[Losses], None] | None) -> None:
        told = Losses(self.step, self._sum / max(1, self._count), self._held_out(), self.seconds)
        self.losses.append(told)
        self._sum, self._count = 0.0, 0
        self.policy.facts = {
            **asdict(self.training),
            "steps": self.step,
            "frames": self._frames,
            "train_loss": told.train,
            "held_out_loss": told.held_out,
            "seconds": told.seconds,
        }
        if report is not None:
            report(told)

    def _held_out(self) -> float:
        if self._held is None:
            return math.nan
        seen, said = self._held
        self.policy.network.eval()
        with torch.no_grad():
            # The same noise each time, so that the losses of two steps can be compared.
            _, loss = self.diffusion.losses(self.policy.network, said, seen, torch.Generator().manual_seed(1))
        return float(loss)

    def _scaled(self, episodes: Sequence[Episode]) -> tuple[Tensor, Tensor]:
        seen, said = windows(episodes, self.shape.horizon)
        scale = self.scale
        return (
            torch.from_numpy((seen - scale.seen_mean) / scale.seen_std),
            torch.from_numpy((said - scale.said_mean) / scale.said_std),
        )

    # --- checkpoints

    def _facts(self) -> dict[str, Any]:
        shape = {**asdict(self.shape), "channels": list(self.shape.channels)}
        return {"training": asdict(self.training), "shape": shape, "robot": self.policy.robot, "data": self._digest()}

    def _digest(self) -> str:
        """Tells other data from the data of a checkpoint."""
        content = hashlib.sha256(self._seen.numpy().tobytes())
        content.update(self._said.numpy().tobytes())
        return content.hexdigest()

    def _state(self) -> dict[str, Any]:
        return {
            "file": _FILE,
            "facts": self._facts(),
            "policy": self.policy.state(),
            "network": self.network.state_dict(),
            "optimizer": self.optimizer.state_dict(),
            "generator": self.generator.get_state(),
            "step": self.step,
            "seconds": self.seconds,
            "losses": [asdict(line) for line in self.losses],
        }

    def _restore(self, state: dict[str, Any]) -> None:
        mine = self._facts()
        for name, value in mine.items():
            if state["facts"].get(name) != value:
                raise sk.Error(
                    f"the checkpoint is of another {name} ({state['facts'].get(name)}, not {value})"
                    "; --fresh trains anew"
                )
        self.policy = Policy.of(state["policy"])
        self.network.load_state_dict(state["network"])
        self.optimizer.load_state_dict(state["optimizer"])
        self.generator.set_state(state["generator"])
        self.step, self.seconds = int(state["step"]), float(state["seconds"])
        self.losses = [Losses(**line) for line in state["losses"]]
