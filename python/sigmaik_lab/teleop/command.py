"""The command `sigmaik teleop`."""

from __future__ import annotations

import argparse
import pathlib
import webbrowser

from sigmaik._extras import need
from sigmaik.teleop.devices import DEVICES
from sigmaik_lab.options import add_arm
from sigmaik_lab.output import say
from sigmaik_lab.runner import parsed, run_study
from sigmaik_lab.signals import signals_interrupt

__all__ = ["options", "run"]


def options(parser: argparse.ArgumentParser) -> None:
    arm = parser.add_argument_group("the arm")
    add_arm(arm)
    arm.add_argument(
        "--acceleration",
        type=float,
        default=10.0,
        metavar="RAD/S²",
        help="assumed limit of joints that have none (%(default)g)",
    )
    loop = parser.add_argument_group("the servo")
    loop.add_argument("--rate", type=float, default=1000.0, metavar="HZ", help="(%(default)g)")
    loop.add_argument("--method", default="jparse", metavar="NAME[:PARAMETER=VALUE,…]", help="(%(default)s)")
    loop.add_argument("--gamma", type=float, default=0.1, metavar="Γ", help="threshold on σ/σ_max (%(default)g)")
    loop.add_argument(
        "--length-scale", type=float, metavar="M", help="1 rad weighs as much as this length (the arm's own)"
    )
    page = parser.add_argument_group("the page")
    page.add_argument(
        "--host",
        default="127.0.0.1",
        help="address to listen on (%(default)s: this machine only); anyone who has the printed address can drive",
    )
    page.add_argument("--port", type=int, default=8080, help="(%(default)s; 0: a free one)")
    page.add_argument(
        "--name", action="append", default=[], metavar="HOST", help="a further name under which browsers reach the page"
    )
    page.add_argument(
        "--package",
        action="append",
        default=[],
        metavar="NAME=DIR",
        help="a ROS package that the URDF's meshes may come from (besides the URDF's own folder and package)",
    )
    page.add_argument("--open", action="store_true", help="open the page in the default browser")
    page.add_argument("--device", choices=tuple(DEVICES), help="drives the arm while its dead man's button is held")
    page.add_argument(
        "--browser-timeout",
        type=float,
        default=2.0,
        metavar="S",
        help="the arm stops after this time without an answer from the browser (%(default)g)",
    )
    page.add_argument("--for", dest="seconds", type=float, metavar="S", help="end after this time (never)")
    out = parser.add_argument_group("recordings")
    out.add_argument("--out", default="episodes", type=pathlib.Path, metavar="DIR", help="(%(default)s)")
    out.add_argument("--replay", type=pathlib.Path, metavar="FILE", help="show this recording (npz) first")
    parser.add_argument(
        "--drill",
        action="store_true",
        help="no page: five arms through their singularities by every method, and figures of the recordings",
    )


def run(args: argparse.Namespace) -> int:
    if args.drill:
        return run_study("drill", parsed("drill", []))
    need("viser", "yourdfpy")
    from sigmaik.teleop import Episode, Session, Settings
    from sigmaik.teleop.page import Page

    if not 0 <= args.port <= 65535:
        raise ValueError(f"--port must be from 0 to 65535, not {args.port}")
    if args.seconds is not None and not 0.0 < args.seconds < 1e9:
        raise ValueError(f"--for must be above 0, not {args.seconds:g}")
    settings = Settings(
        method=args.method,
        gamma=args.gamma,
        length_scale=args.length_scale,
        assumed_acceleration=args.acceleration,
    )
    packages = dict(_package(text) for text in args.package)
    replay = None if args.replay is None else Episode.load(args.replay)
    session = Session(
        args.robot,
        base=args.base,
        tip=args.tip,
        settings=settings,
        rate=args.rate,
        pose_timeout=args.browser_timeout,
    )
    with signals_interrupt(), session:
        page = Page(session, args.host, args.port, args.out, packages=packages, names=tuple(args.name))
        try:
            if args.device is not None:
                say(f"driving by {page.open_device(args.device)}")
            if replay is not None:
                page.replay(replay, args.replay.name)
            say(f"{page.url}  drives {session.name}; Ctrl-C ends it")
            if args.host not in ("127.0.0.1", "localhost", "::1"):
                say(f"everybody who knows this address and reaches {args.host} can drive it")
            if args.open:
                webbrowser.open(page.url)
            page.wait(args.seconds)
        finally:
            page.close()
    statistics = session.statistics
    say(f"{statistics.cycles} cycles at {statistics.rate:.0f} of {session.rate:.0f} Hz, {statistics.missed} left out")
    return 0


def _package(text: str) -> tuple[str, pathlib.Path]:
    name, equals, folder = text.partition("=")
    if not (name and equals and folder):
        raise ValueError(f"--package must be NAME=DIR, not '{text}'")
    return name, pathlib.Path(folder)
