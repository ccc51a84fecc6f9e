"""The page in the browser: a `Session` drawn, driven, changed, recorded and replayed (extra `viewer`).

Input from the page is checked once, where it comes in. The arm stops if the browser that drives the arm is gone or does
not answer: the page repeats a target only while the browser answers, and a target that is not repeated goes stale.
"""

from __future__ import annotations

import contextlib
import functools
import io
import pathlib
import threading
import time
from collections.abc import Callable
from typing import TYPE_CHECKING, Any

import numpy as np

from sigmaik import methods
from sigmaik._extras import need
from sigmaik._types import Array

from . import gauges
from .devices import DEVICES, TwistDevice, open_device
from .episode import Episode
from .scene import Scene, task_singular_values
from .session import Session
from .target import TargetPose

if TYPE_CHECKING:
    import viser

__all__ = ["Page"]

DRAWN = 30.0  #: [Hz] frames of the arm
GAUGES = 10.0  #: [Hz] updates of the gauges
HEARTBEAT = 0.3  #: [s] between two questions to the browser
POLLED = 100.0  #: [Hz] readings of the devices

_AXES = ("x", "y", "z", "roll", "pitch", "yaw")
#: Keys that move the tool a little along an axis, forth and back.
_KEYS = (("W", "S"), ("A", "D"), ("R", "F"), ("U", "O"), ("I", "K"), ("J", "L"))
_ROWS = ("vx", "vy", "vz", "ωx", "ωy", "ωz")


