"""Gains, rate and posture of the pose servo, per arm, as the J-PARSE paper's experiments have them.

Figures that the paper does not print come from its authors' public code (github.com/armlabstanford/jparse);
figures chosen here are marked *ours*.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

__all__ = ["SETTINGS", "ReachSettings", "dwell", "published"]

#: Experiments of the paper, by the kind of arm.
SETTINGS: dict[str, str] = {
    "simulated": "figures 8 to 19",
    "real": "figures 20 and 21, of the xArm7",
}


@dataclass(frozen=True)
class ReachSettings:
    """ẋ = [k_p e_p; k_o e_o], e_p shortened to a cap, and a posture q̇ = k_n (q_nominal − q)."""

    rate: float = 50.0  #: [Hz] of the loop
    gain_linear: float = 5.0  #: k_p [1/s]
    gain_angular: float = 5.0  #: k_o [1/s]
    max_position_error: float = 0.5  #: cap on e_p [m]
    max_orientation_error: float = math.pi  #: cap on e_o [rad]; π is none
    gamma: float = 0.1  #: γ, threshold on σ_i/σ_max of J-PARSE and its ablations
    singular_gain: float = 1.0  #: J-PARSE's gain in singular directions, position and orientation
    adaptive: bool = False  #: whether J-PARSE's threshold grows with the command; the paper's threshold is fixed
    singular_posture: bool = False  #: whether the posture acts along J-PARSE's singular directions
    start: tuple[float, ...] | None = None  #: (n,) [rad] where the arm starts; None: its home
    posture: tuple[float, ...] | None = None  #: q_nominal (n,) [rad]; None: where the arm starts
    posture_gain: float = 0.0  #: k_n [1/s]
    posture_max_speed: float = math.inf  #: cap on each joint's posture speed [rad/s]
    length_scale: float = 1.0  #: [m], see sigmaik.VelocitySolver; the paper mixes m and rad as they are

    def with_(self, **changes: object) -> ReachSettings:
        """A copy with the changes that are not None."""
        return replace(self, **{k: v for k, v in changes.items() if v is not None})  # type: ignore[arg-type]


_PUBLISHED = {
    # "xArm7, simulated". The singular gain is 2 in the authors' launch files; at 1 the rule is continuous.
    "ufactory_xarm7": ReachSettings(
        rate=50.0,
        gain_linear=10.0,
        gain_angular=10.0,
        max_position_error=1.0,
        singular_gain=2.0,
        start=(-0.0314, -0.5166, 0.1204, 0.9198, -0.0314, 1.4172, 0.0349),
        posture=(0.0,) * 7,
        posture_gain=2.0,
    ),
    # Gen3, simulated. k_n and the singular gain are those of the authors' main_experiment_kinova.py and its
    # launch file.
    "kinova_gen3_7dof": ReachSettings(
        rate=20.0,
        gain_linear=1.0,
        gain_angular=1.0,
        max_position_error=0.3,
        singular_gain=2.0,
        start=(0.0, 0.26, 3.14, -2.27, 0.0, 0.96, 1.57),
        posture=(0.0, 0.26, 3.14, -2.27, 0.0, 0.96, 1.57),
        posture_gain=2.0,
    ),
    # Rate, gains and cap are *ours*: neither the paper nor the code has these figures. The arm is not redundant
    # and has no posture.
    "puma560": ReachSettings(rate=50.0, gain_linear=5.0, gain_angular=5.0, max_position_error=0.5, singular_gain=1.0),
}


#: The real xArm7. The paper has the time at a waypoint; the stored text of the paper has no figure for the cap. All
#: others are those of the branch for a real arm in the authors' xarm_vel_main_experiment.py: gains of 1/s, a cap of
#: 10 cm, and a posture of 3/s whose speed is capped. The paper says "the same gains" as in simulation.
_REAL = {
    "ufactory_xarm7": replace(
        _PUBLISHED["ufactory_xarm7"],
        gain_linear=1.0,
        gain_angular=1.0,
        max_position_error=0.1,
        posture_gain=3.0,
        posture_max_speed=0.6,
    )
}
#: [s] at each waypoint on the real arm.
_REAL_DWELL = 40.0


def published(robot: str, setting: str = "simulated") -> ReachSettings:
    """Settings of the paper's experiments with an arm; defaults (ours) for arms that are not in the paper.

    setting: one of `SETTINGS`. ValueError where the paper has no real arm of this name.
    """
    if setting not in SETTINGS:
        raise ValueError(f"no setting '{setting}'; there are {', '.join(SETTINGS)}")
    if setting == "real":
        if robot not in _REAL:
            raise ValueError(f"no real {robot} reaches waypoints in the paper; there is {', '.join(_REAL)}")
        return _REAL[robot]
    return _PUBLISHED.get(robot, ReachSettings())


def dwell(setting: str) -> float | None:
    """[s] at each waypoint, where the setting has a time of its own; None: the path's."""
    return _REAL_DWELL if setting == "real" else None
