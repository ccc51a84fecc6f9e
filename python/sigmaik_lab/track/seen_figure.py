"""The picture of the runs before rendered cameras. Needs matplotlib."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib.figure import Figure

from sigmaik._plotting import empty_figure

from .seen_summary import losses
from .stage import Still

if TYPE_CHECKING:
    from .lens import Lens
    from .rendered import Seen

__all__ = ["seen_figure"]

_CAMERAS = {"wrist": "#0072B2", "fixed": "#009E73", "statistical": "#E69F00", "known": "#000000"}
_SHOWN = 5


def seen_figure(lens: Lens, runs: Sequence[Seen]) -> Figure:
    """Pictures of the first run, errors of the tip and of the tag over time.

    Grey: the target is out of reach. Coloured at the upper edge: that camera does not see the tag.
    """
    e = runs[0].run.experiment
    figure = empty_figure(10.0, 8.0)
    rows: Any = figure.subfigures(3, 1, height_ratios=(2.7, 2.6, 2.4))
    figure.suptitle(f"{e.robot}, {e.target}: a tag in rendered pictures ({runs[0].camera})", fontweight="bold")
    panels: Any = rows[0].subplots(2, _SHOWN)
    for column, still in enumerate(_moments(runs[0])):
        for panel, picture in zip(panels[:, column], (still.picture, still.outside), strict=True):
            panel.imshow(picture)
            panel.set_xticks([])
            panel.set_yticks([])
        if still.corners is not None:
            around = np.concatenate([still.corners, still.corners[:1]])
            panels[0, column].plot(around[:, 0], around[:, 1], color="#33DD33", linewidth=1.5)
        panels[0, column].set_title(f"{still.stamp:.1f} s{'' if still.corners is not None else ', no tag'}", fontsize=9)
        panels[0, column].set_xlim(-0.5, lens.width - 0.5)
        panels[0, column].set_ylim(lens.height - 0.5, -0.5)
    panel = rows[1].subplots()
    for i, seen in enumerate(runs):
        if seen.run.variant.method != runs[0].run.variant.method:
            continue
        panel.plot(
            e.t, 1e3 * seen.run.position_error, color=_CAMERAS[seen.camera], linewidth=1.6 if i == 0 else 1.0,
            zorder=3 if i == 0 else 2, label=seen.camera,
        )  # fmt: skip
        for span in losses(seen.camera, seen.run, seen.looks):
            panel.axvspan(span.begin, span.end, 0.96 - 0.03 * i, 0.985 - 0.03 * i, color=_CAMERAS[seen.camera])
    _grey(panel, runs[0])
    panel.set_ylabel("tip to target [mm]")
    panel.set_ylim(bottom=0.0)
    panel.legend(frameon=False, fontsize=9, ncols=4, loc="center left")
    lower: Any = rows[2].subplots(2, 1, sharex=True)
    for seen in runs:
        if not seen.looks or seen.run.variant.method != runs[0].run.variant.method:
            continue
        stamp = np.array([look.stamp for look in seen.looks])
        linear, angular = (
            np.array([getattr(x, name) for x in seen.looks]) for name in ("position_error", "rotation_error")
        )
        for axis, values in zip(lower, (1e3 * linear, np.degrees(angular)), strict=True):
            axis.plot(stamp, np.maximum(values, 1e-2), ".", color=_CAMERAS[seen.camera], markersize=3.0)
    for axis, text in zip(lower, ("tag: place [mm]", "tag: turn [°]"), strict=True):
        axis.set_yscale("log")
        axis.set_ylabel(text, fontsize=9)
        _grey(axis, runs[0])
    lower[1].set_xlabel("time [s]")
    for axis in (panel, *lower):
        axis.set_xlim(0.0, e.t[-1])
        axis.grid(alpha=0.25)
    return figure


def _moments(seen: Seen) -> list[Still]:
    """Pictures that show the most: the first, one of each of the longest losses, and the farthest target."""
    e, stills = seen.run.experiment, seen.stills
    times = [stills[0].stamp]
    spans = sorted(losses(seen.camera, seen.run, seen.looks), key=lambda x: x.begin - x.end)[: _SHOWN - 2]
    times += [0.5 * (span.begin + span.end) for span in spans]
    out = np.flatnonzero(~e.reachable)
    if len(out):
        times.append(float(e.t[out[len(out) // 2]]))
    spare = iter(np.linspace(0.2, 1.0, _SHOWN) * e.t[-1])
    while len(times) < _SHOWN:
        times.append(float(next(spare)))
    return [min(stills, key=lambda still: abs(still.stamp - time)) for time in sorted(times)]


def _grey(panel: Any, seen: Seen) -> None:
    e = seen.run.experiment
    edges = np.flatnonzero(np.diff(np.concatenate([[0], ~e.reachable, [0]]).astype(int)))
    for begin, end in edges.reshape(-1, 2):
        panel.axvspan(begin / e.settings.rate, end / e.settings.rate, color="#000000", alpha=0.08, linewidth=0.0)
