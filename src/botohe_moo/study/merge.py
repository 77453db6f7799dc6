"""Merging the results that several machines have of one study."""

import os
from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np

from botohe_moo.indicators import area_indicator
from botohe_moo.study.file.model import (
    MANIFEST,
    Run,
    Study,
    StudyError,
    StudyMission,
    study_folder,
)
from botohe_moo.study.file.union import unite_studies
from botohe_moo.study.planning import found_points, make_task, refresh_tables
from botohe_moo.study.run.perform import verify
from botohe_moo.study.run.task import Outcome
from botohe_moo.study.store.bound_files import KeptBound
from botohe_moo.study.store.folder import DamagedError, StudyFolder
from botohe_moo.study.store.manifest import restore_study
from botohe_moo.study.store.run_files import IndexedFile
from botohe_moo.study.store.table_files import tables_locked
from botohe_moo.study.store.tables import StudyTables


def merge_studies(
    folders: Sequence[str | os.PathLike[str]], out: str | os.PathLike[str] | None = None
) -> StudyTables:
    """Make one study of the results that several machines have of it.

    The studies may differ in their missions, algorithms and seeds; the merged one has all of
    these. Every run is checked: its file has to be whole, it has spent no more than its budget, and
    the plans of its final front are evaluated again. Nothing is written before all is checked. Of
    a run that several folders have, ``out`` keeps its own, or else takes that of the first folder;
    of bounds, that which was allowed the most seconds. Bounds that are missing are not computed.

    Parameters
    ----------
    folders
        Folders of the studies, at least two.
    out
        Folder to write to: a new or empty one, or one that holds this study already, such as one
        of ``folders``. Default: ``results/NAME``.

    Raises
    ------
    StudyError
        If a folder holds no study, they hold different ones, or a mission, an algorithm or a
        result of the same label differs between them; names both folders. Also if a run's file is
        damaged, or ``out`` cannot be used or written to.

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
    study = unite_studies(paths, [restore_study(path) for path in paths])
    target = StudyFolder(study_folder(study.name, out))
    target.check(study)
    # Runs that are in the target have to fit, too, and are kept; no folder is read twice.
    resolved = dict.fromkeys(Path(os.path.realpath(path)) for path in (target.path, *paths))
    sources = [StudyFolder(path) for path in resolved]
    _check_nothing_is_lost(target.path, study)
    found = {run.digest: _find_run(run, sources) for run in study.runs()}
    bounds = list(_find_bounds(study, sources))
    with target.locked(study):
        target.write_study(study)
        finished = {}
        for run in study.runs():
            if source := found[run.digest]:
                finished[run.digest] = _copy_run(run, source, target)
            else:
                failures = (source.failure(run.digest) for source in sources)
                if failure := next(filter(None, failures), None):
                    target.save(run, failure)
        for mission, kept in bounds:
            target.save_bound(mission, kept.bound, kept.seconds)
        with tables_locked(target.path):
            return refresh_tables(study, target, finished)


def _check_nothing_is_lost(path: Path, study: Study) -> None:
    """Refuse a folder that holds runs which are not in the merged study."""
    if not (path / MANIFEST).exists():
        return
    lost = {run.digest for run in restore_study(path).runs()}
    lost -= {run.digest for run in study.runs()}
    if lost:
        raise StudyError(
            f"{path}: holds a study with {len(lost)} runs that are not in those to be merged; "
            "merge it, too, or give another folder by --out."
        )


def _find_run(run: Run, sources: Sequence[StudyFolder]) -> StudyFolder | None:
    """Check a run in every folder that has it; give the first of these folders."""
    found: tuple[StudyFolder, Outcome] | None = None
    for folder in sources:
        if not folder.has_run(run.digest):
            continue
        try:
            outcome = folder.load(run)
        except DamagedError as error:
            raise StudyError(
                f"{error}; run the study there again, or remove the file, and merge again."
            ) from error
        try:
            _verify_outcome(run, outcome)
        except ValueError as error:
            raise StudyError(f"{folder.path}: run {_named(run)}: {error}.") from error
        if found is None:
            found = folder, outcome
        elif run.mission.budget.seconds is None and not _agree(found[1], outcome):
            raise StudyError(
                f"{folder.path}: run {_named(run)} has another result than in "
                f"{found[0].path}; the same run gives the same on every machine."
            )
    return found[0] if found else None


def _find_bounds(
    study: Study, sources: Sequence[StudyFolder]
) -> Iterator[tuple[StudyMission, KeptBound]]:
    """Give the bound of each mission that was allowed the most seconds, if there is one."""
    runs = study.runs()
    for mission in study.missions if study.file.bounds else ():
        try:
            kept = [bound for folder in sources if (bound := folder.bound(mission))]
        except DamagedError as error:
            raise StudyError(f"{error}; remove the file, and merge again.") from error
        if not kept:
            continue
        longest = max(kept, key=lambda bound: bound.seconds)
        for folder in sources:
            area = area_indicator(found_points(mission, runs, folder), mission.mission)
            longest.check(mission.label, area)
        yield mission, longest


def _verify_outcome(run: Run, outcome: Outcome) -> None:
    """Raise a ValueError if an outcome exceeds its budget, or its final front is not as claimed."""
    budget = run.mission.budget.evaluations
    if budget is not None and outcome.evaluations > budget:
        raise ValueError(f"expected at most {budget} evaluations, found {outcome.evaluations}")
    if not outcome.records:
        return
    last = outcome.records[-1]
    plans, objectives = last.plans or (None, np.empty((0, 2)))
    if not np.array_equal(np.unique(objectives, axis=0), np.unique(last.objectives, axis=0)):
        raise ValueError("the points of its final front are not those of its plans")
    if plans is not None:
        verify(make_task(run), plans, objectives)


def _agree(one: Outcome, other: Outcome) -> bool:
    """Tell whether two outcomes are the same but for the time they took."""
    return (
        (one.status, one.evaluations) == (other.status, other.evaluations)
        and len(one.records) == len(other.records)
        and all(
            mine.evaluations == theirs.evaluations
            and np.array_equal(mine.objectives, theirs.objectives)
            for mine, theirs in zip(one.records, other.records, strict=True)
        )
    )


def _copy_run(run: Run, source: StudyFolder, target: StudyFolder) -> IndexedFile:
    """Copy a run's file unless it is there, and describe it."""
    file = target.check_run(run) if source.path == Path(os.path.realpath(target.path)) else None
    file = file or target.save(run, source.load(run))
    if file is None:
        raise StudyError(f"{source.path}: run {_named(run)} has changed meanwhile; merge again.")
    return file


def _named(run: Run) -> str:
    return f"{run.digest} ({run.algorithm.label} on {run.mission.label}, seed {run.seed})"
