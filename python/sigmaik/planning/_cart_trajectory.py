"""A cart-mounted arm through taught configurations, clear of its shoulder singularity (Salvato et al. 2022, algorithm
1)."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Literal, TypedDict

import numpy as np
from numpy.typing import ArrayLike

from sigmaik import _core
from sigmaik._core import Chain
from sigmaik._types import Array

from .cart import CartMotion, cart_motion
from .cart_path import PosePath, pose_paths, smooth, when_smooth
from .options import checked

if TYPE_CHECKING:
    from typing_extensions import Unpack

__all__ = ["CartTrajectory", "Shape", "ShoulderCylinder", "cart_trajectory", "follow", "shoulder_cylinder"]
Shape = Literal["line", "spline"]
Profile = Literal["constant", "smooth"]

TIGHT = 1e-11
"""[m or rad] Tolerance of the poses that inverse kinematics reaches."""
LEAP = 0.1
"""[rad] Largest motion of a joint in one step of inverse kinematics; a step with a larger motion is halved."""
HALVINGS = 14
SMOOTH_SPEED = 1.875
"""Top speed of `smooth`, as a multiple of its mean speed."""


@dataclass(frozen=True)
class ShoulderCylinder:
    """The shoulder singularity of a six-axis arm: a point of the hand is at its least distance from the first axis."""

    point: Array
    """(3,) [m] in the tip's frame, where axes 5 and 6 meet."""
    radius: float
    """[m] Least distance of the point from the first axis, at which the arm is singular."""


def shoulder_cylinder(chain: Chain) -> ShoulderCylinder:
    """The point and the radius that make a shoulder singularity a cylinder about axis 1, for every orientation.

    The point where axes 5 and 6 meet moves in a plane at right angles to axis 2, at a fixed distance d from axis 1. The
    distance of the point from axis 1 is √(g² + d²), and the arm is singular where g = 0. For a Universal Robots arm,
    d = d4 and |det J| = a2 a3 |s3 s5 g|. For arms with a spherical wrist the point is the wrist's centre.

    Raises ValueError where the arm has not six joints, its axes 5 and 6 do not meet, axis 2 is not at right angles to
    axis 1, or the point does not move in such a plane.
    """
    if chain.dof != 6:
        raise ValueError(f"a shoulder cylinder needs six joints; the arm has {chain.dof}")
    rng = np.random.default_rng(0)
    points, offsets, sides, size = [], [], [], 0.0
    for q in rng.uniform(-math.pi, math.pi, (200, 6)):
        pose, jacobian = chain.pose(q), chain.jacobian(q)
        axis = jacobian[3:].T
        if np.any(np.abs(np.linalg.norm(axis, axis=1) - 1.0) > 1e-9):
            raise ValueError("a shoulder cylinder needs six revolute joints")
        # The point of each axis nearest to the tip.
        near = pose[:3, 3] - np.cross(jacobian[:3].T, axis)
        size = max(size, float(np.max(np.linalg.norm(near - near[0], axis=1))))
        if abs(axis[0] @ axis[1]) > 1e-9:
            raise ValueError("axis 2 is not at right angles to axis 1")
        normal = np.cross(axis[4], axis[5])
        if np.linalg.norm(normal) < 1e-3:
            continue  # the axes are nearly parallel: another q gives the point more exactly
        between = near[5] - near[4]
        gap = abs(between @ normal) / np.linalg.norm(normal)
        if gap > 1e-9 * size:
            raise ValueError(f"axes 5 and 6 do not meet: they are {gap:g} m apart")
        # o5 + s a5 = o6 + t a6, multiplied by n × a5
        meeting = near[5] - axis[5] * (between @ np.cross(normal, axis[4])) / (axis[5] @ np.cross(normal, axis[4]))
        points.append(pose[:3, :3].T @ (meeting - pose[:3, 3]))
        from_axis = meeting - near[0]
        offsets.append(from_axis @ axis[1])
        sides.append(from_axis @ np.cross(axis[0], axis[1]))
    if not points:
        raise ValueError("axes 5 and 6 are parallel")
    if np.ptp(points, axis=0).max() > 1e-8 * size:
        raise ValueError("where axes 5 and 6 meet is not a point of the hand")
    if np.ptp(offsets) > 1e-9 * size:
        raise ValueError("where axes 5 and 6 meet does not move in a plane at right angles to axis 2")
    if min(sides) > 0.0 or max(sides) < 0.0:
        raise ValueError("the arm does not reach its first axis")
    return ShoulderCylinder(np.mean(points, axis=0), float(abs(np.mean(offsets))))


