"""Performing one run: from a run to records and an outcome."""

import bisect
import functools
import math
import sys
import traceback
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, Self

import numpy as np
from pymoo.core.algorithm import Algorithm
from pymoo.core.termination import NoTermination

from botohe_moo.algorithms.archive import PlanArchive
from botohe_moo.algorithms.base import ArchiveAlgorithm
from botohe_moo.algorithms.genetic.population import PopulationAlgorithm
from botohe_moo.algorithms.registry import make_algorithm
from botohe_moo.base.types import FloatArray
from botohe_moo.core.compile import own_time
from botohe_moo.core.ready import kernels
from botohe_moo.problem import BOTOHE
from botohe_moo.study.content import Budget
from botohe_moo.study.model import Run, check_objectives
from botohe_moo.study.task import Outcome, Record, failure
from botohe_moo.trails import PlanBatch


class BudgetSpentError(Exception):
    """Ends a run in the middle of an evaluation, because its budget is spent."""


@dataclass
class Meter:
    """The number of evaluations and their limit, which all copies of a metered problem share."""

    allowed: int = sys.maxsize  # evaluations
    archive: PlanArchive | None = None  # gets all feasible plans that are evaluated
    progress: Callable[[], Any] | None = None  # called after evaluations
    spent: int = 0  # evaluations


class _Metered(BOTOHE if TYPE_CHECKING else object):  # type: ignore[misc]
    """What counts the evaluations of a problem: the first base of its class.

    pymoo checks ``("n_eval", N)`` between generations, so that a population of 70 spends 1 050 of
    1 000 evaluations. Here the last generation is cut off at the budget.
    """

    meter: Meter

    def evaluate_batch(self, batch: PlanBatch) -> FloatArray:
        """Compute the objectives of plans; raise a BudgetSpentError if not all are allowed."""
        meter = self.meter
        allowed = batch[: max(meter.allowed - meter.spent, 0)]
        if len(allowed) == 0 < len(batch):
            raise BudgetSpentError
        meter.spent += len(allowed)
        F: FloatArray = super().evaluate_batch(allowed)
        if meter.progress is not None:
            meter.progress()
        if meter.archive is not None:
            feasible, objectives = allowed, -self.checked("F", F, len(allowed))
            if self.n_ieq_constr:
                rows = np.flatnonzero((self.constrain_batch(allowed) <= 0).all(axis=1))
                feasible, objectives = allowed.take(rows), objectives[rows]
            if len(feasible):
                meter.archive.insert(feasible, objectives)
        if len(allowed) < len(batch):
            raise BudgetSpentError
        return F

    def __deepcopy__(self, memo: dict[int, Any]) -> Self:
        return self  # pymoo copies the problem with the algorithm; both count together

    def __reduce__(self) -> Any:
        kind: Any = type(self).__mro__[2]
        return _remade, (kind, vars(self))


@functools.cache
def _metered_class(kind: Any) -> Any:
    return type(kind.__name__, (_Metered, kind), {"__module__": kind.__module__})


def _remade(kind: Any, attributes: dict[str, Any]) -> BOTOHE:
    problem: BOTOHE = object.__new__(_metered_class(kind))
    problem.__dict__.update(attributes)
    return problem


def metered(problem: BOTOHE, meter: Meter) -> BOTOHE:
    """Return the same problem, which counts what it evaluates, and evaluates no more than allowed.

    It is of a class derived from the problem's, with the same name.
    """
    return _remade(type(problem), {**vars(problem), "meter": meter})


def record_counts(
    *, evaluations: int | None, per_decade: int, start: float, at: Sequence[int]
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
        self, run: Run, archive: Callable[[], PlanArchive], send: Callable[[Record], None]
    ) -> None:
        self._archive = archive
        self._send = send
        budget, recording = run.mission.budget, run.recording
        # A run with a budget of seconds may be killed before it can send its final plans.
        self._always_with_plans = budget.seconds is not None
        self._counts = record_counts(evaluations=budget.evaluations, **recording.model_dump())
        self._next = self._counts[0]
        self.recording_seconds = 0.0
        self._started = own_time()

    def elapsed(self) -> float:
        """Return the algorithm's own time so far, in seconds: without recording and compiling."""
        return own_time() - self._started - self.recording_seconds

    def watch(self, evaluations: int) -> None:
        """Record the front if a record is due at this number of evaluations."""
        if evaluations >= self._next:
            self.record(evaluations, self.elapsed(), with_plans=self._always_with_plans)
            passed = bisect.bisect_right(self._counts, evaluations)
            self._next = self._counts[passed] if passed < len(self._counts) else sys.maxsize

    def record(self, evaluations: int, seconds: float, *, with_plans: bool) -> None:
        """Send a record of the front, if it has any points, with or without its plans."""
        began = own_time()
        archive = self._archive()
        if len(archive):
            objectives = archive.objectives
            distinct = np.unique(objectives, axis=0)[::-1]  # by descending reward
            ties = len(objectives) - len(distinct)
            plans = (archive.plans, objectives.copy()) if with_plans else None
            self._send(Record(evaluations, seconds, distinct, ties, plans))
        self.recording_seconds += own_time() - began


