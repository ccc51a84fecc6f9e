"""Options that several commands share, each declared and read in one place."""

from __future__ import annotations

import argparse
import math
import pathlib
from collections.abc import Iterable, Sequence

import numpy as np

import sigmaik as sk
from sigmaik._types import Array

__all__ = [
    "add_arm",
    "add_arm_argument",
    "add_arms",
    "add_methods",
    "add_output",
    "choices",
    "configuration",
    "methods_epilog",
    "numbers",
    "open_arm",
    "open_arms",
]

_ROBOT = "a shipped arm or a URDF file"


# --- the arm


def add_arm(parser: argparse._ActionsContainer, default: str = "ufactory_xarm7", only: str = "") -> None:
    """The options --robot, --base and --tip, for `open_arm`.

    only: why the command takes the default arm and no other
    """
    text = f"{default}, and no other: {only}" if only else f"{_ROBOT} (%(default)s)"
    parser.add_argument("--robot", default=default, metavar="ARM_OR_URDF", help=text)
    _add_links(parser)
    parser.set_defaults(only_arm=(default, only) if only else None)


def add_arms(parser: argparse._ActionsContainer, default: str, text: str = "") -> None:
    """The options of `add_arm` for `open_arms`: --robot takes a comma list."""
    parser.add_argument(
        "--robot", default=default, metavar="LIST", help=f"shipped arms or URDF files{text} (%(default)s)"
    )
    _add_links(parser)


def add_arm_argument(parser: argparse._ActionsContainer) -> None:
    """The options of `add_arm` for `open_arm`, with the arm as an argument and not an option."""
    parser.add_argument("robot", metavar="ARM_OR_URDF", help=_ROBOT)
    _add_links(parser)


def _add_links(parser: argparse._ActionsContainer) -> None:
    parser.add_argument("--base", help="base link (the URDF's root)")
    parser.add_argument("--tip", help="tip link (the URDF's only leaf)")


def open_arm(args: argparse.Namespace) -> sk.robots.Arm:
    """The arm of `add_arm`. ValueError where no arm has this name, or where the command takes another arm only."""
    only = getattr(args, "only_arm", None)
    if only is not None and (args.robot, args.base, args.tip) != (only[0], None, None):
        raise ValueError(f"--robot is {only[0]} here, from its root to its flange: {only[1]}")
    return sk.robots.open(args.robot, args.base, args.tip)


def open_arms(args: argparse.Namespace, every: Iterable[str] = ()) -> list[sk.robots.Arm]:
    """The arms of `add_arms`. every: the arms that "all" stands for. ValueError where no arm has one of the names."""
    listed = list(every) if args.robot == "all" else args.robot.split(",")
    return [sk.robots.open(robot, args.base, args.tip) for robot in listed]


# --- what is written


def add_output(
    parser: argparse.ArgumentParser,
    folder: str,
    formats: Sequence[str] = (),
    default: str | None = None,
    plots: bool = True,
) -> None:
    """The options --out, --format and --no-plot, for `output.show`.

    folder: default of --out
    formats: of time series, where the study has any; "none" is one more format. default: the first format
    plots: whether there are pictures
    """
    out = parser.add_argument_group("what is written")
    out.add_argument("--out", default=folder, type=pathlib.Path, metavar="DIR", help="(%(default)s)")
    if formats:
        out.add_argument(
            "--format", choices=(*formats, "none"), default=default or formats[0], help="of time series (%(default)s)"
        )
    if plots:
        out.add_argument("--no-plot", action="store_true", help="no pictures, and no need of matplotlib")
        out.add_argument("--no-plots", dest="no_plot", action="store_true", help=argparse.SUPPRESS)


# --- methods


def add_methods(parser: argparse._ActionsContainer) -> None:
    """The option --method, which may be repeated: a list of texts for `methods.parse_methods`."""
    parser.add_argument(
        "--method",
        action="append",
        metavar="NAME[:PARAMETER=VALUE,…]",
        help="may be repeated; a comma list, or all (all)",
    )


def methods_epilog() -> str:
    """Names of all methods, for a command's help."""
    return (
        "methods: "
        + "; ".join(f"{name} ({title})" for name, title in sk.methods.TITLES.items())
        + ". Parameters follow a colon: dls:damping=0.8, jparse:gain=2,continuous=false."
    )


# --- values


def configuration(option: str, text: str, chain: sk.Chain, home: Array) -> Array:
    """Joint positions (n,) of "home", "zero" or a comma list. ValueError where there are too many or too few."""
    if text == "home":
        return home
    if text == "zero":
        return np.zeros(chain.dof)
    values = numbers(option, text)
    if len(values) != chain.dof:
        raise ValueError(f"{option} has {len(values)} values, but the arm has {chain.dof} joints")
    return np.array(values)


def numbers(option: str, text: str) -> list[float]:
    """A comma list of finite numbers. ValueError where an entry is no finite number."""
    values = []
    for part in text.split(","):
        try:
            value = float(part)
        except ValueError:
            value = math.nan
        if not math.isfinite(value):
            raise ValueError(f"{option} is a comma list of numbers; '{part.strip()}' is none")
        values.append(value)
    return values


def choices(what: str, text: str, known: Iterable[str]) -> list[str]:
    """A comma list of known names. ValueError where a name is not known."""
    chosen = text.split(",")
    for name in chosen:
        if name not in known:
            raise ValueError(f"no {what} '{name}'; there are {', '.join(known)}")
    return chosen
