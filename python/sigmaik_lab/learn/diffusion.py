"""Adding noise to chunks of actions, and taking noise away again. Needs torch.

DDPM (Ho et al. 2020), equations (57) and (58) of J-PARSE's paper: a network learns the noise that was added, by the mean
squared error; at inference the noise is taken away in few steps by DDIM (Song et al. 2021), which is (57) without the
random part.
"""

from __future__ import annotations

import math

import torch
from torch import Tensor, nn

__all__ = ["Diffusion"]


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

    def loss(self, network: nn.Module, chunks: Tensor, seen: Tensor, generator: torch.Generator) -> Tensor:
        """Mean squared error of the noise that the network finds (58), chunks (B, H, A) and observations (B, D)."""
        noise = torch.randn(chunks.shape, generator=generator)
        level = torch.randint(self.levels, (len(chunks),), generator=generator)
        kept = self.kept[level][:, None, None]
        noisy = kept.sqrt() * chunks + (1.0 - kept).sqrt() * noise
        return nn.functional.mse_loss(network(noisy, level, seen), noise)

    @torch.no_grad()
    def sample(self, network: nn.Module, noise: Tensor, seen: Tensor, steps: int, most: Tensor) -> Tensor:
        """Chunks (B, H, A) for observations (B, D), from noise (B, H, A), in `steps` steps of DDIM.

        most: the largest absolute value of each entry of a chunk (H, A): what is further out is brought back, as
        otherwise the first steps' errors are carried on.
        """
        chunk = noise
        levels = torch.linspace(self.levels - 1, 0, steps).round().long()
        for k, level in enumerate(levels):
            kept = self.kept[level]
            found = network(chunk, level.repeat(len(chunk)), seen)
            clean = (chunk - (1.0 - kept).sqrt() * found) / kept.sqrt()
            clean = torch.maximum(torch.minimum(clean, most), -most)
            if k + 1 == len(levels):
                return clean
            found = (chunk - kept.sqrt() * clean) / (1.0 - kept).sqrt()
            after = self.kept[levels[k + 1]]
            chunk = after.sqrt() * clean + (1.0 - after).sqrt() * found
        return chunk
