"""The command `sigmaik teleop`."""

from __future__ import annotations

import argparse
import pathlib
import webbrowser
from typing import TYPE_CHECKING

from ._extras import need
from .console import add_arm, terminal

if TYPE_CHECKING:
    from rich.console import Console

__all__ = ["add_teleop"]


def add_teleop(parser: argparse.ArgumentParser) -> None:
    from .teleop.devices import DEVICES
    from .teleop.session import ACCELERATION

    parser.description = (
        "Drives a simulated arm from a page in the browser: drag the gizmo, hold a button, tap a key, or use a gamepad "
        "or a SpaceMouse. The servo runs in a thread of its own; rule, gains, limits and task change under way; every "
        "cycle can be recorded. The arm stops when the browser that drives it is gone."
    )
    arm = parser.add_argument_group("the arm")
    add_arm(arm)
    arm.add_argument(
        "--acceleration",
        type=float,
        default=ACCELERATION,
        metavar="RAD/S²",
        help="limit of joints that have none (%(default)g)",
    )
    loop = parser.add_argument_group("the servo")
    loop.add_argument("--rate", type=float, default=1000.0, metavar="HZ", help="(%(default)g)")
    loop.add_argument("--method", default="jparse", metavar="NAME[:PARAMETER=VALUE,…]", help="(%(default)s)")
    loop.add_argument("--gamma", type=float, default=0.1, metavar="Γ", help="threshold on σ/σ_max (%(default)g)")
    loop.add_argument("--length-scale", type=float, default=1.0, metavar="M", help="1 rad weighs as much (%(default)g)")
    page = parser.add_argument_group("the page")
    page.add_argument(
        "--host",
        default="127.0.0.1",
        help="address to listen on (%(default)s: this machine only); who reaches it can drive the arm",
    )
    page.add_argument("--port", type=int, default=8080, help="(%(default)s)")
    page.add_argument("--open", action="store_true", help="open it in the default browser")
    page.add_argument("--device", choices=tuple(DEVICES), help="drive by it, too; the dead man's button must be held")
    page.add_argument(
        "--browser-timeout",
        type=float,
        default=2.0,
        metavar="S",
        help="without an answer from the browser for so long, the arm stops (%(default)g)",
    )
    page.add_argument("--for", dest="seconds", type=float, metavar="S", help="end by itself (never)")
    out = parser.add_argument_group("recordings")
    out.add_argument("--out", default="episodes", type=pathlib.Path, metavar="DIR", help="(%(default)s)")
    out.add_argument("--no-parquet", action="store_true", help="npz files only")
    out.add_argument("--replay", type=pathlib.Path, metavar="FILE", help="show this recording (npz) first")
    parser.add_argument(
        "--drill",
        action="store_true",
        help="no page: five arms through their singularities by every method, and what the recordings say",
    )
    parser.set_defaults(run=_teleop)


def _teleop(arguments: argparse.Namespace) -> int:
    console = terminal()
    if arguments.drill:
        return _drill(console)
    need("viser", "yourdfpy")
    from .teleop import Episode, Session, Settings
    from .teleop.page import Page

    if not 0 <= arguments.port <= 65535:
        raise ValueError(f"--port must be from 0 to 65535, not {arguments.port}")
    if arguments.seconds is not None and not 0.0 < arguments.seconds < 1e9:
        raise ValueError(f"--for must be above 0, not {arguments.seconds:g}")
    settings = Settings(method=arguments.method, gamma=arguments.gamma, length_scale=arguments.length_scale)
    replay = None if arguments.replay is None else Episode.load(arguments.replay)
    session = Session(
        arguments.robot,
        base=arguments.base,
        tip=arguments.tip,
        settings=settings,
        rate=arguments.rate,
        acceleration=arguments.acceleration,
        pose_timeout=arguments.browser_timeout,
    )
    with session:
        page = Page(session, arguments.host, arguments.port, arguments.out, not arguments.no_parquet)
        try:
            if arguments.device is not None:
                console.print(f"driving by {page.open_device(arguments.device)}", highlight=False)
            if replay is not None:
                page.replay(replay, arguments.replay.name)
            console.print(f"{page.url}  drives {session.name}; Ctrl-C ends it", highlight=False)
            if arguments.host not in ("127.0.0.1", "localhost", "::1"):
                console.print(f"everybody who reaches {arguments.host} can drive it", highlight=False)
            if arguments.open:
                webbrowser.open(page.url)
            page.wait(arguments.seconds)
        finally:
            page.close()
    statistics = session.statistics
    console.print(
        f"{statistics.cycles} cycles at {statistics.rate:.0f} of {session.rate:.0f} Hz, {statistics.missed} left out",
        highlight=False,
    )
    return 0


def _drill(console: Console) -> int:
    from rich import box
    from rich.progress import Progress
    from rich.table import Table

    from .teleop.drill import drill

    with Progress(console=console, transient=True, disable=not console.is_terminal) as bar:
        task = bar.add_task("driving", total=1.0)
        rows = drill(progress=lambda part: bar.update(task, completed=part))
    table = Table(box=box.SIMPLE_HEAD, pad_edge=False, padding=(0, 1, 0, 0))
    for head in ("arm", "method"):
        table.add_column(head, no_wrap=True)
    for head in ("cycles", "min σ₆/σ₁", "speed", "broken", "error"):
        table.add_column(head, justify="right")
    robot = ""
    for row in rows:
        table.add_row(
            row.robot if row.robot != robot else "",
            row.method,
            str(row.cycles),
            f"{row.smallest_ratio:.2e}",
            f"{row.largest_speed:.3f}",
            str(row.broken),
            f"{1e3 * row.error:.1f} mm",
        )
        robot = row.robot
    console.print(table)
    broken = sum(row.broken for row in rows)
    console.print(
        f"speed: the largest, of its limit. broken: joints times cycles beyond a limit of\n"
        f"position, velocity or acceleration. error: from home, at the end.\n"
        f"{sum(row.cycles for row in rows)} cycles, {broken} limits broken",
        highlight=False,
    )
    return 0
