"""Adding noise to chunks of actions, and taking noise away again. Needs torch.

DDPM (Ho et al. 2020), equations (57) and (58) of J-PARSE's paper: a network learns the noise that was added, by the
mean squared error; at inference the noise is taken away in few steps by DDIM (Song et al. 2021), which is (57)
without the random part.

The network gives v = √ᾱ ε − √(1−ᾱ) x (Salimans and Ho 2022), from which follow the noise ε and the clean chunk x. Where
a network gives ε itself, x = (noisy − √(1−ᾱ) ε)/√ᾱ divides its error by √ᾱ, which is nearly zero where the denoising
begins: chunks of a network that was trained for minutes then tremble.
"""

from __future__ import annotations

import math
from collections.abc import Callable

import torch
from torch import Tensor

__all__ = ["Diffusion", "Network"]

#: (noisy chunks (B, H, A), levels (B,), observations (B, D)) → v (B, H, A)
Network = Callable[[Tensor, Tensor, Tensor], Tensor]


class Diffusion:
    """The noise levels of a diffusion: the squared cosine schedule (Nichol and Dhariwal 2021)."""

    def __init__(self, levels: int = 100) -> None:
        """levels: number of noise levels in training."""
        self.levels = levels
        at = torch.arange(levels + 1, dtype=torch.float64) / levels
        kept = torch.cos((at + 0.008) / 1.008 * math.pi / 2.0) ** 2
        beta = torch.clamp(1.0 - kept[1:] / kept[:-1], max=0.999)
        #: (levels,) the part ᾱ of the chunk's variance that is left at each level.
        self.kept = torch.cumprod(1.0 - beta, dim=0).float()

    def losses(
        self, network: Network, chunks: Tensor, seen: Tensor, generator: torch.Generator
    ) -> tuple[Tensor, Tensor]:
        """The mean squared error of v, which is trained, and that of the noise (58), which is told.

        The error of the noise at a level is ᾱ times that of v: training by v gives all levels the same weight.
        """
        noise = torch.randn(chunks.shape, generator=generator)
        level = torch.randint(self.levels, (len(chunks),), generator=generator)
        kept = self.kept[level][:, None, None]
        noisy = kept.sqrt() * chunks + (1.0 - kept).sqrt() * noise
        wanted = kept.sqrt() * noise - (1.0 - kept).sqrt() * chunks
        error = (network(noisy, level, seen) - wanted) ** 2
        return error.mean(), (kept * error).mean().detach()

    @torch.no_grad()
    def sample(self, network: Network, noise: Tensor, seen: Tensor, steps: int, most: Tensor) -> Tensor:
        """Chunks (B, H, A) for observations (B, D), from noise (B, H, A), in `steps` steps of DDIM.

        most: the largest absolute value of each entry of a chunk (H, A): what is further out is brought back.
        """
        chunk = noise
        levels = torch.linspace(self.levels - 1, 0, steps).round().long()
        for k, level in enumerate(levels):
            kept = self.kept[level]
            v = network(chunk, level.repeat(len(chunk)), seen)
            clean = kept.sqrt() * chunk - (1.0 - kept).sqrt() * v
            clean = torch.maximum(torch.minimum(clean, most), -most)
            if k + 1 == len(levels):
                return clean
            found = (chunk - kept.sqrt() * clean) / (1.0 - kept).sqrt()
            after = self.kept[levels[k + 1]]
            chunk = after.sqrt() * clean + (1.0 - after).sqrt() * found
        return chunk
