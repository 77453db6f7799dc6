"""How long the missing runs of a study will take, from what is known and short trials."""

from __future__ import annotations

import statistics
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

from botohe_moo.study.perform import Record
from botohe_moo.study.runner import make_task
from botohe_moo.study.sandbox import Sandbox

if TYPE_CHECKING:
    from collections.abc import Iterator

    from botohe_moo.study.grid import Run
    from botohe_moo.study.runner import Plan

__all__ = ["Estimate", "estimate_times"]

_TRIAL_SECONDS = 0.3
_GRACE_SECONDS = 5.0


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
    """

    mission: str
    algorithm: str
    n_runs: int
    n_there: int
    n_failed: int
    seconds: float | None
    measured: bool

    @property
    def seconds_left(self) -> float:
        """How long the missing runs will take, one after another."""
        return (self.n_runs - self.n_there) * (self.seconds or 0.0)


def estimate_times(plan: Plan) -> Iterator[Estimate]:
    """Estimate how long each mission and algorithm will take.

    Where no run is finished, a run is tried for a third of a second, and what it did in that time
    is scaled up to its budget.

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
            known = [plan.seconds[run.digest] for run in runs if run.digest in plan.seconds]
            seconds = statistics.median(known) if known else _try(runs[0], sandbox)
            yield Estimate(
                mission=mission,
                algorithm=algorithm,
                n_runs=len(runs),
                n_there=len(known),
                n_failed=sum(run.digest in plan.failed for run in runs),
                seconds=seconds,
                measured=bool(known),
            )
    finally:
        sandbox.close()


def _try(run: Run, sandbox: Sandbox) -> float | None:
    task = make_task(run)
    limit = min(task.seconds or _TRIAL_SECONDS, _TRIAL_SECONDS)
    trial = replace(task, seconds=limit, grace_seconds=_GRACE_SECONDS)
    outcome = sandbox.perform(trial, stopped=lambda: False, note=_ignore)
    if outcome is None or outcome.status in ("failed", "timeout"):
        return None
    if outcome.stopped_by != "seconds":
        return outcome.seconds
    scaled = float("inf")
    if task.evaluations is not None:
        scaled = outcome.seconds * task.evaluations / max(outcome.evaluations, 1)
    return min(scaled, float("inf") if task.seconds is None else task.seconds)


def _ignore(record: Record) -> None:
    """Records of a trial are nobody's."""
