"""Running a study: missing runs are performed, missions bounded, and tables made."""

from __future__ import annotations

import contextlib
import datetime as dt
import hashlib
import json
import math
import os
import signal
import statistics
import warnings
from collections import defaultdict, deque
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Protocol

import numpy as np

from botohe_moo.base.messages import check_integer, check_number
from botohe_moo.base.runtime import hold_signals
from botohe_moo.library import Finder, library_digest
from botohe_moo.mission.loading import library_name_of
from botohe_moo.mission.model import Mission, numbers_digest
from botohe_moo.solution import read_solution
from botohe_moo.study.cluster import check_address, dask_outcomes
from botohe_moo.study.content import Seeds
from botohe_moo.study.folder import FAILURES, StudyFolder, restore_study
from botohe_moo.study.loading import load_study
from botohe_moo.study.model import (
    MANIFEST,
    Run,
    Study,
    StudyError,
    StudyMission,
    installed_versions,
    study_folder,
)
from botohe_moo.study.pool import WorkerPool
from botohe_moo.study.tables import StudyTables, read_study
from botohe_moo.study.task import PATIENCE, BoundTask, Outcome, Record, Task
from botohe_moo.study.words import parameter_words
from botohe_moo.trails import PlanBatch, Plans


def _of_runs(tables: StudyTables, label: str, mission: Mission) -> Iterator[tuple[PlanBatch, str]]:
    """Give the plans of each run on a mission of a study, and how they were found."""
    index_of = {node: i for i, node in enumerate(mission.nodes)}
    rows = tables.plans[tables.plans["mission"] == label]
    trails = dict(iter(rows.groupby("run")["trails"]))
    columns = ["run", "algorithm", "evaluations", "seed"]
    runs = tables.runs.loc[tables.runs["mission"] == label, columns]
    for run, algorithm, *spent in runs.itertuples(index=False):
        plans = map(json.loads, trails.get(run, ()))
        packed = [[[index_of[node] for node in trail] for trail in plan] for plan in plans]
        said = tables.manifest["algorithms"][algorithm]
        yield mission.pack(packed), _method(said["algorithm"], said["parameters"], *spent)


def _method(algorithm: str, parameters: Mapping[str, Any], evaluations: int, seed: int) -> str:
    given = f" ({parameter_words(parameters)})" if parameters else ""
    return f"{algorithm}{given}, {evaluations:,} evaluations, seed {seed}"


# Ctrl-C; what batch systems and ``docker stop`` send; what a terminal sends that is closed.
_STOPS = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)
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
        for mission in study.bounded
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
    cells = defaultdict(list)
    for run in plan.runs:
        cells[run.mission.label, run.algorithm.label].append(run)
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


def _bound_task(
    mission: StudyMission, runs: Iterable[Run], folder: StudyFolder, seconds: float
) -> BoundTask:
    """Return the task to bound a mission, guided by the points that its runs have found."""
    of_mission = [run for run in runs if run.mission.bound_digest == mission.bound_digest]
    last = (outcome.records[-1:] for _, outcome in folder.outcomes(of_mission))
    fronts = [np.empty((0, 2)), *(record.objectives for records in last for record in records)]
    return BoundTask(mission, np.unique(np.concatenate(fronts), axis=0), seconds)


def _refresh_tables(study: Study, folder: StudyFolder, *, anew: bool = False) -> StudyTables:
    """Make the tables of a study, unless those in its folder were made from the same files.

    With ``anew`` they are made in any case.
    """
    libraries = [library_digest(name) for name in study.best_known.values()]
    parts = [study.manifest(), installed_versions(), folder.inputs(study), *libraries]
    made_from = hashlib.sha256(json.dumps(parts).encode()).hexdigest()
    if not anew:
        with contextlib.suppress(StudyError):  # tables that are damaged or missing are made anew
            tables = read_study(folder.path)
            if tables.manifest["made_from"] == made_from:
                return tables
    # Imported late: scipy.stats takes half a second, which a study without new runs can save.
    from botohe_moo.study.scores import collect_tables

    collect_tables(study, folder, made_from)
    return read_study(folder.path)


class StudyInterrupted(KeyboardInterrupt):
    """A study was stopped by a signal; the runs that are finished are in its folder and tables.

    Parameters
    ----------
    number
        Number of the signal, which is SIGINT for Ctrl-C.

    Examples
    --------
    >>> import signal
    >>> from botohe_moo.study import StudyInterrupted
    >>> stopped = StudyInterrupted(signal.SIGTERM)  # what run_study raises then
    >>> stopped.signal == signal.SIGTERM, isinstance(stopped, KeyboardInterrupt)
    (True, True)
    """

    def __init__(self, number: int = signal.SIGINT) -> None:
        super().__init__(
            f"stopped by {signal.Signals(number).name}; what is finished is kept, run the study "
            "again for the rest"
        )
        self.signal = number