@dataclass(frozen=True)
class CartTrajectory:
    """A motion of cart and arm through N taught configurations, T samples."""

    t: Array = field(repr=False)
    """(T,) [s]"""
    q: Array = field(repr=False)
    """(T, 1 + n) the cart [m], then the arm's joints [rad]."""
    qdot: Array = field(repr=False)
    """(T, 1 + n) [m/s, rad/s], second-order differences."""
    poses: Array = field(repr=False)
    """(T, 4, 4) of the tool, in a frame whose x axis is the axis of the cart."""
    motions: tuple[CartMotion, ...] = field(repr=False)
    """(N − 1) laws of the cart, each between two taught configurations."""
    taught_at: tuple[int, ...]
    """(N,) samples of the taught configurations."""
    min_singular_value: Array = field(repr=False)
    """(T,) smallest singular value of the arm's Jacobian, in m and rad without a length scale."""
    joint_error: float
    """[rad] Largest deviation from the taught joints on arrival; each motion begins where the last motion arrived."""


class CartTrajectoryKeywords(TypedDict, total=False):
    """Options of `cart_trajectory`."""

    poses: ArrayLike | None
    """(N, 4, 4) Taught poses of the tool, x along the cart; by default the poses of `taught`."""
    point: ArrayLike
    """(3,) [m] Point in the tip's frame that has to stay out of the cylinder. The default, the tip's origin, is the
    paper's. `shoulder_cylinder(chain)` has the point and the least radius that suit the arm."""
    mount: ArrayLike | None
    """(4, 4) base of the chain on the cart, at cart position 0; by default the cart's frame."""
    tool: ArrayLike | None
    """(4, 4) in the tip's frame; by default the tip."""
    durations: float | Sequence[float]
    """[s] of each motion, or one for all."""
    samples: int | Sequence[int]
    """Samples of each motion, ends included, or one number for all motions. Neighbours share a sample."""
    shape: Shape
    """"line"; or "spline": one natural cubic spline through all positions."""
    via: Sequence[ArrayLike | None] | None
    """(N − 1) a point (3,) [m] that the motion goes through on a circular arc, or None for a line."""
    profile: Profile
    """"constant" speed along the path, as in the paper; "smooth" from rest to rest, of cart, tool and joints."""
    margin: float
    """See `cart_motion`."""
    cart_range: tuple[float, float]
    """See `cart_motion`."""
    max_speed: float
    """See `cart_motion`."""
    max_acceleration: float
    """See `cart_motion`. With "smooth" the acceleration is that of the whole motion."""
    pose_tolerance: float
    """[m or rad] by which the poses of `taught` may differ from `poses`."""
    joint_tolerance: float
    """[rad] by which the arm may miss the taught joints."""
    check_limits: bool
    """Refuse motions out of the joints' limits of position and velocity."""


def cart_trajectory(
    chain: Chain, taught: ArrayLike, radius: float, **options: Unpack[CartTrajectoryKeywords]
) -> CartTrajectory:
    """From taught configuration to taught configuration along Cartesian motions, arriving at the taught joints.

    For each pair of neighbours: the tool's motion p(t); the law of the cart that keeps `point` more than `radius` from
    the first joint's axis, on the side that turns joint 1 as taught (`cart_motion`); the arm's inverse kinematics on
    p(t) shifted by the cart (9), continuous from the taught start; and a check that the arm arrives at the taught
    joints, not at another branch or another turn.

    Parameters
    ----------
    chain
        The arm, six revolute joints, the first about an axis that is parallel to z once mounted.
    taught
        (N, 7) N ≥ 2 configurations: the cart [m], the joints [rad].
    radius
        [m] of the cylinder.
    options
        `CartTrajectoryKeywords`: poses, point, mount, tool, durations, samples, shape, via, profile, margin,
        cart_range, max_speed, max_acceleration, pose_tolerance, joint_tolerance, check_limits.

    Raises
    ------
    CartError
        where no law of the cart keeps out of the cylinder; see `cart_motion`.
    ValueError
        where the arm cannot follow, arrives at other joints, or leaves its limits; or where an argument is out of its
        range.
    """
    return _through(chain, taught, radius, **checked("cart_trajectory", CartTrajectoryKeywords, options, None))


