"""The scene as it goes on: where hand, ball and camera are at each time, and the pictures that the camera takes.

The hand moves with the experiment's target: the tag has a fixed place in the target's frame. In the experiment's gap
the hand takes the tag out of view, and before that a ball passes between the camera and the tag. No random generator
says what the camera sees: the scene does, and the shutter, and the detector.
"""

from __future__ import annotations

import dataclasses
import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

import sigmaik as sk
from sigmaik._types import Array

from .camera import Frame
from .experiment import TrackExperiment
from .lens import Lens

__all__ = ["EYES", "FILM", "LEAVES", "Eye", "Look", "Stage", "Still", "make_stage"]

#: Where the rendered camera is.
EYES: dict[str, str] = {
    "wrist": "on the tip, and looks along its z axis, as in the J-PARSE paper; joints tell where the camera is",
    "fixed": "beside the arm, at a known place",
}
#: How the hand takes the tag out of view in the gap.
LEAVES: dict[str, str] = {
    "turn": "turns its back to the camera, by 150°",
    "aside": "goes aside, out of the picture",
}
#: [m] from the target to the tag, and from the camera to the tag, of each.
_AWAY = {"wrist": 0.3, "fixed": 0.6}
#: [m] of the camera on the wrist, in the tip's frame.
_MOUNT = (0.06, 0.0, 0.0)
#: Part of the duration at which the ball is before the tag, [m/s] its speed; and [s] in which the hand leaves.
_BALL_TIME, _BALL_SPEED, _LEAVE = 0.15, 0.25, 0.35
#: [rad] by which the hand turns.
_TURN = math.radians(150.0)
#: Half widths of the picture that the hand goes aside: an arm with the camera follows for a part of the way.
_HALVES = {"wrist": 2.4, "fixed": 1.6}
#: A sample that is farther from the truth is wrong [m, rad]; for the tables, and not for the arm.
_WRONG = (0.05, 0.5)
#: [pictures/s] that are kept for the film.
FILM = 6.0
_FACING = np.diag([1.0, -1.0, -1.0, 1.0])


@dataclass(frozen=True)
class Stage:
    """An experiment whose target is a hand with a tag, and the camera that looks at the tag."""

    experiment: TrackExperiment  #: no frames: a run makes them
    eye: str  #: one of `EYES`
    lens: Lens
    mount: Array  #: (4, 4) of the camera, in the tip's frame (wrist) or the base's
    to_tag: Array  #: (4, 4) of the tag, in the target's frame
    ball: Array  #: (3,) [m] place of the ball at `ball_time`
    ball_way: Array  #: (3,) [m/s]
    ball_time: float  #: [s]
    leave: str  #: one of `LEAVES`
    aside: Array  #: (3,) [m] the hand's way aside

    @property
    def away(self) -> float:
        """[m] from the camera to the tag: where the tip is at the target (wrist), or at the start (fixed)."""
        return _AWAY[self.eye]

    def hand(self, t: float) -> Array:
        """(4, 4) the tag's true pose at a time [s], which only the scene knows."""
        e = self.experiment
        x = min(max(t * e.settings.rate, 0.0), len(e.poses) - 1.0)
        k = min(int(x), len(e.poses) - 2)
        a, b = e.poses[k], e.poses[k + 1]
        pose = a.copy()
        pose[:3, 3] += (x - k) * (b[:3, 3] - a[:3, 3])
        pose[:3, :3] = sk.rotation_exp((x - k) * sk.rotation_log(b[:3, :3] @ a[:3, :3].T)) @ a[:3, :3]
        tag: Array = pose @ self.to_tag
        begin, end = e.gap
        if begin < t < end:
            u = min(1.0, (t - begin) / _LEAVE, (end - t) / _LEAVE)
            part = u**3 * (10.0 - 15.0 * u + 6.0 * u * u)
            if self.leave == "turn":
                tag[:3, :3] = tag[:3, :3] @ sk.rotation_exp([0.0, part * _TURN, 0.0])
            else:
                tag[:3, 3] += part * self.aside
        return tag


@dataclass(frozen=True)
class Look:
    """A picture, and what was found in it. The errors and the reason are for the tables; the arm does not know them."""

    stamp: float  #: [s] middle of the exposure
    found: bool
    position_error: float  #: [m] of the tag; NaN where the tag was not found
    rotation_error: float  #: [rad]
    reason: str  #: why there was no tag: "outside", "covered", "turned", or "unclear" for all that is left


@dataclass(frozen=True)
class Still:
    """A picture that is kept, and one of the whole scene at the same time."""

    stamp: float
    picture: NDArray[np.uint8]  #: (height, width, 3)
    outside: NDArray[np.uint8]  #: (height, width, 3)
    corners: Array | None  #: (4, 2) of the tag that was found [pixels]


