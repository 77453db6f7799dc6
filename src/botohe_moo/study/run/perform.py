"""Performing one run: from a task to records and an outcome."""

import bisect
import math
import sys
import time
import traceback
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
from pymoo.core.algorithm import Algorithm
from pymoo.core.termination import NoTermination

from botohe_moo._base.types import FloatArray
from botohe_moo.algorithms.base import ArchiveAlgorithm
from botohe_moo.algorithms.population import PopulationAlgorithm
from botohe_moo.algorithms.registry import make_algorithm
from botohe_moo.mission.library import load_mission
from botohe_moo.problem import BOTOHE
from botohe_moo.search.archive import PlanArchive
from botohe_moo.study.file.problems import check_objectives, find_problem, problem_on
from botohe_moo.study.run.metered import (
    BudgetSpentError,
    CountedBOTOHE,
    MeteredBOTOHE,
    blamed,
    counting,
)
from botohe_moo.study.run.task import Outcome, Record, Task, failure
from botohe_moo.trails import PlanBatch


def record_counts(
    *, evaluations: int | None, per_decade: int, start: float, at: tuple[int, ...]
) -> list[int]:
    """List the numbers of evaluations at which a front is recorded.

    They are log-spaced from ``start`` times the budget to the budget, or without one from 1 to
    10¹², so that any smaller budget can be read off afterwards. ``at`` are further numbers.
    """
    end = 10**12 if evaluations is None else evaluations
    first = 1.0 if evaluations is None else max(1.0, start * end)
    n = math.floor(per_decade * math.log10(end / first) + 1e-9)
    spaced = {round(end * 10 ** (-i / per_decade)) for i in range(n + 1)}
    return sorted({math.ceil(first), *spaced, *(count for count in at if count <= end)})


class Recorder:
    """Measures an algorithm's own time, and sends a record of its front whenever one is due."""

    def __init__(
        self, task: Task, archive: Callable[[], PlanArchive], send: Callable[[Record], None]
    ) -> None:
        self._archive = archive
        self._send = send
        self._whole = task.seconds is not None  # it may be killed before it can send its plans
        self._counts = record_counts(
            evaluations=task.evaluations, per_decade=task.per_decade, start=task.start, at=task.at
        )
        self._next = self._counts[0]
        self.recording = 0.0
        self._started = time.perf_counter()

    def elapsed(self) -> float:
        """Give the algorithm's own time so far."""
        return time.perf_counter() - self._started - self.recording

    def watch(self, evaluations: int) -> None:
        """Record the front if a record is due after so many evaluations."""
        if evaluations >= self._next:
            self.record(evaluations, self.elapsed(), whole=self._whole)
            passed = bisect.bisect_right(self._counts, evaluations)
            self._next = self._counts[passed] if passed < len(self._counts) else sys.maxsize

    def record(self, evaluations: int, seconds: float, *, whole: bool) -> None:
        """Send a record of the front, if it has any points, and of its plans if it is ``whole``."""
        began = time.perf_counter()
        archive = self._archive()
        if len(archive):
            objectives = archive.objectives
            different = np.ones(len(objectives), bool)
            different[1:] = (objectives[1:] != objectives[:-1]).any(axis=1)
            ties = int(len(objectives) - different.sum())
            plans = (archive.plans, objectives.copy()) if whole else None
            self._send(Record(evaluations, seconds, objectives[different], ties, plans))
        self.recording += time.perf_counter() - began


_WARM_UP_EVALUATIONS = 250
WARM_UP_SURVIVAL = 1e-9
WARM_UP_LENGTH = 1e9


def perform(
    task: Task, send: Callable[[Record], None], progress: Callable[[], None] = lambda: None
) -> Outcome:
    """Perform a run; every record is sent when it is made, and is not in the outcome.

    ``progress`` is called whenever plans have been evaluated. Whatever the algorithm raises becomes
    the outcome of a failed run. The receiver has to verify the last record: an algorithm may have
    changed the mission that this process knows.
    """
    spent = [0]
    recorder = None
    try:
        algorithm, problem = _prepare(task)
        recorder = Recorder(task, lambda: _archive(task, algorithm, problem), send)
        termination = NoTermination() if task.evaluations is None else ("n_eval", task.evaluations)
        algorithm.setup(problem, termination=termination, seed=task.seed)
        if isinstance(problem, CountedBOTOHE):
            problem.meter.watch = progress
        stopped_by = _loop(task, algorithm, problem, recorder, spent, progress)
        seconds = recorder.elapsed()
        if isinstance(problem, CountedBOTOHE):  # whatever the algorithm reports
            spent[0] = max(spent[0], problem.meter.spent)
        if task.evaluations is not None and spent[0] > task.evaluations:
            raise RuntimeError(f"evaluated {spent[0]} plans of the {task.evaluations} allowed")
        archive = _archive(task, algorithm, problem)
        recorder.record(spent[0], seconds, whole=True)
    except (Exception, SystemExit) as error:  # an algorithm may end its own run only
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
    """Make the algorithm, and a problem that counts evaluations where the algorithm may not."""
    algorithm = make_algorithm(task.algorithm, **task.parameters)
    mission = task.mission
    limits: dict[str, Any] = {
        "min_survival": task.min_survival,
        "max_length": task.max_length,
    }
    kind = find_problem(task.problem)
    if not isinstance(algorithm, ArchiveAlgorithm | PopulationAlgorithm):
        metered = counting(MeteredBOTOHE, kind)
        return algorithm, metered(mission, evaluations=task.evaluations, **limits)
    # What evaluates in a kernel refuses problems that override the evaluation, if only to count.
    in_kernel = getattr(algorithm, "evaluates_in_kernels", False)
    if in_kernel or (kind is BOTOHE and _is_ours(algorithm)):
        return algorithm, kind(mission, **limits)
    return algorithm, counting(CountedBOTOHE, kind)(mission, **limits)


