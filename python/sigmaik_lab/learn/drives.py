"""What makes joint positions of poses and twists, for many arms at once: servos, and the baselines beside them."""

from __future__ import annotations

from typing import Protocol

import numpy as np
from numpy.typing import NDArray

import sigmaik as sk
from sigmaik._types import Array

from .episode import FPS
from .motion import along, difference, moved, rotations, shorten

__all__ = ["BASELINES", "Drive", "make_drive", "sigma_ratio"]

#: Rules that are no rule of `sk.methods`.
BASELINES = ("stop", "position_ik")

#: Times an action at which targets are told to servos: at 100 Hz.
_TARGETS = 10
#: Condition numbers of the Jacobian in m and rad at which the baseline "stop" begins to slow down, and stands: MoveIt
#: Servo's lower_singularity_threshold and hard_stop_singularity_threshold, and the factor of both while the arm leaves.
_SLOW, _STAND, _LEAVING = 17.0, 30.0, 2.0
#: Length [rad or m] of the step in joint space that tells whether the arm approaches a singularity.
_LOOK = 1e-3


class Drive(Protocol):
    """B arms that follow commands. One call of `follow` or `move` is one action: 1/FPS s."""

    dt: float  #: [s] a cycle
    cycles: int  #: of an action

    @property
    def q(self) -> Array:
        """(B, n) joint positions after the last cycle."""

    def reset(self, q: Array, mask: NDArray[np.bool_]) -> None:
        """Starts the arms of a mask (B,) at rest at q (B, n)."""

    def follow(self, start: Array, end: Array) -> Array:
        """Joint positions (cycles, B, n) of arms whose targets go from poses (B, 4, 4) to others within the action."""

    def move(self, twist: Array) -> Array:
        """Joint positions (cycles, B, n) of arms that are to move along twists (B, 6), base axes."""


def make_drive(chain: sk.Chain, rule: str | None, dt: float, size: int, threads: int) -> Drive:
    """The drive of a rule: a text of `sk.methods.parse`, one of BASELINES, or None for the library's default.

    ValueError where the rule is none, or an action is no multiple of ten cycles.
    """
    cycles = round(1.0 / (FPS * dt)) if dt > 0.0 else 0
    if cycles < _TARGETS or cycles % _TARGETS or abs(cycles * dt * FPS - 1.0) > 1e-9:
        raise ValueError(f"dt = {dt:g} must be 10 ms, or a whole part of that")
    if rule == "position_ik":
        return _PositionIk(chain, dt, cycles, size)
    if rule == "stop":
        return _Stop(chain, sk.PseudoInverse(), dt, cycles, size, threads)
    return _Servos(chain, None if rule is None else sk.methods.parse(rule), dt, cycles, size, threads)


def sigma_ratio(chain: sk.Chain, q: Array, length_scale: float) -> Array:
    """(B,) σ_min/σ_max at q (B, n), 1 rad as much as length_scale [m].

    From the eigenvalues of JJᵀ, which takes a third of the time of singular values; ratios below 1e-7 are noise.
    """
    weighted = chain.jacobian(q) * np.repeat([1.0, length_scale], 3)[:, None]
    squares = np.linalg.eigvalsh(weighted @ np.swapaxes(weighted, 1, 2))
    return np.asarray(np.sqrt(np.maximum(squares[:, 0], 0.0) / squares[:, -1]))


