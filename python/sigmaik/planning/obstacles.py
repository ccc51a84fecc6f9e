"""Obstacles as a signed distance field: boxes, spheres, cylinders, or cells of an occupancy grid."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass
from typing import TypeAlias

import numpy as np
from numpy.typing import ArrayLike

from sigmaik._core import DistanceField, Error
from sigmaik._extras import need
from sigmaik._types import Array

__all__ = ["Box", "Cylinder", "Obstacles", "Shape", "Sphere"]

MOST_NODES = 20_000_000
"""Largest number of nodes of a grid: 80 MB."""


@dataclass(frozen=True, eq=False)
class Box:
    """A box, by its sides."""

    size: ArrayLike
    """(3,) [m] > 0 along its own axes."""
    pose: ArrayLike
    """Centre (3,) [m], or pose (4, 4), in the base's axes."""

    def __post_init__(self) -> None:
        _store(self, size=_numbers("size", self.size, (3,)), pose=_pose(self.pose))
        if not np.all(np.asarray(self.size) > 0.0):
            raise Error(f"a box of size {self.size!r}: its sides must be above 0")

    def distance(self, points: ArrayLike) -> Array:
        """Signed distance (…) [m] of points (…, 3), exact."""
        beside = np.abs(_local(self.pose, points)) - 0.5 * np.asarray(self.size)
        return _outside_and_in(beside)

    @property
    def bounds(self) -> Array:
        """Lowest and highest corner (2, 3) [m] of the axis-parallel box around it."""
        pose = np.asarray(self.pose)
        reach = np.abs(pose[:3, :3]) @ (0.5 * np.asarray(self.size))
        return np.array([pose[:3, 3] - reach, pose[:3, 3] + reach])


@dataclass(frozen=True, eq=False)
class Sphere:
    """A sphere."""

    radius: float
    """[m] > 0"""
    center: ArrayLike
    """(3,) [m] in the base's axes."""

    def __post_init__(self) -> None:
        _store(self, radius=_length("a sphere's radius", self.radius), center=_numbers("center", self.center, (3,)))

    def distance(self, points: ArrayLike) -> Array:
        """Signed distance (…) [m] of points (…, 3), exact."""
        away: Array = np.linalg.norm(_points(points) - np.asarray(self.center), axis=-1) - self.radius
        return away

    @property
    def bounds(self) -> Array:
        """Lowest and highest corner (2, 3) [m] of the axis-parallel box around it."""
        center = np.asarray(self.center)
        return np.array([center - self.radius, center + self.radius])


@dataclass(frozen=True, eq=False)
class Cylinder:
    """A cylinder along its own z, with flat ends."""

    radius: float
    """[m] > 0"""
    length: float
    """[m] > 0"""
    pose: ArrayLike
    """Centre (3,) [m], or pose (4, 4), in the base's axes."""

    def __post_init__(self) -> None:
        radius, length = _length("a cylinder's radius", self.radius), _length("a cylinder's length", self.length)
        _store(self, radius=radius, length=length, pose=_pose(self.pose))

    def distance(self, points: ArrayLike) -> Array:
        """Signed distance (…) [m] of points (…, 3), exact."""
        local = _local(self.pose, points)
        around = np.hypot(local[..., 0], local[..., 1]) - self.radius
        along = np.abs(local[..., 2]) - 0.5 * self.length
        return _outside_and_in(np.stack([around, along], axis=-1))

    @property
    def bounds(self) -> Array:
        """Lowest and highest corner (2, 3) [m] of the axis-parallel box around it."""
        pose = np.asarray(self.pose)
        axis = pose[:3, 2]
        # A disc of normal a reaches r √(1 − a_i²) along axis i.
        reach = 0.5 * self.length * np.abs(axis) + self.radius * np.sqrt(np.maximum(0.0, 1.0 - axis**2))
        return np.array([pose[:3, 3] - reach, pose[:3, 3] + reach])


Shape: TypeAlias = Box | Sphere | Cylinder


