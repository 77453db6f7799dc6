"""Running studies: what is missing is performed, and everything becomes tables."""

from __future__ import annotations

import os
import signal
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, Protocol

from botohe_moo._base.checks import check_integer, check_number
from botohe_moo.study.file.grid import Run, Study
from botohe_moo.study.file.loading import load_study, study_folder
from botohe_moo.study.planning import Plan, make_task, plan_study
from botohe_moo.study.refresh import refresh_tables
from botohe_moo.study.run.cluster import check_address, dask_outcomes
from botohe_moo.study.run.pool import Outcomes, local_outcomes
from botohe_moo.study.run.stopping import Stop, hold_stop
from botohe_moo.study.run.task import PATIENCE, Outcome, Record, Task
from botohe_moo.study.store.index import Entry
from botohe_moo.study.store.kept import kept_study
from botohe_moo.study.store.manifest import read_manifest
from botohe_moo.study.store.shelf import tables_locked
from botohe_moo.study.store.store import Store
from botohe_moo.study.store.tables import StudyTables

__all__ = ["StudyInterrupted", "make_tables", "run_study"]


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


def run_study(
    source: str | os.PathLike[str] | Mapping[str, Any] | Study,
    out: str | os.PathLike[str] | None = None,
    *,
    workers: int = 1,
    dask: str | None = None,
    patience: float = PATIENCE,
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
    patience
        Seconds, above 0, after which a run of another package's algorithm fails that evaluates no
        plan any more, where no budget of seconds ends it.
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
    patience = check_number("patience", patience, above=0)
    if dask is not None:
        check_address(dask)
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
            done = _perform(
                plan, store, stop,
                workers=workers, dask=dask, patience=patience, watcher=watcher,
            )  # fmt: skip
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
    patience: float,
    watcher: Watcher,
) -> dict[str, Entry]:
    """Perform the runs that are missing; give the files of those that did not fail."""
    done: dict[str, Entry] = {}
    runs = {run.digest: run for run in plan.missing}
    tasks = [make_task(run, patience) for run in runs.values()]
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


class _Silent:
    """A watcher that keeps everything to itself."""

    def begin(self, plan: Plan) -> None: ...

    def record(self, run: Run, record: Record) -> None: ...

    def end(self, run: Run, outcome: Outcome) -> None: ...