def _through(
    chain: Chain,
    taught: ArrayLike,
    radius: float,
    *,
    poses: ArrayLike | None = None,
    point: ArrayLike = (0.0, 0.0, 0.0),
    mount: ArrayLike | None = None,
    tool: ArrayLike | None = None,
    durations: float | Sequence[float] = 10.0,
    samples: int | Sequence[int] = 1000,
    shape: Shape = "line",
    via: Sequence[ArrayLike | None] | None = None,
    profile: Profile = "constant",
    margin: float = 0.0,
    cart_range: tuple[float, float] = (-math.inf, math.inf),
    max_speed: float = math.inf,
    max_acceleration: float = math.inf,
    pose_tolerance: float = 1e-4,
    joint_tolerance: float = 1e-4,
    check_limits: bool = True,
) -> CartTrajectory:
    if chain.dof != 6:
        raise ValueError(f"the arm must have six joints, not {chain.dof}: a redundant one has no joints to arrive at")
    if profile not in ("constant", "smooth"):
        raise ValueError(f"profile = {profile!r} must be 'constant' or 'smooth'")
    if shape not in ("line", "spline"):
        raise ValueError(f"shape = {shape!r} must be 'line' or 'spline'")
    configurations = _array("taught", taught, (-1, 7))
    if len(configurations) < 2:
        raise ValueError(f"taught has {len(configurations)} configurations; it takes at least 2")
    base = _pose("mount", mount)
    hand = _pose("tool", tool)
    axis, sign = _first_axis(chain, base)
    spot = _array("point", point, (3,))
    of_taught = np.array([_at(c[0]) @ base @ chain.pose(c[1:]) @ hand for c in configurations])
    targets = of_taught if poses is None else _array("poses", poses, (len(configurations), 4, 4))
    for k, (have, want) in enumerate(zip(of_taught, targets, strict=True)):
        difference = float(np.max(np.abs(_core.pose_error(have, want))))
        if difference > pose_tolerance:
            raise ValueError(f"pose {k} is not that of taught configuration {k}: it is off by {difference:g} m or rad")
    spans = _each("durations", durations, len(configurations) - 1)
    counts = [int(c) for c in _each("samples", samples, len(configurations) - 1)]
    if min(counts) < 2:
        raise ValueError(f"samples = {samples}: a motion takes at least 2")
    paths = pose_paths(targets, via, shape == "spline")

    # The point, in the frame of the tool, and seen from the first axis at cart position 0.
    in_tool = np.linalg.solve(hand, np.append(spot, 1.0))
    azimuth = [_azimuth((base @ chain.pose(c[1:]))[:3] @ np.append(spot, 1.0) - axis) for c in configurations]
    to_tip: Array = np.asarray(np.linalg.inv(hand), dtype=np.float64)
    to_base: Array = np.asarray(np.linalg.inv(base), dtype=np.float64)

    times, rows, tools, motions, taught_at = [np.zeros(1)], [configurations[:1]], [targets[:1]], [], [0]
    worst = 0.0
    for k, path in enumerate(paths):
        before, after = configurations[k], configurations[k + 1]
        around = sign * (after[1] - before[1])
        # The point's azimuth is joint 1 plus an angle of the other joints, which is never a whole turn.
        rest = azimuth[k + 1] - azimuth[k] - around
        motion = cart_motion(
            (path(np.linspace(0.0, 1.0, counts[k])) @ in_tool)[:, :2] - axis[:2],
            before[0],
            after[0],
            radius,
            turn=around + math.remainder(rest, 2.0 * math.pi),
            cart_range=cart_range,
            margin=margin,
            duration=spans[k],
            max_speed=max_speed if profile == "constant" else max_speed / SMOOTH_SPEED,
            max_acceleration=max_acceleration if profile == "constant" else math.inf,
        )
        warp, when = (smooth, when_smooth) if profile == "smooth" else (_same, _same)
        # A corner of the law between two samples becomes a sample.
        between = motion.corners[motion.corners % 1.0 != 0.0] / (counts[k] - 1)
        time = np.union1d(np.linspace(0.0, 1.0, counts[k]), when(between))
        joints, reached = follow(chain, _shifted(path, motion, warp, to_base, to_tip), time, rows[-1][-1, 1:])
        if reached < len(time):
            raise ValueError(
                f"the arm cannot follow motion {k}: at t = {time[reached] * spans[k]:g} s of {spans[k]:g} s it finds "
                f"no joints near {joints[-1].tolist()}, where the smallest singular value is "
                f"{_least(chain, joints[-1:])[0]:g}"
            )
        missed = float(np.max(np.abs(joints[-1] - after[1:])))
        if missed > joint_tolerance:
            raise ValueError(
                f"motion {k} arrives at the joints {joints[-1].tolist()}, not at those taught, {after[1:].tolist()}"
            )
        worst = max(worst, missed)
        cart = motion.sample(spans[k] * warp(time))
        rows.append(np.column_stack([cart, joints])[1:])
        times.append(times[-1][-1] + spans[k] * time[1:])
        tools.append(path(warp(time))[1:])
        motions.append(motion)
        taught_at.append(taught_at[-1] + len(time) - 1)
    t, q = np.concatenate(times), np.concatenate(rows)
    qdot = _rates(t, q, taught_at)
    if profile == "smooth" and math.isfinite(max_acceleration):
        _check_acceleration(t, q[:, 0], taught_at, max_acceleration)
    if check_limits:
        _check_limits(chain, t, q[:, 1:], qdot[:, 1:])
    least = _least(chain, q[:, 1:])
    return CartTrajectory(t, q, qdot, np.concatenate(tools), tuple(motions), tuple(taught_at), least, worst)


