"""The settings that can be changed while an arm is driven."""

from __future__ import annotations

import functools
import math
from dataclasses import dataclass, fields, replace
from typing import Literal

from numpy.typing import ArrayLike

import sigmaik as sk
from sigmaik import methods

__all__ = ["Settings"]


@dataclass(frozen=True)
class Settings:
    """Rule, gains, limits and task of a `Session`'s servo. ValueError where a value is out of its range."""

    method: str = "jparse"  #: as for `sigmaik reach`: "jparse", "dls:damping=0.05"
    gamma: float = 0.1  #: γ of J-PARSE (its largest threshold on σ_i/σ_max) and of its ablations
    singular_gain: float = 1.0  #: J-PARSE's gain in singular directions
    singular_posture: bool = False  #: whether the posture acts along J-PARSE's singular directions
    gain_linear: float = 10.0  #: [1/s] position error to velocity
    gain_angular: float = 10.0  #: [1/s] orientation error to angular velocity
    max_linear_error: float | None = None  #: [m] longer position errors are shortened to this length; None: the servo's
    max_angular_error: float = 1.0  #: [rad] longer orientation errors are shortened to this angle
    posture_gain: float = 0.5  #: [1/s] pull towards where the arm started
    limits: bool = True  #: hold all joint limits
    assumed_acceleration: float = 10.0  #: [rad/s² or m/s²] limit of joints that have none; inf: they have none
    on_limit: Literal["redistribute", "scale"] = "redistribute"
    mask: tuple[bool, ...] = (True,) * 6  #: rows (vx, vy, vz, ωx, ωy, ωz) that matter
    frame: Literal["base", "tool"] = "base"  #: axes of the mask's rows
    length_scale: float | None = None  #: [m] 1 rad weighs as much as this length; None: the arm's own
    guided: bool = True  #: take another way to a pose target that the tool's own way does not reach

    def __post_init__(self) -> None:
        for field in fields(self):
            value, default = getattr(self, field.name), field.default
            if isinstance(default, bool | str):
                if not isinstance(value, type(default)):
                    raise ValueError(f"{field.name} must be a {type(default).__name__}, not {value!r}")
            elif default is None or isinstance(default, float):
                number = isinstance(value, int | float) and not isinstance(value, bool)
                finite = number and (math.isfinite(value) or field.name == "assumed_acceleration")
                if not finite and not (default is None and value is None):
                    raise ValueError(
                        f"{field.name} must be a finite number{' or None' if default is None else ''}, not {value!r}"
                    )
            elif len(value) != 6 or not all(isinstance(row, bool) for row in value):
                raise ValueError(f"{field.name} must be six truth values, not {value!r}")
        self.rule()

    def with_(self, **changes: object) -> Settings:
        """A copy with the changes; ValueError where a name or a value is wrong."""
        known = {field.name for field in fields(self)}
        for name in changes:
            if name not in known:
                raise ValueError(f"there is no setting '{name}'; there are {', '.join(sorted(known))}")
        return replace(self, **changes)  # type: ignore[arg-type]

    def rule(self, rate: float = 1000.0) -> methods.NamedMethod:
        """The method at a servo's rate [Hz]. The page asks at each frame, so a cache keeps the last methods."""
        return _rule(self.method, self.gamma, self.singular_gain, self.singular_posture, rate)

    def servo(self, chain: sk.Chain, dt: float, posture: ArrayLike) -> sk.Servo:
        """A servo with these settings, not started."""
        return sk.Servo(
            chain,
            self.rule(1.0 / dt).method,
            dt=dt,
            gain_linear=self.gain_linear,
            gain_angular=self.gain_angular,
            max_linear_error=self.max_linear_error,
            max_angular_error=self.max_angular_error,
            posture=posture,
            posture_gain=self.posture_gain,
            position_limits=self.limits,
            velocity_limits=self.limits,
            acceleration_limits=self.limits,
            jerk_limits=self.limits,
            assumed_acceleration=self.assumed_acceleration,
            on_limit=self.on_limit,
            length_scale=self.length_scale,
            mask=self.mask,
            frame=self.frame,
            guided=self.guided,
        )


@functools.lru_cache(maxsize=64)
def _rule(method: str, gamma: float, gain: float, posture: bool, rate: float) -> methods.NamedMethod:
    defaults = {
        "gamma": gamma,
        "gain_linear": gain,
        "gain_angular": gain,
        "singular_posture": posture,
        # Buss and Kim allow a joint to turn by 45° in an update, whatever the rate of the updates is.
        "max_speed": math.pi / 4.0 * rate,
    }
    return methods.parse_named(method, defaults)
