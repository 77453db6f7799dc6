"""The plan of a study: its runs, which of them are finished, and whether its tables are current."""

import contextlib
import functools
import hashlib
import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from importlib.metadata import version
from pathlib import Path

import numpy as np

from botohe_moo._base.types import FloatArray
from botohe_moo.study.file.digest import canonical
from botohe_moo.study.file.model import Run, Study, StudyError, StudyMission
from botohe_moo.study.run.task import PATIENCE, BoundTask, Task
from botohe_moo.study.store.folder import DamagedError, StudyFolder, writing
from botohe_moo.study.store.manifest import read_manifest
from botohe_moo.study.store.run_files import IndexedFile, read_index, write_index
from botohe_moo.study.store.table_files import note_inputs
from botohe_moo.study.store.tables import SMALL, StudyTables, read_study


@dataclass(frozen=True)
class Plan:
    """The runs of a study, which of them are finished, and which bounds are missing."""

    runs: tuple[Run, ...]
    # All by digest of the run:
    finished: Mapping[str, IndexedFile]  # files of finished runs
    failed: frozenset[str]  # runs that failed the last time
    damaged: Mapping[str, str]  # what is wrong with files that cannot be used
    # All by digest of the bound:
    unbounded: Mapping[str, StudyMission]  # whose bounds are to be computed
    damaged_bounds: Mapping[str, str]  # what is wrong with files that cannot be used

    @property
    def missing(self) -> tuple[Run, ...]:
        """The runs that are to be performed."""
        return tuple(run for run in self.runs if run.digest not in self.finished)


def plan_study(study: Study, folder: StudyFolder, *, anew: bool = False) -> Plan:
    """Find out which runs of a study are finished, and which bounds are there.

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
    return Plan(runs, finished, frozenset(readable), damaged, *_plan_bounds(study, folder))


def _plan_bounds(
    study: Study, folder: StudyFolder
) -> tuple[dict[str, StudyMission], dict[str, str]]:
    """Find out which missions have no bound that was allowed as many seconds as are asked for."""
    missing, damaged = {}, {}
    for mission in study.missions if study.file.bounds else ():
        try:
            kept = folder.bound(mission)
        except DamagedError as error:
            kept, damaged[mission.bound_digest] = None, str(error)
        if kept is None or kept.seconds < study.bound_seconds:
            missing[mission.bound_digest] = mission
    return missing, damaged


def make_task(run: Run, patience: float = PATIENCE) -> Task:
    """Give what a worker needs to know of a run."""
    budget = run.mission.budget
    return Task(
        digest=run.digest,
        mission=run.mission.mission,
        min_survival=run.mission.min_survival,
        max_length=math.inf if run.mission.max_length is None else run.mission.max_length,
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
        version=_version(),
        patience=patience,
    )


@functools.cache
def _version() -> str:
    return version("botohe-moo")  # read from a file, which for each run would take minutes


def make_bound_task(
    mission: StudyMission, runs: Iterable[Run], folder: StudyFolder, seconds: float
) -> BoundTask:
    """Give what a worker needs to know to bound a mission: what its runs have found guides it."""
    return BoundTask(
        digest=mission.bound_digest,
        mission=mission.mission,
        min_survival=mission.min_survival,
        max_length=math.inf if mission.max_length is None else mission.max_length,
        front=found_points(mission, runs, folder),
        seconds=seconds,
    )


def found_points(mission: StudyMission, runs: Iterable[Run], folder: StudyFolder) -> FloatArray:
    """Give E[R] and E[S] (n, 2) of all final fronts that a folder has of a mission."""
    fronts = [np.empty((0, 2))]
    for run in runs:
        if run.mission.bound_digest == mission.bound_digest and folder.has_run(run.digest):
            with contextlib.suppress(DamagedError):
                fronts += [record.objectives for record in folder.load(run).records[-1:]]
    points: FloatArray = np.unique(np.concatenate(fronts), axis=0)
    return points


def refresh_tables(
    study: Study, folder: StudyFolder, finished: Mapping[str, IndexedFile], *, anew: bool = False
) -> StudyTables:
    """Make the tables, unless those in the folder were made from the same inputs.

    Nobody else may make tables there meanwhile. ``finished`` holds the files of finished runs by
    digest of the run; with ``anew`` the tables are made in any case.
    """
    path, inputs = folder.path, _inputs_digest(study, folder, finished)
    with writing(path):
        write_index(path, finished)
    if not anew:
        with contextlib.suppress(StudyError):  # damaged, or not there: they are made again
            csv_there = all((path / f"{name}.csv").exists() for name in SMALL)
            if csv_there and read_manifest(path).get("made_from") == inputs:
                return read_study(path)
    # Imported late: scipy.stats takes half a second, which a study without new runs can save.
    from botohe_moo.study.judge.collect import collect_tables

    collect_tables(study, folder)
    with writing(path):
        note_inputs(path, inputs)
    return read_study(path)


def _inputs_digest(study: Study, folder: StudyFolder, finished: Mapping[str, IndexedFile]) -> str:
    """Give the digest of all that tables depend on: the study, its runs' files, and the code."""
    missing = {run.digest for run in study.runs()} - finished.keys()
    failures = {
        digest: hashlib.sha256(data).hexdigest()
        for digest, data in folder.failures().items()
        if digest in missing
    }
    contents = {digest: file.content for digest, file in finished.items()}
    bounds = {label: kept.content for label, kept in folder.bounds(study).items()}
    parts = [study.manifest(), contents, failures, bounds, _code_digest()]
    return hashlib.sha256(canonical(parts).encode()).hexdigest()


@functools.cache
def _code_digest() -> str:
    """Give the digest of this package's study code, which may change within a version."""
    hashed = hashlib.sha256()
    for path in sorted(Path(__file__).parent.rglob("*.py")):
        hashed.update(path.read_bytes())
    return hashed.hexdigest()
