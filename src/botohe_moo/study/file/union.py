"""One study made of several that share its settings: their missions, algorithms and seeds."""

import json
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any, TypeVar

from pydantic import BaseModel

from botohe_moo._base.checks import quoted
from botohe_moo.mission.formats.files import SUFFIXES
from botohe_moo.study.file.checking import MAX_RUNS
from botohe_moo.study.file.config import AlgorithmEntry, Budget, MissionEntry, Seeds, StudyFile
from botohe_moo.study.file.document import Document
from botohe_moo.study.file.model import Study, StudyAlgorithm, StudyError, StudyMission

Member = TypeVar("Member", StudyMission, StudyAlgorithm)
Entry = TypeVar("Entry", MissionEntry, AlgorithmEntry)

# Must be the same in all studies.
_COMMON = ("name", "problem", "recording", "indicators", "comparison")


def unite_studies(paths: Sequence[Path], studies: Sequence[Study]) -> Study:
    """Give the study that has the missions, algorithms and seeds of all, and the longest bounds."""
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
    asked = [study.file.bounds for study in studies if study.file.bounds]
    file = first.file.model_copy(
        update={
            "missions": _mission_entries([study.file.missions for study in studies], missions),
            "algorithms": _entries(
                [study.file.algorithms for study in studies],
                algorithms,
                lambda a: AlgorithmEntry(algorithm=a.algorithm, parameters=dict(a.parameters)),
            ),
            "seeds": Seeds.model_construct(values=list(seeds)),
            "budget": None,  # each mission has its own
            "bounds": max(asked, key=lambda bounds: bounds.seconds, default=None),
        }
    )
    # JSON is YAML, too, and leaves no doubt what is a text.
    content = file.model_dump(mode="json", exclude_defaults=True)
    text = json.dumps(content, indent=1, ensure_ascii=False) + "\n"
    _check_size(text, len(missions) * len(algorithms) * len(seeds))
    return Study(file, text, missions, algorithms, seeds, first.versions)


def _check_size(text: str, n_runs: int) -> None:
    """Refuse a study that is too large for a study file: it could not be read again."""
    try:
        StudyFile.model_validate(Document(text).content)
    except ValueError as error:
        raise StudyError(f"The studies together are too large for one: {error}") from error
    if n_runs > MAX_RUNS:
        said = f"expected at most {MAX_RUNS:,} runs, found {n_runs:,}."
        raise StudyError(f"The studies together are too large for one: {said}")


def _members(
    kind: str, paths: Sequence[Path], lists: Sequence[Sequence[Member]]
) -> tuple[Member, ...]:
    """Give the missions, or the algorithms, of all studies; a label must stand for one thing."""
    found: dict[str, tuple[Path, Member]] = {}
    for path, members in zip(paths, lists, strict=True):
        for member in members:
            known, other = found.setdefault(member.label, (path, member))
            if _description(other) != _description(member):
                raise StudyError(
                    f"{path}: {kind} {member.label!r} is not the one that {known} has under this "
                    f"label: {_difference(_description(other), _description(member))}."
                )
    return tuple(member for _, member in found.values())


def _description(member: StudyMission | StudyAlgorithm) -> dict[str, Any]:
    """Describe everything about a mission or an algorithm that results depend on."""
    if isinstance(member, StudyMission):
        plain = member.mission
        graph = (
            f"{len(plain.nodes)} nodes, {len(plain.arrays.tail)} arcs, team of {plain.robots}, "
            f"total reward {plain.total_reward:g}, digest {member.digest}"
        )
        return {**member.decides(), "mission": graph}
    return member.decides(Budget(seconds=1))  # with which all parameters count


def _difference(here: dict[str, Any], there: dict[str, Any]) -> str:
    """Say in which keys two things differ."""
    return "; ".join(
        f"{key} is {_shown(there.get(key))} instead of {_shown(here.get(key))}"
        for key in {**here, **there}
        if here.get(key) != there.get(key)
    )


def _entries(
    files: Sequence[Mapping[str, Entry]],
    members: Sequence[Member],
    entry_of: Callable[[Member], Entry],
) -> dict[str, Entry]:
    """Give the entries of a study file for missions or algorithms.

    Where all files have the same entry, it stays; otherwise every member gets an entry of its own.
    Grids whose values differ cannot be written as one grid: it could have further combinations.
    """
    stated: dict[str, list[Entry]] = {}
    for file in files:
        for label, entry in file.items():
            stated.setdefault(label, []).append(entry)
    entries: dict[str, Entry] = {}
    for member in members:
        found = stated.get(member.family, [])
        if not found or _is_of_file(found[0]) or any(entry != found[0] for entry in found):
            entries[member.label] = entry_of(member)
        else:
            entries[member.family] = found[0]
    return entries


def _is_of_file(entry: MissionEntry | AlgorithmEntry) -> bool:
    """Tell whether an entry is a mission read from a file, which other machines may not have."""
    return isinstance(entry, MissionEntry) and Path(entry.mission).suffix.lower() in SUFFIXES


def _mission_entries(
    files: Sequence[Mapping[str, MissionEntry]], missions: Sequence[StudyMission]
) -> dict[str, MissionEntry]:
    """Give the entries of missions, each with its budget, and with files that are in the folder."""
    members = {mission.family: mission for mission in missions}
    members |= {mission.label: mission for mission in missions}
    return {
        label: entry.model_copy(update={"budget": members[label].budget})
        for label, entry in _entries(files, missions, _mission_entry).items()
    }


def _mission_entry(mission: StudyMission) -> MissionEntry:
    source = dict(mission.source)
    limit: Any = "unlimited" if mission.max_length is None else mission.max_length
    if Path(source["name_or_path"]).suffix.lower() in SUFFIXES:  # with its robots and parameters
        source = {"name_or_path": f"missions/{mission.digest}.json"}
    return MissionEntry(
        mission=source.pop("name_or_path"),
        robots=source.pop("robots", None),
        lengths_from_pos=source.pop("lengths_from_pos", False),
        parameters=source,
        min_survival=mission.min_survival,
        max_length=None if mission.max_length == mission.mission.max_length else limit,
    )


def _shown(value: Any) -> str:
    """Write what differs, in a line that is not too long."""
    if isinstance(value, BaseModel):
        value = value.model_dump(exclude_none=True)
    return quoted(value)