def follow(chain: Chain, pose_at: Callable[[float], Array], times: Array, start: Array) -> tuple[Array, int]:
    """Joints (K, n) that follow tip poses, continuous from `start`, by Newton's method, and the number of times that
    were reached.

    pose_at(t) is the tip's pose (4, 4) in the base. Where a step moves a joint too far, or Newton's method does not
    converge, the step is halved up to HALVINGS times; where halving does not help, the function returns the joints that
    it has reached.
    """
    q = np.array(start, dtype=np.float64)
    found = [q]
    first = _newton(chain, pose_at(float(times[0])), q)
    if first is None:
        return np.array(found), 0
    found, rate, now = [first], np.zeros_like(q), float(times[0])
    for until in times[1:]:
        q, part, halvings = found[-1], float(until) - now, 0
        while now < until:
            then = now + part if now + part < until else float(until)
            step = then - now
            moved = _newton(chain, pose_at(then), q + step * rate)
            if moved is not None and np.max(np.abs(moved - q)) < LEAP:
                rate, q, now = (moved - q) / step, moved, then
            elif halvings == HALVINGS:
                return np.array(found), len(found)
            else:
                part, halvings, rate = 0.5 * part, halvings + 1, np.zeros_like(q)
        found.append(q)
    return np.array(found), len(found)


def _newton(chain: Chain, target: Array, q: Array) -> Array | None:
    for _ in range(8):
        error = _core.pose_error(chain.pose(q), target)
        if np.max(np.abs(error)) < TIGHT:
            return q
        try:
            step = np.linalg.solve(chain.jacobian(q), error)
        except np.linalg.LinAlgError:
            return None
        if not np.max(np.abs(step)) < 1.0:
            return None
        q = q + step
    return None


def _shifted(
    path: PosePath, motion: CartMotion, warp: Callable[[Array], Array], to_base: Array, to_tip: Array
) -> Callable[[float], Array]:
    """p'(t) = translx(p(t), −x_C(t)) (9), of the tip in the chain's base, over time in [0, 1]."""

    def pose_at(time: float) -> Array:
        s = warp(np.array([time]))
        pose: Array = to_base @ _at(-float(motion.sample(motion.duration * s)[0])) @ path(s)[0] @ to_tip
        return pose

    return pose_at


