"""Differential inverse kinematics of other libraries, each driven as its own README or example drives an arm.

A peer is a class `Peer(chain, dt)` in a file of this package, with the members of `DrivenServo`. A peer's model is the
chain as a URDF (`peers.urdf`), so that all servos have the same joints, links and limits. Only the file of a peer
that is asked for is imported.
"""

from __future__ import annotations

import importlib
import importlib.metadata
from dataclasses import dataclass
from typing import Protocol

import numpy as np

import sigmaik as sk
from sigmaik._extras import MissingPackage
from sigmaik._types import Array
from sigmaik_lab.arrival.driven import DrivenServo
from sigmaik_lab.arrival.judge import held_limits

__all__ = ["PEERS", "VARIANTS", "Clipped", "Peer", "PeerPackage", "make_peer", "need_peer", "split_peer", "versions"]


@dataclass(frozen=True)
class PeerPackage:
    """A peer, and how its packages are installed."""

    file: str  #: of this package
    modules: tuple[str, ...]  #: which the file imports
    packages: tuple[str, ...]  #: as pip names them, the peer first
    about: str
    accelerates: bool = False  #: whether the peer has acceleration limits of its own
    clips: bool = True  #: whether its commands may be cut; EmbodiK stops where its commands are not obeyed
    note: str = ""  #: what pip does not tell


#: Peers by the name of --servo.
PEERS = {
    "placo": PeerPackage("placo_peer", ("placo",), ("placo>=0.10",), "PlaCo, a QP in C++"),
    "oink": PeerPackage(
        "oink_peer",
        ("roboplan.optimal_ik",),
        ("roboplan-oink",),
        "OInK of RoboPlan, a QP in C++",
        accelerates=True,
        note="in an environment of its own, because placo 0.10 needs another Pinocchio; --resume joins the runs",
    ),
    "pink": PeerPackage(
        "pink_peer",
        ("pink", "pinocchio", "quadprog"),
        ("pin-pink", "quadprog"),
        "Pink, a QP in Python",
        accelerates=True,
    ),
    "mink": PeerPackage("mink_peer", ("mink", "mujoco", "daqp"), ("mink", "daqp"), "mink, a QP in Python on MuJoCo"),
    "embodik": PeerPackage(
        "embodik_peer", ("embodik",), ("embodik",), "EmbodiK, prioritised tasks in C++", accelerates=True, clips=False
    ),
    "jparse-robotics": PeerPackage(
        "jparse_peer",
        ("jparse_robotics", "pinocchio"),
        ("jparse-robotics", "pin"),
        "the J-PARSE authors' package, without limits",
    ),
}
GAIN = 10.0  #: [1/s] of "+clip", the gain of `sk.Servo`: a whole error a cycle is more than acceleration limits follow
#: Variants of a peer, after its name.
VARIANTS = {
    "clip": "with a gain of 10/s, and its commands cut to the limits of velocity and acceleration",
    "acceleration": "with its own acceleration limits, where it has any",
}


def need_peer(name: str) -> None:
    """Raises MissingPackage where the peer's modules cannot be imported; the text has pip's command."""
    peer = PEERS[name]
    for module in peer.modules:
        try:
            importlib.import_module(module)
        except ImportError as error:
            command = " ".join(f"'{package}'" if ">" in package else package for package in peer.packages)
            reason = str(error).splitlines()[0]
            note = f" ({peer.note})" if peer.note else ""
            raise MissingPackage(f"servo '{name}' needs more packages: {reason}; pip install {command}{note}") from None


def make_peer(name: str, chain: sk.Chain, dt: float) -> DrivenServo:
    """The peer of a name of `PEERS`, or of such a name with a variant: "placo+clip".

    MissingPackage where the peer's packages are not installed. ValueError where there is no such peer or variant.
    """
    base, variant = split_peer(name)
    need_peer(base)
    make = importlib.import_module(f"{__name__}.{PEERS[base].file}").Peer
    if variant == "clip":
        return Clipped(make(chain, dt, gain=GAIN * dt), chain, dt)
    peer: Peer = make(chain, dt, acceleration=True) if variant == "acceleration" else make(chain, dt)
    return peer


def split_peer(name: str) -> tuple[str, str]:
    """Name and variant of a peer. ValueError where there is none, or where the peer has no such variant."""
    base, plus, variant = name.partition("+")
    if base not in PEERS:
        raise ValueError(f"no peer '{base}'; there are {', '.join(PEERS)}")
    known = [*(["clip"] if PEERS[base].clips else []), *(["acceleration"] if PEERS[base].accelerates else [])]
    if plus and variant not in known:
        raise ValueError(f"no servo '{name}'; there are {', '.join([base, *(f'{base}+{other}' for other in known)])}")
    return base, variant


def versions(*packages: str) -> str:
    """Names and versions of packages, as in "mink 1.3.0, daqp 0.11.0"."""
    return ", ".join(f"{package} {importlib.metadata.version(package)}" for package in packages)


class Peer(DrivenServo, Protocol):
    """A servo of another library."""

    def put(self, q: Array) -> None:
        """The arm is at q (n,), wherever the commands have led."""


class Clipped:
    """A peer whose commands are cut, joint by joint, to the velocity limits and to what the acceleration limits allow
    in a cycle, as a robot's driver may do. The peer is told where the arm is."""

    def __init__(self, peer: Peer, chain: sk.Chain, dt: float) -> None:
        self._peer, self._dt = peer, dt
        self._velocity, self._acceleration, _ = held_limits(chain)
        self.settings, self.version = f"{peer.settings}; commands cut to the limits", peer.version
        self.led = False
        self._q = self._qdot = np.zeros(chain.dof)

    @property
    def q(self) -> Array:
        return self._q

    def reset(self, q: Array) -> None:
        self._peer.reset(q)
        self._q, self._qdot = q.copy(), np.zeros(len(q))

    def update(self, target: Array) -> Array:
        asked = np.clip(self._peer.update(target), -self._velocity, self._velocity)
        step = self._dt * self._acceleration
        self._qdot = np.clip(asked, self._qdot - step, self._qdot + step)
        self._q = self._q + self._dt * self._qdot
        self._peer.put(self._q)
        return self._qdot
