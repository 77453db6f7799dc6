"""The plan of a study: its runs, and which of them are finished already."""

from collections.abc import Mapping
from dataclasses import dataclass
from importlib.metadata import version

from botohe_moo.study.file.model import Run, Study
from botohe_moo.study.run.task import PATIENCE, Task
from botohe_moo.study.store.folder import DamagedError, StudyFolder
from botohe_moo.study.store.run_files import IndexedFile, read_index


@dataclass(frozen=True)
class Plan:
    """The runs of a study, and which of them are finished."""

    runs: tuple[Run, ...]
    # All by digest of the run:
    finished: Mapping[str, IndexedFile]  # files of finished runs
    failed: frozenset[str]  # runs that failed the last time
    damaged: Mapping[str, str]  # what is wrong with files that cannot be used

    @property
    def missing(self) -> tuple[Run, ...]:
        """The runs that are to be performed."""
        return tuple(run for run in self.runs if run.digest not in self.finished)


def plan_study(study: Study, folder: StudyFolder, *, anew: bool = False) -> Plan:
    """Find out which runs of a study are finished.

    A file that is new, or has changed since it was read, is read in full and checked; with
    ``anew`` every file is.
    """
    runs = study.runs()
    known = {} if anew else read_index(folder.path)
    finished, damaged = {}, {}
    for run in runs:
        try:
            if file := folder.check_run(run, known.get(run.digest)):
                finished[run.digest] = file
        except DamagedError as error:
            damaged[run.digest] = str(error)
    failed = folder.failures().keys() & {run.digest for run in runs} - finished.keys()
    readable = (digest for digest in failed if folder.failure(digest) is not None)
    return Plan(runs, finished, frozenset(readable), damaged)


def make_task(run: Run, patience: float = PATIENCE) -> Task:
    """Give what a worker needs to know of a run."""
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