class _Servos:
    """A servo for each arm, all limits on."""

    def __init__(
        self, chain: sk.Chain, method: sk.Method | None, dt: float, cycles: int, size: int, threads: int
    ) -> None:
        self.dt, self.cycles = dt, cycles
        self._batch = sk.ServoBatch(chain, method, dt, size, threads)
        self._chain = chain
        self._q = np.empty((cycles, size, chain.dof))

    @property
    def q(self) -> Array:
        return self._batch.q

    def reset(self, q: Array, mask: NDArray[np.bool_]) -> None:
        self._batch.reset(q, mask)

    def follow(self, start: Array, end: Array) -> Array:
        # The target moves evenly within the action, and the feed-forward is its twist.
        way = difference(start, end)
        part, target = way / _TARGETS, start
        turn = rotations(part[:, 3:])
        each = self.cycles // _TARGETS
        for k in range(_TARGETS):
            target = moved(target, part[:, :3], turn) if k + 1 < _TARGETS else end
            allowed, ahead = self._allowed(target, way * FPS)
            for cycle in range(k * each, (k + 1) * each):
                self._batch.update(allowed, ahead)
                self._q[cycle] = self._batch.q
        return self._q

    def move(self, twist: Array) -> Array:
        each = self.cycles // _TARGETS
        for k in range(_TARGETS):
            allowed = self._allowed_twist(twist)
            for cycle in range(k * each, (k + 1) * each):
                self._batch.update_twist(allowed)
                self._q[cycle] = self._batch.q
        return self._q

    def _allowed(self, target: Array, ahead: Array) -> tuple[Array, Array]:
        return target, ahead

    def _allowed_twist(self, twist: Array) -> Array:
        return twist


class _Stop(_Servos):
    """Servos with the pseudo-inverse that slow down towards a singularity, and stand before it, as MoveIt Servo does.

    The condition number κ = σ_max/σ_min is that of the Jacobian in m and rad. The command is shortened by
    (stand − κ)/(stand − slow) where it would raise κ; where it would lower κ both thresholds are twice as high.
    """

    def _allowed(self, target: Array, ahead: Array) -> tuple[Array, Array]:
        gain, most = self._batch.options["gain_linear"], self._batch.options["max_linear_error"]
        most = most or 0.5 * self._chain.characteristic_length
        pose = self._batch.pose
        error = shorten(difference(pose, target), most, self._batch.options["max_angular_error"])
        part = self._part(gain * error + ahead)
        return along(pose, part * error), part * ahead

    def _allowed_twist(self, twist: Array) -> Array:
        return self._part(twist) * twist

    def _part(self, twist: Array) -> Array:
        """(B, 1) of the command that is left."""
        jacobian = self._chain.jacobian(self.q)
        u, sigma, vt = np.linalg.svd(jacobian, full_matrices=False)
        kappa = sigma[:, 0] / np.maximum(sigma[:, -1], 1e-12)
        inverse = 1.0 / np.maximum(sigma, 1e-9 * sigma[:, :1])
        qdot = np.einsum("bkn,bk,bmk,bm->bn", vt, inverse, u, twist)
        step = _LOOK * qdot / np.maximum(np.linalg.norm(qdot, axis=1, keepdims=True), 1e-12)
        after = np.linalg.svd(self._chain.jacobian(self.q + step), compute_uv=False)
        leaves = after[:, 0] / np.maximum(after[:, -1], 1e-12) < kappa
        factor = np.where(leaves, _LEAVING, 1.0)
        slow, stand = _SLOW * factor, _STAND * factor
        return np.asarray(np.clip((stand - kappa) / (stand - slow), 0.0, 1.0)[:, None])


class _PositionIk:
    """Position inverse kinematics once an action, from the last joints; the joints go there evenly within the action,
    inside their velocity limits. A pose out of reach gives the nearest pose that is found."""

    def __init__(self, chain: sk.Chain, dt: float, cycles: int, size: int) -> None:
        self.dt, self.cycles = dt, cycles
        self._chain, self._ik = chain, sk.PositionIk(chain)
        self.q: Array = np.full((size, chain.dof), np.nan)

    def reset(self, q: Array, mask: NDArray[np.bool_]) -> None:
        self.q = np.where(mask[:, None], q, self.q)

    def follow(self, start: Array, end: Array) -> Array:
        most = np.asarray(self._chain.limits.velocity) / FPS
        goals = np.array([self._ik.solve(pose, near=q).q for pose, q in zip(end, self.q, strict=True)])
        way = np.clip(goals - self.q, -most, most)
        parts = np.arange(1, self.cycles + 1) / self.cycles
        path = self.q + parts[:, None, None] * way
        self.q = path[-1].copy()
        return path

    def move(self, twist: Array) -> Array:
        pose = self._chain.pose(self.q)
        return self.follow(pose, along(pose, twist / FPS))
