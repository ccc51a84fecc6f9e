"""Planned motions in physics."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

from sigmaik import _core
from sigmaik._types import Array

from .simulation import Simulation

if TYPE_CHECKING:
    from sigmaik.planning import Trajectory

__all__ = ["Execution", "execute"]


@dataclass(frozen=True)
class Execution:
    """A planned motion in physics: N samples, one a control period, the state before the period's command."""

    t: Array = field(repr=False)  #: (N,) [s]
    planned: Array = field(repr=False)  #: (N, n) [rad or m]
    q: Array = field(repr=False)  #: (N, n) where the arm truly was
    qdot: Array = field(repr=False)  #: (N, n) [rad/s or m/s]
    torque: Array = field(
        repr=False
    )  #: (N, n) the largest |τ| in the period after the sample (last sample: before) [N·m or N]
    saturation: Array = field(repr=False)  #: (N, n) the part of this period at the effort limit
    effort: Array = field(repr=False)  #: (n,) the effort limits, infinite where there is none

    @property
    def error(self) -> Array:
        """(N, n) planned minus true [rad or m]."""
        return self.planned - self.q

    @property
    def max_error(self) -> float:
        """The largest |error| of all joints [rad or m]."""
        return float(np.abs(self.error).max())

    @property
    def rms_error(self) -> float:
        """Root of the mean square error, of all joints and samples."""
        return float(np.sqrt(np.mean(self.error**2)))

    @property
    def final_error(self) -> float:
        """The largest |error| of all joints at the end."""
        return float(np.abs(self.error[-1]).max())

    @property
    def max_effort(self) -> float:
        """The largest torque as a part of its limit; 0 where there is none."""
        return float((self.torque / self.effort).max())

    @property
    def saturated(self) -> float:
        """The part of the time in which any drive was at its limit."""
        return float(self.saturation.max(axis=1).mean())


def execute(
    simulation: Simulation,
    trajectory: Trajectory,
    control: _core.ComputedTorque | None = None,
    *,
    position_gain: float = 10.0,
    settle: float = 0.5,
    progress: Callable[[float], None] | None = None,
) -> Execution:
    """Executes a planned motion, from its first position, with feedback of the simulation's measurements.

    Computed torque drives a simulation of torques; the law q̇ = Δq_d/T + k (q_d − q) drives a simulation of velocities,
    with T the control period and Δq_d the planned motion in this period. Errors are taken at the time of the
    measurement.

    control: for torques only; None: the default `ComputedTorque` of the arm alone
    position_gain: k [1/s], for velocities only
    settle: [s] for which the last position is held
    progress: called with the simulated time [s], once a period

    ValueError where the trajectory is empty, has other joints, or a parameter is out of its range.
    """
    chain, period = simulation.chain, simulation.control_period
    if trajectory.q.ndim != 2 or trajectory.q.shape[1] != chain.dof:
        raise ValueError(f"the trajectory's q has shape {trajectory.q.shape}, the arm {chain.dof} joints")
    for name, value in (("position_gain", position_gain), ("settle", settle)):
        if not 0.0 <= value < math.inf:
            raise ValueError(f"{name} = {value} must be finite and not negative")
    if simulation.actuation == "velocity" and control is not None:
        raise ValueError("a simulation of velocities takes no torques: control must be None")
    start = float(trajectory.t[0]) if trajectory.t.size else 0.0
    samples = max(1, math.ceil((trajectory.duration + settle) / period - 1e-9)) + 1 if trajectory.t.size else 0
    t: Array = period * np.arange(samples, dtype=np.float64)
    planned, velocity, _ = trajectory.sample(start + t)
    velocity[t > trajectory.duration] = 0.0  # the arm holds at the end, even if the trajectory ends in motion
    if simulation.actuation == "torque" and control is None:
        control = _core.ComputedTorque(chain)

    measured = simulation.reset(planned[0], velocity[0])
    q, qdot = np.empty_like(planned), np.empty_like(planned)
    torque, saturation = np.zeros_like(planned), np.zeros_like(planned)
    for k in range(samples):
        q[k], qdot[k] = simulation.q, simulation.qdot
        if k + 1 == samples:
            break
        seen = round(measured.t / period)
        if control is not None:
            # The planned acceleration of the coming period is the change of the planned velocity.
            ahead = (velocity[k + 1] - velocity[k]) / period
            step = control.update(measured.q, measured.qdot, planned[seen], velocity[seen], ahead)
            measured = simulation.step(step.torque)
        else:
            ahead = (planned[k + 1] - planned[k]) / period
            measured = simulation.step(ahead + position_gain * (planned[seen] - measured.q))
        torque[k], saturation[k] = simulation.peak_torque, simulation.saturated
        if progress is not None:
            progress(simulation.t)
    torque[-1], saturation[-1] = torque[-2], saturation[-2]  # no period follows the last sample
    return Execution(t, planned, q, qdot, torque, saturation, np.array(chain.limits.effort))
