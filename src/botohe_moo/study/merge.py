"""Results of one study from several machines, put together as if they were from one."""

from __future__ import annotations

import json
import os
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any, TypeVar

import numpy as np
from pydantic import BaseModel

from botohe_moo._base.checks import quoted
from botohe_moo.mission.formats.files import SUFFIXES
from botohe_moo.study.file.checking import MAX_RUNS
from botohe_moo.study.file.config import AlgorithmEntry, Budget, MissionEntry, Seeds
from botohe_moo.study.file.document import Document
from botohe_moo.study.file.grid import Run, Study, StudyAlgorithm, StudyMission
from botohe_moo.study.file.loading import study_folder
from botohe_moo.study.file.shape import file_faults
from botohe_moo.study.planning import make_task
from botohe_moo.study.refresh import refresh_tables
from botohe_moo.study.run.perform import verify
from botohe_moo.study.run.task import Outcome
from botohe_moo.study.store.index import Entry as FileEntry
from botohe_moo.study.store.kept import kept_study
from botohe_moo.study.store.manifest import MANIFEST
from botohe_moo.study.store.shelf import tables_locked
from botohe_moo.study.store.store import DamagedError, Store
from botohe_moo.study.store.tables import StudyError, StudyTables

__all__ = ["merge_studies"]

Member = TypeVar("Member", StudyMission, StudyAlgorithm)
Entry = TypeVar("Entry", MissionEntry, AlgorithmEntry)

# What one study has one of, whatever machine its runs are from.
_COMMON = ("name", "recording", "indicators", "comparison")


def merge_studies(
    folders: Sequence[str | os.PathLike[str]], out: str | os.PathLike[str] | None = None
) -> StudyTables:
    """Make one study of the results that several machines have of it.

    The studies may differ in their missions, algorithms and seeds; the one made of them has all of
    these. Every run is checked: its file has to be whole, it has spent no more than its budget, and
    the plans of its final front are evaluated again. Nothing is written before all is checked. Of
    a run that several folders have, ``out`` keeps its own, or else takes that of the first folder.

    Parameters
    ----------
    folders
        Folders of the studies, at least two.
    out
        Folder to write to: a new or empty one, or one that holds this study already, such as one
        of ``folders``. Default: ``results/NAME``.

    Returns
    -------
    StudyTables
        The tables of the study, as they are in ``out``.

    Raises
    ------
    StudyError
        If a folder holds no study, they hold different ones, or a mission, an algorithm or a
        result of the same label differs between them; names both folders. Also if a run's file is
        damaged, or ``out`` cannot be used or written to.
    """
    if len(folders) < 2:
        raise StudyError(f"Expected at least two folders to merge, got {len(folders)}.")
    paths = [Path(folder) for folder in folders]
    study = _union(paths, [kept_study(path) for path in paths])
    folder = study_folder(study.name, out)
    store = Store(folder)
    store.check(study)
    # What is there of this study already has to fit, too, and is kept; none is read twice.
    sources = [Store(path) for path in dict.fromkeys(p.resolve() for p in (folder, *paths))]
    _check_nothing_is_lost(folder, study)
    found = {run.digest: _whole_run(run, sources) for run in study.runs()}
    with store.locked():
        store.check(study)
        store.write_study(study)
        finished = {}
        for run in study.runs():
            if source := found[run.digest]:
                finished[run.digest] = _kept(run, source, store)
            else:
                _keep_failure(run, sources, store)
        with tables_locked(folder):
            return refresh_tables(study, store, finished)


def _check_nothing_is_lost(folder: Path, study: Study) -> None:
    """Refuse a folder that holds runs which the study merged has not."""
    if not (folder / MANIFEST).exists():
        return
    lost = {run.digest for run in kept_study(folder).runs()}
    lost -= {run.digest for run in study.runs()}
    if lost:
        raise StudyError(
            f"{folder}: holds a study with {len(lost)} runs that are not in those to be merged; "
            "merge it, too, or give another folder by --out."
        )