def make_stage(e: TrackExperiment, eye: str, lens: Lens, leave: str = "turn") -> Stage:
    """Puts a camera before the target of an experiment. ValueError where a name is not known."""
    for what, name, known in (("camera", eye, EYES), ("way to leave", leave, LEAVES)):
        if name not in known:
            raise ValueError(f"no {what} '{name}'; there are {', '.join(known)}")
    home, away = e.poses[0], _AWAY[eye]
    mount = np.eye(4)
    if eye == "wrist":
        mount[:3, 3] = _MOUNT
        # The camera faces the tag where the tip is at the target.
        to_tag = mount @ _shift(away) @ _FACING
        camera = home @ mount
    else:
        from .scene import look_at

        # To the side of the arm, and above: the arm is not between camera and hand.
        outward = np.array([home[0, 3], home[1, 3], 0.0])
        side = np.cross([0.0, 0.0, 1.0], outward / max(1e-9, float(np.linalg.norm(outward))))
        side = side + np.array([0.0, 0.0, 0.4]) if np.linalg.norm(side) > 0.5 else np.array([0.0, 1.0, 0.4])
        tag = home @ _shift(0.15)
        mount = camera = look_at(tag[:3, 3] + away * side / np.linalg.norm(side), tag[:3, 3])
        to_tag = np.linalg.inv(home) @ camera @ _shift(away) @ _FACING
    to_tag[:3, :3] = to_tag[:3, :3] @ sk.rotation_exp([-math.radians(lens.tilt), 0.0, 0.0])
    e = dataclasses.replace(e, frames=())
    ball_time = _BALL_TIME * len(e.poses) / e.settings.rate
    across, half = camera[:3, 0], away * 0.5 * lens.width / lens.focal_length
    stage = Stage(
        e, eye, lens, mount, to_tag, np.zeros(3), across * _BALL_SPEED, ball_time, leave, across * _HALVES[eye] * half
    )
    target = e.poses[min(len(e.poses) - 1, round(ball_time * e.settings.rate))]
    camera = target @ mount if eye == "wrist" else mount
    return dataclasses.replace(stage, ball=0.5 * (camera[:3, 3] + stage.hand(ball_time)[:3, 3]))


def _shift(z: float) -> Array:
    pose = np.eye(4)
    pose[2, 3] = z
    return pose


class Eye:
    """Takes the pictures of a run. `look` is for `follow`.

    A sample comes of a picture, of the lens, of the tag's size, and of where the camera is: of the joints' measured
    positions in the middle of the exposure, or of the known place. The true pose of the hand goes into the picture and
    into the tables, and nowhere else.
    """

    def __init__(self, stage: Stage, film: bool = False) -> None:
        """film: whether pictures are kept. OSError where no OpenGL is found."""
        from .detector import Detector
        from .scene import Scene, look_at

        e, lens = stage.experiment, stage.lens
        size = float(np.linalg.norm(e.poses[:, :3, 3], axis=1).max())
        middle = 0.5 * e.poses[:, :3, 3].mean(axis=0)
        outside = look_at(middle + size * np.array([0.7, -1.9, 0.9]), middle)
        self._scene = Scene(e.chain, lens, stage.mount, stage.eye == "wrist", outside, size)
        self._detector = Detector(lens)
        self._stage, self._moments = stage, lens.moments()
        self._rate, self._dt = e.camera.rate, 1.0 / e.settings.rate
        self._next = math.ceil(0.5 * lens.exposure * self._rate + 1e-9)
        self._sum = np.zeros((lens.height, lens.width, 3))
        self._part, self._where, self._why = 0, np.eye(4), ""
        self._film = max(1, round(self._rate / FILM)) if film else 0
        self._to_target = np.linalg.inv(stage.to_tag)
        self.looks: list[Look] = []
        self.frames: list[Frame] = []
        self.stills: list[Still] = []

    def look(self, k: int, q: Array) -> list[Frame]:
        """Renders the parts of a picture whose time has come, and answers with the sample of a whole picture."""
        stage = self._stage
        if abs(k * self._dt - self._next / self._rate) <= 0.5 * self._dt:  # the middle of the exposure
            self._where = stage.mount if stage.eye == "fixed" else stage.experiment.chain.pose(q) @ stage.mount
        frames: list[Frame] = []
        while k * self._dt >= self._next / self._rate + self._moments[self._part] - 0.5 * self._dt:
            stamp = self._next / self._rate
            moment = stamp + self._moments[self._part]
            ball = stage.ball + (moment - stage.ball_time) * stage.ball_way
            hand = stage.hand(moment)
            self._scene.place(q, hand, ball)
            self._sum += self._scene.draw("eye")
            self._part += 1
            if 2 * self._part == len(self._moments):
                self._why = self._scene.why_not()
            if self._part == len(self._moments):
                frames += self._take(stamp)
                self._sum[:], self._part = 0.0, 0
                self._next += 1
        self.frames += frames
        return frames

    def _take(self, stamp: float) -> list[Frame]:
        stage, e = self._stage, self._stage.experiment
        picture = np.round(self._sum / len(self._moments)).astype(np.uint8)
        found = self._detector.find(picture)
        if self._film and self._next % self._film == 0:
            self.stills.append(Still(stamp, picture, self._scene.draw("view"), found[1] if found else None))
        if found is None:
            self.looks.append(Look(stamp, False, math.nan, math.nan, self._why or "unclear"))
            return []
        tag = self._where @ found[0]
        error = sk.pose_error(tag, stage.hand(stamp))
        linear, angular = float(np.linalg.norm(error[:3])), float(np.linalg.norm(error[3:]))
        self.looks.append(Look(stamp, True, linear, angular, ""))
        arrival = stamp + 0.5 * stage.lens.exposure + e.camera.delay
        return [Frame(stamp, arrival, tag @ self._to_target, linear > _WRONG[0] or angular > _WRONG[1])]

    def close(self) -> None:
        """Frees the renderers."""
        self._scene.close()
