"""The page in the browser: a `Session` drawn, driven, changed, recorded and replayed (extra `viewer`).

Input from the page is checked once, where it comes in (`gate` checks the requests themselves). One browser drives at a
time. The arm stops if this browser is gone or does not answer: the page repeats a target only while the browser
answers, and a target that is not repeated goes stale.
"""

from __future__ import annotations

import contextlib
import logging
import pathlib
import threading
import time
from collections.abc import Callable, Hashable, Iterable, Mapping
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

import sigmaik as sk
from sigmaik import methods
from sigmaik._extras import need
from sigmaik._types import Array

from . import gauges, seat
from .controls import Controls
from .devices import TwistDevice, open_device
from .episode import Episode
from .gate import Gate, open_server, quiet
from .recorder import Recorder
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

_log = logging.getLogger("sigmaik.teleop")


class Page:
    """A web server with the page of a session. It listens until `close`."""

    def __init__(
        self,
        session: Session,
        host: str = "127.0.0.1",
        port: int = 8080,
        directory: str | pathlib.Path = "episodes",
        *,
        packages: Mapping[str, str | pathlib.Path] | None = None,
        names: Iterable[str] = (),
    ) -> None:
        """
        host: the address to listen on; only this machine can reach 127.0.0.1
        port: 0 takes a free port. Error where the port is taken
        directory: of recordings. Recordings that a crash cut off are recovered there
        packages: name to folder of ROS packages that the URDF's meshes may come from
        names: further names of this host under which browsers reach the page
        Error where a mesh is outside the URDF's folder and the packages.
        """
        need("viser", "yourdfpy")
        self.session, self.recorder = session, Recorder(session, directory)
        self._seat = seat.Seat(session)
        self._device: TwistDevice | None = None
        self._device_of: Hashable | None = None  # the driver that the device works for
        self._device_held = False
        self._replay: _Replay | None = None
        self._closed = threading.Event()
        self._linear_speed, self._angular_speed = 0.15, 0.6
        self._box_follows = True  # whether the box of the target shows where the tool rests
        self._shown_place: Any = (0.0, 0.0, 0.0)  # what this program wrote into the box last
        self._troubles: dict[str, str] = {}  # the last error of each thread
        self._told = ""  # the last trouble of a recording's file
        self._server, self.url = open_server(
            host, port, f"sigmaik {session.name}", Gate(host, names, f"sigmaik · {session.name}")
        )
        try:
            self._scene = Scene(self._server, session, packages)
            self._controls = Controls(self, self._server)
        except BaseException:
            with quiet():
                self._server.stop()
            raise

        @self._scene.target.on_update
        def _(event: Any) -> None:
            target = self._scene.target
            if not self._drive(event, lambda: self._follow(event, TargetPose.from_page(target.position, target.wxyz))):
                self._scene.place_target(self._tool() if self.session.goal is None else self.session.goal)

        self._server.on_client_connect(self._greet)
        self._server.on_client_disconnect(self._lost)
        self._threads = [
            threading.Thread(target=self._repeat, args=(what, turn, period), name=f"sigmaik {what}", daemon=True)
            for what, turn, period in (
                ("recording", self._read, 1.0 / DRAWN),
                ("drawing", _Drawing(self).turn, 1.0 / DRAWN),
                ("watching the browser", self._watch, HEARTBEAT),
                ("reading the device", self._poll, 1.0 / POLLED),
            )
        ]
        self._threads.append(threading.Thread(target=self._recover, name="sigmaik recovery", daemon=True))
        for thread in self._threads:
            thread.start()

    @property
    def directory(self) -> pathlib.Path:
        """The folder of the recordings."""
        return self.recorder.directory

    def close(self) -> None:
        """Stops the arm and the server, and saves a recording that goes on."""
        self._closed.set()
        self._seat.leave(self._seat.driver)
        self.session.hold("the page is closed")
        for thread in self._threads:
            thread.join(2.0)
        if self._device is not None:
            self._device.close()
        saved = self.recorder.finish()
        if saved:
            _log.warning("%s", saved)
        with contextlib.suppress(RuntimeError), quiet():
            self._server.stop()

    def wait(self, seconds: float | None = None) -> None:
        """Returns after `seconds`; None: never, but for an interrupt."""
        self._closed.wait(seconds)

    def open_device(self, name: str, driver: Hashable | None = None) -> str:
        """Drives by a gamepad or a SpaceMouse ("none" ends this). Returns its name; ValueError without the device.

        driver: the browser that the device works for; None: the device is a driver of its own
        """
        device = None if name == "none" else open_device(name)
        old, self._device = self._device, device
        if old is not None:
            old.close()
        if not isinstance(self._device_of, int):
            self._seat.leave(self._device_of)
        self._device_of = (driver if driver is not None else f"the {name}") if device is not None else None
        if device is not None:
            self._seat.take_over(self._device_of)
        self.session.hold("the device was changed")
        return device.name if device is not None else "none"

    # --- what the page asked for

    def _guard(self, event: Any, do: Callable[[], None]) -> bool:
        """Calls `do`, and tells the page the reason if the request is refused. Returns whether it was done."""
        try:
            do()
        except Exception as error:  # whatever a page sends, the server must go on
            self._say(event, "refused", " ".join(str(error).split()), "red")
            return False
        return True

    def _drive(self, event: Any, do: Callable[[], None]) -> bool:
        """As `_guard`, for what only the driver may ask; the first who asks becomes the driver."""

        def claim_and_do() -> None:
            self._seat.claim(event.client_id)
            do()

        return self._guard(event, claim_and_do)

    def _say(self, event: Any, title: str, text: str, color: Literal["gray", "red"] = "gray") -> None:
        client = getattr(event, "client", None)
        if client is not None:
            client.add_notification(title, gauges.printable(text), color=color, auto_close_seconds=8.0)

    def _say_to_all(self, title: str, text: str, color: Literal["gray", "red"] = "red") -> None:
        for client in self._server.get_clients().values():
            client.add_notification(title, gauges.printable(text), color=color)

    def _follow(self, event: Any, target: TargetPose) -> None:
        self._go(event, target)
        self._scene.place_target(target.matrix)
        self._box_follows = False
        self._controls.position.value = tuple(np.round(target.matrix[:3, 3], 3).tolist())

    def _follow_typed(self, event: Any, position: Any) -> None:
        """What was typed stays in the box: rounded, it would be another target."""
        self._box_follows = False
        at = self._scene.target
        target = TargetPose.from_page(at.position, at.wxyz).moved_to(position)
        self._go(event, target)
        self._scene.place_target(target.matrix)

    def _let_box_follow(self) -> None:
        """From now on the box shows where the tool rests, until somebody types."""
        self._shown_place, self._box_follows = self._controls.position.value, True

    def _go(self, event: Any, target: TargetPose) -> None:
        if self._replay is not None:
            raise sk.Error("a recording is replayed: end that first")
        self.session.follow(target, self._seat.claim(event.client_id))

    def _tool(self) -> Array:
        latest = self.session.latest
        pose: Array = self.session.chain.pose(self.session.home) if latest is None else latest["pose"]
        return pose

    def _jog(self, axis: Array, event: Any) -> None:
        def jog() -> None:
            if self._replay is not None:
                raise sk.Error("a recording is replayed: end that first")
            self._let_box_follow()
            self.session.twist(self._scaled(axis), self._seat.claim(event.client_id))

        self._drive(event, jog)

    def _scaled(self, twist: Array) -> Array:
        speed = np.repeat([self._linear_speed, self._angular_speed], 3)
        scaled: Array = twist * speed
        return scaled

    def _stop(self, event: Any) -> None:
        """Anybody may stop. The stop is latched: nothing moves the arm until the driver releases the stop."""
        self._replay = None
        self.session.stop(f"Stop was pressed in browser {getattr(event, 'client_id', '?')}")

    def _hold(self, why: str) -> None:
        self._replay = None
        self.session.hold(why)

    def _take_over(self, event: Any) -> None:
        self._seat.take_over(event.client_id)

    def _restart(self) -> None:
        self.session.restart()
        self._replay = None
        self._let_box_follow()
        self._scene.clear_trace()

    def _choose_device(self, event: Any, name: str) -> None:
        try:
            self._say(event, "device", self.open_device(name, event.client_id))
        except Exception:
            self._controls.device.value = "none"
            raise

    def _toggle_recording(self, event: Any) -> None:
        controls = self._controls
        if not self.session.recording:
            trouble = self.recorder.start()
            controls.record.label = "Stop, and save"
            if trouble:
                self._say_to_all("recording in memory only", trouble)
            return
        controls.record.label = "Record"
        try:
            line = self.recorder.stop()
        except sk.Error as error:
            controls.recorded.content = gauges.printable(str(error))
            raise
        finally:
            controls.show_unsaved([unsaved.name for unsaved in self.recorder.unsaved])
        self._show_saved(event, line)

    def _save_unsaved(self, event: Any, folder: str) -> None:
        try:
            lines = self.recorder.save_unsaved(folder)
        finally:
            self._controls.show_unsaved([unsaved.name for unsaved in self.recorder.unsaved])
        self._show_saved(event, "; ".join(lines))

    def _show_saved(self, event: Any, line: str) -> None:
        self._controls.recorded.content = gauges.printable(line)
        self._controls.episodes.options = files = self._files()
        self._controls.episodes.value = files[-1]
        self._say(event, "saved", line.partition(":")[0])

    def _files(self) -> tuple[str, ...]:
        return tuple(gauges.printable(name) for name in self.recorder.files) or ("none",)

    def _toggle_replay(self, event: Any) -> None:
        if self._replay is not None:
            self._replay = None
            return
        name = str(self._controls.episodes.value)
        if name not in self.recorder.files:
            raise sk.Error("there is no recording to replay")
        self.replay(Episode.load(self.directory / name), name)

    def replay(self, episode: Episode, name: str) -> None:
        """Draws a recording of the same arm, in its own time; the arm itself holds.

        Error where the recording is malformed, or of another arm.
        """
        if episode.arm.chain.joint_names != self.session.chain.joint_names:
            raise sk.Error(f"{name} is a recording of {episode.arm.name}, not of {self.session.name}")
        episode.check()
        self.session.hold(f"{name} is replayed")
        self._scene.clear_trace()
        self._replay = _Replay(episode, name, time.monotonic())

    # --- threads

    def _repeat(self, what: str, turn: Callable[[], None], period: float) -> None:
        """Takes turns until the page is closed. An exception holds the arm and is told once; the turns go on."""
        due = time.monotonic()
        while not self._closed.is_set():
            try:
                turn()
                self._troubles.pop(what, None)
            except Exception as error:
                if self._closed.is_set():  # the server was closed before this thread
                    return
                text = f"{what} failed: {type(error).__name__}: {error}"
                self._hold(text)
                if self._troubles.get(what) != text:
                    self._troubles[what] = text
                    _log.exception("%s; the arm holds", text)
                    with contextlib.suppress(Exception):
                        self._say_to_all("the arm holds", text)
            due = max(due + period, time.monotonic())
            self._closed.wait(due - time.monotonic())

    def _read(self) -> None:
        """In a thread of its own, so that slow drawing loses no sample."""
        self.session.read()
        trouble = self.session.recording_trouble
        if trouble and trouble != self._told:
            self._told = trouble
            _log.error("%s; the recording goes on in memory", trouble)
            self._say_to_all("the recording goes on in memory", trouble)

    def _recover(self) -> None:
        try:
            lines = self.recorder.recover()
        except Exception:  # nothing of an old file may end the program
            _log.exception("recovering recordings of %s failed", self.directory)
            return
        for line in lines:
            _log.warning("%s", line)
        if lines and not self._closed.is_set():
            self._controls.episodes.options = self._files()
            self._say_to_all("recovered", "; ".join(lines), "gray")

    def _watch(self) -> None:
        """Asks the browser that drives for an answer, and repeats the target while the browser answers."""
        driver = self._seat.driver
        client = self._server.get_clients().get(driver) if isinstance(driver, int) else None
        if client is None or self.session.goal is None:
            return
        patience = max(self.session.pose_timeout - 2.0 * HEARTBEAT, 0.5 * self.session.pose_timeout)
        try:
            client.local_storage.get_item("sigmaik", timeout=patience)
        except (TimeoutError, RuntimeError):
            self._seat.leave(driver)
            self._hold("the browser that drove did not answer")  # until a new target is given
        else:
            self.session.refresh()

    def _greet(self, client: viser.ClientHandle) -> None:
        client.gui.add_markdown(f"This is browser {client.client_id}.")

    def _lost(self, client: viser.ClientHandle) -> None:
        """Stops the arm if the browser that drove it, or the last browser, is gone."""
        if self._device_of == client.client_id:
            self._device_of = "the device"
        if self._seat.leave(client.client_id) or not self._server.get_clients():
            self._hold("the browser that drove is gone")

    def _poll(self) -> None:
        device = self._device
        if device is None:
            return
        try:
            reading = device.read()
        except ValueError as error:
            self._device = None
            self._seat.leave(self._device_of)
            self.session.hold(str(error))
            self._say_to_all("device", str(error))
            return
        held, self._device_held = self._device_held, reading.held
        if self._replay is not None or self.session.stopped:
            return
        if reading.held:
            try:
                token = self._seat.claim(self._device_of)
            except sk.Error:
                return  # a browser took over
            self._let_box_follow()
            self.session.twist(self._scaled(reading.twist), token)
        elif held and self._seat.driver == self._device_of:
            self.session.hold("the device's button was let go")