@kernels("compiled")
def perform(
    run: Run, send: Callable[[Record], None], progress: Callable[[], Any] | None = None
) -> Outcome:
    """Perform a run; every record is sent when it is made, and is not in the outcome.

    ``progress`` is called whenever plans have been evaluated. If the algorithm raises an exception,
    the outcome is that of a failed run. The receiver has to verify the last record, since the
    algorithm may have changed this process's copy of the mission.
    """
    allowed = run.mission.budget.evaluations
    meter = Meter(progress=progress)
    recorder = None
    try:
        algorithm = make_algorithm(run.algorithm.algorithm, **run.algorithm.parameters)
        problem = run.mission.problem(run.problem)
        recorder = Recorder(run, lambda: _archive(algorithm, problem, meter), send)
        termination = NoTermination() if allowed is None else ("n_eval", allowed)
        algorithm.setup(
            _metered(algorithm, problem, meter, allowed), termination=termination, seed=run.seed
        )
        stopped_by = _loop(run.mission.budget, algorithm, meter, recorder)
        seconds = recorder.elapsed()
        if allowed is not None and meter.spent > allowed:
            raise RuntimeError(f"evaluated {meter.spent} plans of the {allowed} allowed")
        archive = _archive(algorithm, problem, meter)
        recorder.record(meter.spent, seconds, with_plans=True)
    except (Exception, SystemExit) as error:  # an algorithm may end its own run only
        seconds = recorder.elapsed() if recorder else 0.0
        failed = failure("".join(traceback.format_exception_only(error)), traceback.format_exc())
        return replace(failed, evaluations=meter.spent, seconds=seconds)
    return Outcome(
        status="done" if len(archive) else "infeasible",
        stopped_by=stopped_by,
        evaluations=meter.spent,
        seconds=seconds,
        recording_seconds=recorder.recording_seconds,
        error=None if len(archive) else "no feasible plan was found",
    )


def _metered(algorithm: Algorithm, problem: BOTOHE, meter: Meter, allowed: int | None) -> BOTOHE:
    """Return the problem, metered unless the algorithm is known to count its evaluations."""
    if not isinstance(algorithm, ArchiveAlgorithm | PopulationAlgorithm):
        meter.archive = PlanArchive(problem.mission.robots, n_objectives=problem.n_obj)
        meter.allowed = sys.maxsize if allowed is None else allowed
    # An algorithm that evaluates in a kernel refuses a problem that overrides the evaluation, as a
    # metered one does.
    elif getattr(algorithm, "evaluates_in_kernels", False) or (
        type(problem) is BOTOHE and _is_ours(algorithm)
    ):
        return problem
    return metered(problem, meter)


def _is_ours(algorithm: Algorithm) -> bool:
    return type(algorithm).__module__.partition(".")[0] == "botohe_moo"


def _loop(budget: Budget, algorithm: Algorithm, meter: Meter, recorder: Recorder) -> str:
    """Let the algorithm run until its budget is spent; return what ended it."""
    limit = math.inf if budget.seconds is None else budget.seconds
    allowed = math.inf if budget.evaluations is None else budget.evaluations
    while algorithm.has_next():
        before = meter.spent
        try:
            algorithm.next()
        except BudgetSpentError:
            break
        if meter.archive is None:  # kernels do not count in the meter
            meter.spent = max(meter.spent, algorithm.evaluator.n_eval)
        if meter.spent > before and meter.progress is not None:
            meter.progress()
        recorder.watch(meter.spent)
        if meter.spent >= allowed:
            break
        if recorder.elapsed() >= limit:
            return "seconds"
    return "evaluations" if meter.spent >= allowed else "itself"


def _archive(algorithm: Algorithm, problem: BOTOHE, meter: Meter) -> PlanArchive:
    """Return what an algorithm of any kind has found so far."""
    archive: PlanArchive = algorithm.archive if meter.archive is None else meter.archive
    if type(problem) is not BOTOHE:
        check_objectives(problem, archive.objectives)
    return archive


def verify(run: Run, plans: PlanBatch, claimed: FloatArray) -> None:
    """Evaluate the plans of a final front again; raise a ValueError if a claim about them is wrong.

    ``claimed`` are E[R] and E[S] according to the algorithm, or −F of the study's own problem,
    shape (n, 2).
    """
    mission = run.mission.mission
    objectives = mission.evaluate(plans)  # raises if plans are not valid
    problem = run.mission.problem(run.problem)
    if run.problem:
        objectives = _own_objectives(problem, plans)
    wrong = np.flatnonzero(~np.isclose(objectives, claimed, rtol=1e-9, atol=1e-12).all(axis=1))
    if len(wrong):
        plan = int(wrong[0])
        raise ValueError(
            f"plan {plan} of the final front is claimed to bring {claimed[plan]}, and brings "
            f"{objectives[plan]}"
        )
    problem.check_limits(plans)


def _own_objectives(problem: BOTOHE, plans: PlanBatch) -> FloatArray:
    """Return −F of a problem of your own; a ValueError for plans that break its constraints."""
    F, G = problem.evaluate_batch(plans), problem.constrain_batch(plans)
    broken = (problem.checked("G", G, len(plans)) > 0).any(axis=1)
    if broken.any():
        plan = int(broken.argmax())
        raise ValueError(
            f"plan {plan} of the final front breaks constraints of {type(problem).__name__}: "
            f"{G[plan]}"
        )
    return -problem.checked("F", F, len(plans))
