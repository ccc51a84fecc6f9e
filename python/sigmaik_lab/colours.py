"""Colours of methods, the same in all figures."""

from __future__ import annotations

from collections.abc import Iterable

from sigmaik._plotting import DASHES
from sigmaik.methods import NamedMethod

__all__ = ["method_colour", "method_styles"]

# Okabe and Ito's colours, which most colour-blind people can tell apart. J-PARSE is the strong blue
# everywhere.
_COLOURS = {
    "jparse": "#0072B2",
    "pinv": "#D55E00",
    "dls": "#009E73",
    "adaptive-dls": "#7FBF3F",
    "sdls": "#CC79A7",
    "projection": "#E69F00",
    "safety": "#56B4E9",
    "safety-projection": "#7A5C3E",
}
_SWEEP = ("#9CC9E8", "#5BA7D6", "#2E86C1", "#1B5E9E", "#123A6B", "#081D40")


def method_colour(method: NamedMethod) -> str:
    """The colour of the method's family, the same in all figures."""
    return _COLOURS.get(method.family, "black")


def method_styles(methods: Iterable[NamedMethod]) -> dict[str, tuple[str, object]]:
    """Colour and dashes by label. A family has a colour; variants of a family differ in their dashes, and those of
    J-PARSE in their blue."""
    families: dict[str, list[str]] = {}
    for method in methods:
        variants = families.setdefault(method.family, [])
        if method.label not in variants:
            variants.append(method.label)
    styles: dict[str, tuple[str, object]] = {}
    for family, variants in families.items():
        for i, label in enumerate(variants):
            colour = _COLOURS.get(family, "black")
            dash: object = DASHES[i % len(DASHES)]
            if family == "jparse" and len(variants) > 2:
                colour, dash = _SWEEP[round(i * (len(_SWEEP) - 1) / (len(variants) - 1))], "-"
            styles[label] = (colour, dash)
    return styles