class Obstacles:
    """Obstacles of a motion, in the axes of the arm's base, as signed distances on a grid.

        table = sk.planning.Box(size=(0.8, 1.2, 0.04), pose=(0.6, 0.0, 0.4))
        ball = sk.planning.Sphere(radius=0.1, center=(0.3, 0.4, 0.7))
        obstacles = sk.planning.Obstacles([table, ball])
        obstacles.distance(points), obstacles.gradient(points)     # (M,), (M, 3) at points (M, 3)

    A node's distance is exact outside all shapes; where shapes overlap, the depth is the depth in the deepest shape.
    Between the nodes the distance is interpolated, with an error of at most √3/2 `resolution`; outside the grid the
    value is a lower bound of the distance to everything inside the grid (see `DistanceField`).
    """

    field: DistanceField
    """The distances, for the costs of collisions."""
    shapes: tuple[Shape, ...]
    """Empty where the field comes from an occupancy grid."""

    def __init__(
        self,
        shapes: Iterable[Shape],
        *,
        bounds: ArrayLike | None = None,
        margin: float = 0.3,
        resolution: float = 0.02,
    ) -> None:
        """
        Parameters
        ----------
        bounds
            (2, 3) [m]: lowest and highest corner of the grid. By default the box around all shapes and `margin` [m].
            Give bounds where shapes are larger than the space that the arm can reach, e.g. a floor; the space beyond
            the bounds counts as free, even inside a shape.
        margin
            [m] ≥ 0. Beyond the margin distances are lower bounds, so the margin should be more than a cost's clearance
            and the radius of the arm's thickest sphere together.
        resolution
            [m] > 0 from node to node.

        Raises
        ------
        Error
            where there is no shape, bounds are in the wrong order, or the grid would have more than 20 million nodes.
        """
        self.shapes = tuple(shapes)
        for shape in self.shapes:
            if not isinstance(shape, Box | Sphere | Cylinder):
                raise Error(f"{shape!r} is not a Box, Sphere or Cylinder")
        if not self.shapes:
            raise Error("there is no shape; without obstacles no Obstacles are needed")
        resolution = _length("resolution", resolution)
        if bounds is None:
            if not (math.isfinite(margin) and margin >= 0.0):
                raise Error(f"margin = {margin} m must be finite and not negative")
            corners = np.array([shape.bounds for shape in self.shapes])
            low, high = corners[:, 0].min(axis=0) - margin, corners[:, 1].max(axis=0) + margin
        else:
            low, high = _numbers("bounds", bounds, (2, 3))
            if not np.all(low < high):
                raise Error(f"bounds from {low} to {high}: the second corner must be above the first along every axis")
        cells = np.maximum(np.ceil((high - low) / resolution - 1e-9), 1.0)
        count = float(np.prod(cells + 1.0))
        if count > MOST_NODES:
            raise Error(
                f"a grid from {low} to {high} in steps of {resolution} m has {count:.3g} nodes, at most {MOST_NODES} "
                "are supported; give bounds, or a coarser resolution"
            )
        axes = [start + resolution * np.arange(int(n) + 1) for start, n in zip(low, cells, strict=True)]
        distances = np.empty([len(axis) for axis in axes])
        face = np.empty([len(axes[1]), len(axes[2]), 3])
        face[..., 1], face[..., 2] = axes[1][:, None], axes[2]
        for i, x in enumerate(axes[0]):  # face by face, which needs little more memory than the grid
            face[..., 0] = x
            distances[i] = np.min([shape.distance(face) for shape in self.shapes], axis=0)
        self.field = DistanceField(distances, low, resolution)

    @classmethod
    def from_occupancy(cls, occupied: ArrayLike, origin: ArrayLike, cell: float) -> Obstacles:
        """From an occupancy grid, by the Euclidean distance transform of SciPy (extra ``obstacles``).

        `occupied` (X, Y, Z) is true where a cell is occupied; `origin` (3,) [m] is the centre of cell (0, 0, 0) in the
        base's axes; `cell` [m] is a cell's side. A surface lies half a cell from the cells' centres on either side.
        Distances are exact where the surface is parallel to an axis; elsewhere a distance is up to 0.37 cells too large
        outside, and too deep inside.

        Error where no cell is occupied, or none is free; MissingPackage where SciPy is not installed.
        """
        need("scipy")
        from scipy.ndimage import distance_transform_edt  # type: ignore[import-untyped]

        inside = np.asarray(occupied)
        if inside.ndim != 3:
            raise Error(f"occupied has shape {inside.shape}, needs (X, Y, Z)")
        if not np.isin(inside, (0, 1)).all():
            raise Error("occupied must hold truth values, or 0 and 1; of probabilities say first which count")
        inside = inside.astype(bool)
        if inside.all() or not inside.any():
            raise Error(f"{'every' if inside.any() else 'no'} cell is occupied: there is no surface to be distant from")
        cell = _length("cell", cell)
        outwards = np.asarray(distance_transform_edt(~inside, sampling=cell))
        inwards = np.asarray(distance_transform_edt(inside, sampling=cell))
        distances = np.where(inside, 0.5 * cell - inwards, outwards - 0.5 * cell)
        made = cls.__new__(cls)
        made.shapes = ()
        made.field = DistanceField(distances, origin, cell)
        return made

    @property
    def bounds(self) -> Array:
        """Lowest and highest corner (2, 3) [m] of the grid."""
        low = self.field.origin
        return np.array([low, low + self.field.cell * (np.array(self.field.shape) - 1.0)])

    def distance(self, points: ArrayLike) -> float | Array:
        """Signed distance [m] at a point (3,), or (M,) at points (M, 3)."""
        return self.field.distance(points)

    def gradient(self, points: ArrayLike) -> Array:
        """Gradient (3,) of the distance at a point (3,), or (M, 3) at points (M, 3)."""
        return self.field.gradient(points)

    def __repr__(self) -> str:
        what = f"{len(self.shapes)} shapes" if self.shapes else "from an occupancy grid"
        return f"Obstacles({what}, {self.field!r})"


