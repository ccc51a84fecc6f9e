"""Errors, motion and events of the variants, as text tables."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Literal

from sigmaik_lab.report import Table, red

from .experiment import TrackExperiment
from .summary import TrackSummary

__all__ = ["error_table", "event_table", "headline", "motion_table"]

By = Literal["method", "mode"]


def headline(e: TrackExperiment) -> str:
    c, s = e.camera, e.settings
    away = 1.0 - float(e.reachable.mean())
    gap = f", none for {e.gap[1] - e.gap[0]:g} s" if e.gap[1] > e.gap[0] else ""
    return (
        f"{e.robot}, {e.target}: {len(e.poses) / s.rate:g} s at {s.rate:g} Hz, {100 * away:.0f} % of it out of reach, "
        f"seed {s.seed}\n"
        f"at {100 * e.pace:.0f} % of its pace the target asks for {100 * e.asked_speed:.0f} % of the joints' speed\n"
        f"camera: {c.rate:g} Hz, {1e3 * c.delay:g} ms late, noise {1e3 * c.noise:g} mm and "
        f"{1e3 * c.rotation_noise:g} mrad at {1e3 * c.offset:g} mm,\n"
        f"{100 * c.dropout:g} % missing, {100 * c.outliers:g} % wrong{gap}; fed: the target's twist is fed forward"
    )


def error_table(rows: Sequence[TrackSummary], by: By) -> Table:
    """Errors against the true target: mean, 95 % quantile, largest; and the tip's delay."""
    table = _table(f"{_title(rows, by)}: errors within reach and outside [mm, °]")
    table.add_numbers(
        "pos.\nmean",
        "\n95 %",
        "\nmax",
        "ori.\nmean",
        "\n95 %",
        "\nmax",
        "out-\nside",
        "back\ns",
        "delay\nms",
    )
    for row in rows:
        table.add_row(
            _name(row, by),
            *(_number(1e3 * x, 1) for x in (row.position_mean, row.position_95, row.position_max)),
            *(_number(math.degrees(x), 1) for x in (row.orientation_mean, row.orientation_95, row.orientation_max)),
            _number(1e3 * row.outside_mean, 0),
            _number(row.return_time, 1),
            _number(1e3 * row.delay, 0),
        )
    return table


def motion_table(rows: Sequence[TrackSummary], by: By) -> Table:
    """Jerk of tip and joints, broken limits, the speed that the target asks for, and the largest parts of the limits.

    Red: broken limits.
    """
    table = _table(f"{_title(rows, by)}: jerk [m/s³, rad/s³], limits [%, rad]")
    table.add_numbers(
        "tip\nrms", "\nmax", "joint\nrms", "\nmax", "bro-\nken", "asked\n", "speed\n", "acc.\n", "jerk\n", "room\n"
    )
    for row in rows:
        table.add_row(
            _name(row, by),
            *(f"{x:.0f}" for x in (row.tip_jerk_rms, row.tip_jerk_max, row.joint_jerk_rms, row.joint_jerk_max)),
            red(str(row.broken), row.broken > 0),
            *(_number(100.0 * x, 0) for x in (row.asked_speed, row.speed, row.acceleration, row.jerk)),
            f"{row.margin:.2f}",
        )
    return table


def event_table(rows: Sequence[TrackSummary]) -> Table:
    """Samples accepted and refused, the effect of wrong samples on the tip, and its drift while the stream stops."""
    table = _table("events: samples, and how far the tip goes [mm]")
    table.add_numbers("accepted\n", "refused\n", "wrong\nones came", "moved\nby them", "drift while\nstopped")
    for row in rows:
        if row.mode == "true":
            continue
        moved, drift = _number(1e3 * row.moved_by_outliers, 1), _number(1e3 * row.drift, 2)
        table.add_row(_name(row, "mode"), str(row.accepted), str(row.refused), str(row.wrong), moved, drift)
    return table


def _table(title: str) -> Table:
    return Table(title, "")


def _title(rows: Sequence[TrackSummary], by: By) -> str:
    first = rows[0]
    return f"rules, {_name(first, 'mode')}" if by == "method" else f"modes, {first.method}"


def _name(row: TrackSummary, by: By) -> str:
    return row.method if by == "method" else row.mode + (", fed" if row.feedforward else "")


def _number(value: float, digits: int) -> str:
    return "–" if math.isnan(value) else f"{value:.{digits}f}"
