"""What a study and its workers exchange: tasks, records, outcomes."""

import math
from dataclasses import dataclass, field
from typing import Any

from botohe_moo._base.types import FloatArray
from botohe_moo.mission.model import Mission
from botohe_moo.trails import PlanBatch

PATIENCE = 3600.0
MOST_SECONDS_TO_START = 600.0  # kernels are compiled then, perhaps on a slow machine


@dataclass(frozen=True)
class Task:
    """What a worker needs to know of a run."""

    digest: str  # the name of the run
    mission: Mission
    min_survival: float
    algorithm: str  # a registered name or module:Class
    parameters: dict[str, Any]
    origin: dict[str, str | None]  # package, version and source of the algorithm; the problem
    seed: int
    evaluations: int | None  # budget; None for no limit
    seconds: float | None
    grace_seconds: float
    per_decade: int  # when the front is recorded
    start: float
    at: tuple[int, ...]
    version: str  # of this package, when the study was planned
    max_length: float = math.inf  # infinite without a travel budget
    # Seconds without an evaluation after which the run of another package's algorithm fails, if it
    # has no budget of seconds. No result depends on it.
    patience: float = PATIENCE

    @property
    def problem(self) -> str | None:
        """A problem of your own as ``module:Class``; None for BOTOHE."""
        return self.origin.get("problem")


@dataclass(frozen=True)
class BoundTask:
    """What a worker needs to know to bound the front of a mission."""

    digest: str  # the name of the bound
    mission: Mission
    min_survival: float
    max_length: float  # infinite without a travel budget
    front: FloatArray  # E[R] and E[S] of what runs have found (n, 2)
    seconds: float


@dataclass(frozen=True)
class Record:
    """A run's front at some moment."""

    evaluations: int  # so far
    seconds: float  # the algorithm's own time so far
    objectives: FloatArray  # E[R] and E[S] of distinct points (n, 2), by descending reward
    ties: int  # further plans whose objectives are those of a point
    # The plans and their objectives (front_size + ties, 2): of the last record, and of every record
    # where the run may be killed.
    plans: tuple[PlanBatch, FloatArray] | None = None

    @property
    def front_size(self) -> int:
        """Number of distinct points on the front."""
        return len(self.objectives)


@dataclass(frozen=True)
class Outcome:
    """How a run ended."""

    status: str  # done, infeasible (found no feasible plan), timeout (was killed) or failed
    stopped_by: str  # evaluations, seconds, itself, limit or error
    evaluations: int
    seconds: float  # without recording
    recording_seconds: float
    records: tuple[Record, ...] = ()  # the last one has its plans
    error: str | None = None
    traceback: str | None = None
    environment: dict[str, Any] = field(default_factory=dict)
    began: str | None = None  # UTC, as 2026-11-22T04:30:12Z; None if it never did


def seconds_allowed(task: Task) -> float:
    """Return how long a run may take, or without a budget of seconds, go without an evaluation."""
    if task.seconds is not None:
        return task.seconds + task.grace_seconds
    ours = task.origin["package"] == "botohe-moo" and task.origin["source"] is None
    return math.inf if ours else task.patience


def failure(error: str, where: str | None = None, last: Record | None = None) -> Outcome:
    """Return the outcome of a run that failed; ``error`` becomes a single line."""
    return Outcome(
        status="failed",
        stopped_by="error",
        evaluations=last.evaluations if last else 0,
        seconds=last.seconds if last else 0.0,
        recording_seconds=0.0,
        error=" ".join(error.split()),
        traceback=where,
    )
