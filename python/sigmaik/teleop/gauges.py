"""The page's gauges beside the arm, as HTML: status in words, singular values, joints against their limits."""

from __future__ import annotations

import html
import math
from typing import Any

import numpy as np

import sigmaik as sk
from sigmaik._types import Array

__all__ = ["guide_words", "joint_bars", "legend", "printable", "singular_bars", "status_text"]

_GREEN, _AMBER, _RED, _GREY, _TRACK = "#2f9e44", "#e8890c", "#d6336c", "#868e96", "#e9ecef"
_COLOURS = {
    sk.Status.OK: _GREEN,
    sk.Status.DAMPED: _AMBER,
    sk.Status.LIMITED: _RED,
    sk.Status.HOLDING: _GREY,
    sk.Status.BAD_INPUT: _RED,
}
_WORDS = {
    sk.Status.OK: "as asked",
    sk.Status.DAMPED: "near a singularity: damped",
    sk.Status.LIMITED: "held back by joint limits",
    sk.Status.HOLDING: "holding",
    sk.Status.BAD_INPUT: "bad input",
}
_GUIDE_COLOURS = {
    sk.GuideState.SEARCHING: _AMBER,
    sk.GuideState.POSTURE: _AMBER,
    sk.GuideState.CHANGING_BRANCH: _AMBER,
    sk.GuideState.UNREACHABLE: _RED,
}
_FONT = "font:12px/1.5 ui-monospace,monospace;padding:2px 12px"


def status_text(
    sample: Any,
    chain: sk.Chain,
    method: str,
    statistics: sk.LoopStatistics,
    rate: float,
    replaying: str = "",
    *,
    why: str = "",
    driver: str = "",
) -> str:
    """Status, limiting joints, what the guide does, place and twist of the tool, the servo's rate, who drives.

    why: the arm holds, where it holds
    """
    status, command = sk.Status(int(sample["status"])), sk.LoopCommand(int(sample["command"]))
    word = _WORDS.get(status, status.name.lower().replace("_", " "))
    if command is sk.LoopCommand.STALE:
        word = f"holding: {why or 'the last command is stale'}"
    elif command is sk.LoopCommand.HOLD and why:
        word = f"holding: {why}"
    if replaying:
        word = f"replaying {replaying}: {word}"
    joints = [name for i, name in enumerate(chain.joint_names) if int(sample["limiting_joints"]) >> i & 1]
    rows = [
        f"<div id='sk-status' data-status='{status.name}' data-command='{command.name}' "
        f"style='font-size:15px;font-weight:600;color:{_COLOURS.get(status, _GREY)}'>{_safe(word)}</div>",
        f"<div>{html.escape(method)}{' · at limits: ' + html.escape(', '.join(joints)) if joints else ''}</div>",
        _guide_text(sk.GuideState(int(sample["guide"])), int(sample["guide_joints"])),
    ]
    x, y, z = sample["pose"][:3, 3].tolist()
    rows.append(f"<div style='white-space:pre'>{'tool':<9}{x:.3f} {y:.3f} {z:.3f} m</div>")
    for label, field in (("asked", "asked_twist"), ("achieved", "achieved_twist")):
        v = sample[field]
        size = f"{np.linalg.norm(v[:3]):.3f} m/s {np.linalg.norm(v[3:]):.3f} rad/s"
        rows.append(f"<div style='white-space:pre'>{label:<9}{size}</div>")
    left = f"{100.0 * float(sample['scale']):.0f} %" if status is sk.Status.LIMITED else "–"
    rows.append(
        f"<div style='white-space:pre'>{'left':<9}{left}   servo <span id='sk-rate'>{statistics.rate:.0f}</span> of "
        f"{rate:.0f} Hz</div>"
    )
    if driver:
        rows.append(f"<div style='white-space:pre'>{'driver':<9}<span id='sk-driver'>{_safe(driver)}</span></div>")
    return f"<div style='{_FONT}'>{''.join(rows)}</div>"


def printable(text: str) -> str:
    """Text that can be sent: characters that UTF-8 cannot encode (lone surrogates of file names) become �."""
    return text.encode("utf-8", "replace").decode()


def _safe(text: str) -> str:
    return html.escape(printable(text))


def legend() -> str:
    """What the colours mean."""
    entries = (
        (_GREEN, "as asked"),
        (_AMBER, "damped, or near a limit"),
        (_RED, "held back by limits"),
        (_GREY, "holding"),
        ("#228be6", "arrow: asked velocity"),
        (_GREEN, "arrow: achieved"),
        (_RED, "line: singular, linear"),
        ("#9735d6", "line: singular, angular"),
        (_RED, "bar: σ below the threshold"),
        ("#74c0fc", "ellipsoid: speeds of the tool"),
    )
    rows = "".join(
        f"<div style='display:flex;gap:5px;align-items:center'><span style='flex:none;width:9px;height:9px;"
        f"border-radius:2px;background:{colour}'></span><span>{words}</span></div>"
        for colour, words in entries
    )
    grid = "display:grid;grid-template-columns:repeat(auto-fit,minmax(150px,1fr));column-gap:8px;font-size:11px"
    return (
        f"<details id='sk-legend' open style='{_FONT}'><summary>colours</summary>"
        f"<div style='{grid}'>{rows}</div></details>"
    )


