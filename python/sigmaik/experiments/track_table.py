"""Figures of the tracking experiment as tables for the terminal. Needs rich, `pip install 'sigmaik[demo]'`."""

from __future__ import annotations

import math
from collections.abc import Sequence

from rich import box
from rich.table import Table
from rich.text import Text

from .track import TrackExperiment, TrackSummary

__all__ = ["error_table", "event_table", "headline", "motion_table"]


def headline(e: TrackExperiment) -> str:
    c, s = e.camera, e.settings
    away = 1.0 - float(e.reachable.mean())
    gap = f", none for {e.gap[1] - e.gap[0]:g} s" if e.gap[1] > e.gap[0] else ""
    return (
        f"{e.robot}, {e.target}: {len(e.poses) / s.rate:g} s at {s.rate:g} Hz, {100 * away:.0f} % of it out of reach, seed {s.seed}\n"
        f"camera: {c.rate:g} Hz, {1e3 * c.delay:g} ms late, noise {1e3 * c.noise:g} mm and {1e3 * c.rotation_noise:g} mrad at "
        f"{1e3 * c.offset:g} mm,\n{100 * c.dropout:g} % missing, {100 * c.outliers:g} % wrong{gap}"
    )


def error_table(rows: Sequence[TrackSummary], title: str) -> Table:
    """Errors against the true target: mean, of 95 % of the time, largest; and the tip's delay."""
    table = _table(f"{title}: errors within reach (mm, °) and outside (mm), return and delay")
    for head in ("pos.\nmean", "\n95 %", "\nmax", "ori.\nmean", "\n95 %", "\nmax", "outside\nmean", "return\ns", "delay\nms"):
        table.add_column(head, justify="right", no_wrap=True)
    for row in rows:
        table.add_row(
            *_names(row),
            *(f"{1e3 * x:.1f}" for x in (row.position_mean, row.position_95, row.position_max)),
            *(f"{math.degrees(x):.2f}" for x in (row.orientation_mean, row.orientation_95, row.orientation_max)),
            _number(1e3 * row.outside_mean, 1),
            _number(row.return_time, 2),
            _number(1e3 * row.delay, 0),
        )
    return table


def motion_table(rows: Sequence[TrackSummary], title: str) -> Table:
    """Jerk of tip and joints, limits broken, and how near they came. Red: broken limits."""
    table = _table(f"{title}: jerk of the tip (m/s³) and the joints (rad/s³), and joint limits")
    for head in ("tip\nrms", "\nmax", "joint\nrms", "\nmax", "limits\nbroken", "speed\n%", "accel.\n%", "jerk\n%", "margin\nrad"):
        table.add_column(head, justify="right", no_wrap=True)
    for row in rows:
        table.add_row(
            *_names(row),
            *(f"{x:.0f}" for x in (row.tip_jerk_rms, row.tip_jerk_max, row.joint_jerk_rms, row.joint_jerk_max)),
            Text(str(row.broken), style="red" if row.broken else ""),
            *(_number(100.0 * x, 0) for x in (row.speed, row.acceleration, row.jerk)),
            f"{row.margin:.2f}",
        )
    return table


def event_table(rows: Sequence[TrackSummary]) -> Table:
    """What became of the samples, what wrong ones moved, and whether the arm holds while the stream stops."""
    table = _table("events: samples; the tip moved by wrong ones, and in the gap once it holds (mm)")
    for head in ("accepted", "refused", "wrong\nones came", "moved by\nwrong", "drift in\nthe gap"):
        table.add_column(head, justify="right", no_wrap=True)
    for row in rows:
        if row.mode == "true":
            continue
        moved, drift = _number(1e3 * row.moved_by_outliers, 1), _number(1e3 * row.drift, 2)
        table.add_row(*_names(row), str(row.accepted), str(row.refused), str(row.wrong), moved, drift)
    return table


def _table(title: str) -> Table:
    table = Table(
        title=title, title_justify="left", title_style="bold", box=box.SIMPLE_HEAD, padding=(0, 1, 0, 0), pad_edge=False
    )
    table.add_column("rule", no_wrap=True)
    table.add_column("mode", no_wrap=True)
    table.add_column("f.f.", no_wrap=True)
    return table


def _names(row: TrackSummary) -> tuple[str, str, str]:
    return row.method, row.mode, "yes" if row.feedforward else "no"


def _number(value: float, digits: int) -> str:
    return "–" if math.isnan(value) else f"{value:.{digits}f}"
