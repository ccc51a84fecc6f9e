"""A UR10 on a cart by its shoulder singularity (Salvato et al. 2022, section 4): the ways to drive the cart.

There are two variants, because no mounting of a UR10 makes the paper's joints give the paper's poses:

    fk     the poses are those of the paper's joints, at the flange
    paper  the poses are the paper's; a constant tool takes the arm from its joints to them

Both keep the taught joints, the cart from 0.5 to 0.75 m, the radius of 0.2 m, 200 s and 5068 samples.
"""

from __future__ import annotations

import functools
import math
from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

import sigmaik as sk
from sigmaik import _core
from sigmaik._types import Array
from sigmaik.planning._cart_trajectory import follow
from sigmaik.planning.cart import PUBLISHED_ITERATIONS, CartMotion, cart_motion, evaluate_cart_motion
from sigmaik.planning.cart_path import PosePath, pose_paths
from sigmaik.planning.cart_plane import PlaneCartMotion, cart_motion_plane

__all__ = ["METHODS", "ROBOT", "VARIANTS", "CartExperiment", "CartRun", "cart_xy", "density", "descent", "load", "run"]

ROBOT = "ur10"
VARIANTS = ("fk", "paper")
METHODS = {
    "linear": "linear",
    "redundancy": "redundancy scheme",
    "gradient": "gradient, linear guess",
    "gradient-admissible": "gradient, admissible guess",
    "exact": "exact",
    "plane": "exact, two axes",
}

_JOINTS = (-1.235, -1.7272, 0.7, -1.0, 1.5951, -0.0311)
_LAST_AXIS_1 = 1.235
_CART = (0.5, 0.75)
# x, y, z [m], then the turns about z, y, x [rad], each in the axes that the turn before has rotated. The paper's
# second pose lacks a comma: "1.4551 − 0.1648" is z and the turn about z.
_POSES = (
    (0.2607, 0.1354, 1.4551, -2.6348, 0.7090, -0.1134),
    (0.8531, -0.2549, 1.4551, -0.1648, 0.7090, -0.1134),
)
_RANGES = np.array([1.0, *6 * [4.0 * math.pi]])  # of (12), the cart's from 0, the joints' from −2π
_MIDDLES = np.array([0.5, *6 * [0.0]])


@dataclass(frozen=True)
class CartExperiment:
    """The taught configurations, and the straight line between them."""

    variant: str
    chain: sk.Chain = field(repr=False)
    mount: Array = field(repr=False)
    """(4, 4) the chain's base on the cart, at 0."""
    tool: Array = field(repr=False)
    """(4, 4) in the tip's frame."""
    taught: Array = field(repr=False)
    """(2, 7) cart [m], joints [rad]."""
    poses: Array = field(repr=False)
    """(2, 4, 4) of the tool."""
    samples: int = 5068
    radius: float = 0.2
    cart_range: tuple[float, float] = (0.0, 1.0)
    duration: float = 200.0

    @property
    def path(self) -> PosePath:
        """Path of the tool, over [0, 1]."""
        return pose_paths(self.poses, None, False)[0]

    @property
    def s(self) -> Array:
        """(M,) path parameter of the samples, in [0, 1]."""
        return np.linspace(0.0, 1.0, self.samples)

    @property
    def turn(self) -> float:
        """[rad] Angle by which joint 1 was taught to turn."""
        return float(self.taught[1, 1] - self.taught[0, 1])

    @functools.cached_property
    def flange_xy(self) -> Array:
        """(M, 2) [m] Path of the point that keeps out of the cylinder: the poses' origin, as in the paper."""
        return self.path(self.s)[:, :2, 3].copy()


