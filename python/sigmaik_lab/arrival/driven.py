"""The interface of a servo that the study drives."""

from __future__ import annotations

from typing import Protocol

from sigmaik._types import Array

__all__ = ["DrivenServo"]


class DrivenServo(Protocol):
    """What the study drives. A peer is a class with these members."""

    @property
    def settings(self) -> str:
        """How the servo is set up, in one line."""

    @property
    def version(self) -> str:
        """Names and versions of the packages."""

    @property
    def q(self) -> Array:
        """(n,) where the commands have led so far."""

    @property
    def led(self) -> bool:
        """Whether the last command led away from the tool's own way."""

    def reset(self, q: Array) -> None:
        """The arm rests at q (n,)."""

    def update(self, target: Array) -> Array:
        """Joint velocities (n,) of the next cycle towards the pose `target` (4, 4), tip in base."""
