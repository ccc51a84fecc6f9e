"""Methods by short name, with parameters: "jparse", "dls:damping=0.8", "jparse:gain=2,continuous=false".

    sk.methods.ALL                          # ("jparse", "pinv", "dls", …)
    sk.methods.parse("jparse:gamma=0.2")    # JParse(gamma=0.2, …)

A method's name is accepted as it stands wherever a method is: `sk.Servo(arm, "dls:damping=0.8")`.
"""

from __future__ import annotations

import difflib
import math
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from typing import TypeAlias

from . import _core

__all__ = ["ALL", "TITLES", "Method", "NamedMethod", "parse", "parse_list", "parse_named"]

Method: TypeAlias = (
    _core.PseudoInverse
    | _core.DampedLeastSquares
    | _core.AdaptiveDampedLeastSquares
    | _core.SelectivelyDampedLeastSquares
    | _core.JParse
    | _core.JacobianProjection
    | _core.JacobianSafety
    | _core.JacobianSafetyProjection
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


_GAMMA: dict[str, Value] = {"gamma": 0.1}
_FAMILIES: dict[str, _Family] = {
    "jparse": _Family(
        "J-PARSE",
        _core.JParse,
        {"gamma": 0.1, "gain_linear": 1.0, "gain_angular": 1.0, "continuous": True, "singular_posture": False},
    ),
    "pinv": _Family("pseudo-inverse", _core.PseudoInverse, {"tolerance": 1e-12}),
    "dls": _Family("damped least squares", _core.DampedLeastSquares, {"damping": 0.1}),
    "adaptive-dls": _Family(
        "adaptive damped least squares",
        _core.AdaptiveDampedLeastSquares,
        {"rule": "numerical_filtering", "damping": 0.1, "threshold": 0.1, "relative": True},
    ),
    "sdls": _Family(
        "selectively damped least squares", _core.SelectivelyDampedLeastSquares, {"max_speed": math.pi / 4.0}
    ),
    "projection": _Family("ablation: projection", _core.JacobianProjection, _GAMMA),
    "safety": _Family("ablation: safety", _core.JacobianSafety, _GAMMA),
    "safety-projection": _Family("ablation: safety projection", _core.JacobianSafetyProjection, _GAMMA),
}

#: Short names of all methods. In lists of methods, "all" stands for them.
ALL: tuple[str, ...] = tuple(_FAMILIES)
#: Short name to what it stands for.
TITLES: dict[str, str] = {name: family.title for name, family in _FAMILIES.items()}


def parse(spec: str, defaults: Mapping[str, Value] | None = None) -> Method:
    """The method of NAME or NAME:parameter=value,parameter=value.

    Parameters that are not given come from `defaults`, where the method has a parameter of that name, then from the
    library. For jparse, gain=… sets gain_linear and gain_angular.

    Raises ValueError where a name, a parameter or a value is wrong, with those that there are.
    """
    name, _, arguments = spec.strip().partition(":")
    family = _FAMILIES.get(name)
    if family is None:
        near = difflib.get_close_matches(name, ALL, n=1)
        hint = f"; did you mean '{near[0]}'?" if near else ""
        raise ValueError(f"unknown method '{name}'; there are {', '.join(ALL)} and all{hint}")
    values = {key: value for key, value in (defaults or {}).items() if key in family.parameters}
    for item in filter(None, (part.strip() for part in arguments.split(","))):
        key, equals, text = (part.strip() for part in item.partition("="))
        if key == "gain" and equals and "gain_linear" in family.parameters:
            values["gain_linear"] = values["gain_angular"] = _value(name, key, text, 1.0)
            continue
        if key not in family.parameters or not equals:
            known = ", ".join(f"{k}={_show(v)}" for k, v in family.parameters.items())
            raise ValueError(f"method '{name}' has no parameter '{item}'; it has {known}")
        values[key] = _value(name, key, text, family.parameters[key])
    try:
        return family.make(**values)
    except ValueError as error:
        raise ValueError(f"method '{spec.strip()}': {error}") from None


def parse_named(spec: str, defaults: Mapping[str, Value] | None = None) -> NamedMethod:
    """Like parse(), with the name as it was written."""
    label = spec.strip()
    return NamedMethod(label, label.partition(":")[0], parse(label, defaults))


def parse_list(specs: Iterable[str], defaults: Mapping[str, Value] | None = None) -> list[NamedMethod]:
    """Methods from several texts, each one spec, a comma list of them, or "all". Doubles are dropped.

    A comma starts a new method where a method's name follows it, and a parameter otherwise:
    "jparse:gain_linear=2,gain_angular=2,dls:damping=0.8" is two methods.
    """
    found: dict[str, NamedMethod] = {}
    for text in specs:
        for spec in _split(text):
            for single in ALL if spec == "all" else (spec,):
                found.setdefault(single, parse_named(single, defaults))
    if not found:
        raise ValueError("no method given")
    return list(found.values())


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