class _Drawing:
    """What is drawn in a turn."""

    def __init__(self, page: Page) -> None:
        self._page, self._ticks = page, 0

    def turn(self) -> None:
        page, session = self._page, self._page.session
        self._ticks += 1
        sample, replaying = session.latest, ""
        replay = page._replay
        if replay is not None:
            replayed = replay.sample()
            if replayed is None:
                page._replay = None
            else:
                sample, replaying = replayed, replay.name
        if sample is None:
            return
        with page._server.atomic():
            page._scene.draw(sample, session.length_scale)
            if session.goal is None:
                page._scene.place_target(sample["pose"])
                self._show_place(sample)
        if self._ticks % round(DRAWN / GAUGES) == 0:
            self._show_gauges(sample, replaying)

    def _show_place(self, sample: Any) -> None:
        """The box shows where a jogged tool rests; what somebody typed is never overwritten."""
        page, box = self._page, self._page._controls.position
        at = tuple(np.round(sample["pose"][:3, 3], 3).tolist())
        # Typed just now: the value is there before the request is handled.
        typed = box.value != page._shown_place
        if page._box_follows and not typed and at != box.value and not sample["qdot"].any():
            box.value = page._shown_place = at

    def _show_gauges(self, sample: Any, replaying: str) -> None:
        page, session, controls = self._page, self._page.session, self._page._controls
        settings = session.settings
        rule = settings.rule()
        gamma = settings.gamma if hasattr(rule.method, "gamma") else None
        sigma = sample["singular_values"]
        sigma = sigma[np.isfinite(sigma)]
        singular: int | None = int(sample["singular"])
        if not len(sigma):  # the arm holds: no rule has run
            jacobian = session.chain.jacobian(sample["q"])
            rotation = sample["pose"][:3, :3]
            sigma, singular = task_singular_values(jacobian, rotation, settings, session.length_scale), None
        clients = len(page._server.get_clients())
        controls.status.content = gauges.status_text(
            sample,
            session.chain,
            methods.TITLES[rule.family],
            session.statistics,
            session.rate,
            replaying,
            why="" if replaying else session.why_it_holds,
            driver=f"{seat.name(page._seat.driver)} of {clients}" if clients > 1 else seat.name(page._seat.driver),
        )
        controls.sigma.content = gauges.singular_bars(sigma, gamma, singular)
        controls.joints.content = gauges.joint_bars(
            sample["q"], sample["qdot"], session.chain, int(sample["limiting_joints"])
        )
        controls.release.visible = bool(session.stopped)
        controls.take.visible = clients > 1 or page._device is not None
        controls.play.label = "Replay" if page._replay is None else "End the replay"
        if session.recording:
            full = ", full" if session.recording_full else ""
            where = f", in memory only: {session.recording_trouble}" if session.recording_trouble else ""
            controls.recorded.content = gauges.printable(f"recording: {session.recorded} cycles{full}{where}")


class _Replay:
    """A recording that is being shown."""

    def __init__(self, episode: Episode, name: str, begun: float) -> None:
        self.episode, self.name, self._begun = episode, name, begun

    def sample(self) -> Any:
        """The sample to show now, by the recording's clock; None after the last one."""
        at = time.monotonic() - self._begun
        if at > self.episode.duration:
            return None
        clock = self.episode["time"]
        return self.episode.samples[max(0, int(np.searchsorted(clock, clock[0] + at, side="right")) - 1)]