def _same(s: Array) -> Array:
    return s


def _at(x: float) -> Array:
    pose = np.eye(4)
    pose[0, 3] = x
    return pose


def _first_axis(chain: Chain, base: Array) -> tuple[Array, float]:
    """A point of axis 1 (3,) [m] at cart position 0, and 1 or −1, its direction along z."""
    q = np.zeros(chain.dof)
    pose, jacobian = chain.pose(q), chain.jacobian(q)
    direction = base[:3, :3] @ jacobian[3:, 0]
    if abs(abs(direction[2]) - 1.0) > 1e-9:
        raise ValueError(f"axis 1 must be parallel to z once mounted; it is along {direction.tolist()}")
    near = pose[:3, 3] - np.cross(jacobian[:3, 0], jacobian[3:, 0])
    return base[:3, :3] @ near + base[:3, 3], float(np.sign(direction[2]))


def _azimuth(v: Array) -> float:
    return math.atan2(v[1], v[0])


def _least(chain: Chain, q: Array) -> Array:
    least: Array = np.asarray(np.linalg.svd(chain.jacobian(q), compute_uv=False)[:, -1], dtype=np.float64)
    return least


def _rates(t: Array, q: Array, taught_at: list[int]) -> Array:
    """Differences within each motion. At a taught configuration the rate may jump; the rate given there belongs to the
    motion that begins."""
    out = np.empty_like(q)
    for first, last in zip(taught_at[:-1], taught_at[1:], strict=True):
        part = slice(first, last + 1)
        for j in range(q.shape[1]):
            out[part, j] = np.gradient(q[part, j], t[part], edge_order=2 if last - first > 1 else 1)
    return out


def _check_acceleration(t: Array, cart: Array, taught_at: list[int], limit: float) -> None:
    for first, last in zip(taught_at[:-1], taught_at[1:], strict=True):
        part = slice(first, last + 1)
        rate = np.diff(cart[part]) / np.diff(t[part])
        top = float(np.max(np.abs(np.diff(rate) / (0.5 * (t[part][2:] - t[part][:-2]))), initial=0.0))
        if top > limit:
            raise ValueError(
                f"the cart accelerates by {top:g} m/s², more than {limit:g} m/s²; "
                f"{math.sqrt(top / limit):g} times the duration would do"
            )


def _check_limits(chain: Chain, t: Array, q: Array, qdot: Array) -> None:
    limits = chain.limits
    for what, unit, beyond in (
        ("position", "rad", np.maximum(limits.lower - q, q - limits.upper)),
        ("velocity", "rad/s", np.abs(qdot) - limits.velocity),
    ):
        i, j = np.unravel_index(int(np.argmax(beyond)), beyond.shape)
        if beyond[i, j] > 1e-9:
            raise ValueError(
                f"joint {chain.joint_names[j]} exceeds its {what} limit by {beyond[i, j]:g} {unit} at t = {t[i]:g} s"
            )


def _array(name: str, values: ArrayLike, shape: tuple[int, ...]) -> Array:
    out = np.array(values, dtype=np.float64)
    fits = out.ndim == len(shape) and all(want in (-1, have) for want, have in zip(shape, out.shape, strict=True))
    if not fits or not np.all(np.isfinite(out)):
        need = str(shape).replace("-1", "N")
        raise ValueError(f"{name} must be finite and of shape {need}, not {out.shape}")
    return out


def _pose(name: str, pose: ArrayLike | None) -> Array:
    if pose is None:
        return np.eye(4)
    out = _array(name, pose, (4, 4))
    _core.pose_error(out, out)  # refuses a matrix that is no pose
    return out


def _each(name: str, values: ArrayLike, count: int) -> list[float]:
    given = np.asarray(values, dtype=np.float64)
    out = np.full(count, given) if given.ndim == 0 else given
    if out.shape != (count,) or not np.all(np.isfinite(out) & (out > 0.0)):
        raise ValueError(f"{name} must be one number, or one for each of the {count} motions, greater than 0")
    return [float(v) for v in out]
