"""All trials of several arms and servos, on any executor; a run may go on from the rows of an earlier one."""

from __future__ import annotations

import concurrent.futures
import functools
import pathlib
from collections.abc import Callable, Iterable
from dataclasses import asdict, dataclass
from typing import TypeAlias

import sigmaik as sk
from sigmaik_lab.row_file import append_rows, resume_rows
from sigmaik_lab.work import compute

from .experiment import ArrivalSettings, Trial, draw_trials, drive_trial
from .judge import TrialRow
from .servos import make_driven

__all__ = ["ArmSource", "Plan", "known_rows", "missing_tasks", "run_trials"]

CHUNK = 10  #: trials that a worker takes at a time


@dataclass(frozen=True)
class ArmSource:
    """From where a worker loads an arm: the arguments of `sk.robots.open`."""

    robot: str
    base: str | None = None
    tip: str | None = None

    @property
    def name(self) -> str:
        return sk.robots.open(self.robot, self.base, self.tip).name


@dataclass(frozen=True)
class Plan:
    """Arms, servos and settings; equal plans have equal trials."""

    arms: tuple[ArmSource, ...]
    servos: tuple[str, ...]
    settings: ArrivalSettings


Task: TypeAlias = tuple[ArmSource, str, ArrivalSettings, tuple[int, ...]]  #: arm, servo, settings, numbers of trials


def known_rows(plan: Plan, file: pathlib.Path | None) -> list[TrialRow]:
    """The rows of a file, which is begun where there is none: those of other arms, servos and trials, too.

    ValueError where the file is of other settings or another version.
    """
    if file is None:
        return []
    facts = {name: value for name, value in asdict(plan.settings).items() if name != "trials"}
    facts |= {"time": plan.settings.seconds, "version": sk.__version__}
    return resume_rows(file, facts, TrialRow)


def missing_tasks(plan: Plan, rows: Iterable[TrialRow]) -> list[Task]:
    """The work that is left to do, in chunks."""
    known = {(row.robot, row.servo, row.trial) for row in rows}
    tasks: list[Task] = []
    for arm in plan.arms:
        count = len(_trials(arm, plan.settings)[1])
        for servo in plan.servos:
            left = [k for k in range(count) if (arm.name, servo, k) not in known]
            tasks += [(arm, servo, plan.settings, tuple(left[i : i + CHUNK])) for i in range(0, len(left), CHUNK)]
    return tasks


def run_trials(
    plan: Plan,
    file: pathlib.Path | None = None,
    pool: concurrent.futures.Executor | None = None,
    jobs: int = 1,
    advance: Callable[[str, int], None] = lambda what, done: None,
) -> list[TrialRow]:
    """All rows of the plan, in the order of arms, servos and trials.

    file: takes each row as it comes, and has the rows that are not computed again
    pool: takes the work; None: this thread. jobs: number of workers to keep busy
    advance: called with what was done and the number of trials
    """
    rows = known_rows(plan, file)
    for found in compute(drive_chunk, missing_tasks(plan, rows), pool, jobs):
        if file is not None:
            append_rows(file, found)
        rows += found
        advance(f"{found[0].robot}, {found[0].servo}", len(found))
    order = {(arm.name, servo): i for i, (arm, servo) in enumerate((a, s) for a in plan.arms for s in plan.servos)}
    counts = {arm.name: len(_trials(arm, plan.settings)[1]) for arm in plan.arms}
    mine = [row for row in rows if (row.robot, row.servo) in order and row.trial < counts[row.robot]]
    return sorted(mine, key=lambda row: (order[row.robot, row.servo], row.trial))


def drive_chunk(task: Task) -> list[TrialRow]:
    """The rows of some trials. Runs in any process that has sigmaik."""
    arm, name, settings, numbers = task
    chain, trials = _trials(arm, settings)
    servo = make_driven(name, chain, settings.rate)
    return [drive_trial(chain, trials[k], servo, settings, (arm.name, name, k)) for k in numbers]


@functools.lru_cache(maxsize=32)
def _trials(arm: ArmSource, settings: ArrivalSettings) -> tuple[sk.Chain, list[Trial]]:
    chain = settings.with_limits(sk.robots.open(arm.robot, arm.base, arm.tip).chain)
    return chain, draw_trials(chain, settings)