class Watcher(Protocol):
    """Follows the progress of a study."""

    def begin(self, plan: Plan) -> None:
        """Note the plan, before any run begins."""

    def record(self, run: Run, record: Record) -> None:
        """Note a front that a run has recorded."""

    def end(self, run: Run, outcome: Outcome) -> None:
        """Note a run that has ended and whose outcome is saved."""

    def end_bound(self, mission: StudyMission, error: str | None) -> None:
        """Note a mission whose bound is saved, or the error because of which it has none."""


class _SilentWatcher:
    """A watcher that does nothing."""

    def begin(self, plan: Plan) -> None: ...

    def record(self, run: Run, record: Record) -> None: ...

    def end(self, run: Run, outcome: Outcome) -> None: ...

    def end_bound(self, mission: StudyMission, error: str | None) -> None: ...


def run_study(
    source: str | os.PathLike[str] | Mapping[str, Any] | Study,
    out: str | os.PathLike[str] | None = None,
    *,
    workers: int = 1,
    dask: str | None = None,
    patience: float = PATIENCE,
    watcher: Watcher | None = None,
) -> StudyTables:
    """Perform the missing runs of a study, bound its missions if it asks so, and make its tables.

    A run that is already in the folder is not performed again, unless something has changed that
    its result depends on: mission, algorithm, parameters, budget, recording, seed or package
    version. Failed runs are performed again. Bounds are computed when all runs are done. A bound
    that is in the folder is computed again only if it is now allowed more seconds.

    Parameters
    ----------
    source
        A study file, the content of one as a mapping, or a study that was read before.
    out
        Folder to write to; default: ``results/NAME``.
    workers
        Runs or bounds at a time on this machine, at least 1. Results of runs do not depend on it.
    dask
        Address of the scheduler of a Dask cluster, to perform runs there instead.
    patience
        Seconds, above 0, without an evaluation after which a run of another package's algorithm
        fails. Where the budget limits the seconds of a run, these end it instead.
    watcher
        Is called as runs and bounds make progress.

    Raises
    ------
    StudyError
        If the study file is wrong, the folder cannot be used or written to, another runner is at
        work in it, or the cluster does not answer.
    StudyInterrupted
        After Ctrl-C, SIGTERM or SIGHUP; what was finished until then is kept.

    Warns
    -----
    UserWarning
        If all runs failed.

    Examples
    --------
    >>> import tempfile
    >>> from botohe_moo.study import run_study
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     tables = run_study({
    ...         "name": "trial",
    ...         "missions": ["toy"],
    ...         "algorithms": ["random", "greedy"],
    ...         "budget": {"evaluations": 50},
    ...         "seeds": 2,
    ...     }, folder)
    >>> tables.runs[["algorithm", "seed", "status"]].values.tolist()
    [['random', 1, 'done'], ['random', 2, 'done'], ['greedy', 1, 'done'], ['greedy', 2, 'done']]
    """
    workers = check_integer("workers", workers, at_least=1, at_most=1_024)
    patience = check_number("patience", patience, above=0)
    if dask is not None:
        check_address(dask)
    study = source if isinstance(source, Study) else load_study(source)
    folder = StudyFolder(study_folder(study.name, out))
    watcher = watcher or _SilentWatcher()
    with folder.locked(study):
        plan = plan_study(study, folder)
        if plan.missing:  # name damaged files before, not after, hours of work
            deque(folder.outcomes(run for run in plan.runs if run.digest in plan.finished), 0)
        folder.write_study(study)
        watcher.begin(plan)
        with hold_signals(*_STOPS) as stop, contextlib.closing(WorkerPool()) as pool:
            tasks = [Task(run, patience) for run in plan.missing]
            if dask is not None and tasks:
                outcomes = dask_outcomes(tasks, address=dask, stopped=stop.is_set)
            else:
                outcomes = pool.perform(
                    tasks,
                    workers=workers,
                    stopped=stop.is_set,
                    note=lambda task, record: watcher.record(task.run, record),
                )
            with contextlib.closing(outcomes):
                for task, outcome in outcomes:
                    folder.save(task.run, outcome)
                    watcher.end(task.run, outcome)
            bound_tasks = (
                _bound_task(mission, plan.runs, folder, study.bound_seconds)
                for mission in plan.unbounded.values()
            )
            bounds = pool.perform(bound_tasks, workers=workers, stopped=stop.is_set)
            with contextlib.closing(bounds):
                for bound_task, bound in bounds:
                    error = bound if isinstance(bound, str) else None
                    if error is None:
                        folder.save_bound(bound_task.mission, bound, bound_task.seconds)
                    watcher.end_bound(bound_task.mission, error)
            tables = _refresh_tables(study, folder)
    if stop.is_set():
        raise StudyInterrupted(stop.signal)
    if len(tables.runs) and (tables.runs["status"] == "failed").all():
        first = tables.runs["error"].iloc[0]
        warnings.warn(
            f"{folder.path}: all {len(tables.runs)} runs failed, the first with: {first}",
            stacklevel=2,
        )
    return tables


