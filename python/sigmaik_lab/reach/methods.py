"""Methods by short name (see sigmaik.methods), with an experiment's settings as their defaults."""

from __future__ import annotations

import math
from collections.abc import Iterable

import sigmaik as sk
from sigmaik.methods import ALL as ALL_METHODS
from sigmaik.methods import TITLES as SHORT_NAMES
from sigmaik.methods import NamedMethod, Value, parse_list, parse_named

from .settings import ReachSettings

__all__ = ["ALL_METHODS", "SHORT_NAMES", "NamedMethod", "parse_method", "parse_methods", "singular_gain_sweep"]


def _defaults(settings: ReachSettings | None) -> dict[str, Value]:
    s = settings or ReachSettings()
    return {
        "gamma": s.gamma,
        "gain_linear": s.singular_gain,
        "gain_angular": s.singular_gain,
        "adaptive": s.adaptive,
        "singular_posture": s.singular_posture,
        # Buss and Kim allow a joint to turn by 45° in an update, whatever the rate of the updates is.
        "max_speed": math.pi / 4.0 * s.rate,
    }


def parse_method(spec: str, settings: ReachSettings | None = None) -> NamedMethod:
    """One method from NAME or NAME:parameter=value,parameter=value, see sigmaik.methods.parse().

    Parameters that are not given come from the experiment's settings (γ, a threshold that is fixed as published, the
    gain in singular directions, the rate), then from the library.
    """
    return parse_named(spec, _defaults(settings))


def parse_methods(specs: Iterable[str], settings: ReachSettings | None = None) -> list[NamedMethod]:
    """Methods from several texts, see sigmaik.methods.parse_list()."""
    return parse_list(specs, _defaults(settings))


def singular_gain_sweep(gains: Iterable[float], gamma: float, continuous: bool = False) -> list[NamedMethod]:
    """J-PARSE at several gains in singular directions, as in figures 14 and 15 of the paper.

    Each gain is for position and orientation. The threshold is fixed; continuous=False is the published rule.
    """
    methods = []
    for gain in gains:
        method = sk.JParse(gamma=gamma, gain_linear=gain, gain_angular=gain, continuous=continuous, adaptive=False)
        methods.append(NamedMethod(f"jparse gain {gain:g}", "jparse", method))
    return methods
