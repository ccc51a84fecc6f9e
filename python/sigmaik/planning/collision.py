"""The distance of an arm from obstacles, and the cost of small distances."""

from __future__ import annotations

import os

from numpy.typing import ArrayLike

from sigmaik import _core
from sigmaik._core import ArmSpheres, Chain, DistanceField, JointCost
from sigmaik._types import Array

from .obstacles import Obstacles

__all__ = ["arm_spheres", "collision_cost", "min_distance"]


def arm_spheres(chain: Chain, source: str | os.PathLike[str] | None = None, radius: float = 0.05) -> ArmSpheres:
    """An arm as spheres fixed to its links.

    source
        The URDF that the chain was read from, as a path or as XML, e.g. ``sk.robots.path(name)``. Spheres cover the
        boxes, cylinders and spheres of its ``<collision>`` elements completely, or of a link's ``<visual>`` elements
        where the link has no ``<collision>``: a cylinder by spheres at most 12 % wider than the cylinder. Links that
        fixed joints carry beside the arm are part of the arm. None: capsules from each link's frame to the next.
    radius
        [m] > 0 of these capsules, and of those of links that have meshes.

    Error where the source is not this arm's, or gives no link a shape; `ArmSpheres` itself takes any spheres.
    """
    if source is None:
        return ArmSpheres.along_links(chain, radius)
    return ArmSpheres.from_urdf(chain, source, radius)


def collision_cost(
    spheres: ArmSpheres, obstacles: Obstacles | DistanceField, clearance: float = 0.05, weight: float = 1.0
) -> JointCost:
    """weight · Σ c(d) over the spheres that move, d the signed distance of their surfaces to the obstacles.

    With ε the `clearance` [m] > 0, as CHOMP has it (Ratliff et al. 2009; Zucker et al. 2013):

        c(d) = 0   d ≥ ε,        (ε − d)²/(2ε)   0 ≤ d < ε,        ε/2 − d   d < 0

    The Hessian is positive semidefinite, Gauss-Newton's where there is no contact.
    """
    return _core.collision_cost(spheres, _field(obstacles), clearance, weight)


def min_distance(
    spheres: ArmSpheres, obstacles: Obstacles | DistanceField, q: ArrayLike, threads: int = 1
) -> float | Array:
    """The least signed distance [m] from a sphere that moves to the obstacles at q (n,), or (B,) at q (B, n).

    Below 0 there is contact. The base's spheres do not count, because no joint moves them.
    """
    return _core.min_distance(spheres, _field(obstacles), q, threads)


def _field(obstacles: Obstacles | DistanceField) -> DistanceField:
    return obstacles.field if isinstance(obstacles, Obstacles) else obstacles
