"""Running a study: missing runs are performed until a signal stops it, and the tables are made."""

import contextlib
import os
import signal
import threading
from collections.abc import Generator, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Protocol

from botohe_moo._base.checks import check_integer, check_number
from botohe_moo.solving import hold_interrupt
from botohe_moo.study.file.loading import load_study
from botohe_moo.study.file.model import Run, Study, StudyMission, study_folder
from botohe_moo.study.planning import Plan, make_bound_task, make_task, plan_study, refresh_tables
from botohe_moo.study.run.cluster import check_address, dask_outcomes
from botohe_moo.study.run.pool import WorkerPool
from botohe_moo.study.run.task import PATIENCE, BoundTask, Outcome, Record, Task
from botohe_moo.study.store.folder import StudyFolder
from botohe_moo.study.store.manifest import restore_study
from botohe_moo.study.store.tables import StudyTables

# Sent by batch systems and ``docker stop``, and by a terminal that is closed.
_LIKE_CTRL_C = (signal.SIGTERM, signal.SIGHUP)


@dataclass
class Stop:
    """Whether a study is to stop, and which signal has asked for it."""

    pressed: threading.Event
    signal: int = signal.SIGINT


@contextlib.contextmanager
def hold_stop() -> Iterator[Stop]:
    """Let Ctrl-C, SIGTERM and SIGHUP ask for a stop; the second one breaks off at once.

    Signals that are ignored, as under ``nohup``, or have another handler, stay as they are; so do
    all outside the main thread, which alone may handle signals.
    """
    with hold_interrupt() as pressed:
        stop = Stop(pressed)

        def note(number: int, _: object) -> None:
            stop.signal = number
            pressed.set()
            signal.signal(number, signal.SIG_DFL)

        ours = []
        if threading.current_thread() is threading.main_thread():
            ours = [n for n in _LIKE_CTRL_C if signal.getsignal(n) is signal.SIG_DFL]
        for number in ours:
            signal.signal(number, note)
        try:
            yield stop
        finally:
            for number in ours:
                signal.signal(number, signal.SIG_DFL)


class StudyInterrupted(KeyboardInterrupt):
    """A study was stopped by a signal; what was finished is in its folder, as tables, too.

    Parameters
    ----------
    number
        Of the signal: Ctrl-C is SIGINT.

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
        """Take note of the plan, before any run begins."""

    def record(self, run: Run, record: Record) -> None:
        """Take note of a front that a run has recorded."""

    def end(self, run: Run, outcome: Outcome) -> None:
        """Take note of a run that has ended and whose outcome is saved."""

    def end_bound(self, mission: StudyMission, error: str | None) -> None:
        """Take note of a mission whose bound is saved, or of the error that there is instead."""


class _Silent:
    """A watcher that shows nothing."""

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
    """Perform what is missing of a study, bound its missions if it says so, and make its tables.

    Runs that are already in the folder are not performed again, unless something has changed that
    their result depends on: mission, algorithm, parameters, budget, recording, seed or package
    version. Failed runs are performed again. Bounds are computed when all runs are done, unless the
    folder has those that were allowed as many seconds.

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
        Seconds, above 0, after which a run of another package's algorithm fails that evaluates no
        plan any more, where no budget of seconds ends it.
    watcher
        Notes how the study gets on.

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
    watcher = watcher or _Silent()
    with folder.locked(study):
        plan = plan_study(study, folder)
        folder.write_study(study)
        watcher.begin(plan)
        runs = {run.digest: run for run in plan.missing}
        tasks = [make_task(run, patience) for run in runs.values()]
        with hold_stop() as stop, contextlib.closing(WorkerPool()) as pool:
            if dask is not None and tasks:
                outcomes = dask_outcomes(tasks, address=dask, stopped=stop.pressed.is_set)
            else:
                outcomes = pool.perform(
                    tasks,
                    workers=workers,
                    stopped=stop.pressed.is_set,
                    note=lambda task, record: watcher.record(runs[task.digest], record),
                )
            _save(outcomes, runs, folder, watcher)
            bound_tasks = (
                make_bound_task(mission, plan.runs, folder, study.bound_seconds)
                for mission in plan.unbounded.values()
            )
            bounds = pool.perform(bound_tasks, workers=workers, stopped=stop.pressed.is_set)
            _save_bounds(bounds, plan.unbounded, folder, watcher)
            tables = refresh_tables(study, folder)
    if stop.pressed.is_set():
        raise StudyInterrupted(stop.signal)
    return tables


def _save(
    outcomes: Generator[tuple[Task, Outcome], None, None],
    runs: Mapping[str, Run],
    folder: StudyFolder,
    watcher: Watcher,
) -> None:
    """Save outcomes as they come."""
    with contextlib.closing(outcomes):
        for task, outcome in outcomes:
            run = runs[task.digest]
            folder.save(run, outcome)
            watcher.end(run, outcome)


def _save_bounds(
    bounds: Generator[tuple[BoundTask, Any], None, None],
    missions: Mapping[str, StudyMission],
    folder: StudyFolder,
    watcher: Watcher,
) -> None:
    """Save bounds as they are found."""
    with contextlib.closing(bounds):
        for task, found in bounds:
            mission, error = missions[task.digest], found if isinstance(found, str) else None
            if error is None:
                folder.save_bound(mission, found, task.seconds)
            watcher.end_bound(mission, error)


def make_tables(folder: str | os.PathLike[str]) -> StudyTables:
    """Make the tables of a study anew, of the runs that are in its folder.

    The study file is not needed, nor are the packages that algorithms are from. A runner may be at
    work meanwhile.

    Parameters
    ----------
    folder
        Folder that ``botohe study run`` has written to.

    Raises
    ------
    StudyError
        If the folder holds no study, or cannot be written to; or names a file that is damaged.

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
