"""An arm that has mass: its options, its settings and its simulation, for `sigmaik reach --physics` and
`sigmaik execute`."""

from __future__ import annotations

import argparse
import math
from dataclasses import dataclass
from typing import Literal

import numpy as np

import sigmaik as sk
from sigmaik.sim import Simulation

__all__ = ["PhysicsSettings", "add_physical_arm", "physics_settings", "simulation"]


@dataclass(frozen=True)
class PhysicsSettings:
    """The properties of the arm and of its drives, and the feedback of the loop."""

    actuation: Literal["velocity", "torque"] = "velocity"  #: of the drives; computed torque drives "torque"
    feedback: Literal["reference", "measured"] = "reference"
    period: float = 1e-3  #: [s] of the drives' commands
    timestep: float = 5e-4  #: [s] of physics
    position_gain: float = 10.0  #: [1/s] of the reference's positions, drives of velocity
    frequency: float = 20.0  #: ω of the computed torque [rad/s]
    friction: float = 0.0  #: dry, as a part of the effort limit; and as much again, viscous, at the speed limit
    payload: float = 0.0  #: [kg], a point mass at the tip, of which neither drives nor computed torque know
    position_noise: float = 0.0  #: standard deviation [rad or m]
    velocity_noise: float = 0.0  #: [rad/s or m/s]
    delay: int = 0  #: of measurements, in periods
    trip: float = (
        5.0  #: where a joint is faster than this multiple of its limit the drives trip: the arm stands from then on
    )
    seed: int = 0


def add_physical_arm(group: argparse._ActionsContainer) -> None:
    """The options of an arm in physics."""
    group.add_argument(
        "--friction",
        type=float,
        default=0.0,
        metavar="PART",
        help="dry friction, as a part of the effort limits, and as much again, viscous, at the speed limits "
        "(%(default)g)",
    )
    for option, unit, text in (
        ("--payload", "KG", "a point mass at the tip, of which the drives do not know"),
        ("--noise", "RAD", "standard deviation of measured positions"),
        ("--velocity-noise", "RAD/S", "standard deviation of measured velocities"),
    ):
        group.add_argument(option, type=float, default=0.0, metavar=unit, help=f"{text} (%(default)g)")
    group.add_argument(
        "--delay", type=int, default=0, metavar="N", help="periods by which measurements are late (%(default)s)"
    )
    group.add_argument(
        "--period",
        type=float,
        default=1e-3,
        metavar="S",
        help="of the drives' commands; physics runs twice as fast (%(default)s)",
    )
    group.add_argument(
        "--frequency", type=float, default=20.0, metavar="RAD/S", help="of the computed torque (%(default)g)"
    )
    group.add_argument("--seed", type=int, default=0, help="of the noise (%(default)s)")


def physics_settings(
    args: argparse.Namespace,
    actuation: Literal["velocity", "torque"],
    feedback: Literal["reference", "measured"] = "reference",
) -> PhysicsSettings:
    """The settings from the options of `add_physical_arm`."""
    return PhysicsSettings(
        actuation=actuation,
        feedback=feedback,
        period=args.period,
        timestep=0.5 * args.period,
        frequency=args.frequency,
        friction=args.friction,
        payload=args.payload,
        position_noise=args.noise,
        velocity_noise=args.velocity_noise,
        delay=args.delay,
        seed=args.seed,
    )


def simulation(chain: sk.Chain, p: PhysicsSettings, actuation: Literal["velocity", "torque"]) -> Simulation:
    """The arm that the settings describe. ValueError where a setting is out of its range or the arm has no inertias."""
    effort, speed = np.array(chain.limits.effort), np.array(chain.limits.velocity)
    dry = np.zeros(chain.dof)
    if p.friction:
        if not (math.isfinite(p.friction) and p.friction > 0.0):
            raise ValueError(f"friction = {p.friction:g} must be finite and not negative")
        if not np.isfinite(effort).all():
            raise ValueError("friction is a part of the effort limits, but not all joints have one")
        dry = p.friction * effort
    return Simulation(
        chain,
        actuation=actuation,
        timestep=p.timestep,
        control_period=p.period,
        coulomb_friction=dry,
        viscous_friction=dry / speed,
        payload=sk.Inertia(p.payload) if p.payload else None,
        position_noise=p.position_noise,
        velocity_noise=p.velocity_noise,
        delay=p.delay,
        seed=p.seed,
    )