def load(variant: str, samples: int = 5068) -> CartExperiment:
    """Loads one of `VARIANTS`; ValueError for another name."""
    if variant not in VARIANTS:
        raise ValueError(f"no variant {variant!r}; there are {', '.join(VARIANTS)}")
    if samples < 10:
        raise ValueError(f"samples = {samples} must be at least 10")
    chain = sk.robots.load(ROBOT)
    mount = np.diag([-1.0, -1.0, 1.0, 1.0])  # base_link of ROS is turned by π against the maker's base
    joints = np.array([_JOINTS, (_LAST_AXIS_1, *_JOINTS[1:])])
    taught = np.column_stack([_CART, joints])
    flanges = np.array([_shift(q[0]) @ mount @ chain.pose(q[1:]) for q in taught])
    if variant == "fk":
        return CartExperiment(variant, chain, mount, np.eye(4), taught, flanges, samples)
    poses = np.array([_pose(*p) for p in _POSES])
    tool = np.linalg.solve(flanges[0], poses[0])
    return CartExperiment(variant, chain, mount, tool, taught, poses, samples)


@dataclass(frozen=True)
class CartRun:
    """One way to drive the cart, and the motion of the arm with it."""

    method: str
    motion: CartMotion | PlaneCartMotion = field(repr=False)
    q: Array = field(repr=False)
    """(K, 7) cart [m], along x, and joints [rad], of the K ≤ M samples that the arm can follow."""
    joint_error: Array = field(repr=False)
    """(7,) last configuration minus the taught configuration; nan where the arm does not arrive."""
    task_error: float
    """[m or rad] the tool's largest distance from its line, of position or orientation."""
    min_singular_value: float
    """Of the arm's 6×6 Jacobian, along the samples followed."""
    max_joint_speed: float
    """[rad/s]"""

    @property
    def followed(self) -> float:
        """Part of the samples that the arm can follow."""
        return len(self.q) / len(self.motion.t)


def run(e: CartExperiment, method: str, iterations: int = PUBLISHED_ITERATIONS) -> CartRun:
    """Drives the cart by one of `METHODS`."""
    keep = (e.flange_xy, *_CART, e.radius)
    if method == "redundancy":
        q = redundancy(e)
        looked_at = evaluate_cart_motion(e.flange_xy, q[:, 0], e.radius, duration=e.duration)
        return _judge(e, method, looked_at, q)
    motion: CartMotion | PlaneCartMotion
    if method == "linear":
        motion = evaluate_cart_motion(e.flange_xy, np.linspace(*_CART, e.samples), e.radius, duration=e.duration)
    elif method == "exact":
        motion = cart_motion(*keep, turn=e.turn, cart_range=e.cart_range, duration=e.duration)
    elif method == "plane":
        start, end = ((x, 0.0) for x in _CART)
        motion = cart_motion_plane(
            e.flange_xy, start, end, e.radius, turn=e.turn, x_range=e.cart_range, duration=e.duration
        )
    elif method in ("gradient", "gradient-admissible"):
        motion = cart_motion(
            *keep,
            method="gradient",
            turn=e.turn,
            cart_range=e.cart_range,
            duration=e.duration,
            first_guess="admissible" if method == "gradient-admissible" else "linear",
            max_iterations=iterations,
        )
    else:
        raise ValueError(f"no method {method!r}; there are {', '.join(METHODS)}")
    path, to_tip, to_base = e.path, np.linalg.inv(e.tool), np.linalg.inv(e.mount)

    def pose_at(s: float) -> Array:
        cart = np.atleast_1d(motion.sample(s * e.duration))
        pose: Array = to_base @ _shift(*-cart) @ path(np.array([s]))[0] @ to_tip
        return pose

    joints, reached = follow(e.chain, pose_at, e.s, e.taught[0, 1:])
    return _judge(e, method, motion, np.column_stack([cart_xy(motion)[:reached, 0], joints[:reached]]))


def cart_xy(motion: CartMotion | PlaneCartMotion) -> Array:
    """(M, 2) [m] of the cart; with one axis it is on the line y = 0."""
    if isinstance(motion, PlaneCartMotion):
        return motion.xy
    return np.column_stack([motion.x, np.zeros_like(motion.x)])