def _store(shape: object, **values: object) -> None:
    for name, value in values.items():
        object.__setattr__(shape, name, value)


def _numbers(name: str, values: ArrayLike, shape: tuple[int, ...]) -> Array:
    array = np.array(values, dtype=np.float64)
    if array.shape != shape or not np.all(np.isfinite(array)):
        raise Error(f"{name} = {array.tolist()} must be finite, of shape {shape}")
    array.flags.writeable = False
    return array


def _length(name: str, value: float) -> float:
    if not (math.isfinite(value) and value > 0.0):
        raise Error(f"{name} = {value} m must be finite and above 0")
    return float(value)


def _pose(values: ArrayLike) -> Array:
    if np.shape(values) == (3,):
        pose = np.eye(4)
        pose[:3, 3] = _numbers("pose", values, (3,))
    else:
        pose = np.array(_numbers("pose", values, (4, 4)))
        turn = pose[:3, :3]
        off = float(np.abs(turn.T @ turn - np.eye(3)).max())
        if off > 1e-6 or np.linalg.det(turn) < 0.0 or not np.array_equal(pose[3], (0.0, 0.0, 0.0, 1.0)):
            raise Error(f"pose = {pose.tolist()} is not a rotation and a translation (RᵀR − I up to {off:.3g})")
    pose.flags.writeable = False
    return pose


def _points(points: ArrayLike) -> Array:
    array = np.asarray(points, dtype=np.float64)
    if array.ndim == 0 or array.shape[-1] != 3:
        raise Error(f"points have shape {array.shape}, need (…, 3)")
    return array


def _local(pose: ArrayLike, points: ArrayLike) -> Array:
    matrix = np.asarray(pose)
    local: Array = (_points(points) - matrix[:3, 3]) @ matrix[:3, :3]
    return local


def _outside_and_in(beside: Array) -> Array:
    """Signed distances (…) from distances (…, k) to k pairs of faces at right angles, negative between a pair."""
    outside = np.linalg.norm(np.maximum(beside, 0.0), axis=-1)
    signed: Array = outside + np.minimum(beside.max(axis=-1), 0.0)
    return signed
