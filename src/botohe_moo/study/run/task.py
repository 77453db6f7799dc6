"""The data that a study and its workers exchange: tasks, records, outcomes."""

import math
from dataclasses import dataclass, field
from typing import Any

from botohe_moo.base.types import FloatArray
from botohe_moo.study.file.model import Run, StudyMission
from botohe_moo.trails import PlanBatch

PATIENCE = 3600.0
MOST_SECONDS_TO_START = 600.0  # kernels are compiled then, perhaps on a slow machine


@dataclass(frozen=True)
class Task:
    """A run to be performed."""

    run: Run
    # Seconds without an evaluation after which a run of another package's algorithm fails, unless
    # it has a budget of seconds. Not part of a run's identity: no result depends on it.
    patience: float = PATIENCE

    @property
    def seconds_allowed(self) -> float:
        """Seconds for the run; without a budget of seconds, those between its evaluations."""
        budget, origin = self.run.mission.budget, self.run.algorithm.origin
        if budget.seconds is not None:
            return budget.seconds + budget.grace_seconds
        ours = origin["package"] == "botohe-moo" and origin["source"] is None
        return math.inf if ours else self.patience


@dataclass(frozen=True)
class BoundTask:
    """A mission whose front is to be bounded."""

    mission: StudyMission
    front: FloatArray  # E[R] and E[S] of the points that its runs have found (n, 2)
    seconds: float


@dataclass(frozen=True)
class Record:
    """The front of a run after some number of evaluations."""

    evaluations: int
    seconds: float  # the algorithm's own time
    objectives: FloatArray  # E[R] and E[S] of distinct points (n, 2), by descending reward
    ties: int  # further plans whose objectives are those of a point
    # The plans, and their objectives (front_size + ties, 2). The last record has them; the others
    # have them only if the run may be killed.
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
    recording_seconds: float = 0.0
    records: tuple[Record, ...] = ()  # the last one has its plans
    error: str | None = None
    traceback: str | None = None
    environment: dict[str, Any] = field(default_factory=dict)
    began: str | None = None  # UTC, as 2026-11-22T04:30:12Z; None if it never did


def failure(error: str, traceback: str | None = None, last: Record | None = None) -> Outcome:
    """Return the outcome of a run that failed after its ``last`` record.

    ``error`` becomes a single line. ``traceback`` is that of an exception, or what the process
    printed before it died.
    """
    return Outcome(
        status="failed",
        stopped_by="error",
        evaluations=last.evaluations if last else 0,
        seconds=last.seconds if last else 0.0,
        error=" ".join(error.split()),
        traceback=traceback,
    )
