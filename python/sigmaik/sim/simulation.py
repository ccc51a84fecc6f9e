"""A chain in MuJoCo, driven at its joints."""

from __future__ import annotations

import math
from collections import deque
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike

from sigmaik import _core
from sigmaik._extras import need
from sigmaik._types import Array

from .model import build

__all__ = ["Measurement", "Simulation"]

_GRAVITY = (0.0, 0.0, -9.80665)


@dataclass(frozen=True)
class Measurement:
    """A measurement of the arm's sensors."""

    t: float  #: [s] time of the measurement: `delay` control periods ago, but not before the start
    q: Array  #: (n,) [rad or m]
    qdot: Array  #: (n,) [rad/s or m/s]


class Simulation:
    """A chain in MuJoCo, driven at its joints, one control period a `step`. The same seed gives the same motion."""

    def __init__(
        self,
        chain: _core.Chain,
        *,
        actuation: Literal["velocity", "torque"] = "velocity",
        timestep: float = 5e-4,
        control_period: float = 1e-3,
        bandwidth: float = 100.0,
        integral_rate: float = 10.0,
        gravity_compensation: bool = True,
        velocity_limits: bool = True,
        effort_limits: bool = True,
        position_stops: bool = False,
        viscous_friction: ArrayLike = 0.0,
        coulomb_friction: ArrayLike = 0.0,
        armature: ArrayLike = 0.0,
        payload: _core.Inertia | None = None,
        gravity: ArrayLike = _GRAVITY,
        position_noise: float = 0.0,
        velocity_noise: float = 0.0,
        delay: int = 0,
        seed: int = 0,
    ) -> None:
        """
        chain: an arm all of whose moving links have inertias (see Dynamics)
        actuation: the command of `step`. "velocity": each joint has a velocity loop of its own, closed in every physics
            step, τ = K_v (e + ω_i ∫ e dt) + g(q), e = q̇_command − q̇, cut at the effort limit; "torque": τ itself, held
            over the control period, cut at the effort limit
        timestep: [s] of physics, which has to divide control_period
        control_period: [s] from one command to the next
        bandwidth: ω_v [1/s] of the velocity loops: K_v = ω_v · max M_ii, the maximum over 256 configurations. As
            M ≤ n diag(M), no motion's error decays more slowly than with ω_v/n. K_v q̇ is integrated implicitly, so that
            any ω_v is stable
        integral_rate: ω_i [1/s]; 0: no integral. The integral stands still while its joint's torque is cut
        gravity_compensation: g(q), of the arm alone: the drives do not know the payload. For "velocity" only
        velocity_limits: velocity commands are cut at the chain's limits, as drives do. For "velocity" only
        effort_limits: torques are cut at the chain's limits; False: drives of any strength
        position_stops: the chain's position limits are stops, as stiff as MuJoCo's default; False: joints pass them
        viscous_friction: b [N·m·s/rad], (n,) or one number; torque −b q̇
        coulomb_friction: [N·m], (n,) or one number; dry friction of at most this torque
        armature: [kg·m²], (n,) or one number: rotors' inertia, seen at the joint
        payload: what the tip carries
        gravity: (3,) [m/s²], in base axes
        position_noise, velocity_noise: standard deviations [rad or m, rad/s or m/s] of measurements
        delay: control periods by which measurements are late
        seed: of the noise

        Error where a value is out of its range, where timestep does not divide control_period, or where Dynamics
        refuses; MissingPackage where MuJoCo is not installed.
        """
        need("mujoco")
        if actuation not in ("velocity", "torque"):
            raise _core.Error(f"actuation = {actuation!r} must be 'velocity' or 'torque'")
        _check_positive(timestep=timestep, control_period=control_period, bandwidth=bandwidth)
        _check_not_negative(
            integral_rate=integral_rate, position_noise=position_noise, velocity_noise=velocity_noise, delay=delay
        )
        if delay != int(delay):
            raise _core.Error(f"delay = {delay} must be a whole number of control periods")
        self._substeps = round(control_period / timestep)
        if self._substeps < 1 or abs(self._substeps * timestep - control_period) > 1e-9 * control_period:
            raise _core.Error(f"timestep = {timestep} does not divide control_period = {control_period}")

        self.chain = chain
        self.actuation = actuation
        self.control_period = control_period
        self.timestep = timestep
        n = chain.dof
        joints = {
            "viscous_friction": _per_joint(viscous_friction, "viscous_friction", n),
            "coulomb_friction": _per_joint(coulomb_friction, "coulomb_friction", n),
            "armature": _per_joint(armature, "armature", n),
        }
        # Dynamics refuses arms and payloads without usable inertias.
        _core.Dynamics(chain, gravity, payload)
        self._compensation = (
            _core.Dynamics(chain, gravity) if gravity_compensation and actuation == "velocity" else None
        )
        effort = np.array(chain.limits.effort)
        self._effort = effort if effort_limits else np.full(n, math.inf)
        self._cut = (1.0 - 1e-9) * self._effort  # a torque that was scaled down to the limit counts as cut
        speed = np.array(chain.limits.velocity)
        self._speed = speed if velocity_limits else np.full(n, math.inf)
        gain = None
        if actuation == "velocity":
            gain = bandwidth * (largest_inertias(chain, gravity) + joints["armature"])
        self._gain, self._integral_rate = gain, integral_rate
        self.model = build(chain, gain, self._effort, position_stops, joints, payload, gravity, timestep)

        import mujoco  # type: ignore[import-untyped]

        self._step = mujoco.mj_step
        self._forward = mujoco.mj_forward
        self.data = mujoco.MjData(self.model)
        self._position_noise, self._velocity_noise = position_noise, velocity_noise
        self._seed = seed
        self._late: deque[Measurement] = deque(maxlen=int(delay) + 1)
        self.reset(np.zeros(n))

    def reset(self, q: ArrayLike, qdot: ArrayLike | None = None) -> Measurement:
        """Starts, or starts again, at q (n,) and q̇ (n,), at rest where none is given; time and noise begin anew."""
        self.data.time = 0.0
        self.data.qpos[:] = self._sized(q, "q")
        self.data.qvel[:] = 0.0 if qdot is None else self._sized(qdot, "qdot")
        self.data.qacc_warmstart[:] = 0.0
        self.data.ctrl[:] = 0.0
        self._forward(self.model, self.data)
        self._periods = 0
        self._noise = np.random.default_rng(self._seed)
        self._saturated = np.zeros(self.chain.dof, dtype=np.int64)
        self._peak = np.zeros(self.chain.dof)
        self._integral = np.zeros(self.chain.dof)
        self._late.clear()
        return self._measure()

    def step(self, command: ArrayLike) -> Measurement:
        """Drives the joints by a command (n,) [rad/s, or N·m] for one control period; then measures.

        Error where the command has a wrong size or is not finite, and where the motion is no longer finite. In the
        latter case MuJoCo itself warns, too, on stderr and in a file MUJOCO_LOG.TXT.
        """
        asked = self._sized(command, "the command")
        data = self.data
        if self._gain is not None:
            asked = np.clip(asked, -self._speed, self._speed)
        self._saturated[:] = 0
        self._peak[:] = 0.0
        for _ in range(self._substeps):
            data.ctrl[:] = asked
            if self._gain is not None:
                # The force of the actuator is K_v (ctrl − q̇), cut at the effort limit.
                data.ctrl += self._integral_rate * self._integral
                if self._compensation is not None:
                    data.ctrl += self._compensation.gravity(data.qpos) / self._gain
                error = asked - data.qvel
            self._step(self.model, data)
            torque = np.abs(data.actuator_force)
            cut = torque >= self._cut
            if self._gain is not None:
                self._integral += np.where(cut, 0.0, self.timestep * error)
            self._saturated += cut
            np.maximum(self._peak, torque, out=self._peak)
            if not np.isfinite(data.qvel).all():
                raise _core.Error(f"the motion is no longer finite {data.time:g} s after the start")
        self._periods += 1
        return self._measure()

    @property
    def t(self) -> float:
        """[s] since `reset`."""
        return self._periods * self.control_period

    @property
    def q(self) -> Array:
        """(n,) true positions [rad or m]."""
        return np.array(self.data.qpos)

    @property
    def qdot(self) -> Array:
        """(n,) true velocities [rad/s or m/s]."""
        return np.array(self.data.qvel)

    @property
    def peak_torque(self) -> Array:
        """(n,) the largest |τ| of the drives in the last control period [N·m or N]."""
        return self._peak.copy()

    @property
    def saturated(self) -> Array:
        """(n,) the part of the last control period's physics steps in which a drive was at its effort limit."""
        share: Array = self._saturated / self._substeps
        return share

    def _measure(self) -> Measurement:
        n = self.chain.dof
        # Drawn even without noise, so that the amount of one noise does not change the other random numbers.
        dq, dqdot = self._noise.standard_normal((2, n))
        measured = Measurement(self.t, self.q + self._position_noise * dq, self.qdot + self._velocity_noise * dqdot)
        self._late.append(measured)
        return self._late[0]

    def _sized(self, values: ArrayLike, name: str) -> Array:
        array = np.asarray(values, dtype=np.float64)
        if array.shape != (self.chain.dof,):
            raise _core.Error(f"{name} has shape {array.shape}, needs ({self.chain.dof},)")
        if not np.isfinite(array).all():
            raise _core.Error(f"{name} has an entry that is not finite: {array.tolist()}")
        return array