def _is_ours(algorithm: Algorithm) -> bool:
    return type(algorithm).__module__.partition(".")[0] == "botohe_moo"


def _loop(
    task: Task,
    algorithm: Algorithm,
    problem: BOTOHE,
    recorder: Recorder,
    spent: list[int],
    progress: Callable[[], None],
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
            spent[0] = metered.meter.spent if metered else evaluator.n_eval
            break
        before, spent[0] = spent[0], metered.meter.spent if metered else evaluator.n_eval
        if spent[0] > before:
            progress()
        recorder.watch(spent[0])
        if spent[0] >= allowed:
            break
        if recorder.elapsed() >= limit:
            return "seconds"
    return "evaluations" if spent[0] >= allowed else "itself"


def _archive(task: Task, algorithm: Algorithm, problem: BOTOHE) -> PlanArchive:
    """Give what an algorithm of any kind has found so far."""
    archive = problem.archive if isinstance(problem, MeteredBOTOHE) else algorithm.archive
    if not isinstance(archive, PlanArchive):
        raise TypeError(f"Expected the archive of {type(algorithm).__name__} to be a PlanArchive.")
    if task.problem:
        check_objectives(problem, archive.objectives)
    return archive


def verify(task: Task, plans: PlanBatch, claimed: FloatArray) -> None:
    """Evaluate a final front again; no algorithm's objectives are trusted.

    ``claimed`` are E[R] and E[S] according to the algorithm, or −F of the task's own problem, shape
    (n, 2).
    """
    found = task.mission.evaluate(plans)  # names plans that are not valid
    problem = problem_on(task, task.problem)
    if task.problem:
        found = _own_objectives(problem, plans)
    wrong = np.flatnonzero(~np.isclose(found, claimed, rtol=1e-9, atol=1e-12).all(axis=1))
    if len(wrong):
        plan = int(wrong[0])
        raise ValueError(
            f"plan {plan} of the final front is claimed to bring {claimed[plan]}, and brings "
            f"{found[plan]}"
        )
    least = task.mission.robot_survival(plans).min(initial=1.0)
    if least < problem.survival_floor:
        raise ValueError(
            f"a robot of the final front survives with {least:g}, below {task.min_survival:g}"
        )
    longest = task.mission.trail_lengths(plans).max(initial=0.0)
    if longest > problem.travel_budget:
        raise ValueError(
            f"a trail of the final front is {longest:g} long, beyond {task.max_length:g}"
        )


def _own_objectives(problem: BOTOHE, plans: PlanBatch) -> FloatArray:
    """Give −F of a problem of one's own; a ValueError for plans that break its constraints."""
    with blamed(problem, "evaluate_batch"):
        F = problem.evaluate_batch(plans)
    with blamed(problem, "constrain_batch"):
        G = problem.constrain_batch(plans)
    broken = (problem.checked("G", G, len(plans)) > 0).any(axis=1)
    if broken.any():
        plan = int(broken.argmax())
        raise ValueError(
            f"plan {plan} of the final front breaks constraints of {type(problem).__name__}: "
            f"{G[plan]}"
        )
    return -problem.checked("F", F, len(plans))


def warm_up(task: Task) -> None:
    """Compile, or load from the cache, the kernels that a run will need, so that it is not timed.

    Other packages' algorithms and problems are not tried: they may have side effects.
    """
    toy = load_mission("toy")
    ours = _is_ours(make_algorithm(task.algorithm, **task.parameters))
    trial = replace(
        task,
        mission=toy,
        # A limit, however loose, has kernels of its own.
        min_survival=min(task.min_survival, WARM_UP_SURVIVAL),
        max_length=max(task.max_length, WARM_UP_LENGTH),
        algorithm=task.algorithm if ours else "random",
        parameters=task.parameters if ours else {},
        origin={**task.origin, "problem": None},
        evaluations=_WARM_UP_EVALUATIONS,
        seconds=None,
    )
    perform(trial, lambda _: None)
