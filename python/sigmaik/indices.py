"""How far from singular: indices of a Jacobian, and their gradients in the joints.

All indices come from the singular values σ_1 ≥ … ≥ σ_m of J (m, n), 1 ≤ m ≤ 6, 1 ≤ n ≤ 16. Where n < m the missing
singular values are zero, because the arm cannot do such a task completely. J may have a leading batch axis, (B, m, n);
the result is then (B,).

Lengths and angles mix in J. `length_scale` [m] is the length that weighs as much as one radian, as in VelocitySolver;
rows from the fourth on count as angular.

At an exact singularity (σ_m ≤ 1e-14 σ_1, where σ_m is rounding) the condition number and the geometry-aware index are
``inf``; they raise no error.
"""

from __future__ import annotations

from typing import Literal

from numpy.typing import ArrayLike

from . import _core
from ._core import Chain, reference_scale
from ._types import Array

__all__ = [
    "DEFAULT_SCALE",
    "Index",
    "condition_number",
    "evaluate",
    "geometry_aware",
    "gradient",
    "manipulability",
    "min_singular_value",
    "reference_scale",
]
Index = Literal["manipulability", "condition_number", "min_singular_value", "geometry_aware"]
"""Name of an index."""

DEFAULT_SCALE: float = _core.DEFAULT_SCALE
"""k where nothing is known of the arm: an upper bound of the largest eigenvalue of JJᵀ of a metre-sized arm."""


def manipulability(J: ArrayLike, length_scale: float = 1.0) -> float | Array:  # noqa: N803
    """√det(JJᵀ) = Π σ_i (Yoshikawa 1985); 0 at a singularity."""
    return _core.index_of_jacobian(J, "manipulability", length_scale=length_scale)


def condition_number(J: ArrayLike, length_scale: float = 1.0) -> float | Array:  # noqa: N803
    """σ_1/σ_m ≥ 1 (the dexterity index of Petrović et al., eq. 5); inf at a singularity."""
    return _core.index_of_jacobian(J, "condition_number", length_scale=length_scale)


def min_singular_value(J: ArrayLike, length_scale: float = 1.0) -> float | Array:  # noqa: N803
    """σ_m; 0 at a singularity."""
    return _core.index_of_jacobian(J, "min_singular_value", length_scale=length_scale)


def geometry_aware(
    J: ArrayLike,  # noqa: N803
    k: ArrayLike | None = None,
    length_scale: float = 1.0,
) -> float | Array:
    """ξ = ‖log(Σ^{-1/2} JJᵀ Σ^{-1/2})‖_F² (Petrović et al., eqs. 8 to 12): squared distance of the manipulability
    ellipsoid from the ellipsoid of Σ in the affine-invariant metric; inf at a singularity.

    k: a number, Σ = kI, so that ξ = Σ log²(σ_i²/k); or Σ (m, m) itself, symmetric positive definite. By default 6, as
    for an arm of a metre's reach; `reference_scale` finds the k of any chain.
    """
    k = DEFAULT_SCALE if k is None else k
    return _core.index_of_jacobian(J, "geometry_aware", k, length_scale)


def evaluate(
    chain: Chain,
    q: ArrayLike,
    index: Index,
    k: ArrayLike | None = None,
    length_scale: float = 1.0,
    threads: int = 1,
) -> float | Array:
    """An index of a chain's Jacobian at q (n,), or (B,) at q (B, n), without the GIL.

    k: as for `geometry_aware`; by default `reference_scale(chain)`. The answers do not depend on the order of the
    configurations or on `threads`.
    """
    value = _evaluate(chain, q, index, k, length_scale, threads, gradients=False)[0]
    return float(value) if value.ndim == 0 else value


def gradient(
    chain: Chain,
    q: ArrayLike,
    index: Index,
    k: ArrayLike | None = None,
    length_scale: float = 1.0,
    threads: int = 1,
) -> Array:
    """Gradient (n,) [per rad or m] of an index at q (n,), or (B, n) at q (B, n), in closed form.

    The gradient is always finite. Where the smallest singular value is zero or repeated, the gradient is one of several
    slopes, along the singular vectors that the decomposition chose. Where an index is inf, its gradient is zero,
    because no direction leads away from the singularity.
    """
    return _evaluate(chain, q, index, k, length_scale, threads, gradients=True)[1]


def _evaluate(
    chain: Chain, q: ArrayLike, index: Index, k: ArrayLike | None, length_scale: float, threads: int, gradients: bool
) -> tuple[Array, Array]:
    if k is None:
        k = reference_scale(chain, length_scale) if index == "geometry_aware" else DEFAULT_SCALE
    return _core.evaluate_index(chain, q, index, k, length_scale, threads, gradients)
