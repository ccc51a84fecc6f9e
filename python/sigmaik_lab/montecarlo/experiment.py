"""The Monte Carlo study of Beck et al. (2022), section 4: what keeping clear of singularities costs, and what it
brings.

The study draws random pairs of configurations, the same pairs for every objective, and computes the metrics (28) to
(32) of the motion between them. A sample depends on the seed and its number alone, so that any sample can be computed
anywhere, in any order: the study runs on any object with the interface of `concurrent.futures.Executor`, writes each
sample as it comes, and resumes where it was interrupted.

The study does two things that the paper does not do. It also samples m densely, between the nodes, where m can be
orders of magnitude smaller; and it counts the crossings of singular sets that no path could have avoided.
"""

from __future__ import annotations

import concurrent.futures
import itertools
import math
import pathlib
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass
from typing import Literal, cast

import numpy as np

import sigmaik as sk
from sigmaik._types import Array
from sigmaik.planning import Trajectory, time_optimal
from sigmaik_lab import row_file
from sigmaik_lab.work import compute

__all__ = [
    "OBJECTIVES",
    "Mean",
    "MonteCarlo",
    "Row",
    "Summary",
    "read_rows",
    "run_study",
    "sample_pair",
    "solve_sample",
    "summarize_study",
]
Objective = Literal["none", "manipulability", "potential"]

OBJECTIVES: tuple[Objective, ...] = ("none", "manipulability", "potential")
LEAST = 1e-4
"""Manipulability below which a start or goal is left out, as in the paper."""
CHUNK = 8
"""Samples that a worker takes at a time."""


@dataclass(frozen=True)
class MonteCarlo:
    """All settings of a study. Two studies with equal settings have equal samples."""

    robot: str = "kuka_lbr_iiwa_14_r820"
    """A shipped arm or a URDF file; without known singular sets there is no objective "potential"."""
    samples: int = 1000
    seed: int = 0
    objectives: tuple[Objective, ...] = OBJECTIVES
    nodes: int = 30
    time_weight: float = 600.0
    """1 as printed; 600 gives durations like the paper's."""
    avoid_weight: float = 1e2
    solver: Literal["sigmaik", "ipopt"] = "sigmaik"
    generic: bool = False
    """m from the Jacobian, even where a closed form is known."""
    between_nodes: bool = False
    """Keep the limits of position between the nodes, which the paper does not ask for."""
    base: str | None = None
    tip: str | None = None
    """Link names, as for `sigmaik.robots.open`."""

    def __post_init__(self) -> None:
        arm = sk.robots.open(self.robot, self.base, self.tip)
        if not 1 <= self.samples <= 10_000_000 or self.seed < 0:
            raise ValueError("samples must be 1 to 10,000,000, and seed not negative")
        wrong = [o for o in self.objectives if o not in OBJECTIVES]
        if wrong or not self.objectives or len(set(self.objectives)) != len(self.objectives):
            raise ValueError(f"objectives must be some of {', '.join(OBJECTIVES)}, each once")
        if "potential" in self.objectives and sk.singularities.of(arm.chain) is None:
            raise ValueError(
                f"no objective potential for '{arm.name}': its singular sets are not known; those of "
                f"{', '.join(sk.singularities.names())} are"
            )

    @property
    def name(self) -> str:
        """Name of the arm."""
        return sk.robots.open(self.robot, self.base, self.tip).name

    def chain(self) -> sk.Chain:
        """The arm. The range of a joint that turns more than twice is cut to one turn; more turns are another study."""
        chain = sk.robots.open(self.robot, self.base, self.tip).chain
        wide = chain.limits.upper - chain.limits.lower > 4.0 * math.pi + 1e-6
        return chain.with_limits(
            lower=np.where(wide, -math.pi, chain.limits.lower), upper=np.where(wide, math.pi, chain.limits.upper)
        )


@dataclass(frozen=True)
class Row:
    """A sample with one objective."""

    sample: int
    objective: str
    status: str
    duration: float
    """[s] t_F"""
    solve_time: float
    """[s] computing time of the optimiser"""
    m_min: float
    """Least manipulability of the nodes (28)"""
    m_max: float
    """Largest manipulability of the nodes (29)"""
    m_avg: float
    """Mean manipulability of the nodes (30)"""
    l_p: float
    """[m] length of the flange's path (31)"""
    l_quat: float
    """Change of orientation (32), as printed: with Shepperd's quaternions, whose sign can jump, by about 2 each time"""
    angle: float
    """[rad] angle that the flange turns through, without such jumps"""
    m_dense: float
    """Least manipulability between the nodes too"""
    unavoidable: int
    """Crossings of singular sets that no path could do without"""
    avoidable: int
    """Other crossings"""
    cost: float
    """Objective"""


