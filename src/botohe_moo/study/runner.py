"""Running studies: what is missing is performed, and everything becomes tables."""

from __future__ import annotations

import os
import threading
from collections.abc import Mapping
from dataclasses import dataclass, field
from importlib.metadata import version
from pathlib import Path
from typing import Any, Protocol

from botohe_moo._checks import check_integer
from botohe_moo.console.waiting import hold_interrupt
from botohe_moo.study.grid import Run, Study
from botohe_moo.study.loading import load_study, study_folder
from botohe_moo.study.pool import Outcomes, dask_outcomes, local_outcomes
from botohe_moo.study.store import DamagedError, Store
from botohe_moo.study.tables import StudyTables, read_study
from botohe_moo.study.task import Outcome, Record, Task

__all__ = ["Plan", "StudyInterrupted", "make_task", "plan_study", "run_study"]


class StudyInterrupted(KeyboardInterrupt):
    """A study was stopped by Ctrl-C; what was finished is in its folder, as tables, too."""


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
        Names of those whose results are there.
    failed
        Names of those that failed the last time.
    damaged
        What is wrong with the files of runs that cannot be used, by name of the run.
    seconds
        How long the finished ones took, by name of the run.
    """

    runs: tuple[Run, ...]
    finished: frozenset[str]
    failed: frozenset[str]
    damaged: Mapping[str, str]
    seconds: Mapping[str, float] = field(default_factory=dict)

    @property
    def missing(self) -> tuple[Run, ...]:
        """The runs that are to be performed."""
        return tuple(run for run in self.runs if run.digest not in self.finished)


def plan_study(study: Study, folder: Path) -> Plan:
    """Find out which runs of a study are already in its folder; each file is read and checked.

    Parameters
    ----------
    study
        The study.
    folder
        Its folder; need not exist.

    Raises
    ------
    StudyError
        If the folder holds another study.
    """
    store = Store(folder)
    store.check(study)
    runs = study.runs()
    finished, damaged, seconds = set(), {}, {}
    for run in runs:
        if store.finished(run.digest):
            try:
                seconds[run.digest] = store.load(run).seconds
                finished.add(run.digest)
            except DamagedError as error:
                damaged[run.digest] = str(error)
    failed = {
        run.digest
        for run in runs
        if run.digest not in finished and store.failure(run.digest) is not None
    }
    return Plan(runs, frozenset(finished), frozenset(failed), damaged, seconds)


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
        After Ctrl-C; what was finished until then is kept.

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
    # scipy.stats takes half a second to import, which every worker's process would wait for.
    from botohe_moo.study.collect import collect_tables

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
        with hold_interrupt() as stop:
            _perform(plan, store, stop, workers=workers, dask=dask, watcher=watcher)
            collect_tables(study, store)
    if stop.is_set():
        raise StudyInterrupted
    return read_study(folder)


def _perform(
    plan: Plan,
    store: Store,
    stop: threading.Event,
    *,
    workers: int,
    dask: str | None,
    watcher: Watcher,
) -> None:
    runs = {run.digest: run for run in plan.missing}
    tasks = [make_task(run) for run in runs.values()]
    if not tasks:
        return

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
            store.save(run, outcome)
            watcher.end(run, outcome)
    finally:
        outcomes.close()  # type: ignore[attr-defined]


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
