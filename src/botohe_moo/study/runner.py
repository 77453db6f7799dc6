"""Running studies: what is missing is performed, and everything becomes tables."""

from __future__ import annotations

import os
import signal
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from importlib.metadata import version
from pathlib import Path
from typing import Any, Protocol

from botohe_moo._checks import check_integer
from botohe_moo.study.cluster import dask_outcomes
from botohe_moo.study.grid import Run, Study
from botohe_moo.study.index import Entry, read_index
from botohe_moo.study.kept import kept_study
from botohe_moo.study.loading import load_study, study_folder
from botohe_moo.study.manifest import read_manifest
from botohe_moo.study.pool import Outcomes, local_outcomes
from botohe_moo.study.refresh import refresh_tables
from botohe_moo.study.shelf import tables_locked
from botohe_moo.study.stopping import Stop, hold_stop
from botohe_moo.study.store import DamagedError, Store
from botohe_moo.study.tables import StudyTables
from botohe_moo.study.task import Outcome, Record, Task

__all__ = [
    "Plan",
    "StudyInterrupted",
    "make_tables",
    "make_task",
    "plan_study",
    "run_study",
]


class StudyInterrupted(KeyboardInterrupt):
    """A study was stopped by a signal; what was finished is in its folder, as tables, too.

    Parameters
    ----------
    number
        Of the signal: Ctrl-C is SIGINT.
    """

    def __init__(self, number: int = signal.SIGINT) -> None:
        super().__init__()
        self.signal = number


class Watcher(Protocol):
    """Is told how a study gets on."""

    def begin(self, plan: Plan) -> None:
        """Take note of what is to be done.

        Parameters
        ----------
        plan
            The runs, and what is already there.
        """

    def record(self, run: Run, record: Record) -> None:
        """Take note of a front that a run has recorded.

        Parameters
        ----------
        run, record
            The run and its front.
        """

    def end(self, run: Run, outcome: Outcome) -> None:
        """Take note of a run that has ended and been kept.

        Parameters
        ----------
        run, outcome
            The run and how it ended.
        """


@dataclass(frozen=True)
class Plan:
    """The runs of a study, and which of them are already there.

    Attributes
    ----------
    runs
        All runs.
    finished
        The files of those whose results are there, by name of the run.
    failed
        Names of those that failed the last time.
    damaged
        What is wrong with the files of runs that cannot be used, by name of the run.
    """

    runs: tuple[Run, ...]
    finished: Mapping[str, Entry]
    failed: frozenset[str]
    damaged: Mapping[str, str]

    @property
    def missing(self) -> tuple[Run, ...]:
        """The runs that are to be performed."""
        return tuple(run for run in self.runs if run.digest not in self.finished)


def plan_study(study: Study, folder: Path, *, anew: bool = False) -> Plan:
    """Find out which runs of a study are already in its folder.

    A file that is new, or has changed since it was read, is read in full and checked.

    Parameters
    ----------
    study
        The study.
    folder
        Its folder; need not exist.
    anew
        Whether every file is read, also those that were read before and have not changed.

    Raises
    ------
    StudyError
        If the folder holds another study.
    """
    store = Store(folder)
    store.check(study)
    runs = study.runs()
    known = {} if anew else read_index(folder)
    finished, damaged = {}, {}
    for run in runs:
        try:
            if entry := store.entry(run, known.get(run.digest)):
                finished[run.digest] = entry
        except DamagedError as error:
            damaged[run.digest] = str(error)
    failed = store.failures().keys() & {run.digest for run in runs} - finished.keys()
    readable = (digest for digest in failed if store.failure(digest) is not None)
    return Plan(runs, finished, frozenset(readable), damaged)


