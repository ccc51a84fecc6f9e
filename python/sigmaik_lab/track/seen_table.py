"""What rendered cameras saw, and how the arm followed, as text tables."""

from __future__ import annotations

import math
from collections.abc import Sequence

from sigmaik_lab.report import Table, red

from .experiment import TrackExperiment
from .seen_summary import Lost, SeenSummary
from .stage import Stage

__all__ = ["lost_table", "seen_headline", "seen_table", "tag_table"]


def seen_headline(stage: Stage, e: TrackExperiment) -> str:
    lens, s = stage.lens, e.settings
    pixels = lens.focal_length * lens.tag / stage.away
    return (
        f"{e.robot}, {e.target}: {len(e.poses) / s.rate:.1f} s at {s.rate:g} Hz, "
        f"{100 * (1.0 - float(e.reachable.mean())):.0f} % of it out of reach, seed {s.seed}\n"
        f"at {100 * e.pace:.0f} % of its pace the target asks for {100 * e.asked_speed:.0f} % of the joints' speed\n"
        f"pictures: {lens.width} × {lens.height}, {lens.view:g}° high, {e.camera.rate:g} Hz, exposed for "
        f"{1e3 * lens.exposure:g} ms,\nsamples {1e3 * e.camera.delay:g} ms later; "
        f"the tag is {1e3 * lens.tag:g} mm wide, and {pixels:.0f} pixels at {stage.away:g} m from the camera "
        f"({stage.eye})"
    )


def tag_table(rows: Sequence[SeenSummary]) -> Table:
    """Pictures, and errors of the tag's pose as found."""
    table = Table("the tag in the pictures: errors of its pose [mm, °]", "")
    table.add_numbers(
        "pic-\ntures", "tag\nfound", "times\nlost", "long-\nest s", "place\nmean", "\n95 %", "turn\nmean",
        "\n95 %", "far\noff", "re-\nfused",
    )  # fmt: skip
    for row in rows:
        if row.pictures:
            table.add_row(
                _name(row, rows),
                str(row.pictures),
                f"{100.0 * row.found / row.pictures:.0f} %",
                str(row.lost),
                f"{row.longest:.2f}",
                *(_number(1e3 * x, 1) for x in (row.tag_position_mean, row.tag_position_95)),
                *(_number(math.degrees(x), 1) for x in (row.tag_rotation_mean, row.tag_rotation_95)),
                str(row.tag_wrong),
                str(row.refused),
            )
    return table


def seen_table(rows: Sequence[SeenSummary]) -> Table:
    """Errors of the tip with the tag in view and without. Red: broken limits."""
    table = Table("the tip: errors with the tag in view, out of reach, without the tag [mm, °]", "")
    table.add_numbers(
        "view\nmean", "\n95 %", "\nmax", "turn\nmean", "out-\nside", "no tag\nmean", "\nmax", "delay\nms",
        "jerk\nrms", "bro-\nken",
    )  # fmt: skip
    for row in rows:
        table.add_row(
            _name(row, rows),
            *(_number(1e3 * x, 1) for x in (row.seen_mean, row.seen_95, row.seen_max)),
            _number(math.degrees(row.seen_rotation), 1),
            *(_number(1e3 * x, 0) for x in (row.outside_mean, row.unseen_mean, row.unseen_max, row.delay)),
            f"{row.joint_jerk_rms:.0f}",
            red(str(row.broken), row.broken > 0),
        )
    return table


def lost_table(spans: Sequence[Lost]) -> Table:
    """When and why there was no tag, how far the tip was off, and when the tip was back."""
    table = Table("when the tag was lost", "", "why")
    table.add_numbers("from\ns", "to\ns", "pictures\n", "largest\nerror mm", "back\nafter s")
    for span in spans:
        table.add_row(
            _name(span, spans),
            span.reason,
            f"{span.begin:.2f}",
            f"{span.end:.2f}",
            str(span.pictures),
            f"{1e3 * span.largest_error:.0f}",
            _number(span.back, 2),
        )
    return table


def _name(row: SeenSummary | Lost, rows: Sequence[SeenSummary] | Sequence[Lost]) -> str:
    """The camera, and the rule where there are several."""
    return row.camera if len({other.method for other in rows}) == 1 else f"{row.camera}, {row.method}"


def _number(value: float, digits: int) -> str:
    return "–" if math.isnan(value) else f"{value:.{digits}f}"
