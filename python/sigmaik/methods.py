"""Methods by short name, with parameters: "jparse", "dls:damping=0.8", "jparse:gain=2,continuous=false".

    sk.methods.ALL                          # ("jparse", "pinv", "dls", …)
    sk.methods.parse("jparse:gamma=0.2")    # JParse(gamma=0.2, …)

A method's name is accepted wherever a method is accepted: `sk.Servo(arm, "dls:damping=0.8")`.
"""

from __future__ import annotations

import difflib
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import TypeAlias

from ._core import ArgumentError, Error, Method, rules

__all__ = ["ALL", "TITLES", "Method", "NamedMethod", "parse", "parse_list", "parse_named"]

Value: TypeAlias = float | bool | str | None


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


_CLASSES: dict[str, type[Method]] = {rule.short_name: rule for rule in rules()}
#: Short names of all methods. In lists of methods, "all" stands for them.
ALL: tuple[str, ...] = tuple(_CLASSES)
#: Short name to title.
TITLES: dict[str, str] = {name: rule.title for name, rule in _CLASSES.items()}


def parse(spec: str, defaults: Mapping[str, Value] | None = None) -> Method:
    """The method of NAME or NAME:parameter=value,parameter=value.

    Parameters that are not given come from `defaults`, where the method has a parameter of that name, then from the
    library. For jparse, gain=… sets gain_linear and gain_angular.

    Raises ArgumentError (an Error and a TypeError) where there is no such method, Error (a ValueError) where a
    parameter or a value is wrong; both texts list the valid names.
    """
    name, _, arguments = spec.strip().partition(":")
    if name not in _CLASSES:
        near = difflib.get_close_matches(name.lower(), ALL, n=1)
        hint = f"; did you mean '{near[0]}'?" if near else ""
        raise ArgumentError(f"unknown method '{name}'; there are {', '.join(ALL)}{hint}")
    own = _CLASSES[name]().parameters
    values = {key: value for key, value in (defaults or {}).items() if key in own}
    for item in filter(None, (part.strip() for part in arguments.split(","))):
        key, equals, text = (part.strip() for part in item.partition("="))
        if key == "gain" and equals and "gain_linear" in own:
            values["gain_linear"] = values["gain_angular"] = _value(name, key, text, 1.0)
            continue
        if key not in own or not equals:
            known = ", ".join(f"{k}={_show(v)}" for k, v in own.items())
            raise Error(f"method '{name}' has no parameter '{item}'; it has {known}")
        values[key] = _value(name, key, text, own[key])
    try:
        return _CLASSES[name](**values)
    except Error as error:
        raise Error(f"method '{spec.strip()}': {error}") from None


def parse_named(spec: str, defaults: Mapping[str, Value] | None = None) -> NamedMethod:
    """Like parse(), with the name as it was written."""
    label = spec.strip()
    return NamedMethod(label, label.partition(":")[0], parse(label, defaults))


def parse_list(specs: Iterable[str], defaults: Mapping[str, Value] | None = None) -> list[NamedMethod]:
    """Methods from several texts, each one spec, a comma list of specs, or "all". Duplicates are dropped.

    A comma starts a new method where a method's name follows it, and a parameter otherwise:
    "jparse:gain_linear=2,gain_angular=2,dls:damping=0.8" is two methods.
    """
    found: dict[str, NamedMethod] = {}
    for text in specs:
        for spec in _split(text):
            for single in ALL if spec == "all" else (spec,):
                found.setdefault(single, parse_named(single, defaults))
    if not found:
        raise Error("no method given")
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
            raise Error(f"method '{name}': {key} is true or false, not '{text}'")
        return known[text.lower()]
    if isinstance(default, str):
        return text
    if default is None and text.lower() == "none":
        return None
    try:
        return float(text)
    except ValueError:
        raise Error(f"method '{name}': {key} is a number, not '{text}'") from None


def _show(value: Value) -> str:
    return f"{value:g}" if isinstance(value, float) else str(value).lower()