def _union(paths: Sequence[Path], studies: Sequence[Study]) -> Study:
    """Give the study that has the missions, algorithms and seeds of all."""
    first = studies[0]
    for path, study in zip(paths[1:], studies[1:], strict=True):
        for name in _COMMON:
            here, there = getattr(first.file, name), getattr(study.file, name)
            if here != there:
                raise StudyError(
                    f"{path}: not the study in {paths[0]}; expected its {name} to be "
                    f"{_shown(here)}, found {_shown(there)}."
                )
        if study.versions != first.versions:
            raise StudyError(
                f"{path}: its runs are of {_shown(study.versions)}, those in {paths[0]} of "
                f"{_shown(first.versions)}; results of different versions are not one study's."
            )
    missions = _members("mission", paths, [study.missions for study in studies])
    algorithms = _members("algorithm", paths, [study.algorithms for study in studies])
    seeds = tuple(dict.fromkeys(seed for study in studies for seed in study.seeds))
    file = first.file.model_copy(
        update={
            "missions": _mission_entries([study.file.missions for study in studies], missions),
            "algorithms": _entries(
                [study.file.algorithms for study in studies], algorithms, _algorithm_entry
            ),
            "seeds": Seeds.model_construct(values=list(seeds)),
            "budget": None,  # each mission's own
        }
    )
    # JSON is YAML, too, and leaves no doubt what is a text.
    content = file.model_dump(mode="json", exclude_defaults=True)
    text = json.dumps(content, indent=1, ensure_ascii=False) + "\n"
    _check_size(text, len(missions) * len(algorithms) * len(seeds))
    return Study(file, text, missions, algorithms, seeds, first.versions)


def _check_size(text: str, n_runs: int) -> None:
    """Refuse together what no study file may hold: nobody could read it again."""
    document = Document.parse(text)
    faults = [fault.message for fault in document.faults] or [
        f"{place[0] if place else 'it'}: {said}" for place, said in file_faults(document.content)
    ]
    if n_runs > MAX_RUNS:
        faults.append(f"expected at most {MAX_RUNS:,} runs, found {n_runs:,}.")
    if faults:
        raise StudyError(f"The studies together are too large for one: {faults[0]}")


def _members(
    kind: str, paths: Sequence[Path], lists: Sequence[Sequence[Member]]
) -> tuple[Member, ...]:
    """Give the missions, or the algorithms, of all studies; one label means one thing."""
    found: dict[str, tuple[Path, Member]] = {}
    for path, members in zip(paths, lists, strict=True):
        for member in members:
            known, other = found.setdefault(member.label, (path, member))
            if _decides(other) != _decides(member):
                raise StudyError(
                    f"{path}: {kind} {member.label!r} is not the one that {known} has under this "
                    f"label: {_difference(_decides(other), _decides(member))}."
                )
    return tuple(member for _, member in found.values())


def _decides(member: StudyMission | StudyAlgorithm) -> dict[str, Any]:
    """Say what results depend on of a mission or an algorithm."""
    if isinstance(member, StudyMission):
        plain = member.mission
        told = (
            f"{len(plain.nodes)} nodes, {len(plain.arrays.tail)} arcs, team of {plain.robots}, "
            f"total reward {plain.total_reward:g}, digest {member.digest}"
        )
        return {**member.decides(), "mission": told}
    return member.decides(Budget(seconds=1))  # so that nothing is left out


def _difference(here: dict[str, Any], there: dict[str, Any]) -> str:
    """Say in which keys two things differ."""
    return "; ".join(
        f"{key} is {_shown(there[key])} instead of {_shown(here[key])}"
        for key in here
        if here[key] != there[key]
    )


def _entries(
    files: Sequence[Mapping[str, Entry]],
    members: Sequence[Member],
    entry_of: Callable[[Member], Entry],
) -> dict[str, Entry]:
    """Give what a study file says of members: their entry, or each its own where entries differ.

    A grid whose values were shared out among machines cannot be written as one: its whole might
    have combinations that nobody wants.
    """
    stated: dict[str, list[Entry]] = {}
    for file in files:
        for label, entry in file.items():
            stated.setdefault(label, []).append(entry)
    same = {
        label
        for label, found in stated.items()
        if all(e == found[0] for e in found) and not _is_of_file(found[0])
    }
    entries: dict[str, Entry] = {}
    for member in members:
        if member.family in same:
            entries[member.family] = stated[member.family][0]
        else:
            entries[member.label] = entry_of(member)
    return entries


