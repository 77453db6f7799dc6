"""What passes between a study and its workers: tasks, records, outcomes."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

from botohe_moo._base.types import FloatArray
from botohe_moo.mission.model import Mission
from botohe_moo.trails import PlanBatch

__all__ = ["PATIENCE", "Outcome", "Record", "Task", "failure"]

PATIENCE = 3600.0


@dataclass(frozen=True)
class Task:
    """What a worker is told of a run.

    Attributes
    ----------
    digest
        The run's name.
    mission, min_survival
        What is planned for.
    algorithm, parameters
        What plans: a registered name or ``module:Class``.
    origin
        Package, version and source that it is from.
    seed
        Seed of the random numbers.
    evaluations, seconds, grace_seconds
        The budget; None for no limit.
    per_decade, start, at
        When the front is recorded.
    version
        Version of this package that the study was planned with.
    patience
        Seconds without an evaluation after which another package's algorithm is given up, where no
        budget of seconds ends it; no result depends on it.
    """

    digest: str
    mission: Mission
    min_survival: float
    algorithm: str
    parameters: dict[str, Any]
    origin: dict[str, str | None]
    seed: int
    evaluations: int | None
    seconds: float | None
    grace_seconds: float
    per_decade: int
    start: float
    at: tuple[int, ...]
    version: str
    patience: float = PATIENCE


@dataclass(frozen=True)
class Record:
    """A run's front at some moment.

    Attributes
    ----------
    evaluations
        Trail plans evaluated so far.
    seconds
        The algorithm's own time so far.
    objectives
        E[R] and E[S] of the front's distinct points, shape (n, 2), by descending reward.
    ties
        Further plans whose objectives are those of a point.
    plans
        The plans with their objectives, (batch, (front_size + ties, 2)); kept where the run may
        be killed, and of the last record.
    """

    evaluations: int
    seconds: float
    objectives: FloatArray
    ties: int
    plans: tuple[PlanBatch, FloatArray] | None = None

    @property
    def front_size(self) -> int:
        """Points on the front: how many plans with equal objectives are kept says nothing of it."""
        return len(self.objectives)


@dataclass(frozen=True)
class Outcome:
    """How a run ended.

    Attributes
    ----------
    status
        ``done``, ``infeasible`` (no feasible plan was found), ``timeout`` (it had to be killed)
        or ``failed``.
    stopped_by
        ``evaluations``, ``seconds``, ``itself``, ``limit`` or ``error``.
    evaluations, seconds
        What was spent, without recording.
    recording_seconds
        Time spent on recording.
    records
        The fronts; the last one has the plans. Empty where nothing feasible was found.
    error, traceback
        What went wrong, and where.
    environment
        Where it ran.
    began
        When its worker began with it: UTC, as in ``2026-11-22T04:30:12Z``; None if it never did.
    """

    status: str
    stopped_by: str
    evaluations: int
    seconds: float
    recording_seconds: float
    records: tuple[Record, ...] = ()
    error: str | None = None
    traceback: str | None = None
    environment: dict[str, Any] = field(default_factory=dict)
    began: str | None = None


def failure(error: str, where: str | None = None, last: Record | None = None) -> Outcome:
    """Give the outcome of a run that went wrong; ``error`` becomes a single line."""
    return Outcome(
        status="failed",
        stopped_by="error",
        evaluations=last.evaluations if last else 0,
        seconds=last.seconds if last else 0.0,
        recording_seconds=0.0,
        error=" ".join(error.split()),
        traceback=where,
    )
