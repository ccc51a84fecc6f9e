"""The noise network: a 1-D temporal convolutional U-Net with feature-wise linear modulation. Needs torch.

After Chi et al., "Diffusion policy" (2023), which J-PARSE's paper takes over: convolutions along the time of a chunk of
actions, each block scaled and shifted by the observation and the noise level (FiLM, Perez et al. 2018).
"""

from __future__ import annotations

import math

import torch
from torch import Tensor, nn

__all__ = ["NoiseNet"]

_KERNEL, _GROUPS = 5, 8


class NoiseNet(nn.Module):
    """What `Diffusion` asks for, v (B, H, width), from noisy chunks, their levels (B,) and observations (B, seen).

    H must be a multiple of 2 to the power len(channels) − 1.
    """

    def __init__(self, width: int, seen: int, channels: tuple[int, ...] = (32, 64), hidden: int = 128) -> None:
        super().__init__()
        self._levels = hidden // 2
        self.level = nn.Sequential(nn.Linear(self._levels, hidden), nn.Mish(), nn.Linear(hidden, hidden))
        self.observation = nn.Sequential(
            nn.Linear(seen, 2 * hidden),
            nn.Mish(),
            nn.Linear(2 * hidden, 2 * hidden),
            nn.Mish(),
            nn.Linear(2 * hidden, hidden),
        )
        known = 2 * hidden
        widths = (width, *channels)
        self.down, self.narrow = nn.ModuleList(), nn.ModuleList()
        for before, after in zip(widths[:-1], widths[1:], strict=True):
            self.down.append(_Block(before, after, known))
            last = len(self.down) == len(channels)
            self.narrow.append(nn.Identity() if last else nn.Conv1d(after, after, 3, 2, 1))
        self.middle = _Block(channels[-1], channels[-1], known)
        self.widen, self.up = nn.ModuleList(), nn.ModuleList()
        for before, after in zip(reversed(channels[1:]), reversed(channels[:-1]), strict=True):
            self.widen.append(nn.ConvTranspose1d(before, before, 4, 2, 1))
            self.up.append(_Block(before + after, after, known))
        self.end = nn.Sequential(_convolution(channels[0], channels[0]), nn.Conv1d(channels[0], width, 1))

    def forward(self, chunks: Tensor, level: Tensor, seen: Tensor) -> Tensor:
        known = torch.cat([self.level(self._waves(level)), self.observation(seen)], dim=1)
        x = chunks.transpose(1, 2)
        skips = []
        for block, narrow in zip(self.down, self.narrow, strict=True):
            x = block(x, known)
            skips.append(x)
            x = narrow(x)
        x = self.middle(x, known)
        for widen, block, skip in zip(self.widen, self.up, reversed(skips[:-1]), strict=True):
            x = block(torch.cat([widen(x), skip], dim=1), known)
        out: Tensor = self.end(x).transpose(1, 2)
        return out

    def _waves(self, level: Tensor) -> Tensor:
        """Sines and cosines of a noise level, as of a position in transformers."""
        half = self._levels // 2
        rates = torch.exp(torch.arange(half, device=level.device) * (-math.log(10000.0) / (half - 1)))
        angle = level[:, None].float() * rates
        return torch.cat([angle.sin(), angle.cos()], dim=1)


class _Block(nn.Module):
    """Two convolutions along time with a residual way; the first is modulated by what is known."""

    def __init__(self, before: int, after: int, known: int) -> None:
        super().__init__()
        self.first, self.second = _convolution(before, after), _convolution(after, after)
        self.film = nn.Sequential(nn.Mish(), nn.Linear(known, 2 * after))
        self.past = nn.Conv1d(before, after, 1) if before != after else nn.Identity()

    def forward(self, x: Tensor, known: Tensor) -> Tensor:
        scale, shift = self.film(known)[:, :, None].chunk(2, dim=1)
        out: Tensor = self.second(self.first(x) * (1.0 + scale) + shift) + self.past(x)
        return out


def _convolution(before: int, after: int) -> nn.Sequential:
    return nn.Sequential(
        nn.Conv1d(before, after, _KERNEL, padding=_KERNEL // 2), nn.GroupNorm(_GROUPS, after), nn.Mish()
    )
