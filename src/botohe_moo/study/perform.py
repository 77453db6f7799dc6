"""Performing one run: from a run to records and an outcome."""

import bisect
import math
import sys
import traceback
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, Self

import numpy as np
from pymoo.core.algorithm import Algorithm
from pymoo.core.termination import NoTermination

from botohe_moo.algorithms.base import ArchiveAlgorithm, PlanArchive
from botohe_moo.algorithms.genetic.population import PopulationAlgorithm
from botohe_moo.algorithms.registry import make_algorithm
from botohe_moo.base.types import FloatArray
from botohe_moo.core.compile import kernels, own_time
from botohe_moo.objectives import SLACK
from botohe_moo.problem import BOTOHE, problem_path
from botohe_moo.study.content import Budget
from botohe_moo.study.model import Run
from botohe_moo.trails import PlanBatch


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

    status: str = "failed"  # or done, infeasible (found no feasible plan), timeout (was killed)
    stopped_by: str = "error"  # or evaluations, seconds, itself or limit
    evaluations: int = 0
    seconds: float = 0.0  # without compiling and recording
    recording_seconds: float = 0.0
    records: tuple[Record, ...] = ()  # the last one has its plans
    error: str | None = None
    traceback: str | None = None
    environment: dict[str, Any] = field(default_factory=dict)
    began: str | None = None  # UTC, as 2026-11-22T04:30:12Z


def in_a_line(error: BaseException) -> str:
    """Return the name and the message of an exception as a single line."""
    return " ".join("".join(traceback.format_exception_only(error)).split())


class BudgetSpentError(Exception):
    """Ends a run in the middle of an evaluation, because its budget is spent."""


@dataclass
class Meter:
    """The number of evaluations and their limit, which all copies of a metered problem share."""

    allowed: int = sys.maxsize  # evaluations
    archive: PlanArchive | None = None  # gets all feasible plans that are evaluated
    progress: Callable[[], Any] = lambda: None  # called after evaluations
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


def metered(problem: BOTOHE, meter: Meter) -> BOTOHE:
    """Return the same problem, which counts what it evaluates, and evaluates no more than allowed.

    It is of a class derived from the problem's, with the same name.
    """
    of: Any = type(problem)
    kind: Any = type(of.__name__, (_Metered, of), {"__module__": of.__module__})
    made: BOTOHE = object.__new__(kind)
    made.__dict__.update(vars(problem), meter=meter)
    return made


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
        budget: Any = run.mission.budget
        # A run with a budget of seconds may be killed before it can send its final plans.
        self._always_with_plans = budget.seconds is not None
        self._counts = record_counts(evaluations=budget.evaluations, **run.identity["recording"])
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
    run: Run, send: Callable[[Record], None], progress: Callable[[], Any] = lambda: None
) -> Outcome:
    """Perform a run; every record is sent when it is made, and is not in the outcome.

    ``progress`` is called whenever plans have been evaluated. If the algorithm raises an exception,
    the outcome is that of a failed run. The receiver has to verify the last record, since the
    algorithm may have changed this process's copy of the mission.
    """
    budget = run.mission.budget
    meter = Meter(progress=progress)
    recorder = None
    try:
        algorithm = make_algorithm(run.algorithm.algorithm, **run.algorithm.parameters)
        problem = _metered(algorithm, run.mission.problem(run.problem), meter, budget)

        def archive() -> PlanArchive:
            return algorithm.archive if meter.archive is None else meter.archive

        recorder = Recorder(run, archive, send)
        allowed = budget.evaluations
        termination = NoTermination() if allowed is None else ("n_eval", allowed)
        algorithm.setup(problem, termination=termination, seed=run.seed)
        stopped_by = _loop(budget, algorithm, meter, recorder)
        seconds = recorder.elapsed()
        if allowed is not None and meter.spent > allowed:
            raise RuntimeError(f"evaluated {meter.spent} plans of the {allowed} allowed")
        recorder.record(meter.spent, seconds, with_plans=True)
        is_empty = len(archive()) == 0
    except (Exception, SystemExit) as error:  # an algorithm may end its own run only
        return Outcome(
            evaluations=meter.spent,
            seconds=recorder.elapsed() if recorder else 0.0,
            error=in_a_line(error),
            traceback=traceback.format_exc(),
        )
    return Outcome(
        status="infeasible" if is_empty else "done",
        stopped_by=stopped_by,
        evaluations=meter.spent,
        seconds=seconds,
        recording_seconds=recorder.recording_seconds,
        error="no feasible plan was found" if is_empty else None,
    )


def _metered(algorithm: Algorithm, problem: BOTOHE, meter: Meter, budget: Budget) -> BOTOHE:
    """Return the problem, metered unless the algorithm is known to count its evaluations."""
    if not isinstance(algorithm, ArchiveAlgorithm | PopulationAlgorithm):
        meter.archive = PlanArchive(problem.mission.robots, n_objectives=problem.n_obj)
        meter.allowed = budget.evaluations or sys.maxsize
        return metered(problem, meter)
    # An algorithm that evaluates in a kernel refuses a problem that overrides the evaluation, as a
    # metered one does.
    in_kernels = getattr(algorithm, "evaluates_in_kernels", False)
    ours = type(algorithm).__module__.startswith("botohe_moo.")
    return problem if in_kernels or (ours and type(problem) is BOTOHE) else metered(problem, meter)


def _loop(budget: Budget, algorithm: Algorithm, meter: Meter, recorder: Recorder) -> str:
    """Let the algorithm run until its budget is spent; return what ended it."""
    limit, allowed = budget.seconds or math.inf, budget.evaluations or math.inf
    while algorithm.has_next():
        before = meter.spent
        try:
            algorithm.next()
        except BudgetSpentError:
            break
        if meter.archive is None:  # kernels do not count in the meter
            meter.spent = max(meter.spent, algorithm.evaluator.n_eval)
        if meter.spent > before:
            meter.progress()
        recorder.watch(meter.spent)
        if meter.spent >= allowed:
            break
        if recorder.elapsed() >= limit:
            return "seconds"
    return "evaluations" if meter.spent >= allowed else "itself"


def verify(run: Run, plans: PlanBatch, claimed: FloatArray) -> None:
    """Evaluate the plans of a final front again; raise a ValueError if a claim about them is wrong.

    ``claimed`` are E[R] and E[S] according to the algorithm, or −F of the study's own problem,
    shape (n, 2).
    """
    problem = run.mission.problem(run.problem)
    objectives = problem.mission.evaluate(plans)  # raises if plans are not valid
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
    """Return −F of a problem of your own.

    A ValueError names a plan that breaks its constraints, or whose objectives are outside the
    bounds that it states.
    """
    G = problem.checked("G", problem.constrain_batch(plans), len(plans))
    values: FloatArray = -problem.checked("F", problem.evaluate_batch(plans), len(plans))
    within = (values >= -SLACK) & (values <= problem.objectives.bounds_with_slack)
    name, bounds = problem_path(type(problem)), [*problem.objectives.bounds]
    if (G > 0).any():
        raise ValueError(f"a plan of the final front breaks constraints of {name}")
    if not within.all():
        raise ValueError(
            f"{name} says by its objectives that −F is at least 0 and at most {bounds}, and gives "
            f"{values[~within.all(axis=1)][0].tolist()}"
        )
    return values