def run_study(
    source: str | os.PathLike[str] | Mapping[str, Any] | Study,
    out: str | os.PathLike[str] | None = None,
    *,
    workers: int = 1,
    dask: str | None = None,
    watcher: Watcher | None = None,
) -> StudyTables:
    """Perform what is missing of a study, and make its tables.

    Runs that are already in the folder are not performed again, unless something has changed that
    their result depends on: mission, algorithm, parameters, budget, recording, seed or package
    version. Failed runs are performed again.

    Parameters
    ----------
    source
        A study file, the content of one as a mapping, or a study that was read before.
    out
        Folder to write to; default: ``results/NAME``.
    workers
        Runs at a time on this machine, at least 1. Results do not depend on it.
    dask
        Address of the scheduler of a Dask cluster, to work there instead.
    watcher
        Is told how the study gets on.

    Returns
    -------
    StudyTables
        The tables, as they are in the folder.

    Raises
    ------
    StudyError
        If the study file is wrong, the folder cannot be used or written to, another runner is at
        work in it, or the cluster does not answer.
    StudyInterrupted
        After Ctrl-C, SIGTERM or SIGHUP; what was finished until then is kept.

    Examples
    --------
    >>> import tempfile
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
    study = source if isinstance(source, Study) else load_study(source, out=out)
    folder = study_folder(study.name, out)
    store = Store(folder)
    store.check(study)
    with store.locked():
        store.check(study)
        plan = plan_study(study, folder)
        store.write_study(study)
        watcher = watcher or _Silent()
        watcher.begin(plan)
        with hold_stop() as stop:
            done = _perform(plan, store, stop, workers=workers, dask=dask, watcher=watcher)
            with tables_locked(folder):
                tables = refresh_tables(study, store, {**plan.finished, **done})
    if stop.is_set():
        raise StudyInterrupted(stop.signal)
    return tables


def make_tables(
    folder: str | os.PathLike[str], *, say: Callable[[str], None] | None = None
) -> StudyTables:
    """Make the tables of a study anew, of the runs that are in its folder.

    Every file of a run is read and checked. The study file is not needed, nor are the packages
    that algorithms are from. A runner may be at work meanwhile.

    Parameters
    ----------
    folder
        Folder that ``botohe study run`` has written to.
    say
        Is told which files are damaged; their runs are not in the tables.

    Raises
    ------
    StudyError
        If the folder holds no study, or cannot be written to.
    """
    folder = Path(folder)
    read_manifest(folder)
    with tables_locked(folder):
        study = kept_study(folder)
        plan = plan_study(study, folder, anew=True)
        for fault in plan.damaged.values():
            if say is not None:
                say(f"{fault}; the run is missing from the tables.")
        return refresh_tables(study, Store(folder), plan.finished, anew=True)


def _perform(
    plan: Plan,
    store: Store,
    stop: Stop,
    *,
    workers: int,
    dask: str | None,
    watcher: Watcher,
) -> dict[str, Entry]:
    """Perform the runs that are missing; give the files of those that did not fail."""
    done: dict[str, Entry] = {}
    runs = {run.digest: run for run in plan.missing}
    tasks = [make_task(run) for run in runs.values()]
    if not tasks:
        return done

    def note(task: Task, record: Record) -> None:
        watcher.record(runs[task.digest], record)

    outcomes: Outcomes = (
        local_outcomes(tasks, workers=workers, stopped=stop.is_set, note=note)
        if dask is None
        else dask_outcomes(tasks, address=dask, stopped=stop.is_set)
    )
    try:
        for task, outcome in outcomes:
            run = runs[task.digest]
            if entry := store.save(run, outcome):
                done[run.digest] = entry
            watcher.end(run, outcome)
    finally:
        outcomes.close()  # type: ignore[attr-defined]
    return done


def make_task(run: Run) -> Task:
    """Say what a worker needs to know of a run.

    Parameters
    ----------
    run
        The run.
    """
    budget = run.mission.budget
    return Task(
        digest=run.digest,
        mission=run.mission.mission,
        min_survival=run.mission.min_survival,
        algorithm=run.algorithm.algorithm,
        parameters=dict(run.algorithm.parameters),
        origin=dict(run.algorithm.origin),
        seed=run.seed,
        evaluations=budget.evaluations,
        seconds=budget.seconds,
        grace_seconds=budget.grace_seconds,
        per_decade=run.recording.per_decade,
        start=run.recording.start,
        at=tuple(run.recording.at),
        version=version("botohe-moo"),
    )


class _Silent:
    """A watcher that keeps everything to itself."""

    def begin(self, plan: Plan) -> None: ...

    def record(self, run: Run, record: Record) -> None: ...

    def end(self, run: Run, outcome: Outcome) -> None: ...
