"""Where an arm is singular: known sets with potentials around them, and a search for any arm.

    sing = sk.singularities.load("kuka_lbr_iiwa_14_r820")
    sing.names                   # ('elbow', 'shoulder', 'shoulder-wrist', 'wrist')
    sing.residuals(q)            # (4,) ψ_i ≥ 0, zero exactly on set i
    sing.potential(q), sing.gradient(q), sing.hessian(q)
    sing.manipulability(q)       # √det(JJᵀ) in closed form

    sk.singularities.find(chain)  # any arm, numerically

The known sets are those of Beck et al. (2022) for the Comau Racer 7-1.4, the KUKA LBR iiwa 14 R820 and the Franka Emika
Panda, corrected where a printed condition does not hold, and with one set of the Panda that the paper does not have.
"""

from __future__ import annotations

from sigmaik import _core
from sigmaik._core import Chain, SingularSets

from .search import FoundSet, find
from .symbolic import symbolic_manipulability_squared, symbolic_potential, symbolic_residuals

__all__ = [
    "FoundSet",
    "SingularSets",
    "find",
    "load",
    "names",
    "of",
    "symbolic_manipulability_squared",
    "symbolic_potential",
    "symbolic_residuals",
]


def names() -> tuple[str, ...]:
    """Names of the shipped arms whose singular sets are known."""
    return _core.known_singular_sets()


def load(name: str) -> SingularSets:
    """The known singular sets of a shipped arm. For any other name ValueError, whose text lists the known names."""
    return _core.load_singular_sets(name)


def of(chain: Chain) -> SingularSets | None:
    """The known singular sets of a chain that has the kinematics of one of these arms, whatever its base, tool and
    names.

    None for any other chain. The function compares the axes, so a chain whose inner joints have other zeros counts as
    another arm.
    """
    return _core.singular_sets_of(chain)
