"""The panel of the page: its controls, what they ask of the page, and what the page shows in them."""

from __future__ import annotations

import functools
from collections.abc import Callable
from typing import TYPE_CHECKING, Any

import numpy as np

from sigmaik import methods
from sigmaik._types import Array

from . import gauges
from .devices import DEVICES
from .settings import Settings

if TYPE_CHECKING:
    from .page import Page

__all__ = ["Controls", "fits_rule"]

_AXES = ("x", "y", "z", "roll", "pitch", "yaw")
#: Keys that move the tool a little along an axis, forth and back.
_KEYS = (("W", "S"), ("A", "D"), ("R", "F"), ("U", "O"), ("I", "K"), ("J", "L"))
_ROWS = ("vx", "vy", "vz", "ωx", "ωy", "ωz")
#: Settings of some rules only, and the rule's parameter.
_OF_SOME_RULES = {"gamma": "gamma", "singular_gain": "gain_linear", "singular_posture": "singular_posture"}


def fits_rule(setting: str, settings: Settings) -> bool:
    """Whether the chosen rule has a setting that can be changed: not where the method's text gives the parameter."""
    parameter = _OF_SOME_RULES.get(setting)
    if parameter is None:
        return True
    return hasattr(settings.rule().method, parameter) and f"{parameter}=" not in settings.method