def sample_pair(study: MonteCarlo, chain: sk.Chain, sample: int) -> tuple[Array, Array]:
    """Start and goal (n,) of a sample: uniform within the limits, of manipulability at least 1e-4."""
    rng = np.random.default_rng([study.seed, sample])
    ends: list[Array] = []
    while len(ends) < 2:
        q = rng.uniform(chain.limits.lower, chain.limits.upper)
        if float(sk.indices.manipulability(chain.jacobian(q))) >= LEAST:
            ends.append(q)
    return ends[0], ends[1]


def solve_sample(study: MonteCarlo, sample: int) -> list[Row]:
    """The rows of a sample, one an objective. Runs in any process that has sigmaik."""
    arm = (study.robot, study.base, study.tip)
    if arm not in _chains:
        _chains[arm] = study.chain()
    chain = _chains[arm]
    start, goal = sample_pair(study, chain, sample)
    rows = []
    for objective in study.objectives:
        plan = time_optimal(
            chain,
            start,
            goal,
            None if objective == "none" else objective,
            nodes=study.nodes,
            time_weight=study.time_weight,
            avoid_weight=study.avoid_weight,
            generic_manipulability=study.generic,
            between_nodes=study.between_nodes,
            solver=study.solver,
        )
        rows.append(_row(chain, sample, objective, plan))
    return rows


_chains: dict[tuple[str, str | None, str | None], sk.Chain] = {}


def _solve_chunk(task: tuple[MonteCarlo, Sequence[int]]) -> list[list[Row]]:
    study, samples = task
    return [solve_sample(study, sample) for sample in samples]


def _row(chain: sk.Chain, sample: int, objective: str, plan: Trajectory) -> Row:
    if plan.clearance is None:
        nan = math.nan
        return Row(sample, objective, plan.status, nan, plan.solve_time, nan, nan, nan, nan, nan, nan, nan, 0, 0, nan)
    m = np.asarray(sk.indices.evaluate(chain, plan.q, "manipulability"))
    poses = chain.pose(plan.q)
    rotations = poses[:, :3, :3]
    steps = rotations[1:] @ rotations[:-1].transpose(0, 2, 1)
    # ‖R − I‖ = √8 sin(angle/2), which is accurate for small angles, too.
    half = np.linalg.norm(steps - np.eye(3), axis=(1, 2)) / math.sqrt(8.0)
    quaternions = shepperd(rotations)
    return Row(
        sample,
        objective,
        plan.status,
        plan.duration,
        plan.solve_time,
        float(m.min()),
        float(m.max()),
        float(m.mean()),
        float(np.linalg.norm(np.diff(poses[:, :3, 3], axis=0), axis=1).sum()),
        float(np.sum(1.0 - np.sum(quaternions[1:] * quaternions[:-1], axis=1))),
        float(np.sum(2.0 * np.arcsin(np.minimum(half, 1.0)))),
        plan.clearance.min_manipulability,
        len(plan.clearance.unavoidable),
        len(plan.clearance.avoidable),
        plan.cost,
    )


def shepperd(rotations: Array) -> Array:
    """Quaternions (N, 4), wxyz, of rotations (N, 3, 3) by Shepperd (1978): the largest component is positive."""
    r = rotations
    trace = np.trace(r, axis1=1, axis2=2)
    squares = np.stack([trace, r[:, 0, 0], r[:, 1, 1], r[:, 2, 2]], axis=1)
    symmetric = {
        (0, 1): r[:, 2, 1] - r[:, 1, 2],
        (0, 2): r[:, 0, 2] - r[:, 2, 0],
        (0, 3): r[:, 1, 0] - r[:, 0, 1],
        (1, 2): r[:, 0, 1] + r[:, 1, 0],
        (1, 3): r[:, 0, 2] + r[:, 2, 0],
        (2, 3): r[:, 1, 2] + r[:, 2, 1],
    }
    products = np.zeros((len(r), 4, 4))  # 4 q_i q_j
    for i in range(4):
        products[:, i, i] = 1.0 + 2.0 * squares[:, i] - trace
    for (i, j), value in symmetric.items():
        products[:, i, j] = products[:, j, i] = value
    best = squares.argmax(axis=1)
    row = products[np.arange(len(r)), best]
    quaternions: Array = row / (2.0 * np.sqrt(row[np.arange(len(r)), best]))[:, None]
    return quaternions


# --- the run


