"""What is to be done in a study: its runs, and which of them are already there."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from importlib.metadata import version
from pathlib import Path

from botohe_moo.study.file.grid import Run, Study
from botohe_moo.study.run.task import PATIENCE, Task
from botohe_moo.study.store.index import Entry, read_index
from botohe_moo.study.store.store import DamagedError, Store

__all__ = ["Plan", "make_task", "plan_study"]


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


def make_task(run: Run, patience: float = PATIENCE) -> Task:
    """Say what a worker needs to know of a run.

    Parameters
    ----------
    run
        The run.
    patience
        As :func:`run_study` takes it.
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
        patience=patience,
    )
