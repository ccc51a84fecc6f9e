"""Gamepads and SpaceMice as twists (extra `devices`). A missing device is an error.

Both devices move the arm only while a button is held (the dead man's switch): the left shoulder button of a gamepad,
the left button of a SpaceMouse. The devices are plugged into the machine that runs the servo.
"""

from __future__ import annotations

import os
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np

from sigmaik._extras import need
from sigmaik._types import Array

__all__ = ["DEVICES", "DeviceError", "Gamepad", "Reading", "SpaceMouse", "TwistDevice", "open_device"]

DEAD_ZONE = 0.12  #: part of a stick's travel in which the stick counts as released


class DeviceError(ValueError):
    """A device is missing, or has been unplugged."""


@dataclass(frozen=True)
class Reading:
    """One reading of a device."""

    twist: Array  #: (6,) [v; ω], each in [−1, 1], base axes: x ahead, y to the left, z up
    held: bool  #: whether the dead man's switch is held


class TwistDevice(Protocol):
    """A device that drives an arm by twists."""

    name: str

    def read(self) -> Reading:
        """The current reading. DeviceError if the device has been unplugged."""

    def close(self) -> None: ...


class Gamepad:
    """The first gamepad that SDL finds. The left stick moves along x and y, the right stick along z and about z."""

    def __init__(self) -> None:
        need("pygame")
        os.environ.setdefault("PYGAME_HIDE_SUPPORT_PROMPT", "1")
        os.environ.setdefault("SDL_VIDEODRIVER", "dummy")
        os.environ.setdefault("SDL_JOYSTICK_ALLOW_BACKGROUND_EVENTS", "1")
        import pygame

        self._pygame = pygame
        pygame.display.init()
        pygame.joystick.init()
        if pygame.joystick.get_count() == 0:
            pygame.joystick.quit()
            raise DeviceError("no gamepad is plugged in")
        self._pad = pygame.joystick.Joystick(0)
        self._id = self._pad.get_instance_id()
        self.name = f"gamepad {self._pad.get_name()}"
        if self._pad.get_numaxes() < 4 or self._pad.get_numbuttons() < 5:
            name, self.name = self.name, ""
            self.close()
            raise DeviceError(f"{name} has fewer than two sticks or five buttons")

    def read(self) -> Reading:
        for event in self._pygame.event.get():
            if event.type == self._pygame.JOYDEVICEREMOVED and event.instance_id == self._id:
                raise DeviceError(f"{self.name} is gone")
        x, y, turn, z = (_outside_dead_zone(self._pad.get_axis(i)) for i in range(4))
        return Reading(np.array([-y, -x, -z, 0.0, 0.0, -turn]), bool(self._pad.get_button(4)))

    def close(self) -> None:
        self._pygame.joystick.quit()


class SpaceMouse:
    """The first SpaceMouse that is found."""

    def __init__(self) -> None:
        need("pyspacemouse")
        import pyspacemouse

        try:
            self._mouse = pyspacemouse.open()
        except Exception as error:  # pyspacemouse and its HID layer raise errors of several types
            raise DeviceError(f"no SpaceMouse can be opened: {' '.join(str(error).split())}") from None
        if self._mouse is None:
            raise DeviceError("no SpaceMouse is plugged in")
        self.name = f"SpaceMouse {self._mouse.name}"

    def read(self) -> Reading:
        try:
            state: Any = self._mouse.read()
        except Exception as error:
            raise DeviceError(f"{self.name} is gone: {' '.join(str(error).split())}") from None
        # y of a SpaceMouse points ahead and x to the right; roll is about y, pitch about x.
        twist = np.array([state.y, -state.x, state.z, -state.roll, -state.pitch, -state.yaw])
        return Reading(np.clip(np.nan_to_num(twist), -1.0, 1.0), bool(state.buttons and state.buttons[0]))

    def close(self) -> None:
        self._mouse.close()


#: The class of each name that `open_device` knows.
DEVICES: dict[str, type[Gamepad] | type[SpaceMouse]] = {"gamepad": Gamepad, "spacemouse": SpaceMouse}


def open_device(name: str) -> TwistDevice:
    """Opens a device by name. ValueError for an unknown name; DeviceError, a ValueError too, for a missing device."""
    if name not in DEVICES:
        raise ValueError(f"there is no device '{name}'; there are {', '.join(DEVICES)}")
    return DEVICES[name]()


def _outside_dead_zone(value: float) -> float:
    """The deflection of a stick, scaled from 0 at the edge of the dead zone to ±1."""
    size = (min(abs(value), 1.0) - DEAD_ZONE) / (1.0 - DEAD_ZONE)
    return float(np.copysign(size, value)) if size > 0.0 else 0.0
