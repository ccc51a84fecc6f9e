"""The conditions as expressions in any algebra, from the description from which the compiled code is made.

`q` is a sequence of n numbers or symbols that add, subtract and multiply; `sin`, `cos` and `exp` take one symbol. With
`casadi`:

    q = casadi.SX.sym("q", 7)
    residuals = symbolic_residuals(sing, casadi.vertsplit(q), sin=casadi.sin, cos=casadi.cos)
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import Any

from sigmaik._core import SingularSets

__all__ = ["symbolic_manipulability_squared", "symbolic_potential", "symbolic_residuals"]

Function = Callable[[Any], Any]


def symbolic_residuals(
    sets: SingularSets, q: Sequence[Any], sin: Function = math.sin, cos: Function = math.cos
) -> list[list[Any]]:
    """Residuals r of every set, a list of `codimension` expressions each. On the set all its residuals are zero."""
    flat = _replay(sets._residual_tape(), q, sin, cos)
    out, at = [], 0
    for codimension in sets.codimensions:
        out.append(flat[at : at + codimension])
        at += codimension
    return out


def symbolic_potential(
    sets: SingularSets,
    q: Sequence[Any],
    eta1: float,
    eta2: float,
    sin: Function = math.sin,
    cos: Function = math.cos,
    exp: Function = math.exp,
) -> Any:
    """Σ_i exp(η₁ − η₂ ψ_i), ψ_i = Σ r²."""
    terms = (exp(eta1 - eta2 * _sum_of_squares(r)) for r in symbolic_residuals(sets, q, sin, cos))
    return _sum(terms)


def symbolic_manipulability_squared(
    sets: SingularSets, q: Sequence[Any], sin: Function = math.sin, cos: Function = math.cos
) -> Any:
    """m² = det(JJᵀ), a sum of squares."""
    return _sum_of_squares(_replay(sets._manipulability_tape(), q, sin, cos))


def _replay(tape: tuple[list[Any], list[int]], q: Sequence[Any], sin: Function, cos: Function) -> list[Any]:
    operations, results = tape
    x: list[Any] = []
    for kind, *operands in operations:
        if kind == "constant":
            x.append(operands[0])
        elif kind == "sin":
            x.append(sin(q[operands[0]]))
        elif kind == "cos":
            x.append(cos(q[operands[0]]))
        else:
            a, b = x[operands[0]], x[operands[1]]
            x.append(a + b if kind == "+" else a - b if kind == "-" else a * b)
    return [x[i] for i in results]


def _sum_of_squares(terms: Sequence[Any]) -> Any:
    return _sum(r * r for r in terms)


def _sum(terms: Any) -> Any:
    first, *rest = terms
    for term in rest:
        first = first + term
    return first