def redundancy(e: CartExperiment, gain: float = 1.0, damping: float = 0.02, feedback: float = 1.0) -> Array:
    """q (M, 7) of (11), (12): q̇ = J†(ṗ + feedback · error) + gain (I − J†J) ∂w/∂q, w = −½ Σ ((q_k − mid_k)/range_k)².

    J† is damped by `damping`: without damping the arm runs into a singularity and the scheme stops there. The paper
    gives no gain; feedback [1/s] of position prevents drift.
    """
    solver = sk.VelocitySolver(sk.DampedLeastSquares(damping=damping))
    targets = e.path(e.s)
    dt = e.duration / (e.samples - 1)
    forward = sk.pose_error(e.poses[0], e.poses[1]) / e.duration  # one axis, constant speed
    turn = e.mount[:3, :3]
    out = np.empty((e.samples, 7))
    q = out[0] = e.taught[0]
    for i in range(1, e.samples):
        flange, arm = e.chain.pose(q[1:]), e.chain.jacobian(q[1:])
        lever = flange[:3, :3] @ e.tool[:3, 3]
        jacobian = np.zeros((6, 7))
        jacobian[0, 0] = 1.0
        jacobian[:3, 1:] = turn @ (arm[:3] + np.cross(arm[3:], lever, axis=0))
        jacobian[3:, 1:] = turn @ arm[3:]
        error = sk.pose_error(_shift(q[0]) @ e.mount @ flange @ e.tool, targets[i - 1])
        slope = -(q - _MIDDLES) / _RANGES**2
        q = q + dt * solver.solve(jacobian, forward + feedback * error, posture=gain * slope).qdot
        out[i] = q
    return out


def descent(e: CartExperiment, first_guess: str, stops: Sequence[int]) -> list[tuple[int, Array]]:
    """Laws of the gradient descent (10) after the numbers of iterations in `stops`, the guess first."""
    lower, upper = _core.forbidden_intervals(e.flange_xy, e.radius)
    x = np.linspace(*_CART, e.samples)
    if first_guess == "admissible":
        x[1:-1] = e.cart_range[1]
    out, done = [(0, x)], 0
    for stop in stops:
        x, _ = _core.cart_descent(lower, upper, x, 0.01, 20.0, stop - done, False)
        out.append((stop, x))
        done = stop
    return out


def density(x: Array, lower: float, upper: float) -> Array:
    """H (…) of (10): 0 outside λ−, λ+, rising to 1 half-way between (Salvato et al. 2022, figure 4)."""
    half = 0.5 * (upper - lower)
    value: Array = np.maximum(0.0, 1.0 - np.abs(x - 0.5 * (lower + upper)) / half)
    return value


def _judge(e: CartExperiment, method: str, motion: CartMotion | PlaneCartMotion, q: Array) -> CartRun:
    poses = e.path(e.s[: len(q)])
    task = max(
        float(np.max(np.abs(sk.pose_error(_shift(*c) @ e.mount @ e.chain.pose(joints) @ e.tool, p))))
        for c, joints, p in zip(cart_xy(motion), q[:, 1:], poses, strict=False)
    )
    least = np.linalg.svd(e.chain.jacobian(q[:, 1:]), compute_uv=False)[:, -1]
    speed = np.abs(np.diff(q[:, 1:], axis=0)) * ((e.samples - 1) / e.duration)
    missed = q[-1] - e.taught[1] if len(q) == e.samples else np.full(7, math.nan)
    return CartRun(method, motion, q, missed, task, float(np.min(least)), float(np.max(speed, initial=0.0)))


def _shift(x: float, y: float = 0.0) -> Array:
    pose = np.eye(4)
    pose[:2, 3] = x, y
    return pose


def _pose(x: float, y: float, z: float, about_z: float, about_y: float, about_x: float) -> Array:
    pose = np.eye(4)
    pose[:3, 3] = x, y, z
    pose[:3, :3] = functools.reduce(
        np.matmul,
        [sk.rotation_exp(angle * np.eye(3)[axis]) for axis, angle in ((2, about_z), (1, about_y), (0, about_x))],
    )
    return pose