def make_tables(folder: str | os.PathLike[str]) -> StudyTables:
    """Make the tables of a study anew from the runs in its folder.

    Neither the study file nor the packages of its algorithms are needed. Another process may be
    running the study meanwhile.

    Parameters
    ----------
    folder
        Folder that ``botohe study run`` has written to.

    Raises
    ------
    StudyError
        If the folder holds no study or cannot be written to, or a file is damaged.

    Examples
    --------
    >>> from botohe_moo.study import make_tables, run_study
    >>> trial = {
    ...     "name": "trial",
    ...     "missions": ["toy"],
    ...     "algorithms": ["greedy"],
    ...     "budget": {"evaluations": 50},
    ...     "seeds": 1,
    ... }
    >>> tables = run_study(trial, "results/trial")
    >>> len(make_tables("results/trial").runs)
    1
    """
    study = restore_study(Path(folder))
    return _refresh_tables(study, StudyFolder(folder), anew=True)


def merge_studies(
    folders: Sequence[str | os.PathLike[str]], out: str | os.PathLike[str] | None = None
) -> StudyTables:
    """Make one study from the results of it on several machines.

    Their study files are the same but for the seeds, and the merged study has all of these. Where
    several folders have the same run, ``out`` keeps its own, or else gets that of the first folder.

    Parameters
    ----------
    folders
        Folders of the study, at least two.
    out
        Folder to write to: a new or empty one, or one with this study, such as one of ``folders``.
        Default: ``results/NAME``.

    Raises
    ------
    StudyError
        If a folder holds no study, or another one than the first folder does. Also if the file of a
        run is damaged, or ``out`` cannot be used or written to.

    Examples
    --------
    >>> from botohe_moo.study import merge_studies, run_study
    >>> trial = {
    ...     "name": "trial",
    ...     "missions": ["toy"],
    ...     "algorithms": ["greedy"],
    ...     "budget": {"evaluations": 50},
    ...     "seeds": [1],
    ... }
    >>> first = run_study(trial, "one")
    >>> second = run_study({**trial, "seeds": [2]}, "two")
    >>> merge_studies(["one", "two"], "both").runs["seed"].tolist()
    [1, 2]
    """
    if len(folders) < 2:
        raise StudyError(f"Expected at least two folders to merge, got {len(folders)}.")
    paths = [Path(folder) for folder in folders]
    first = restore_study(paths[0])
    target = StudyFolder(study_folder(first.name, out))
    if (target.path / MANIFEST).exists():
        paths.append(target.path)
    studies = {path: restore_study(path) for path in paths}
    for path, study in studies.items():
        if differing := _difference(first, study):
            raise StudyError(
                f"{path}: not the study in {paths[0]}; expected the same study but for its seeds, "
                f"found differences in {differing}."
            )
    values = sorted({seed for study in studies.values() for seed in study.seeds})
    file = first.file.model_copy(update={"seeds": Seeds(values=values)})
    # JSON is YAML, too, and never takes a text for a number.
    text = json.dumps(file.model_dump(mode="json", exclude_defaults=True), indent=1) + "\n"
    study = replace(first, file=file, text=text, seeds=tuple(values))
    with target.locked(study):
        target.write_study(study)
        for path in paths:
            target.take_from(path)
        return _refresh_tables(study, target)


def _difference(one: Study, other: Study) -> str:
    """Return in words where two studies differ besides their seeds; empty if nowhere."""
    first, second = (study.file.model_dump(exclude={"seeds"}) for study in (one, other))
    if keys := [key for key, value in first.items() if second[key] != value]:
        return " and ".join(keys)
    # Equal files may name different missions by the same name, or code of different versions.
    ours, others = (
        [run.digest for run in replace(study, seeds=(0,)).runs()] for study in (one, other)
    )
    return "" if ours == others else "missions or package versions"


def found_plans(folder: Path, *, by: str) -> dict[str, list[tuple[Plans, Finder]]]:
    """Read the plans of a solution or a study, as :func:`botohe_moo.library.add_plans` takes them.

    Parameters
    ----------
    folder
        Folder of a solution, or of a study.
    by
        Who found the plans; the date is today's.

    Raises
    ------
    ValueError
        If no mission in it is one of the library, or a plan cannot be read.
    """
    today = dt.date.today().isoformat()
    read: list[tuple[Mission, Iterator[tuple[Plans, str]]]]
    if (folder / "plans.json").exists():
        solution = read_solution(folder)
        how = solution.algorithm, solution.parameters, solution.evaluations, solution.seed
        read = [(solution.mission, iter([(solution.plans, _method(*how))]))]
    else:
        tables = read_study(folder)
        missions = {label: tables.mission(label) for label in tables.mission_labels}
        read = [(of, _of_runs(tables, label, of)) for label, of in missions.items()]
    found: dict[str, list[tuple[Plans, Finder]]] = {}
    for mission, lists in read:
        if name := library_name_of(numbers_digest(mission)):
            known = found.setdefault(name, [])
            known += ((plans, Finder(today, by, method)) for plans, method in lists)
    if not found:
        others = ", ".join(f"{mission.name!r} of {mission.team}" for mission, _ in read)
        raise ValueError(
            f"{folder}: expected plans of a mission of the library, found those of {others}: no "
            "mission of the library has the same nodes, arcs and team."
        )
    return found
