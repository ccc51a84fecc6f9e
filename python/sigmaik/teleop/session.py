"""One arm that is driven by hand."""

from __future__ import annotations

import dataclasses
import math
import pathlib
import threading
import time
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

import sigmaik as sk
from sigmaik._types import Array

from .episode import Arm, Episode
from .journal import Journal
from .settings import Settings
from .target import TargetPose

__all__ = ["Session"]
Samples = NDArray[np.void]

#: [cycles] The longest recording: ten minutes at 1 kHz, half a gigabyte.
LONGEST_RECORDING = 600_000


class Session:
    """A simulated arm, its servo in a thread, and the commands. Any thread may call the functions of a session.

    Commands go stale: the arm stops within its limits unless the command is repeated in time. `refresh` repeats a pose;
    the code that watches over the commander calls `refresh` while the commander is alive.

    A stop is latched: after `stop` every command is refused until `release`. A session that is left and entered again
    does not move before a new command. Whoever commands may own the arm (`take`): then commands need the token.

    Stops, faults and the owner are those of the `ServoLoop` (docs/loop.md); the session adds the reasons, for people.
    """

    def __init__(
        self,
        robot: str = "ufactory_xarm7",
        *,
        base: str | None = None,
        tip: str | None = None,
        settings: Settings | None = None,
        rate: float = 1000.0,
        start: ArrayLike | None = None,
        pose_timeout: float = 2.0,
        twist_timeout: float = 0.2,
        longest_recording: int = LONGEST_RECORDING,
    ) -> None:
        """
        robot: a shipped arm or a URDF file; base, tip: link names
        rate: [Hz] of the servo
        start: (n,) [rad or m], by default the arm's home
        pose_timeout, twist_timeout: [s] after which a command is stale
        longest_recording: [cycles], where a recording ends by itself
        ValueError where an argument is wrong, with the facts.
        """
        name, chain, home, self.source = sk.robots.open(robot, base, tip)
        self._urdf = self.source.read_text(encoding="utf-8")  # a recording needs the text, whatever becomes of the file
        if not 1.0 <= rate <= 20e3:
            raise ValueError(f"rate must be from 1 to 20000 Hz, not {rate:g}")
        for what, value in (("pose_timeout", pose_timeout), ("twist_timeout", twist_timeout)):
            if not 0.0 < value < math.inf:
                raise ValueError(f"{what} must be above 0 and finite, not {value:g}")
        known = np.isfinite(chain.limits.acceleration)
        #: Names of the joints without an acceleration limit, for which the servo assumes one.
        self.assumed = tuple(joint for joint, has in zip(chain.joint_names, known, strict=True) if not has)
        self.name = name
        self.chain = chain
        self.home: Array = home if start is None else np.array(start, dtype=np.float64)
        self.pose_timeout, self.twist_timeout = pose_timeout, twist_timeout
        self.longest_recording = longest_recording
        self._settings = settings or Settings()
        self._dt = 1.0 / rate
        servo = self._settings.servo(self.chain, self._dt, self.home)
        self._length_scale = servo.length_scale
        servo.reset(self.home)
        self._loop = sk.ServoLoop(servo, history=_power_of_two(2.0 * rate))
        self._goal: Array | None = None
        self._why_stopped = ""  # the loop says whether the arm is stopped
        self._stops = 0
        self._token: sk.LoopToken | None = None  # the owner's
        self._goal_token: sk.LoopToken | None = None
        self._why_it_holds = "no command yet"
        self._lock = threading.RLock()
        self._latest: Samples | None = None
        self._recorded: list[Samples] | None = None
        self._recording_ended = False
        self._journal: Journal | None = None
        self._recorded_cycles = 0
        self._from = 0  # number of the configuration with which the recording begins
        self._before: tuple[Array, Array] | None = None  # q and q̇ before the recording
        self._history: dict[int, Settings] = {0: self._settings}

    def __enter__(self) -> Session:
        with self._lock:
            if self._loop.fault is not None:
                self._loop.acknowledge()
                if not self._why_stopped:
                    self._loop.release(*self._tokens())
            self._hold("no command yet")
            self._loop.start()
            return self

    def __exit__(self, *_: object) -> None:
        self.hold("the session has ended")
        self._loop.stop()
        with self._lock:
            self.read()
            self._hold("the session has ended")  # what another thread commanded meanwhile
            if self._recorded is not None:
                self._recording_ended = True
            journal = self._journal
        if journal is not None:
            journal.close()

    # --- commands

    def take(self, who: str, take_over: bool = False) -> sk.LoopToken:
        """Makes `who` the arm's owner, whose commands need the token that is returned. The arm holds.

        Error where the arm has an owner, unless it is taken over on purpose. Anyone may stop and hold the arm.
        """
        with self._lock:
            self._token = self._loop.take(who, take_over)
            self._goal, self._why_it_holds = None, f"{who} took over"
            return self._token

    def give_back(self, token: sk.LoopToken) -> bool:
        """Gives the arm back; the arm holds. Returns False where the token is not the owner's any more."""
        with self._lock:
            given = self._loop.give_back(token)
            if given:
                self._token = None
                self._goal, self._why_it_holds = None, "nobody drives"
            return given

    @property
    def owner(self) -> str:
        """Who owns the arm; empty: nobody."""
        return self._loop.owner

    def follow(self, target: ArrayLike | TargetPose, token: sk.LoopToken | None = None) -> None:
        """Drives the tip to a pose (4, 4) in base. Error if the target is no pose, or more than 100 m away.

        Error while the session is stopped, and without the owner's token where the arm has an owner.
        """
        pose = TargetPose.of(target).matrix
        with self._lock:
            self._refuse_if_stopped()
            self._loop.follow(pose, self.pose_timeout, token)
            self._goal, self._goal_token, self._why_it_holds = pose, token, "the target was not repeated in time"

    def refresh(self) -> None:
        """Repeats the pose that the arm follows, so that the pose does not go stale."""
        with self._lock:
            if self._goal is not None and not self.stopped:
                self._loop.follow(self._goal, self.pose_timeout, self._goal_token)

    def twist(self, twist: ArrayLike, token: sk.LoopToken | None = None) -> None:
        """Moves the tip along [v; ω] (6,) [m/s, rad/s], base axes, for `twist_timeout`. Errors as those of `follow`."""
        with self._lock:
            self._refuse_if_stopped()
            self._loop.follow_twist(twist, self.twist_timeout, token)
            self._goal, self._why_it_holds = None, "the twist was not repeated"

    def hold(self, why: str = "told to hold") -> None:
        """Stops as fast as the limits allow. The next command moves the arm again; `stop` is latched.

        why: for people, see `why_it_holds`
        """
        with self._lock:
            self._hold(why)

    def _hold(self, why: str) -> None:
        self._goal, self._why_it_holds = None, why
        self._loop.hold()

    def stop(self, why: str = "Stop was pressed") -> None:
        """Stops as fast as the limits allow, and refuses every command until `release`."""
        with self._lock:
            self._why_stopped = why
            self._stops += 1
            self._loop.halt()
            self._hold(why)

    def release(self) -> None:
        """Ends a stop, and a fault of the loop, as soon as the arm rests. The arm holds until the next command.

        Error where the arm does not rest in time (`ServoLoop.stop_time`), and where it is stopped once more meanwhile.
        """
        with self._lock:
            asked, fault = self._stops, self._loop.fault
            deadline = time.monotonic() + self._loop.stop_time
        while not self._try_to_release(asked, fault, time.monotonic() > deadline):
            time.sleep(1e-3)

    def _try_to_release(self, asked: int, fault: sk.LoopFault | None, last: bool) -> bool:
        """Returns whether nothing is left to release. `last`: Error where the arm does not rest yet."""
        with self._lock:
            if self._stops != asked or self._loop.fault not in (None, fault):
                raise sk.Error(f"stopped once more ({self.stopped}): release that stop")
            if not self.stopped:
                return True
            if self._loop.state == sk.LoopState.STOPPING and not last:
                return False
            if self._loop.fault is not None:
                self._loop.acknowledge()
            self._loop.release(*self._tokens())
            self._why_stopped = ""
            self._hold("the stop was released; no command yet")
            return True

    @property
    def stopped(self) -> str:
        """Why the session is stopped: by `stop`, or a fault of the loop; empty while commands are taken."""
        fault = self._loop.fault
        if fault is not None:
            return f"fault: {fault.text}"
        return (self._why_stopped or "the loop was halted") if self._loop.halted else ""

    @property
    def why_it_holds(self) -> str:
        """Why the arm holds, where it holds."""
        return self.stopped or self._why_it_holds

    def _tokens(self) -> tuple[sk.LoopToken, ...]:
        """The owner's token; none where nobody owns the arm."""
        return () if self._token is None else (self._token,)

    def _refuse_if_stopped(self) -> None:
        if self.stopped:
            raise sk.Error(f"stopped ({self.stopped}): release the stop first")

    def restart(self, q: ArrayLike | None = None) -> None:
        """Puts the (simulated) arm at q (n,), by default where it started, and ends a recording's run of cycles.

        Error while stopped.
        """
        with self._lock:
            self._refuse_if_stopped()
            self._hold("put back; no command yet")
            servo = self._settings.servo(self.chain, self._dt, self.home)
            servo.reset(self.home if q is None else q)
            self._remember(self._loop.configure(servo, restart=True, token=self._token), self._settings)

    @property
    def goal(self) -> Array | None:
        """(4, 4) the pose that is followed."""
        return self._goal

    # --- settings

    @property
    def settings(self) -> Settings:
        return self._settings

    def configure(self, **changes: Any) -> None:
        """Changes settings by name, during the motion. Where a name or value is wrong, ValueError and no change."""
        with self._lock:
            settings = self._settings.with_(**changes)
            servo = settings.servo(self.chain, self._dt, self.home)
            self._remember(self._loop.configure(servo, token=self._token), settings)
            self._settings = settings
            self._length_scale = servo.length_scale

    def _remember(self, number: int, settings: Settings) -> None:
        self._history[number] = settings
        if self._journal is not None:
            self._journal.note(settings={str(number): dataclasses.asdict(settings)})

    @property
    def length_scale(self) -> float:
        """[m] 1 rad weighs as much as this length, as the servo has it."""
        return self._length_scale

    # --- what happens

    def read(self) -> Samples:
        """(N,) the samples since the last call, see `ServoLoop.read`. Recordings are made here: call `read` often."""
        with self._lock:
            samples: Samples = self._loop.read()
            if self._recorded is not None and not self._recording_ended:
                self._record(samples)
            if len(samples):
                self._latest = samples[-1:].copy()
            return samples

    def _record(self, samples: Samples) -> None:
        assert self._recorded is not None
        first = int(np.searchsorted(samples["configuration"], self._from))  # numbers of configurations only grow
        if first == len(samples):
            return
        if not self._recorded:
            before = samples[first - 1] if first > 0 else self.latest
            if before is not None:
                self._before = (before["q"].copy(), before["qdot"].copy())
            else:
                start = samples[first]
                self._before = (start["q"] - self._dt * start["qdot"], np.zeros(self.chain.dof))
            if self._journal is not None:
                self._journal.note(before=np.stack(self._before).tolist())
        kept = samples[first : first + self.longest_recording - self._recorded_cycles]
        if len(kept) == 0:
            return
        self._recorded.append(kept)
        self._recorded_cycles += len(kept)
        if self._journal is not None:
            self._journal.append(kept)

    @property
    def latest(self) -> Any:
        """The newest sample that `read` has seen; None before the first."""
        return None if self._latest is None else self._latest[0]

    @property
    def statistics(self) -> sk.LoopStatistics:
        """Cycles, rate and delays of the servo."""
        return self._loop.statistics

    @property
    def rate(self) -> float:
        """[Hz] The rate that was asked for."""
        return 1.0 / self._dt

    # --- recording

    @property
    def recording(self) -> bool:
        return self._recorded is not None

    @property
    def recorded(self) -> int:
        """Cycles recorded so far."""
        return self._recorded_cycles

    @property
    def recording_full(self) -> bool:
        """Whether the recording has reached its longest."""
        return self.recorded >= self.longest_recording

    @property
    def recording_trouble(self) -> str:
        """Why the file of the recording is not written any more; the recording goes on in memory."""
        return self._journal.trouble if self._journal is not None else ""

    def start_recording(self, file: str | pathlib.Path | None = None) -> None:
        """Records from the next cycle on, in memory.

        file: a new file `.part` that has the recording as far as it goes, whatever ends the program, and that
        `Episode.load` reads; by default none. The caller removes the file once the episode is saved. Error where the
        file exists or a recording already runs, OSError where the file cannot be written.
        """
        with self._lock:
            if self._recorded is not None:
                raise sk.Error("it is recording already")
            self.read()
            self._journal = None if file is None else Journal(file, self._note())
            # The recording begins with a fresh servo, so that a replay gives the same bits.
            servo = self._settings.servo(self.chain, self._dt, self.home)
            self._from = self._loop.configure(servo, token=self._token)
            self._remember(self._from, self._settings)
            self._recorded, self._recorded_cycles, self._recording_ended = [], 0, False

    def stop_recording(self) -> Episode:
        """Ends the recording and returns it. Error where no cycle was recorded."""
        with self._lock:
            if self._recorded is None:
                raise sk.Error("it is not recording")
            self.read()
            recorded, self._recorded = self._recorded, None
            cycles, self._recorded_cycles = self._recorded_cycles, 0
            journal, self._journal = self._journal, None
            before, history = self._before, dict(self._history)
        # Without the lock, so that no command waits for the disk.
        if journal is not None:
            journal.close() if cycles else journal.discard()
        if cycles == 0:
            raise sk.Error("no cycle was recorded")
        assert before is not None
        samples: Samples = np.concatenate(recorded)
        used = set(np.unique(samples["configuration"]).tolist())
        return Episode(
            samples,
            Arm(self.name, self._urdf, self.chain, self.home),
            self._dt,
            {number: s for number, s in history.items() if number in used},
            before,
        )

    def _note(self) -> dict[str, Any]:
        """What the file of a recording says before its first cycle."""
        limits = self.chain.limits
        return {
            "robot": self.name,
            "base": self.chain.base,
            "tip": self.chain.tip,
            "dt": self._dt,
            "urdf": self._urdf,
            "joint_names": list(self.chain.joint_names),
            "limits": {name: getattr(limits, name).tolist() for name in ("lower", "upper", "velocity", "acceleration")},
            "home": self.home.tolist(),
            "settings": {},
            "version": sk.__version__,
        }


def _power_of_two(least: float) -> int:
    return 1 << max(6, math.ceil(math.log2(least)))
