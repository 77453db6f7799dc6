"""Planning a study: which of its runs and bounds are missing, and how long these take."""

import contextlib
import hashlib
import json
import math
import statistics
from collections.abc import Iterable, Mapping
from dataclasses import dataclass

import numpy as np

from botohe_moo.library import library_digest
from botohe_moo.study.file.model import Run, Study, StudyError, StudyMission, installed_versions
from botohe_moo.study.run.task import BoundTask
from botohe_moo.study.store.folder import FAILURES, StudyFolder
from botohe_moo.study.store.tables import StudyTables, read_study

_MOST_TIMED = 9  # finished runs of an algorithm on a mission that are read for an estimate


@dataclass(frozen=True)
class Plan:
    """The runs of a study, which of them are finished, and which bounds are missing."""

    runs: tuple[Run, ...]
    finished: frozenset[str]  # digests of runs
    failed: frozenset[str]  # digests of runs that failed the last time
    unbounded: Mapping[str, StudyMission]  # by digests of the bounds that are to be computed

    @property
    def missing(self) -> tuple[Run, ...]:
        """The runs that are to be performed."""
        return tuple(run for run in self.runs if run.digest not in self.finished)


def plan_study(study: Study, folder: StudyFolder) -> Plan:
    """Find out which runs of a study are finished, and which bounds are there."""
    runs = study.runs()
    digests = {run.digest for run in runs}
    finished = digests & folder.digests()
    unbounded = {
        mission.bound_digest: mission
        for mission in (study.missions if study.file.bounds else ())
        if (bound := folder.bound(mission)) is None or bound[1] < study.bound_seconds
    }
    failed = digests & folder.digests(FAILURES) - finished
    return Plan(runs, frozenset(finished), frozenset(failed), unbounded)


@dataclass(frozen=True)
class Estimate:
    """How long the runs of one algorithm on one mission take."""

    mission: str
    algorithm: str
    n_runs: int
    n_finished: int
    n_failed: int  # when they were performed last
    seconds: float | None  # of one run; None if it is not known
    at_most: bool  # whether these are the seconds of the budget, which a run need not use up

    @property
    def n_left(self) -> int:
        """The number of runs that are missing."""
        return self.n_runs - self.n_finished


def estimate_times(plan: Plan, folder: StudyFolder) -> list[Estimate]:
    """Estimate from finished runs how long those of each algorithm on each mission take.

    Where none is finished, the estimate is the seconds of the budget, if it has any.
    """
    cells: dict[tuple[str, str], list[Run]] = {}
    for run in plan.runs:
        cells.setdefault((run.mission.label, run.algorithm.label), []).append(run)
    estimates = []
    for (mission, algorithm), runs in cells.items():
        finished = [run for run in runs if run.digest in plan.finished]
        outcomes = filter(None, map(folder.load, finished[:_MOST_TIMED]))
        seconds = [outcome.seconds for outcome in outcomes]
        estimates.append(
            Estimate(
                mission=mission,
                algorithm=algorithm,
                n_runs=len(runs),
                n_finished=len(finished),
                n_failed=sum(run.digest in plan.failed for run in runs),
                seconds=statistics.median(seconds) if seconds else runs[0].mission.budget.seconds,
                at_most=not seconds,
            )
        )
    return estimates


def time_left(
    estimates: Iterable[Estimate], workers: int, *, n_bounds: int = 0, bound_seconds: float = 0.0
) -> float:
    """Return about how many seconds ``workers`` need for the missing runs of which it is known.

    When these are done, each of ``n_bounds`` bounds takes at most ``bound_seconds``.
    """
    left = [(e.n_left, e.seconds) for e in estimates if e.n_left and e.seconds is not None]
    shared = sum(n * seconds for n, seconds in left) / workers
    longest = max((seconds for _, seconds in left), default=0.0)
    return max(shared, longest) + math.ceil(n_bounds / workers) * bound_seconds


def make_bound_task(
    mission: StudyMission, runs: Iterable[Run], folder: StudyFolder, seconds: float
) -> BoundTask:
    """Return the task to bound a mission, guided by the points that its runs have found."""
    of_mission = [run for run in runs if run.mission.bound_digest == mission.bound_digest]
    fronts = [np.empty((0, 2))]
    for _, outcome in folder.outcomes(of_mission):
        fronts += [record.objectives for record in outcome.records[-1:]]
    return BoundTask(mission, np.unique(np.concatenate(fronts), axis=0), seconds)


def refresh_tables(study: Study, folder: StudyFolder, *, anew: bool = False) -> StudyTables:
    """Make the tables of a study, unless those in its folder were made from the same files.

    With ``anew`` they are made in any case.
    """
    parts = [study.manifest(), installed_versions(), folder.inputs(study)]
    parts += [library_digest(name) for name in study.best_known.values()]
    made_from = hashlib.sha256(json.dumps(parts).encode()).hexdigest()
    if not anew:
        with contextlib.suppress(StudyError):  # tables that are damaged or missing are made anew
            tables = read_study(folder.path)
            if tables.manifest["made_from"] == made_from:
                return tables
    # Imported late: scipy.stats takes half a second, which a study without new runs can save.
    from botohe_moo.study.judge.collect import collect_tables

    collect_tables(study, folder, made_from)
    return read_study(folder.path)
