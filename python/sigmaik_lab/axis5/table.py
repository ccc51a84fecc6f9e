"""Tracks compared, as text tables."""

from __future__ import annotations

import math
from collections.abc import Sequence

from sigmaik_lab.report import Table, red

from .experiment import ROBOT, VARIANTS, Axis5Settings, Motion
from .summary import Summary

__all__ = ["headline", "smoothness_table", "summary_table"]


def headline(motion: Motion, settings: Axis5Settings) -> str:
    """The motion and the settings, in a few lines."""
    way = "there and back, close by" if motion.back else "straight across"
    cap = settings.max_error
    most = "any" if cap is None or math.isinf(cap) else f"at most {math.degrees(cap):g}° about each axis"
    return (
        f"{ROBOT}, example {motion.example}: {way} the axis-5 singularity\n"
        f"{motion.distance:g} m in {motion.duration:g} s, axis 5 {math.degrees(motion.offset):g}° from zero, "
        f"dt = {1e3 * settings.dt:g} ms,\nβ = {settings.error_rate_weight:.3g}, "
        f"γ = {settings.time_scaling_weight:.3g}, orientation error {most}"
    )


def summary_table(rows: Sequence[Summary]) -> Table:
    """Limits and errors: a line per variant, for 80 characters. Figures beyond a limit are red."""
    heads = ("\ntime\ns", "top\nspeed\n/limit", "top\naccel.\n/limit", "be-\nyond\nlimits")
    table = _table((*heads, "pos.\nerror\nµm", "ori.\nerror\n°", "top\nϑ\n"))
    for row in rows:
        speed, acceleration = max(row.speed_ratio), max(row.acceleration_ratio)
        beyond = row.speed_beyond + row.acceleration_beyond
        table.add_row(
            VARIANTS[row.variant],
            f"{row.duration:.2f}" if row.finished else "stuck",
            red(_ratio(speed), row.speed_beyond > 0),
            red(_ratio(acceleration), row.acceleration_beyond > 0),
            red(str(beyond), beyond > 0),
            f"{1e6 * row.max_position_error:.3f}",
            f"{math.degrees(row.max_orientation_error):.3f}",
            f"{row.max_time_scale:.2f}",
        )
    return table


def smoothness_table(rows: Sequence[Summary]) -> Table:
    """Switching, and how smooth axis 4 is: a line per variant, for 80 characters."""
    heads = ("opti-\nmised\n%", "swit-\nches\n", "\nfirst\ns", "\nlast\ns")
    table = _table((*heads, "axis 4:\nrever-\nsals", "speed\nvaries\nrad/s", "rms\njerk\nrad/s³"))
    for row in rows:
        table.add_row(
            VARIANTS[row.variant],
            f"{100.0 * row.optimised:.1f}",
            str(row.switches),
            *("–" if math.isnan(t) else f"{t:.3f}" for t in (row.first_switch, row.last_switch)),
            str(row.reversals[3]),
            f"{row.speed_variation[3]:.1f}",
            f"{row.rms_jerk[3]:.0f}" if row.rms_jerk[3] < 99999.5 else f"{row.rms_jerk[3]:.1e}",
        )
    return table


def _table(heads: Sequence[str]) -> Table:
    table = Table("", "variant")
    table.add_numbers(*heads)
    return table


def _ratio(value: float) -> str:
    return f"{value:.3f}" if value < 9.9995 else f"{value:.1f}"
