"""Running a study: its missing runs are performed, its missions bounded and its tables made."""

import contextlib
import os
import signal
from collections.abc import Mapping
from pathlib import Path
from typing import Any, Protocol

from botohe_moo.base.messages import check_integer, check_number
from botohe_moo.base.runtime import hold_signals
from botohe_moo.study.file.loading import load_study
from botohe_moo.study.file.model import Run, Study, StudyMission, study_folder
from botohe_moo.study.planning import Plan, make_bound_task, plan_study, refresh_tables
from botohe_moo.study.run.cluster import check_address, dask_outcomes
from botohe_moo.study.run.pool import WorkerPool
from botohe_moo.study.run.task import PATIENCE, Outcome, Record, Task
from botohe_moo.study.store.folder import StudyFolder, restore_study
from botohe_moo.study.store.tables import StudyTables

# Ctrl-C; what batch systems and ``docker stop`` send; what a terminal sends that is closed.
_STOPS = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)


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
    study = source if isinstance(source, Study) else load_study(source, out=out)
    folder = StudyFolder(study_folder(study.name, out))
    watcher = watcher or _SilentWatcher()
    with folder.locked(study):
        plan = plan_study(study, folder)
        if plan.missing:  # name damaged files before, not after, hours of work
            for _ in folder.outcomes(run for run in plan.runs if run.digest in plan.finished):
                pass
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
                make_bound_task(mission, plan.runs, folder, study.bound_seconds)
                for mission in plan.unbounded.values()
            )
            bounds = pool.perform(bound_tasks, workers=workers, stopped=stop.is_set)
            with contextlib.closing(bounds):
                for bound_task, bound in bounds:
                    error = bound if isinstance(bound, str) else None
                    if error is None:
                        folder.save_bound(bound_task.mission, bound, bound_task.seconds)
                    watcher.end_bound(bound_task.mission, error)
            tables = refresh_tables(study, folder)
    if stop.is_set():
        raise StudyInterrupted(stop.signal)
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
    return refresh_tables(study, StudyFolder(folder), anew=True)