def _is_of_file(entry: MissionEntry | AlgorithmEntry) -> bool:
    """Tell whether a mission is read from a file, which stays on the machine that has it."""
    return isinstance(entry, MissionEntry) and Path(entry.mission).suffix.lower() in SUFFIXES


def _mission_entries(
    files: Sequence[Mapping[str, MissionEntry]], missions: Sequence[StudyMission]
) -> dict[str, MissionEntry]:
    """Give what a study file says of missions, with budgets, and files that are in the folder."""
    members = {mission.family: mission for mission in missions}
    members |= {mission.label: mission for mission in missions}
    return {
        label: entry.model_copy(update={"budget": members[label].budget})
        for label, entry in _entries(files, missions, _mission_entry).items()
    }


def _mission_entry(mission: StudyMission) -> MissionEntry:
    source = dict(mission.source)
    if Path(source["name_or_path"]).suffix.lower() in SUFFIXES:  # with its robots and parameters
        source = {"name_or_path": f"missions/{mission.digest}.json"}
    return MissionEntry(
        mission=source.pop("name_or_path"),
        robots=source.pop("robots", None),
        parameters=source,
        min_survival=mission.min_survival,
    )


def _algorithm_entry(algorithm: StudyAlgorithm) -> AlgorithmEntry:
    return AlgorithmEntry(algorithm=algorithm.algorithm, parameters=dict(algorithm.parameters))


def _whole_run(run: Run, sources: Sequence[Store]) -> Store | None:
    """Check a run in every folder that has it; give the first of these folders."""
    found: tuple[Store, Outcome] | None = None
    for store in sources:
        if not store.finished(run.digest):
            continue
        try:
            outcome = store.load(run)
        except DamagedError as error:
            raise StudyError(
                f"{error}; run the study there again, or remove the file, and merge again."
            ) from error
        try:
            _verify_outcome(run, outcome)
        except ValueError as error:
            raise StudyError(f"{store.folder}: run {_named(run)}: {error}.") from error
        if found is None:
            found = store, outcome
        elif run.mission.budget.seconds is None and not _agree(found[1], outcome):
            raise StudyError(
                f"{store.folder}: run {_named(run)} has another result than in "
                f"{found[0].folder}; the same run gives the same on every machine."
            )
    return found[0] if found else None


def _verify_outcome(run: Run, outcome: Outcome) -> None:
    """Check what can be checked without performing a run again; raises ValueError."""
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
    """Tell whether two outcomes are one result, whatever time it took."""
    return (
        (one.status, one.evaluations) == (other.status, other.evaluations)
        and len(one.records) == len(other.records)
        and all(
            mine.evaluations == theirs.evaluations
            and np.array_equal(mine.objectives, theirs.objectives)
            for mine, theirs in zip(one.records, other.records, strict=True)
        )
    )


def _kept(run: Run, source: Store, store: Store) -> FileEntry:
    """Bring a run to a folder; say what is known of its file."""
    entry = store.entry(run) if source.folder == store.folder.resolve() else None
    entry = entry or store.save(run, source.load(run))
    if entry is None:
        raise StudyError(f"{source.folder}: run {_named(run)} has changed meanwhile; merge again.")
    return entry


def _keep_failure(run: Run, sources: Sequence[Store], store: Store) -> None:
    failures = (source.failure(run.digest) for source in sources)
    if outcome := next((outcome for outcome in failures if outcome is not None), None):
        store.save(run, outcome)


def _named(run: Run) -> str:
    return f"{run.digest} ({run.algorithm.label} on {run.mission.label}, seed {run.seed})"


def _shown(value: Any) -> str:
    """Write what differs, in a line that is not too long."""
    if isinstance(value, BaseModel):
        value = value.model_dump(exclude_none=True)
    return quoted(value)
