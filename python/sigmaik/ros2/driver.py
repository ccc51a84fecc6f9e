"""A servo loop with measured joints, named frames and time stamps: what a node of a middleware needs."""

from __future__ import annotations

import dataclasses
import reprlib
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from sigmaik._core import Chain, Error, LoopState, Servo, ServoLoop
from sigmaik._types import Array

from .frames import Frames

__all__ = ["Driver", "DriverSettings"]


@dataclasses.dataclass(frozen=True)
class DriverSettings:
    """Settings of a Driver. Error in `Driver` where a value is out of its range."""

    method: str = "jparse"
    """A rule with parameters, as on the command line: "jparse:gamma=0.05"."""
    rate: float = 500.0
    """[Hz] of the servo's cycles."""
    timeout: float = 0.1
    """[s] after which a command that is not repeated is stale, and the arm stops."""
    guided: bool = False
    """Whether the servo changes the arm's configuration where its own way to a pose does not arrive."""
    max_following_error: float | None = None
    """[rad or m] of any joint, beyond which the arm stops with a fault; None: no check."""
    measure_timeout: float | None = None
    """[s] without measured joints, after which the arm stops with a fault; None: no check."""
    servo: Mapping[str, Any] = dataclasses.field(default_factory=dict)
    """More options of `Servo`, by their names."""


