"""Methods by short name, with parameters: "jparse", "dls:damping=0.8", "jparse:gain=2,continuous=false"."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from typing import TypeAlias

import sigmaik as sk

from .settings import Settings

__all__ = [
    "ALL_METHODS",
    "SHORT_NAMES",
    "Method",
    "NamedMethod",
    "parse_method",
    "parse_methods",
    "singular_gain_sweep",
]

Method: TypeAlias = (
    sk.PseudoInverse
    | sk.DampedLeastSquares
    | sk.AdaptiveDampedLeastSquares
    | sk.SelectivelyDampedLeastSquares
    | sk.JParse
    | sk.JacobianProjection
    | sk.JacobianSafety
    | sk.JacobianSafetyProjection
)
Value: TypeAlias = float | bool | str


@dataclass(frozen=True)
class NamedMethod:
    """A method with the name it has in tables, file names and legends."""

    label: str  #: as the user wrote it: "dls:damping=0.8"
    family: str  #: short name: "dls"
    method: Method

    @property
    def file_name(self) -> str:
        """The label without characters that trouble file systems."""
        return "".join(c if c.isalnum() or c in "-_." else "_" for c in self.label)


@dataclass(frozen=True)
class _Family:
    title: str
    make: Callable[..., Method]
    parameters: Mapping[str, Value]  #: name to the library's default, which also fixes the type
    settings: Callable[[Settings], Mapping[str, Value]]  #: defaults that an experiment's settings override


def _gamma(settings: Settings) -> dict[str, Value]:
    return {"gamma": settings.gamma}


def _jparse(settings: Settings) -> dict[str, Value]:
    gain = settings.singular_gain
    return {
        "gamma": settings.gamma,
        "gain_linear": gain,
        "gain_angular": gain,
        "singular_posture": settings.singular_posture,
    }


# Buss and Kim let a joint turn by 45° an update, whatever the update's rate.
def _sdls(settings: Settings) -> dict[str, Value]:
    return {"max_speed": math.pi / 4.0 * settings.rate}


def _none(_: Settings) -> dict[str, Value]:
    return {}


_GAMMA: dict[str, Value] = {"gamma": 0.1}
_FAMILIES: dict[str, _Family] = {
    "jparse": _Family(
        "J-PARSE",
        sk.JParse,
        {"gamma": 0.1, "gain_linear": 1.0, "gain_angular": 1.0, "continuous": True, "singular_posture": False},
        _jparse,
    ),
    "pinv": _Family("pseudo-inverse", sk.PseudoInverse, {"tolerance": 1e-12}, _none),
    "dls": _Family("damped least squares", sk.DampedLeastSquares, {"damping": 0.1}, _none),
    "adaptive-dls": _Family(
        "adaptive damped least squares",
        sk.AdaptiveDampedLeastSquares,
        {"rule": "numerical_filtering", "damping": 0.1, "threshold": 0.1, "relative": True},
        _none,
    ),
    "sdls": _Family(
        "selectively damped least squares",
        sk.SelectivelyDampedLeastSquares,
        {"max_speed": math.pi / 4.0},
        _sdls,
    ),
    "projection": _Family("ablation: projection", sk.JacobianProjection, _GAMMA, _gamma),
    "safety": _Family("ablation: safety", sk.JacobianSafety, _GAMMA, _gamma),
    "safety-projection": _Family("ablation: safety projection", sk.JacobianSafetyProjection, _GAMMA, _gamma),
}

#: Short name to what it stands for.
SHORT_NAMES: dict[str, str] = {name: family.title for name, family in _FAMILIES.items()}
#: What "all" stands for.
ALL_METHODS: tuple[str, ...] = tuple(_FAMILIES)


def parse_method(spec: str, settings: Settings | None = None) -> NamedMethod:
    """One method from NAME or NAME:parameter=value,parameter=value.

    Parameters that are not given come from the experiment's settings (γ, the gain in singular directions),
    then from the library. For jparse, gain=… sets gain_linear and gain_angular. ValueError where a name, a
    parameter or a value is wrong; it says what there is.
    """
    name, _, arguments = spec.strip().partition(":")
    family = _FAMILIES.get(name)
    if family is None:
        raise ValueError(f"unknown method '{name}'; there are {', '.join(_FAMILIES)} and all")
    values: dict[str, Value] = dict(family.settings(settings or Settings()))
    for item in filter(None, (part.strip() for part in arguments.split(","))):
        key, equals, text = (part.strip() for part in item.partition("="))
        if key == "gain" and equals and family.make is sk.JParse:
            values["gain_linear"] = values["gain_angular"] = _value(name, key, text, 1.0)
            continue
        if key not in family.parameters or not equals:
            known = ", ".join(f"{k}={_show(v)}" for k, v in family.parameters.items())
            raise ValueError(f"method '{name}' has no parameter '{item}'; it has {known}")
        values[key] = _value(name, key, text, family.parameters[key])
    try:
        method = family.make(**values)
    except ValueError as error:
        raise ValueError(f"method '{spec.strip()}': {error}") from None
    return NamedMethod(spec.strip(), name, method)


def parse_methods(specs: Iterable[str], settings: Settings | None = None) -> list[NamedMethod]:
    """Methods from several texts, each one spec, a comma list of them, or "all". Doubles are dropped.

    A comma starts a new method where a method's name follows it, and a parameter otherwise:
    "jparse:gain_linear=2,gain_angular=2,dls:damping=0.8" is two methods.
    """
    found: dict[str, NamedMethod] = {}
    for text in specs:
        for spec in _split(text):
            for single in ALL_METHODS if spec == "all" else (spec,):
                found.setdefault(single, parse_method(single, settings))
    if not found:
        raise ValueError("no method given")
    return list(found.values())


def singular_gain_sweep(gains: Iterable[float], gamma: float, continuous: bool = False) -> list[NamedMethod]:
    """J-PARSE at several gains in singular directions, as in figures 14 and 15 of the paper.

    Each gain is for position and orientation. continuous=False is the published rule.
    """
    methods = []
    for gain in gains:
        method = sk.JParse(gamma=gamma, gain_linear=gain, gain_angular=gain, continuous=continuous)
        methods.append(NamedMethod(f"jparse gain {gain:g}", "jparse", method))
    return methods


def _split(text: str) -> list[str]:
    specs: list[str] = []
    for part in text.split(","):
        name = part.partition(":")[0].strip()
        if specs and "=" in name and ":" in specs[-1]:
            specs[-1] += "," + part.strip()
        elif part.strip():
            specs.append(part.strip())
    return specs


def _value(name: str, key: str, text: str, default: Value) -> Value:
    if isinstance(default, bool):
        known = {"true": True, "yes": True, "1": True, "false": False, "no": False, "0": False}
        if text.lower() not in known:
            raise ValueError(f"method '{name}': {key} is true or false, not '{text}'")
        return known[text.lower()]
    if isinstance(default, str):
        return text
    try:
        return float(text)
    except ValueError:
        raise ValueError(f"method '{name}': {key} is a number, not '{text}'") from None


def _show(value: Value) -> str:
    return str(value).lower() if isinstance(value, bool) else f"{value:g}" if isinstance(value, float) else value