def _check_positive(**values: float) -> None:
    for name, value in values.items():
        if not 0.0 < value < math.inf:
            raise _core.Error(f"{name} = {value} must be finite and greater than 0")


def _check_not_negative(**values: float) -> None:
    for name, value in values.items():
        if not 0.0 <= value < math.inf:
            raise _core.Error(f"{name} = {value} must be finite and not negative")


def largest_inertias(chain: _core.Chain, gravity: ArrayLike) -> Array:
    """(n,) the largest M_ii in 256 configurations, for the gains of the velocity loops."""
    generator = np.random.default_rng(0)
    dynamics = _core.Dynamics(chain, gravity)
    diagonals = [np.diag(dynamics.mass_matrix(chain.random_configuration(generator))) for _ in range(256)]
    largest: Array = np.max(diagonals, axis=0)
    return largest


def _per_joint(values: ArrayLike, name: str, n: int) -> Array:
    array = np.asarray(values, dtype=np.float64)
    if array.shape not in ((), (n,)):
        raise _core.Error(f"{name} has shape {array.shape}, needs ({n},) or one number")
    if not (np.isfinite(array).all() and (array >= 0.0).all()):
        raise _core.Error(f"{name} = {array.tolist()} must be finite and not negative")
    return np.broadcast_to(array, (n,)).copy()