class Controls:
    """The handles of the panel. Each request goes through the page, which asks who drives."""

    def __init__(self, page: Page, server: Any) -> None:
        self._page, self._gui = page, server.gui
        self._settings: list[tuple[Any, str, Callable[[Settings], Any]]] = []
        gui = self._gui
        gui.configure_theme(control_width="large", show_share_button=False)
        gui.set_panel_label(gauges.printable(f"sigmaik · {page.session.name}"))
        self.status = gui.add_html("")
        stop = gui.add_button("Stop", color="red", hint="or the space bar; anybody may stop")
        stop.on_click(lambda event: page._stop(event))
        gui.add_command("Stop", hotkey="space").on_trigger(lambda event: page._stop(event))
        self.release = gui.add_button("Release the stop", color="green", visible=False, hint="the arm goes on to hold")
        self._ask(self.release, lambda event: page.session.release())
        self.take = gui.add_button("Take over", visible=False, hint="the arm holds, and this browser drives")
        self.take.on_click(lambda event: page._guard(event, lambda: page._take_over(event)))
        self.sigma = gui.add_html("")
        self.joints = gui.add_html("")
        gui.add_html(gauges.legend())
        self._build_drive()
        self._build_jog()
        self._build_rule()
        self._build_limits()
        self._build_record()
        self.show_settings()

    def show_settings(self) -> None:
        """Shows the session's settings: after a refused change, too, and only the controls that the rule has."""
        settings = self._page.session.settings
        for handle, setting, shown in self._settings:
            value = shown(settings)
            if handle.value != value:
                handle.value = value
            visible = fits_rule(setting, settings)
            if handle.visible != visible:
                handle.visible = visible

    def show_unsaved(self, names: list[str]) -> None:
        """Shows the controls for recordings that could not be saved."""
        for handle in (self.folder, self.save):
            handle.visible = bool(names)

    # --- folders

    def _build_drive(self) -> None:
        page, gui = self._page, self._gui
        with gui.add_folder("Drive"):
            self.position: Any = gui.add_vector3(
                "target [m]", (0.0, 0.0, 0.0), step=0.001, hint="or drag the gizmo: where the tool is to go"
            )
            self.position.on_update(
                lambda event: self._if_asked(event, lambda: page._follow_typed(event, self.position.value))
            )
            guided = gui.add_checkbox(
                "guide",
                page.session.settings.guided,
                hint="where the tool's own way to a target that rests does not arrive, the joints take another way, "
                "inside their limits; a twist (jog, device) is never overruled",
            )
            self._bind(guided, "guided", bool)
            home = gui.add_button("Put the arm back", hint="at once, where it started: it is a simulated arm")
            self._ask(home, lambda event: page._restart())
            self.device: Any = gui.add_dropdown(
                "device",
                ("none", *DEVICES),
                hint="plugged into the servo's machine; it drives for the browser that chooses it",
            )
            self.device.on_update(
                lambda event: self._if_asked(event, lambda: page._choose_device(event, self.device.value))
            )
            for label, attribute, least, most, step in (
                ("speed [m/s]", "_linear_speed", 0.02, 0.5, 0.01),
                ("turn [rad/s]", "_angular_speed", 0.05, 2.0, 0.05),
            ):
                slider = gui.add_slider(label, least, most, step, getattr(page, attribute))
                slider.on_update(functools.partial(self._change_speed, slider, attribute, most))

    def _change_speed(self, slider: Any, attribute: str, most: float, event: Any) -> None:
        if event.client is None:
            return
        page = self._page
        if not page._drive(event, lambda: setattr(page, attribute, _number(slider.value, 0.0, most))):
            slider.value = getattr(page, attribute)

    def _build_jog(self) -> None:
        page, gui = self._page, self._gui
        with gui.add_folder("Jog: hold a button, or tap or hold a key", expand_by_default=False):
            for axis, (name, keys) in enumerate(zip(_AXES, _KEYS, strict=True)):
                for sign, letter in zip((1.0, -1.0), keys, strict=True):
                    twist: Array = np.zeros(6)
                    twist[axis] = sign
                    label = f"{'+' if sign > 0 else '−'}{name}"
                    button = gui.add_button(f"{label}  ({letter})")
                    button.on_hold(functools.partial(page._jog, twist), callback_hz=20.0)
                    command = gui.add_command(f"Nudge {label}", hotkey=letter)
                    command.on_trigger(functools.partial(page._jog, twist))

    def _build_rule(self) -> None:
        gui, settings = self._gui, self._page.session.settings
        family = settings.rule().family
        names = methods.ALL
        # The method as it was given, if it has parameters.
        given = settings.method if settings.method not in names else None
        with gui.add_folder("Rule"):
            method = gui.add_dropdown("method", (*((given,) if given else ()), *names), initial_value=given or family)
            self._bind(method, "method", str)
            gamma = gui.add_slider("γ", 0.01, 0.5, 0.01, settings.gamma, hint="J-PARSE: the largest threshold on σ/σ₁")
            self._bind(gamma, "gamma", lambda value: _number(value, 0.0, 1.0))
            for label, name, most in (
                ("singular gain", "singular_gain", 5.0),
                ("gain [1/s]", "gain_linear", 20.0),
                ("turn gain [1/s]", "gain_angular", 20.0),
                ("posture [1/s]", "posture_gain", 5.0),
            ):
                slider = gui.add_slider(label, 0.0, most, 0.1, getattr(settings, name))
                self._bind(slider, name, functools.partial(_number, least=0.0, most=most))
            posture = gui.add_checkbox(
                "posture at singularities",
                settings.singular_posture,
                hint="J-PARSE: an arm that was stretched out folds back to the side of its posture; "
                "off is as published",
            )
            self._bind(posture, "singular_posture", bool)

    def _build_limits(self) -> None:
        page, gui, settings = self._page, self._gui, self._page.session.settings
        with gui.add_folder("Limits and task"):
            held = gui.add_checkbox("hold joint limits", settings.limits)
            self._bind(held, "limits", bool)
            on_limit = gui.add_dropdown("on limit", ("redistribute", "scale"), initial_value=settings.on_limit)
            self._bind(on_limit, "on_limit", str)
            frame = gui.add_dropdown("axes of the task", ("base", "tool"), initial_value=settings.frame)
            self._bind(frame, "frame", str)
            boxes = [gui.add_checkbox(row, on) for row, on in zip(_ROWS, settings.mask, strict=True)]
            for row, box in enumerate(boxes):
                self._bind(
                    box, "mask", lambda _: tuple(bool(b.value) for b in boxes), functools.partial(_row_of_mask, row)
                )
        if page.session.assumed:
            gui.add_markdown(
                f"Of {', '.join(page.session.assumed)} no acceleration limit is known: "
                f"{settings.assumed_acceleration:g} rad/s² is assumed."
            )
        if page._scene.robot.missing:
            gui.add_markdown(
                f"{len(page._scene.robot.missing)} meshes were not found: simple shapes stand in for them."
            )

    def _build_record(self) -> None:
        page, gui = self._page, self._gui
        with gui.add_folder("Record and replay"):
            self.record = gui.add_button("Record", hint="every cycle, until the button is pressed again")
            self._ask(self.record, page._toggle_recording)
            self.recorded = gui.add_markdown("no recording")
            self.folder: Any = gui.add_text("folder", gauges.printable(str(page.directory)), visible=False)
            self.save = gui.add_button("Save what is in memory", color="orange", visible=False)
            self._ask(self.save, lambda event: page._save_unsaved(event, self.folder.value))
            self.episodes: Any = gui.add_dropdown("episode", page._files())
            self.play = gui.add_button("Replay", hint="the arm holds meanwhile")
            self._ask(self.play, page._toggle_replay)

    # --- from a control to the page

    def _ask(self, button: Any, do: Callable[[Any], None]) -> None:
        """Connects a button to what only the driver may ask."""
        button.on_click(lambda event: self._page._drive(event, lambda: do(event)))

    def _if_asked(self, event: Any, do: Callable[[], None]) -> None:
        if event.client is not None:  # otherwise the value was set by this program
            self._page._drive(event, do)

    def _bind(
        self,
        handle: Any,
        setting: str,
        convert: Callable[[Any], object],
        shown: Callable[[Settings], Any] | None = None,
    ) -> None:
        """Connects a control to a setting. A refused value is shown no longer."""
        self._settings.append((handle, setting, shown or (lambda settings: getattr(settings, setting))))

        def change(event: Any) -> None:
            if event.client is None:
                return
            page = self._page
            page._drive(event, lambda: page.session.configure(**{setting: convert(handle.value)}))
            self.show_settings()

        handle.on_update(change)


def _row_of_mask(row: int, settings: Settings) -> bool:
    return settings.mask[row]


def _number(value: Any, least: float, most: float) -> float:
    number = float(value)
    if not least <= number <= most:
        raise ValueError(f"{number:g} is not between {least:g} and {most:g}")
    return number
