"""One run, from its description to its records, in whatever process it is performed."""

from __future__ import annotations

import bisect
import math
import time
import traceback
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from pymoo.core.algorithm import Algorithm
from pymoo.core.termination import NoTermination

from botohe_moo._types import FloatArray
from botohe_moo.algorithms.base import ArchiveAlgorithm
from botohe_moo.algorithms.population import PopulationAlgorithm
from botohe_moo.algorithms.registry import make_algorithm
from botohe_moo.archive import PlanArchive
from botohe_moo.mission.library import load_mission
from botohe_moo.mission.model import Mission
from botohe_moo.problem import BOTOHE
from botohe_moo.study.metered import BudgetSpentError, MeteredBOTOHE
from botohe_moo.trails import PlanBatch

__all__ = ["Outcome", "Record", "Task", "failure", "perform", "record_counts", "warm_up"]

_WARM_UP_EVALUATIONS = 250


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
    seed
        Seed of the random numbers.
    evaluations, seconds, grace_seconds
        The budget; None for no limit.
    per_decade, start, at
        When the front is recorded.
    version
        Version of this package that the study was planned with.
    """

    digest: str
    mission: Mission
    min_survival: float
    algorithm: str
    parameters: dict[str, Any]
    seed: int
    evaluations: int | None
    seconds: float | None
    grace_seconds: float
    per_decade: int
    start: float
    at: tuple[int, ...]
    version: str


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
    front_size
        Plans on the front, also those with equal objectives.
    plans
        The plans with their objectives, (batch, (front_size, 2)); kept where the run may be
        killed, and of the last record.
    """

    evaluations: int
    seconds: float
    objectives: FloatArray
    front_size: int
    plans: tuple[PlanBatch, FloatArray] | None = None


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


def failure(error: str, where: str | None = None, last: Record | None = None) -> Outcome:
    """Give the outcome of a run that went wrong."""
    return Outcome(
        status="failed",
        stopped_by="error",
        evaluations=last.evaluations if last else 0,
        seconds=last.seconds if last else 0.0,
        recording_seconds=0.0,
        error=error,
        traceback=where,
    )


def record_counts(
    *, evaluations: int | None, per_decade: int, start: float, at: tuple[int, ...]
) -> list[int]:
    """List the numbers of evaluations at which a front is recorded.

    They are log-spaced and end with the budget, so that any smaller budget can be read off
    afterwards.

    Parameters
    ----------
    evaluations
        Budget; None for no limit: then they go from 1 to 10¹².
    per_decade
        Counts in a tenfold of evaluations.
    start
        Share of the budget with which they begin.
    at
        Further counts.
    """
    end = 10**12 if evaluations is None else evaluations
    first = 1.0 if evaluations is None else max(1.0, start * end)
    n = math.floor(per_decade * math.log10(end / first) + 1e-9)
    spaced = {round(end * 10 ** (-i / per_decade)) for i in range(n + 1)}
    return sorted({math.ceil(first), *spaced, *(count for count in at if count <= end)})


class _Recorder:
    """Keeps the algorithm's own time and takes its front at the counts."""

    def __init__(self, task: Task, archive: Callable[[], PlanArchive]) -> None:
        self._task = task
        self._archive = archive
        self._counts = record_counts(
            evaluations=task.evaluations,
            per_decade=task.per_decade,
            start=task.start,
            at=task.at,
        )
        self._next = self._counts[0]
        self._recorded = 0
        self.recording = 0.0
        self._started = time.perf_counter()

    def elapsed(self) -> float:
        """Give the algorithm's own time so far."""
        return time.perf_counter() - self._started - self.recording

    def watch(self, evaluations: int, send: Callable[[Record], None]) -> None:
        """Record the front if the time has come."""
        if evaluations >= self._next:
            self._record(evaluations, send, whole=self._task.seconds is not None)
            passed = bisect.bisect_right(self._counts, evaluations)
            self._next = self._counts[passed] if passed < len(self._counts) else 10**18

    def last(self, evaluations: int, send: Callable[[Record], None]) -> None:
        """Record the final front with its plans."""
        self._record(evaluations, send, whole=True)

    def _record(self, evaluations: int, send: Callable[[Record], None], *, whole: bool) -> None:
        began = time.perf_counter()
        archive = self._archive()
        if len(archive):
            objectives = archive.objectives
            different = np.ones(len(objectives), bool)
            different[1:] = (objectives[1:] != objectives[:-1]).any(axis=1)
            distinct = objectives[different]
            send(
                Record(
                    evaluations=evaluations,
                    seconds=began - self._started - self.recording,
                    objectives=distinct,
                    front_size=len(objectives),
                    plans=(archive.plans, objectives.copy()) if whole else None,
                )
            )
        self.recording += time.perf_counter() - began


