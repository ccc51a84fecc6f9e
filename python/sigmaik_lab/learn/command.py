"""The command `sigmaik learn`, with a module of this folder for each of its tools."""

from __future__ import annotations

import argparse
import importlib

__all__ = ["TOOLS", "options", "run"]

#: Tools in the order in which they are used. The first line of a module's docstring is its line of help.
TOOLS = ("record", "train", "evaluate", "show", "export", "speed")


def options(parser: argparse.ArgumentParser) -> None:
    tools = parser.add_subparsers(metavar="TOOL", required=True)
    for name in TOOLS:
        module = importlib.import_module(f".{name}", __package__)
        line = str(module.__doc__).strip().partition("\n")[0].rstrip(".")
        tool = tools.add_parser(name, help=line[0].lower() + line[1:], description=line + ".")
        module.options(tool)
        tool.set_defaults(tool=module.run)


def run(args: argparse.Namespace) -> int:
    code: int = args.tool(args)
    return code
