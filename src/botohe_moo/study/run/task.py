"""What a study and its workers exchange: tasks, records, outcomes."""

import math
from dataclasses import dataclass, field
from typing import Any

from botohe_moo._base.types import FloatArray
from botohe_moo.study.file.model import Run, StudyMission
from botohe_moo.trails import PlanBatch

PATIENCE = 3600.0
MOST_SECONDS_TO_START = 600.0  # kernels are compiled then, perhaps on a slow machine


@dataclass(frozen=True)
class Task:
    """A run to be performed."""

    run: Run
    # Seconds without an evaluation after which the run of another package's algorithm fails, if it
    # has no budget of seconds. No result depends on it.
    patience: float = PATIENCE

    @property
    def seconds_allowed(self) -> float:
        """How long it may take, or without a budget of seconds, go without an evaluation."""
        budget, origin = self.run.mission.budget, self.run.algorithm.origin
        if budget.seconds is not None:
            return budget.seconds + budget.grace_seconds
        ours = origin["package"] == "botohe-moo" and origin["source"] is None
        return math.inf if ours else self.patience


@dataclass(frozen=True)
class BoundTask:
    """A mission whose front is to be bounded."""

    mission: StudyMission
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