def perform(task: Task, send: Callable[[Record], None]) -> Outcome:
    """Perform a run.

    Parameters
    ----------
    task
        The run.
    send
        Is given every record when it is made.

    Returns
    -------
    Outcome
        Without records, which have been sent. Whatever the algorithm raises becomes the outcome
        of a failed run.
    """
    spent = [0]
    recorder = None
    try:
        algorithm, problem = _prepare(task)
        recorder = _Recorder(task, lambda: _archive(algorithm, problem))
        termination = NoTermination() if task.evaluations is None else ("n_eval", task.evaluations)
        algorithm.setup(problem, termination=termination, seed=task.seed)
        stopped_by = _loop(task, algorithm, problem, recorder, send, spent)
        seconds = recorder.elapsed()
        if task.evaluations is not None and spent[0] > task.evaluations:
            raise RuntimeError(f"evaluated {spent[0]} plans of the {task.evaluations} allowed")
        archive = _archive(algorithm, problem)
        _verify(task, archive)
        recorder.last(spent[0], send)
    except Exception as error:  # whatever an algorithm may raise ends its own run only
        said = "".join(traceback.format_exception_only(error)).strip()
        seconds = recorder.elapsed() if recorder else 0.0
        return replace(failure(said, traceback.format_exc()), evaluations=spent[0], seconds=seconds)
    return Outcome(
        status="done" if len(archive) else "infeasible",
        stopped_by=stopped_by,
        evaluations=spent[0],
        seconds=seconds,
        recording_seconds=recorder.recording,
        error=None if len(archive) else "no feasible plan was found",
    )


def _prepare(task: Task) -> tuple[Algorithm, BOTOHE]:
    algorithm = make_algorithm(task.algorithm, **task.parameters)
    if isinstance(algorithm, ArchiveAlgorithm | PopulationAlgorithm):
        return algorithm, BOTOHE(task.mission, min_survival=task.min_survival)
    return algorithm, MeteredBOTOHE(
        task.mission, min_survival=task.min_survival, evaluations=task.evaluations
    )


def _loop(
    task: Task,
    algorithm: Algorithm,
    problem: BOTOHE,
    recorder: _Recorder,
    send: Callable[[Record], None],
    spent: list[int],
) -> str:
    """Let the algorithm run until its budget is spent; say what ended it."""
    limit = math.inf if task.seconds is None else task.seconds
    allowed = math.inf if task.evaluations is None else task.evaluations
    evaluator = algorithm.evaluator
    metered = problem if isinstance(problem, MeteredBOTOHE) else None
    while algorithm.has_next():
        try:
            algorithm.next()
        except BudgetSpentError:
            spent[0] = metered.spent if metered else evaluator.n_eval
            break
        spent[0] = metered.spent if metered else evaluator.n_eval
        recorder.watch(spent[0], send)
        if spent[0] >= allowed:
            break
        if recorder.elapsed() >= limit:
            return "seconds"
    return "evaluations" if spent[0] >= allowed else "itself"


def _archive(algorithm: Algorithm, problem: BOTOHE) -> PlanArchive:
    """Give what an algorithm has found so far, as one archive for all kinds of them."""
    if isinstance(problem, MeteredBOTOHE):
        return problem.archive
    archive = (
        algorithm.plan_archive if isinstance(algorithm, PopulationAlgorithm) else algorithm.archive
    )
    if not isinstance(archive, PlanArchive):
        raise TypeError(f"Expected the archive of {type(algorithm).__name__} to be a PlanArchive.")
    return archive


def _verify(task: Task, archive: PlanArchive) -> None:
    """Evaluate the final front again: nobody's objectives are taken on trust."""
    batch, claimed = archive.plans, archive.objectives
    found = task.mission.evaluate(batch)
    wrong = np.flatnonzero(~np.isclose(found, claimed, rtol=1e-9, atol=1e-12).all(axis=1))
    if len(wrong):
        plan = int(wrong[0])
        raise ValueError(
            f"plan {plan} of the final front is claimed to bring {claimed[plan]}, and brings "
            f"{found[plan]}"
        )
    floor = BOTOHE(task.mission, min_survival=task.min_survival).survival_floor
    if len(batch) and (least := task.mission.robot_survival(batch).min()) < floor:
        raise ValueError(
            f"a robot of the final front survives with {least:g}, below {task.min_survival:g}"
        )


def warm_up(task: Task) -> None:
    """Compile, or load from the cache, what a run will need, so that it is not timed.

    Other packages' algorithms are left alone: who knows what they do.
    """
    toy = load_mission("toy")
    built_in = type(make_algorithm(task.algorithm, **task.parameters)).__module__
    ours = built_in.partition(".")[0] == "botohe_moo"
    trial = replace(
        task,
        mission=toy,
        min_survival=0.0,
        algorithm=task.algorithm if ours else "random",
        parameters=task.parameters if ours else {},
        evaluations=_WARM_UP_EVALUATIONS,
        seconds=None,
    )
    perform(trial, _ignore)


def _ignore(record: Record) -> None:
    """Let a record go by: nobody asks what a trial finds."""