class Driver:
    """Drives one arm: measured joints in, stamped commands in, the newest joint command out.

    An arm is *ready* when all of its joints have been measured, and *active* between `activate` and `deactivate`. The
    loop starts at the measured joints. The calls are for one thread; the loop has a thread of its own.
    """

    def __init__(self, chain: Chain, description: str, settings: DriverSettings | None = None) -> None:
        """description: the URDF's text, for the frames. Error where a setting is out of its range."""
        self.chain = chain
        self.settings = settings or DriverSettings()
        self.frames = Frames(chain, description)
        self.refused = 0  #: commands that were refused, since the driver was made
        self.last_refusal = ""  #: why the last one was
        self._make_servo(self.settings)
        self._joints: dict[str, float] = {}
        self._q: Array | None = None
        self._qdot: Array | None = None
        self._loop: ServoLoop | None = None
        self._token: Any = None
        self._newest: Any = None

    # --- the arm's joints

    def measure(self, names: Sequence[str], position: ArrayLike, velocity: ArrayLike = ()) -> bool:
        """Takes measured joints, in any order, with joints of other parts of the robot among them.

        position, velocity: [rad or m, rad/s or m/s]; velocity may be empty

        Returns whether all joints of the arm were among them, with finite numbers. Others are remembered for `frames`.
        """
        positions = np.asarray(position, dtype=float)
        velocities = np.asarray(velocity, dtype=float)
        if len(names) != positions.size:
            return False
        known = dict(zip(names, positions.tolist(), strict=True))
        self._joints.update((name, value) for name, value in known.items() if np.isfinite(value))
        if not all(np.isfinite(known.get(name, np.nan)) for name in self.chain.joint_names):
            return False
        self._q = np.array([known[name] for name in self.chain.joint_names])
        self._qdot = None
        if velocities.size == positions.size:
            speeds = dict(zip(names, velocities.tolist(), strict=True))
            qdot = np.array([speeds[name] for name in self.chain.joint_names])
            self._qdot = qdot if np.all(np.isfinite(qdot)) else None
        if self._loop is not None:
            self._loop.measure(self._q, self._qdot)
        return True

    @property
    def ready(self) -> bool:
        """Whether all joints of the arm have been measured."""
        return self._q is not None

    # --- the loop

    @property
    def active(self) -> bool:
        return self._loop is not None

    @property
    def state(self) -> LoopState:
        """Of the loop; DISABLED while the driver is not active."""
        return LoopState.DISABLED if self._loop is None else self._loop.state

    @property
    def fault(self) -> str:
        """Why the loop stopped the arm by itself; "": it did not."""
        fault = None if self._loop is None else self._loop.fault
        return "" if fault is None else fault.text

    def activate(self) -> None:
        """Starts the loop at the measured joints; the arm rests until a command comes. Error where a joint has not been
        measured."""
        if self._loop is not None:
            return
        if self._q is None:
            missing = [name for name in self.chain.joint_names if name not in self._joints]
            raise Error(f"no measured positions yet of {', '.join(missing) or 'all joints at once'}")
        servo = self._make_servo(self.settings)
        servo.reset(self._q, self._qdot)
        bound = self.settings.max_following_error
        loop = ServoLoop(
            servo,
            max_following_error=None if bound is None else np.full(self.chain.dof, bound),
            measure_timeout=self.settings.measure_timeout,
        )
        loop.measure(self._q, self._qdot)
        loop.start()
        self._token = loop.take("driver")
        self._loop, self._newest = loop, None

    def deactivate(self) -> bool:
        """Stops the arm, and ends the loop. Returns whether the arm rests; where it does not, the loop goes on stopping
        the arm, and the driver stays active."""
        if self._loop is None:
            return True
        if not self._loop.stop():
            return False
        self._loop = None
        return True

    def pause(self) -> None:
        """Stops the arm until `resume`; commands are refused meanwhile."""
        if self._loop is not None:
            self._loop.halt()

    def resume(self) -> None:
        """Goes on after `pause`, or after a fault: from the joints as they are measured now.

        Error where the arm does not rest yet, or is not active.
        """
        if self._loop is None:
            raise Error("the arm is not active")
        if self._loop.state == LoopState.STOPPING:
            raise Error("the arm does not rest yet")
        if self._loop.fault is not None:
            self._loop.acknowledge()
        if not self.deactivate():
            raise Error("the arm does not rest yet")
        self.activate()

    def change(self, settings: DriverSettings) -> None:
        """Goes on with other settings, without a stop where rate and supervision stay the same.

        Error where a setting is out of its range (nothing changes then), or where rate, max_following_error or
        measure_timeout differ while the driver is active.
        """
        servo = self._make_servo(settings)
        if self._loop is not None:
            for name in ("rate", "max_following_error", "measure_timeout"):
                if getattr(settings, name) != getattr(self.settings, name):
                    raise Error(f"{name} can change only while the arm is not active")
            self._loop.configure(servo, False, self._token)
        self.settings = settings

    def _make_servo(self, settings: DriverSettings) -> Servo:
        """Error where any of the settings is out of its range, also one that the servo does not have."""
        _check(settings)
        return Servo(self.chain, settings.method, 1.0 / settings.rate, guided=settings.guided, **dict(settings.servo))

    # --- commands

    def twist(self, twist: ArrayLike, frame: str = "", age: float = 0.0) -> bool:
        """Follows a twist (6,) [v; ω] of the tip's origin, with the axes of a frame.

        age: [s] of the command, whose time-out is shorter by this

        Returns whether the command was taken; `last_refusal` says why one was not.
        """

        def send(timeout: float) -> None:
            values = _array("twist", twist)
            if values.shape != (6,) or not np.all(np.isfinite(values)):
                raise Error(f"the twist needs six finite numbers, got {values}")
            axes = self._frame(frame)[:3, :3]
            turned = np.concatenate([axes @ values[:3], axes @ values[3:]])
            self._active().follow_twist(turned, timeout, self._token)

        return self._command(send, age)

    def pose(self, pose: ArrayLike, frame: str = "", age: float = 0.0) -> bool:
        """Follows a pose (4, 4) of the tip in a frame; age and answer as for `twist`."""

        def send(timeout: float) -> None:
            matrix = _array("pose", pose)
            if matrix.shape != (4, 4):
                raise Error(f"the pose needs shape (4, 4), got {matrix.shape}")
            self._active().follow(self._frame(frame) @ matrix, timeout, self._token)

        return self._command(send, age)

    def hold(self) -> None:
        """Stops the arm, until the next command."""
        if self._loop is not None:
            self._loop.hold()

    def _command(self, send: Any, age: float) -> bool:
        try:
            if not np.isfinite(age):
                raise Error(f"the command's age is {age} s")
            timeout = self.settings.timeout - max(0.0, age)
            if not timeout > 0.0:
                raise Error(f"the command is {age:.3g} s old, more than the time-out of {self.settings.timeout:g} s")
            if age < -self.settings.timeout:
                raise Error(f"the command's stamp is {-age:.3g} s ahead of the clock")
            send(timeout)
        except ValueError as error:
            self.refused += 1
            self.last_refusal = str(error)
            return False
        return True

    def _active(self) -> ServoLoop:
        if self._loop is None:
            raise Error("the arm is not active")
        return self._loop

    def _frame(self, frame: str) -> Array:
        positions = dict(self._joints)
        sample = self.newest()
        if sample is not None:  # where the arm is led to: what the servo refers to
            positions.update(zip(self.chain.joint_names, sample["q"].tolist(), strict=True))
        return self.frames.pose(frame, positions)

    # --- what was done

    def newest(self) -> Any:
        """The newest record of `ServoLoop.read`; None before the first cycle."""
        if self._loop is not None:
            records = self._loop.read()
            if len(records):
                self._newest = records[-1]
        return self._newest


def _check(settings: DriverSettings) -> None:
    """What the loop would refuse later: the command with the time-out, and the activation."""
    if not 1.0 <= settings.rate <= 1e4:
        raise Error(f"rate = {settings.rate:g} Hz must be from 1 to 10000")
    if not 0.0 < settings.timeout <= 60.0:
        raise Error(f"timeout = {settings.timeout:g} s must be above 0 and at most 60")
    if settings.max_following_error is not None and not 0.0 < settings.max_following_error < np.inf:
        raise Error(f"max_following_error = {settings.max_following_error:g} must be finite and above 0")
    if settings.measure_timeout is not None and not settings.measure_timeout > 0.0:
        raise Error(f"measure_timeout = {settings.measure_timeout:g} s must be above 0")


def _array(what: str, numbers: ArrayLike) -> Array:
    try:
        return np.array(numbers, dtype=float)
    except (TypeError, ValueError):
        raise Error(f"the {what} is no array of numbers: {reprlib.repr(numbers)}") from None
