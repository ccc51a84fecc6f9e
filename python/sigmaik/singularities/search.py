"""Singular sets of any arm, found numerically.

An arm is singular at q where the tip cannot move along some unit twist u: J(q)ᵀu = 0. In (q, u) these equations are a
smooth system with many more unknowns than equations. From a random start, Newton's method in its least-norm form,
damped far from a solution, converges quadratically to a nearby solution. At a solution, with N a basis of the null
space of J, the tangent space of the set is given by Nᵀ ∂(Jᵀu)/∂q δq = 0: the rank of the matrix Nᵀ ∂(Jᵀu)/∂q is the
codimension of the set, and the joints whose columns are not zero are the joints in the set's condition.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np

from sigmaik._core import Chain
from sigmaik._types import Array

__all__ = ["FoundSet", "find", "singular_configurations"]

SINGULAR = 1e-10
"""σ_min/σ_max below which a configuration is singular."""
ZERO = 1e-5
"""Values below this part of the largest value count as zero in the classification."""


@dataclass(frozen=True)
class FoundSet:
    """A set of singular configurations that involves the same joints in the same way."""

    codimension: int
    """Number of conditions that hold on the set. A set of codimension 1 is a wall; paths can go round other sets."""
    joints: tuple[int, ...]
    """Indices of the joints in these conditions; the conditions do not depend on the other joints."""
    values: dict[int, tuple[float, ...]]
    """Joint positions [rad or m] that are the same all over the set, up to five each; other joints are left out."""
    count: int
    """Number of the found configurations that lie on the set."""
    configurations: Array = field(repr=False)
    """(count, n)"""


def find(chain: Chain, starts: int = 2000, seed: int = 0) -> list[FoundSet]:
    """Singular sets of a chain within its joint ranges, the most often found first.

    The search starts from `starts` random configurations in these ranges (within ±π where a joint has no limits). Sets
    of a high codimension, or in a corner of the ranges, are found seldom and may be missed; many starts are evidence of
    completeness, and no proof. Two sets with the same codimension and joints count as one set. Where two sets meet,
    more than one twist is lost; the search leaves such configurations out. ValueError for a chain of fewer than six
    joints, which is singular everywhere.
    """
    q = singular_configurations(chain, starts, seed)
    groups: dict[tuple[int, tuple[int, ...]], list[Array]] = {}
    for at, key in zip(q, _classify(chain, q), strict=True):
        if key is not None:
            groups.setdefault(key, []).append(at)
    found = [
        FoundSet(codimension, joints, _values(chain, joints, np.array(points)), len(points), np.array(points))
        for (codimension, joints), points in groups.items()
    ]
    return sorted(found, key=lambda s: (-s.count, s.joints))


def singular_configurations(chain: Chain, starts: int = 2000, seed: int = 0) -> Array:
    """Singular configurations (M, n) within the joint ranges, M ≤ starts, each from a random start of its own."""
    n = chain.dof
    if n < 6:
        raise ValueError(f"a chain of {n} joints is singular everywhere: six are needed for any twist")
    if starts < 1:
        raise ValueError(f"starts = {starts} must be at least 1")
    lower = np.where(np.isfinite(chain.limits.lower), chain.limits.lower, -math.pi)
    upper = np.where(np.isfinite(chain.limits.upper), chain.limits.upper, math.pi)
    q = np.random.default_rng(seed).uniform(lower, upper, (starts, n))
    u, _, _ = np.linalg.svd(chain.jacobian(q))
    u = u[:, :, -1]
    damping = np.full(starts, 1e-2)
    residual = _lost(chain.jacobian(q), u)
    for _ in range(100):
        jacobian = chain.jacobian(q)
        # Unknowns (δq, δu): ∂(Jᵀu)/∂q δq + Jᵀ δu = −Jᵀu,  uᵀδu = 0.
        system = np.zeros((starts, n + 1, n + 6))
        system[:, :n, :n] = np.einsum("bkij,bi->bjk", chain.jacobian_gradient(q), u)
        system[:, :n, n:] = jacobian.transpose(0, 2, 1)
        system[:, n, n:] = u
        right = np.zeros((starts, n + 1))
        right[:, :n] = -residual
        gram = system @ system.transpose(0, 2, 1)
        gram += damping[:, None, None] * np.eye(n + 1)
        step = (system.transpose(0, 2, 1) @ np.linalg.solve(gram, right[:, :, None]))[:, :, 0]
        step *= np.minimum(1.0, 1.0 / np.maximum(np.linalg.norm(step, axis=1, keepdims=True), 1e-300))
        q_new = np.clip(q + step[:, :n], lower, upper)
        u_new = u + step[:, n:]
        u_new /= np.linalg.norm(u_new, axis=1, keepdims=True)
        new = _lost(chain.jacobian(q_new), u_new)
        better = np.linalg.norm(new, axis=1) < np.linalg.norm(residual, axis=1)
        q = np.where(better[:, None], q_new, q)
        u = np.where(better[:, None], u_new, u)
        residual = np.where(better[:, None], new, residual)
        damping = np.clip(np.where(better, 0.1 * damping, 10.0 * damping), 1e-12, 1e6)
    sigma = np.linalg.svd(chain.jacobian(q), compute_uv=False)
    return q[sigma[:, -1] < SINGULAR * sigma[:, 0]]


def _lost(jacobian: Array, u: Array) -> Array:
    """Jᵀu (B, n)."""
    lost: Array = np.einsum("bij,bi->bj", jacobian, u)
    return lost


def _classify(chain: Chain, q: Array) -> list[tuple[int, tuple[int, ...]] | None]:
    """Codimension and joints at singular configurations (M, n); None where more than one twist is lost."""
    keys: list[tuple[int, tuple[int, ...]] | None] = []
    jacobians, slopes = chain.jacobian(q), chain.jacobian_gradient(q)
    for jacobian, slope in zip(jacobians, slopes, strict=True):
        u, sigma, v = np.linalg.svd(jacobian)
        if sigma[4] < ZERO * sigma[0]:
            keys.append(None)
            continue
        normal = v[5:] @ np.einsum("kij,i->jk", slope, u[:, 5])  # Nᵀ ∂(Jᵀu)/∂q
        _, size, rows = np.linalg.svd(normal)
        rank = int(np.sum(size > 1e-3 * size[0])) if size[0] > ZERO else 0
        if rank == 0 or (rank < len(size) and size[rank] > ZERO * size[0]):
            keys.append(None)  # near a point where two sets meet
            continue
        joints = np.flatnonzero(np.abs(rows[:rank]).max(axis=0) > ZERO)
        keys.append((rank, tuple(int(j) for j in joints)))
    return keys


def _values(chain: Chain, joints: tuple[int, ...], q: Array) -> dict[int, tuple[float, ...]]:
    values = {}
    for j in joints:
        distinct = np.unique(np.round(q[:, j], 4))
        kept = distinct[np.concatenate([[True], np.diff(distinct) > 2e-4])]
        if len(kept) <= 5 and len(q) > len(kept):
            near = (np.abs(q[:, j] - value) < 1e-3 for value in kept)
            values[j] = tuple(float(np.median(q[mask, j])) for mask in near)
    return values
