"""The Monte Carlo study as a text table, beside the paper's."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence

from sigmaik_lab.report import Table

from .experiment import Mean, MonteCarlo, Summary
from .paper import PAPER

__all__ = ["study_table"]


def study_table(study: MonteCarlo, summaries: Sequence[Summary]) -> Table:
    """A line a metric, a column an objective; below it, dim, tables 3 to 5 of Beck et al. (2022) where they have the
    arm."""
    paper = PAPER.get(study.robot)
    table = Table("", "")
    table.add_numbers(*(s.objective for s in summaries))
    for label, key, text in _LINES:
        table.add_row(label, *(text(s) for s in summaries))
        if paper and key:
            table.add_row("  paper", *(_paper(paper[s.objective][key]) for s in summaries), style="dim")
    return table


def _pm(mean: Mean, scale: float = 1.0) -> str:
    return f"{_short(mean.mean * scale)} ± {_short(mean.deviation * scale)}"


def _short(value: float) -> str:
    if math.isnan(value):
        return "–"
    if value != 0.0 and abs(value) < 1e-3:
        return f"{value:.1e}"
    return f"{value:.3f}" if abs(value) < 1.0 else f"{value:.2f}" if abs(value) < 10.0 else f"{value:.1f}"


def _paper(values: tuple[float, ...]) -> str:
    return " ± ".join(_short(v) for v in values)


_LINES: tuple[tuple[str, str, Callable[[Summary], str]], ...] = (
    ("t_F s", "duration", lambda s: _pm(s.duration)),
    ("computing time ms", "solve_time", lambda s: _pm(s.solve_time, 1e3)),
    ("  median", "", lambda s: _short(1e3 * s.median_solve_time)),
    ("m_min (28)", "m_min", lambda s: _short(s.m_min)),
    ("  of each, median", "", lambda s: _short(s.m_min_median)),
    ("  between nodes too", "", lambda s: _short(s.m_dense)),
    ("    of each, median", "", lambda s: _short(s.m_dense_median)),
    ("    without must-cross", "", lambda s: _short(s.m_dense_free)),
    ("m_max (29)", "m_max", lambda s: _short(s.m_max)),
    ("m_avg (30)", "m_avg", lambda s: _pm(s.m_avg)),
    ("l_p m (31)", "l_p", lambda s: _pm(s.l_p)),
    ("l_quat (32)", "l_quat", lambda s: _pm(s.l_quat)),
    ("  angle rad", "", lambda s: _pm(s.angle)),
    ("must cross", "", lambda s: f"{100.0 * s.unavoidable:.1f} %"),
    ("cross and need not", "", lambda s: f"{100.0 * s.avoidable:.1f} %"),
    ("failed, unfinished", "", lambda s: f"{s.failed}, {s.unfinished} of {s.count}"),
)
