"""How long the missing runs of a study will take, from what is known and short trials."""

from __future__ import annotations

import statistics
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

from botohe_moo.study.planning import make_task
from botohe_moo.study.sandbox import Sandbox

if TYPE_CHECKING:
    from collections.abc import Iterator

    from botohe_moo.study.grid import Run
    from botohe_moo.study.planning import Plan
    from botohe_moo.study.task import Outcome, Record

__all__ = ["Estimate", "estimate_times"]

_TRIAL_SECONDS = 0.5
_GRACE_SECONDS = 10.0


@dataclass(frozen=True)
class Estimate:
    """The runs of one algorithm on one mission.

    Attributes
    ----------
    mission, algorithm
        Their labels.
    n_runs, n_there, n_failed
        How many there are, how many are finished, and how many failed the last time.
    seconds
        How long one will take; None where a trial did not come to an end.
    measured
        Whether that is known from finished runs, and not from a trial.
    at_most
        Whether a run may end by itself long before, or a trial was too short to tell.
    """

    mission: str
    algorithm: str
    n_runs: int
    n_there: int
    n_failed: int
    seconds: float | None
    measured: bool
    at_most: bool

    @property
    def seconds_left(self) -> float:
        """How long the missing runs will take, one after another."""
        return (self.n_runs - self.n_there) * (self.seconds or 0.0)


def estimate_times(plan: Plan) -> Iterator[Estimate]:
    """Estimate how long each mission and algorithm will take.

    Where no run is finished, a run is tried for half a second. What an evaluation takes after its
    first iteration, which may have much to prepare, is scaled up to its budget.

    Parameters
    ----------
    plan
        The runs, and what is already there.
    """
    cells: dict[tuple[str, str], list[Run]] = {}
    for run in plan.runs:
        cells.setdefault((run.mission.label, run.algorithm.label), []).append(run)
    sandbox = Sandbox()
    try:
        for (mission, algorithm), runs in cells.items():
            there = [plan.finished[run.digest] for run in runs if run.digest in plan.finished]
            known = [entry.seconds for entry in there]
            seconds, at_most = (
                (statistics.median(known), False) if known else _try(runs[0], sandbox)
            )
            yield Estimate(
                mission=mission,
                algorithm=algorithm,
                n_runs=len(runs),
                n_there=len(known),
                n_failed=sum(run.digest in plan.failed for run in runs),
                seconds=seconds,
                measured=bool(known),
                at_most=at_most,
            )
    finally:
        sandbox.close()


def _try(run: Run, sandbox: Sandbox) -> tuple[float | None, bool]:
    """Give the seconds a run will take, None if unknown, and whether it may take less."""
    task = make_task(run)
    limit = min(task.seconds or _TRIAL_SECONDS, _TRIAL_SECONDS)
    trial = replace(task, seconds=limit, grace_seconds=_GRACE_SECONDS)
    outcome = sandbox.perform(trial, stopped=lambda: False, note=_ignore)
    if outcome is None or outcome.status in ("failed", "timeout"):
        return task.seconds, True
    if outcome.stopped_by != "seconds":
        return outcome.seconds, False
    limits = [] if task.seconds is None else [task.seconds]
    at_most = False
    if task.evaluations is not None:
        scaled, at_most = _scaled(outcome, task.evaluations)
        limits.append(scaled)
    return min(limits), at_most


def _scaled(outcome: Outcome, evaluations: int) -> tuple[float, bool]:
    """Scale a trial up to a budget; its first iteration counts once, if there was another."""
    first = outcome.records[0] if outcome.records else None
    if first is not None and outcome.evaluations > first.evaluations:
        pace = (outcome.seconds - first.seconds) / (outcome.evaluations - first.evaluations)
        return first.seconds + pace * (evaluations - first.evaluations), False
    return outcome.seconds * evaluations / max(outcome.evaluations, 1), True


def _ignore(record: Record) -> None:
    """Let a record go by: the outcome has it, too."""
