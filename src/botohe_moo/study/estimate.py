"""Estimating how long the missing runs of a study will take, by finished runs and trials."""

import contextlib
import heapq
import math
import statistics
import time
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, replace

from botohe_moo.study.file.config import Budget
from botohe_moo.study.file.model import Run
from botohe_moo.study.planning import Plan, make_task
from botohe_moo.study.run.pool import WorkerPool
from botohe_moo.study.run.task import Outcome

_TRIAL_SECONDS = 0.5
_FIRST_SECONDS = 0.01
_GRACE_SECONDS = 10.0
_COMPILING_SECONDS = 120.0  # a first iteration may take
_ENDED = ("done", "infeasible")


@dataclass(frozen=True)
class Estimate:
    """How long the runs of one algorithm on one mission take."""

    mission: str
    algorithm: str
    n_runs: int
    n_there: int  # finished
    n_failed: int  # the last time
    seconds: float | None  # of one run; None where a trial failed
    start_seconds: float  # of the process that each run has to itself; 0 if it is shared
    measured: bool  # whether the seconds are those of finished runs, not of a trial
    at_most: bool  # whether a run may end long before by itself, or a trial was too short to tell
    shared_start_seconds: float = 0.0  # of a process for several runs; 0 if it was not tried

    @property
    def n_left(self) -> int:
        """How many are missing."""
        return self.n_runs - self.n_there

    @property
    def each(self) -> float:
        """How long one run keeps a worker."""
        return self.start_seconds + (self.seconds or 0.0)


def estimate_times(plan: Plan, tell: Callable[[str], None]) -> Iterator[Estimate]:
    """Estimate how long the runs of each algorithm on each mission take.

    Where no run is finished, a run is tried for half a second, after a first trial that compiles
    kernels. The time of an evaluation after the trial's first iteration, which may have much to
    prepare, is scaled up to the budget. ``tell`` is told what is tried.
    """
    cells: dict[tuple[str, str], list[Run]] = {}
    for run in plan.runs:
        cells.setdefault((run.mission.label, run.algorithm.label), []).append(run)
    missing = {(run.mission.label, run.algorithm.label): run for run in plan.missing}
    with contextlib.closing(WorkerPool()) as pool:
        trial = _Trial(pool)
        for n, (cell, runs) in enumerate(cells.items(), 1):
            mission, algorithm = cell
            there = [plan.finished[run.digest] for run in runs if run.digest in plan.finished]
            seconds: float | None = 0.0
            at_most, start, shared_start = False, 0.0, 0.0
            if cell in missing and (not there or _has_own_process(missing[cell])):
                tell(f"trying {algorithm} on {mission} ({n} of {len(cells)})")
                seconds, at_most, start = trial.of(missing[cell])
                if seconds is not None and not _has_own_process(missing[cell]):
                    shared_start = trial.shared_start(missing[cell])
            if there:
                seconds, at_most = statistics.median(entry.seconds for entry in there), False
            yield Estimate(
                mission=mission,
                algorithm=algorithm,
                n_runs=len(runs),
                n_there=len(there),
                n_failed=sum(run.digest in plan.failed for run in runs),
                seconds=seconds,
                start_seconds=start,
                measured=bool(there),
                at_most=at_most,
                shared_start_seconds=shared_start,
            )


def time_left(
    estimates: Iterable[Estimate], workers: int, *, n_bounds: int = 0, bound_seconds: float = 0.0
) -> float:
    """Give the seconds until the last missing run ends, and then the last bound, with ``workers``.

    Each of ``n_bounds`` takes ``bound_seconds`` at most.
    """
    estimates = [estimate for estimate in estimates if estimate.n_left]
    start = max((estimate.shared_start_seconds for estimate in estimates), default=0.0)
    free_at = [start] * workers
    for estimate in estimates:
        for _ in range(estimate.n_left):
            heapq.heapreplace(free_at, free_at[0] + estimate.each)
    return max(free_at) + math.ceil(n_bounds / workers) * bound_seconds


def _has_own_process(run: Run) -> bool:
    return run.algorithm.origin["source"] is not None


class _Trial:
    """Tries runs; the first trial of each algorithm compiles its kernels."""

    def __init__(self, pool: WorkerPool) -> None:
        self._pool = pool
        self._compiled: set[str] = set()
        self._shared_start: float | None = None

    def of(self, run: Run) -> tuple[float | None, bool, float]:
        """Give a run's seconds, whether it may take less, and the start of its own process."""
        outcome = None
        if run.algorithm.label not in self._compiled:
            outcome = self._perform(run, _FIRST_SECONDS, _COMPILING_SECONDS)
        if outcome is None or outcome.status in _ENDED:
            self._compiled.add(run.algorithm.label)
            started = time.perf_counter()
            outcome = self._perform(run, _TRIAL_SECONDS, _GRACE_SECONDS)
            waited = time.perf_counter() - started
        if outcome.status not in _ENDED:
            return run.mission.budget.seconds, True, 0.0
        spent = outcome.seconds + outcome.recording_seconds
        start = max(0.0, waited - spent) if _has_own_process(run) else 0.0
        return *_whole(run.mission.budget, outcome), start

    def shared_start(self, run: Run) -> float:
        """Give the seconds until a worker's process begins with a run that was tried before."""
        if self._shared_start is None:
            started = time.perf_counter()
            with contextlib.closing(WorkerPool()) as pool:
                outcome = self._perform(run, _FIRST_SECONDS, _GRACE_SECONDS, pool)
            waited = time.perf_counter() - started
            self._shared_start = max(0.0, waited - outcome.seconds - outcome.recording_seconds)
        return self._shared_start

    def _perform(
        self, run: Run, seconds: float, grace_seconds: float, pool: WorkerPool | None = None
    ) -> Outcome:
        task = make_task(run)
        limit = min(task.seconds or seconds, seconds)
        trial = replace(task, seconds=limit, grace_seconds=grace_seconds)
        [(_, outcome)] = (pool or self._pool).perform([trial])
        found: Outcome = outcome
        return found


def _whole(budget: Budget, outcome: Outcome) -> tuple[float, bool]:
    """Give the seconds of a whole run after a trial, and whether it may take less."""
    if outcome.stopped_by != "seconds":
        return outcome.seconds, False
    limit = math.inf if budget.seconds is None else budget.seconds
    if budget.evaluations is None:
        return limit, False
    first = outcome.records[0] if outcome.records else None
    # The first iteration, which sets everything up, counts once.
    if first is not None and outcome.evaluations > first.evaluations:
        pace = (outcome.seconds - first.seconds) / (outcome.evaluations - first.evaluations)
        return min(limit, first.seconds + pace * (budget.evaluations - first.evaluations)), False
    return min(limit, outcome.seconds * budget.evaluations / max(outcome.evaluations, 1)), True
