"""Servos by name, behind one interface: our own, and those of other libraries (`sigmaik_lab.arrival.peers`)."""

from __future__ import annotations

import sigmaik as sk
from sigmaik._types import Array

from .driven import DrivenServo
from .peers import PEERS, make_peer, need_peer, split_peer

__all__ = ["SERVOS", "OwnServo", "check_servo", "is_peer", "make_driven", "make_servo"]

#: Our servos that the study compares.
SERVOS: dict[str, str] = {
    "default": "sk.Servo(arm)",
    "guided": "sk.Servo(arm, guided=True)",
    "fixed": "J-PARSE with γ = 0.02, not adaptive",
}


class OwnServo:
    """A `sk.Servo` as a `DrivenServo`."""

    version = f"sigmaik {sk.__version__}"

    def __init__(self, servo: sk.Servo, settings: str) -> None:
        self.servo, self.settings = servo, settings
        self._step: sk.ServoStep | None = None

    @property
    def q(self) -> Array:
        return self.servo.q

    @property
    def led(self) -> bool:
        return self._step is not None and self._step.guide == sk.GuideState.CHANGING_BRANCH

    def reset(self, q: Array) -> None:
        self.servo.reset(q)
        self._step = None

    def update(self, target: Array) -> Array:
        self._step = self.servo.update(target)
        return self._step.qdot


def is_peer(name: str) -> bool:
    """Whether the name is that of a peer, with a variant or without."""
    return name.partition("+")[0] in PEERS


def check_servo(name: str, installed: bool = True) -> None:
    """ValueError where no servo has this name. installed: also MissingPackage where a peer's packages are missing."""
    if is_peer(name):
        base, _ = split_peer(name)
        if installed:
            need_peer(base)
    elif name not in SERVOS:
        try:
            sk.methods.parse(name)
        except sk.Error as error:
            raise ValueError(
                f"no servo '{name}'; there are {', '.join(SERVOS)}, {', '.join(PEERS)}, and methods: {error}"
            ) from None


def make_driven(name: str, chain: sk.Chain, rate: float) -> DrivenServo:
    """The servo of a name: of `SERVOS`, a peer's, or a method's. ValueError where there is none, or not installed."""
    check_servo(name)
    if is_peer(name):
        return make_peer(name, chain, 1.0 / rate)
    return OwnServo(make_servo(name, chain, rate), SERVOS.get(name, f"sk.Servo(arm, {name})"))


def make_servo(name: str, chain: sk.Chain, rate: float) -> sk.Servo:
    """A servo of `SERVOS`, or one with a method by name. Error where there is neither."""
    if name not in SERVOS:
        return sk.Servo(chain, sk.methods.parse(name), dt=1.0 / rate)
    if name != "fixed":
        return sk.Servo(chain, dt=1.0 / rate, guided=name == "guided")
    rule = sk.JParse(gamma=0.02, adaptive=False)
    return sk.Servo(chain, rule, dt=1.0 / rate, gain_linear=10.0, gain_angular=10.0)