def guide_words(state: sk.GuideState, joints: int) -> str:
    """What the guide does; bit i of `joints`: joint i changes its branch. Joints are counted from 1, as in the bars."""
    if state is sk.GuideState.OFF:
        return "–"
    words = state.name.lower().replace("_", " ")
    numbers = [str(i + 1) for i in range(joints.bit_length()) if joints >> i & 1]
    if state is not sk.GuideState.CHANGING_BRANCH or not numbers:
        return words
    return f"{words}: joint{'s' if len(numbers) > 1 else ''} {', '.join(numbers)}"


def _guide_text(state: sk.GuideState, joints: int) -> str:
    colour = _GUIDE_COLOURS.get(state)
    style = f" style='color:{colour}'" if colour else ""
    words = f"<span id='sk-guide' data-guide='{state.name}'{style}>{guide_words(state, joints)}</span>"
    return f"<div style='white-space:pre'>{'guide':<9}{words}</div>"


def singular_bars(sigma: Array, gamma: float | None, singular: int | None = None) -> str:
    """A bar for each singular value, as parts of the largest, with the threshold γ where the method has one.

    Bit i of `singular`: direction i is singular to the rule; None: no rule has run, and γ decides.
    """
    largest = float(sigma[0]) if len(sigma) and sigma[0] > 0.0 else 1.0
    rows = []
    for i, value in enumerate(sigma):
        part = float(value) / largest
        by_threshold = gamma is not None and part <= gamma
        colour = _RED if (by_threshold if singular is None else singular >> i & 1) else _GREEN
        rows.append(
            f"<div style='display:flex;gap:6px;align-items:center'><span style='width:2em'>σ{i + 1}</span>"
            f"{_bar(part, colour, gamma)}<span style='width:4em;text-align:right'>{value:.3f}</span></div>"
        )
    legend = "singular values" + ("" if gamma is None else f", threshold γ σ₁ = {gamma * largest:.3f}")
    return f"<div id='sk-sigma' style='{_FONT}'><div>{legend}</div>{''.join(rows)}</div>"


def joint_bars(q: Array, qdot: Array, chain: sk.Chain, limiting: int) -> str:
    """Each joint's position within its range, and its speed as a part of its limit."""
    limits = chain.limits
    rows = []
    for i, name in enumerate(chain.joint_names):
        lower, upper, fastest = float(limits.lower[i]), float(limits.upper[i]), float(limits.velocity[i])
        bounded = math.isfinite(lower) and math.isfinite(upper)
        at = (float(q[i]) - lower) / (upper - lower) if bounded else (float(q[i]) / math.tau + 0.5) % 1.0
        speed = abs(float(qdot[i])) / fastest if math.isfinite(fastest) else 0.0
        held = limiting >> i & 1
        colour = _RED if held else _AMBER if bounded and min(at, 1.0 - at) < 0.03 else _GREEN
        rows.append(
            f"<div style='display:flex;gap:6px;align-items:center' title='{html.escape(name)}'>"
            f"<span style='width:2em;{'color:' + _RED if held else ''}'>q{i + 1}</span>"
            f"{_marker(at, colour)}<span style='width:4.5em;text-align:right'>{float(q[i]):+.2f}</span>"
            f"{_bar(speed, _RED if speed > 0.999 else _GREEN)}</div>"
        )
    title = "joints: in their range, and speed of its limit"
    return f"<div id='sk-joints' style='{_FONT}'><div>{title}</div>{''.join(rows)}</div>"


def _bar(part: float, colour: str, tick: float | None = None) -> str:
    width = 100.0 * min(max(part, 0.0), 1.0)
    mark = "" if tick is None else _line(tick, "#343a40", 2)
    return _box(f"<div style='width:{width:.1f}%;height:100%;background:{colour}'></div>{mark}")


def _marker(at: float, colour: str) -> str:
    return _box(_line(at, colour, 6))


def _line(at: float, colour: str, width: int) -> str:
    left = 100.0 * min(max(at, 0.0), 1.0)
    return (
        f"<div style='position:absolute;top:0;height:100%;width:{width}px;margin-left:-{width // 2}px;"
        f"left:{left:.1f}%;background:{colour}'></div>"
    )


def _box(inside: str) -> str:
    return (
        f"<div style='flex:1;position:relative;height:9px;background:{_TRACK};border-radius:2px;overflow:hidden'>"
        f"{inside}</div>"
    )