def run_study(
    study: MonteCarlo,
    file: str | pathlib.Path,
    executor: concurrent.futures.Executor | None = None,
    advance: Callable[[int], None] = lambda n: None,
    jobs: int = 1,
) -> list[Row]:
    """Computes the samples that are missing in `file`, and returns all rows, in the order of samples.

    The file is CSV, a line for each sample and objective, after a line "# " with the study as JSON. All lines of a
    sample are written at once; a sample that an interruption left incomplete is computed again. Raises ValueError where
    the file is of another study.

    executor: takes the work; by default this thread does the work. `jobs`: number of workers to keep busy.
    advance: called with the number of samples done, first with the number of samples in the file.
    """
    file = pathlib.Path(file)
    facts = {name: value for name, value in asdict(study).items() if name not in ("base", "tip") or value is not None}
    facts["version"] = sk.__version__
    rows = row_file.resume_rows(file, facts, Row, lambda found: _whole(study, found), may_differ=["samples"])
    done = {row.sample for row in rows}
    advance(len(done))
    missing = [s for s in range(study.samples) if s not in done]
    chunk = 1 if executor is None else CHUNK
    tasks = ((study, missing[i : i + chunk]) for i in range(0, len(missing), chunk))
    for sample_rows in itertools.chain.from_iterable(compute(_solve_chunk, tasks, executor, jobs)):
        row_file.append_rows(file, sample_rows)
        rows += sample_rows
        advance(1)
    order = {objective: i for i, objective in enumerate(study.objectives)}
    return sorted(rows, key=lambda row: (row.sample, order[cast(Objective, row.objective)]))


def _whole(study: MonteCarlo, rows: Sequence[Row]) -> list[Row]:
    """Rows of complete samples."""
    complete: dict[int, dict[str, Row]] = {}
    for row in rows:
        complete.setdefault(row.sample, {}).setdefault(row.objective, row)
    return [
        row
        for sample, found in complete.items()
        if sample < study.samples and set(found) == set(study.objectives)
        for row in found.values()
    ]


def read_rows(file: str | pathlib.Path) -> tuple[dict[str, object], list[Row]]:
    """The study of a file, and its rows; a line that was cut off is left out."""
    return row_file.read_rows(file, Row)


# --- summary


@dataclass(frozen=True)
class Mean:
    mean: float
    deviation: float


@dataclass(frozen=True)
class Summary:
    """A column of tables 3 to 5."""

    objective: str
    count: int
    failed: int
    unfinished: int
    duration: Mean
    solve_time: Mean
    median_solve_time: float
    m_min: float
    m_max: float
    m_avg: Mean
    l_p: Mean
    l_quat: Mean
    angle: Mean
    m_dense: float
    m_dense_free: float
    """Least m between the nodes, of the samples without an unavoidable crossing"""
    m_min_median: float
    m_dense_median: float
    unavoidable: float
    """Part of the samples with a crossing that no path could do without"""
    avoidable: float
    """Part of the samples with an avoidable crossing"""


def summarize_study(rows: Sequence[Row]) -> list[Summary]:
    """A summary per objective, in the order of the rows. Failed samples are counted, and enter no mean."""
    return [
        _summary(objective, [row for row in rows if row.objective == objective])
        for objective in dict.fromkeys(row.objective for row in rows)
    ]


def _summary(objective: str, rows: Sequence[Row]) -> Summary:
    good = [row for row in rows if row.status != "failed"]

    def of(name: str) -> Array:
        return np.array([getattr(row, name) for row in good], dtype=np.float64)

    def mean(name: str) -> Mean:
        values = of(name)
        return Mean(float(values.mean()), float(values.std())) if good else Mean(math.nan, math.nan)

    free = of("m_dense")[of("unavoidable") == 0]
    return Summary(
        objective,
        len(rows),
        len(rows) - len(good),
        sum(row.status == "feasible" for row in rows),
        mean("duration"),
        mean("solve_time"),
        float(np.median(of("solve_time"))) if good else math.nan,
        float(of("m_min").min(initial=math.inf)),
        float(of("m_max").max(initial=0.0)),
        mean("m_avg"),
        mean("l_p"),
        mean("l_quat"),
        mean("angle"),
        float(of("m_dense").min(initial=math.inf)),
        float(free.min(initial=math.inf)),
        float(np.median(of("m_min"))) if good else math.nan,
        float(np.median(of("m_dense"))) if good else math.nan,
        float(np.mean(of("unavoidable") > 0)) if good else math.nan,
        float(np.mean(of("avoidable") > 0)) if good else math.nan,
    )
