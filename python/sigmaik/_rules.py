"""The classes of the rules, as sigmaik::Rules lists them. Written by `make stubs`."""

from ._core import (
    AdaptiveDampedLeastSquares,
    DampedLeastSquares,
    JacobianProjection,
    JacobianSafety,
    JacobianSafetyProjection,
    JParse,
    PseudoInverse,
    SelectivelyDampedLeastSquares,
)

__all__ = [
    "AdaptiveDampedLeastSquares",
    "DampedLeastSquares",
    "JacobianProjection",
    "JacobianSafety",
    "JacobianSafetyProjection",
    "JParse",
    "PseudoInverse",
    "SelectivelyDampedLeastSquares",
]