class Page:
    """A web server with the page of a session. It listens until `close`."""

    def __init__(
        self,
        session: Session,
        host: str = "127.0.0.1",
        port: int = 8080,
        directory: str | pathlib.Path = "episodes",
        parquet: bool = True,
    ) -> None:
        """
        host: the address to listen on; only this machine can reach 127.0.0.1
        port: 0 takes a free port
        directory: of recordings
        parquet: write recordings as parquet, too
        """
        need("viser", "yourdfpy")
        if parquet:
            need("pyarrow")
        import viser

        self.session, self.directory, self.parquet = session, pathlib.Path(directory), parquet
        with _quiet():
            self._server = viser.ViserServer(host=host, port=port, label=f"sigmaik {session.name}", verbose=False)
        self.url = f"http://{self._server.get_host()}:{self._server.get_port()}"
        self._scene = Scene(self._server, session)
        self._driver: int | None = None  # the client whose target the arm follows
        self._device: TwistDevice | None = None
        self._replay: _Replay | None = None
        self._closed = threading.Event()
        self._linear_speed, self._angular_speed = 0.15, 0.6
        self._build()
        self._server.on_client_disconnect(self._lost)
        self._threads = [
            threading.Thread(target=run, name=f"sigmaik {run.__name__}", daemon=True)
            for run in (self._draw, self._watch, self._poll)
        ]
        for thread in self._threads:
            thread.start()

    def close(self) -> None:
        """Stops the arm and the server."""
        self._closed.set()
        self.session.hold()
        for thread in self._threads:
            thread.join(2.0)
        if self._device is not None:
            self._device.close()
        with contextlib.suppress(RuntimeError), _quiet():
            self._server.stop()

    def wait(self, seconds: float | None = None) -> None:
        """Returns after `seconds`; None: never, but for an interrupt."""
        self._closed.wait(seconds)

    def open_device(self, name: str) -> str:
        """Drives by a gamepad or a SpaceMouse ("none" ends this). Returns its name; ValueError without the device."""
        device = None if name == "none" else open_device(name)
        old, self._device = self._device, device
        if old is not None:
            old.close()
        self.session.hold()
        return device.name if device is not None else "none"

    # --- what the page shows and asks

    def _build(self) -> None:
        gui = self._server.gui
        gui.configure_theme(control_width="large", show_share_button=False)
        gui.set_panel_label(f"sigmaik · {self.session.name}")
        self._status = gui.add_html("")
        stop = gui.add_button("Stop", color="red", hint="or the space bar")
        stop.on_click(lambda event: self._hold())
        key = gui.add_command("Stop", hotkey="space")
        key.on_trigger(lambda event: self._hold())
        self._sigma = gui.add_html("")
        self._joints = gui.add_html("")
        self._build_drive()
        self._build_jog()
        self._build_rule()
        self._build_limits()
        self._build_record()

        @self._scene.target.on_update
        def _(event: Any) -> None:
            target = self._scene.target
            self._guard(event, lambda: self._follow(event, TargetPose.from_page(target.position, target.wxyz)))

    def _build_drive(self) -> None:
        gui = self._server.gui
        with gui.add_folder("Drive"):
            self._position: Any = gui.add_vector3(
                "target [m]", (0.0, 0.0, 0.0), step=0.001, hint="or drag the gizmo: where the tool is to go"
            )

            @self._position.on_update
            def _(event: Any) -> None:
                if event.client is None:
                    return
                self._guard(event, lambda: self._follow(event, self._moved_target(self._position.value)))

            guided = gui.add_checkbox(
                "guide",
                self.session.settings.guided,
                hint="where the tool's own way to a target that rests does not arrive, the joints take another way, "
                "inside their limits; a twist (jog, device) is never overruled",
            )
            self._bind(guided, "guided", bool)
            home = gui.add_button("Put the arm back", hint="at once, where it started: it is a simulated arm")
            home.on_click(lambda event: self._guard(event, self._restart))
            device: Any = gui.add_dropdown("device", ("none", *DEVICES), hint="plugged into the servo's machine")

            def choose(event: Any) -> None:
                try:
                    self._say(event, "device", self.open_device(device.value))
                except Exception:
                    device.value = "none"
                    raise

            device.on_update(
                lambda event: self._guard(event, lambda: choose(event)) if event.client is not None else None
            )

            speed = gui.add_slider("speed [m/s]", 0.02, 0.5, 0.01, self._linear_speed)
            turn = gui.add_slider("turn [rad/s]", 0.05, 2.0, 0.05, self._angular_speed)

            @speed.on_update
            def _(event: Any) -> None:
                self._guard(event, lambda: setattr(self, "_linear_speed", _number(speed.value, 0.0, 0.5)))

            @turn.on_update
            def _(event: Any) -> None:
                self._guard(event, lambda: setattr(self, "_angular_speed", _number(turn.value, 0.0, 2.0)))

    def _build_jog(self) -> None:
        gui = self._server.gui
        with gui.add_folder("Jog: hold a button, or tap or hold a key", expand_by_default=False):
            for axis, (name, keys) in enumerate(zip(_AXES, _KEYS, strict=True)):
                for sign, letter in zip((1.0, -1.0), keys, strict=True):
                    twist = np.zeros(6)
                    twist[axis] = sign
                    label = f"{'+' if sign > 0 else '−'}{name}"
                    button = gui.add_button(f"{label}  ({letter})")
                    button.on_hold(functools.partial(self._jog, twist), callback_hz=20.0)
                    command = gui.add_command(f"Nudge {label}", hotkey=letter)  # type: ignore[arg-type]
                    command.on_trigger(functools.partial(self._jog, twist))

    def _build_rule(self) -> None:
        gui, settings = self._server.gui, self.session.settings
        family = self.session.settings.rule().family
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
        gui, settings = self._server.gui, self.session.settings
        with gui.add_folder("Limits and task"):
            held = gui.add_checkbox("hold joint limits", settings.limits)
            self._bind(held, "limits", bool)
            on_limit = gui.add_dropdown("on limit", ("redistribute", "scale"), initial_value=settings.on_limit)
            self._bind(on_limit, "on_limit", str)
            frame = gui.add_dropdown("axes of the task", ("base", "tool"), initial_value=settings.frame)
            self._bind(frame, "frame", str)
            boxes = [gui.add_checkbox(row, on) for row, on in zip(_ROWS, settings.mask, strict=True)]
            for box in boxes:
                self._bind(box, "mask", lambda _: tuple(bool(b.value) for b in boxes))
        if self.session.assumed:
            gui.add_markdown(
                f"Of {', '.join(self.session.assumed)} no acceleration limit is known: "
                f"{self.session.settings.assumed_acceleration:g} rad/s² is assumed."
            )
        if self._scene.robot.missing:
            gui.add_markdown(
                f"{len(self._scene.robot.missing)} meshes were not found: simple shapes stand in for them."
            )

    def _build_record(self) -> None:
        gui = self._server.gui
        with gui.add_folder("Record and replay"):
            self._record = gui.add_button("Record", hint="every cycle, until the button is pressed again")
            self._record.on_click(lambda event: self._guard(event, lambda: self._toggle_recording(event)))
            self._recorded = gui.add_markdown("no recording")
            self._episodes: Any = gui.add_dropdown("episode", self._files())
            play = gui.add_button("Replay", hint="the arm holds meanwhile")
            play.on_click(lambda event: self._guard(event, lambda: self._toggle_replay(event)))
            self._play = play

    def _bind(self, handle: Any, setting: str, convert: Callable[[Any], object]) -> None:
        """Connects a control to a setting."""

        def change(event: Any) -> None:
            if event.client is not None:  # otherwise the value was set by this program
                self._guard(event, lambda: self.session.configure(**{setting: convert(handle.value)}))

        handle.on_update(change)

    # --- what the page asked for

    def _guard(self, event: Any, do: Callable[[], None]) -> None:
        """Calls `do`, and tells the page the reason if the request is refused."""
        try:
            do()
        except Exception as error:  # whatever a page sends, the server must go on
            self._say(event, "refused", " ".join(str(error).split()), "red")

    def _say(self, event: Any, title: str, text: str, color: str = "gray") -> None:
        client = getattr(event, "client", None)
        if client is not None:
            client.add_notification(title, text, color=color, auto_close_seconds=8.0)

    def _follow(self, event: Any, target: TargetPose) -> None:
        if self._replay is not None:
            raise ValueError("a recording is replayed: end that first")
        self._driver = event.client_id
        self.session.follow(target)
        self._scene.place_target(target.matrix)
        self._position.value = tuple(np.round(target.matrix[:3, 3], 3).tolist())

    def _moved_target(self, position: Any) -> TargetPose:
        target = self._scene.target
        return TargetPose.from_page(target.position, target.wxyz).moved_to(position)

    def _jog(self, axis: Array, event: Any) -> None:
        def jog() -> None:
            if self._replay is not None:
                raise ValueError("a recording is replayed: end that first")
            self.session.twist(self._scaled(axis))

        self._guard(event, jog)

    def _scaled(self, twist: Array) -> Array:
        speed = np.repeat([self._linear_speed, self._angular_speed], 3)
        scaled: Array = twist * speed
        return scaled

    def _hold(self) -> None:
        self._replay = None
        self.session.hold()

    def _restart(self) -> None:
        self._replay = None
        self.session.restart()
        self._scene.clear_trace()

    def _toggle_recording(self, event: Any) -> None:
        if not self.session.recording:
            self.session.start_recording()
            self._record.label = "Stop, and save"
            return
        self._record.label = "Record"
        episode = self.session.stop_recording()
        number, file = self._next_file()
        episode.save(file)
        if self.parquet:
            episode.save_parquet(file.with_suffix(".parquet"), number)
        broken = sum(episode.broken_limits().values())
        self._recorded.content = (
            f"{file.name}: {len(episode)} cycles, {episode.duration:.1f} s, limits broken {broken} times"
        )
        self._episodes.options = self._files()
        self._episodes.value = file.name
        self._say(event, "saved", str(file))

    def _next_file(self) -> tuple[int, pathlib.Path]:
        number = 0
        while (self.directory / f"episode-{number:04d}.npz").exists():
            number += 1
        return number, self.directory / f"episode-{number:04d}.npz"

    def _files(self) -> tuple[str, ...]:
        return tuple(sorted(file.name for file in self.directory.glob("*.npz"))) or ("none",)

    def _toggle_replay(self, event: Any) -> None:
        if self._replay is not None:
            self._replay = None
            return
        name = str(self._episodes.value)
        if name not in self._files() or name == "none":
            raise ValueError("there is no recording to replay")
        self.replay(Episode.load(self.directory / name), name)

    def replay(self, episode: Episode, name: str) -> None:
        """Draws a recording of the same arm, in its own time; the arm itself holds."""
        if episode.arm.chain.joint_names != self.session.chain.joint_names:
            raise ValueError(f"{name} is a recording of {episode.arm.name}, not of {self.session.name}")
        self.session.hold()
        self._scene.clear_trace()
        self._replay = _Replay(episode, name, time.monotonic())

    # --- threads

    def _draw(self) -> None:
        ticks = 0
        due = time.monotonic()
        while not self._closed.is_set():
            try:
                self._draw_once(ticks)
            except Exception:
                if self._closed.is_set():  # the server was closed before this thread
                    return
                self.session.hold()
                self._closed.set()
                raise
            ticks += 1
            due = max(due + 1.0 / DRAWN, time.monotonic())
            self._closed.wait(due - time.monotonic())

    def _draw_once(self, ticks: int) -> None:
        session = self.session
        session.read()
        sample, replaying = session.latest, ""
        replay = self._replay
        if replay is not None:
            replayed = replay.sample()
            if replayed is None:
                self._replay = None
            else:
                sample, replaying = replayed, replay.name
        self._play.label = "Replay" if self._replay is None else "End the replay"
        if sample is None:
            return
        settings = session.settings
        rule = settings.rule()
        gamma = settings.gamma if hasattr(rule.method, "gamma") else None
        with self._server.atomic():
            self._scene.draw(sample, session.length_scale)
            if session.goal is None:
                self._scene.place_target(sample["pose"])
                at = tuple(np.round(sample["pose"][:3, 3], 3).tolist())
                if at != self._position.value and not sample["qdot"].any():
                    self._position.value = at
        if ticks % round(DRAWN / GAUGES):
            return
        sigma = sample["singular_values"]
        sigma = sigma[np.isfinite(sigma)]
        singular: int | None = int(sample["singular"])
        if not len(sigma):  # the arm holds: no rule has run
            jacobian = session.chain.jacobian(sample["q"])
            rotation = sample["pose"][:3, :3]
            sigma, singular = task_singular_values(jacobian, rotation, settings, session.length_scale), None
        title = methods.TITLES[rule.family]
        self._status.content = gauges.status_text(
            sample, session.chain, title, session.statistics, session.rate, replaying
        )
        self._sigma.content = gauges.singular_bars(sigma, gamma, singular)
        self._joints.content = gauges.joint_bars(
            sample["q"], sample["qdot"], session.chain, int(sample["limiting_joints"])
        )
        if session.recording:
            full = ", full" if session.recording_full else ""
            self._recorded.content = f"recording: {session.recorded} cycles{full}"

    def _watch(self) -> None:
        """Asks the browser that drives for an answer, and repeats the target while the browser answers."""
        while not self._closed.wait(HEARTBEAT):
            client = self._server.get_clients().get(self._driver) if self._driver is not None else None
            if client is None or self.session.goal is None:
                continue
            patience = max(self.session.pose_timeout - 2.0 * HEARTBEAT, 0.5 * self.session.pose_timeout)
            try:
                client.local_storage.get_item("sigmaik", timeout=patience)
            except (TimeoutError, RuntimeError):
                self._driver = None
                self._hold()  # the arm holds until a new target is given
            else:
                self.session.refresh()

    def _lost(self, client: viser.ClientHandle) -> None:
        """Stops the arm if the browser that drove it, or the last browser, is gone."""
        if client.client_id == self._driver or not self._server.get_clients():
            self._driver = None
            self._hold()

    def _poll(self) -> None:
        held = False
        while not self._closed.wait(1.0 / POLLED):
            device = self._device
            if device is None:
                continue
            try:
                reading = device.read()
            except ValueError as error:
                self._device = None
                self.session.hold()
                for client in self._server.get_clients().values():
                    client.add_notification("device", str(error), color="red")
                continue
            if reading.held and self._replay is None:
                self.session.twist(self._scaled(reading.twist))
            elif held:
                self.session.hold()
            held = reading.held


class _Replay:
    """A recording that is being shown."""

    def __init__(self, episode: Episode, name: str, begun: float) -> None:
        self.episode, self.name, self._begun = episode, name, begun

    def sample(self) -> Any:
        """The sample to show now; None after the last one."""
        at = int((time.monotonic() - self._begun) / self.episode.dt)
        return self.episode.samples[at] if at < len(self.episode) else None


def _number(value: Any, least: float, most: float) -> float:
    number = float(value)
    if not least <= number <= most:
        raise ValueError(f"{number:g} is not between {least:g} and {most:g}")
    return number


@contextlib.contextmanager
def _quiet() -> Any:
    """Suppresses the banner of viser."""
    with contextlib.redirect_stdout(io.StringIO()):
        yield
