"""Sums of costs, put together before the arm is known."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np

from sigmaik import _core
from sigmaik._core import Chain, Error, JointCost
from sigmaik._types import Array

from ..batch_cost import BatchCost

__all__ = ["Cost", "Term", "cost_of"]


class Bindable(Protocol):
    """A part of a cost."""

    def bind(self, chain: Chain, factor: float) -> JointCost | BatchCost:
        """`factor` times this cost, of one arm's joints."""
        ...


class Cost:
    """A weighted sum of costs.

        cost = costs.Potential() + 2.0 * costs.Collision(obstacles) + MyCost()

    Costs add up, and take factors that are not below 0. A summand may be a cost of this package, a `JointCost`, or any
    object with ``value(q: (B, n)) -> (B,)`` (`BatchCost`); ``Cost.of(MyCost())`` makes a Cost of one summand alone.
    """

    __slots__ = ("parts",)

    def __init__(self, parts: tuple[tuple[float, Bindable], ...] = ()) -> None:
        self.parts = parts

    @staticmethod
    def of(cost: Any) -> Cost:
        """Returns a Cost unchanged, and makes a Cost of any other summand. Error where the object is no cost."""
        return cost_of(cost)

    def bind(self, chain: Chain) -> tuple[JointCost | None, tuple[BatchCost, ...]]:
        """For one arm: the sum of the parts that have a Hessian (None where no part has one), and the other parts."""
        bound = [part.bind(chain, factor) for factor, part in self.parts]
        smooth = [cost for cost in bound if isinstance(cost, JointCost)]
        others = tuple(cost for cost in bound if not isinstance(cost, JointCost))
        return _core.sum_of_costs(smooth) if smooth else None, others

    def __add__(self, other: Any) -> Cost:
        return Cost(self.parts + cost_of(other).parts)

    def __radd__(self, other: Any) -> Cost:
        return Cost(cost_of(other).parts + self.parts)

    def __mul__(self, factor: float) -> Cost:
        if not (math.isfinite(factor) and factor >= 0.0):
            raise Error(f"a cost times {factor}: the factor must be finite and not below 0")
        return Cost(tuple((factor * own, part) for own, part in self.parts))

    __rmul__ = __mul__

    def __repr__(self) -> str:
        return " + ".join(repr(part) if factor == 1.0 else f"{factor:g} * {part!r}" for factor, part in self.parts) or (
            "Cost()"
        )


class Term(Cost):
    """Base of the costs of this package: a frozen dataclass with its parameters, and `bind_term`."""

    __slots__ = ()

    @property
    def parts(self) -> tuple[tuple[float, Bindable], ...]:  # type: ignore[override]
        return ((1.0, _OfTerm(self)),)

    def __getstate__(self) -> dict[str, Any]:
        return self.__dict__  # the parameters; `parts`, a slot of Cost, is made of them

    def bind_term(self, chain: Chain) -> JointCost | BatchCost:
        """This cost of one arm's joints. Error where a parameter is out of its range."""
        raise NotImplementedError


@dataclass(frozen=True)
class _OfTerm:
    term: Term

    def bind(self, chain: Chain, factor: float) -> JointCost | BatchCost:
        return _times(factor, self.term.bind_term(chain))

    def __repr__(self) -> str:
        return repr(self.term)


@dataclass(frozen=True)
class _Given:
    cost: JointCost | BatchCost

    def bind(self, chain: Chain, factor: float) -> JointCost | BatchCost:
        return _times(factor, self.cost)

    def __repr__(self) -> str:
        return repr(self.cost)


def cost_of(cost: Any) -> Cost:
    """See `Cost.of`."""
    if isinstance(cost, Cost):
        return cost
    if not isinstance(cost, JointCost) and getattr(cost, "value", None) is None:
        raise Error(f"a cost of type '{type(cost).__name__}' has no method value(q)")
    return Cost(((1.0, _Given(cost)),))


def _times(factor: float, cost: JointCost | BatchCost) -> JointCost | BatchCost:
    if factor == 1.0:
        return cost
    if isinstance(cost, JointCost):
        return _core.scaled_cost(factor, cost)
    return _ScaledWithGradient(factor, cost) if hasattr(cost, "gradient") else _Scaled(factor, cost)


class _Scaled:
    def __init__(self, factor: float, cost: Any) -> None:
        self._factor, self._cost = factor, cost

    def value(self, q: Array) -> Array:
        values: Array = np.multiply(self._factor, self._cost.value(q))
        return values


class _ScaledWithGradient(_Scaled):
    def gradient(self, q: Array) -> Array:
        gradients: Array = np.multiply(self._factor, self._cost.gradient(q))
        return gradients
