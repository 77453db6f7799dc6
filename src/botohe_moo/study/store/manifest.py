"""What a study's folder says about the study: ``study.json`` and the missions beside it."""

import json
import re
from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Any

from pydantic import AfterValidator, BaseModel, StrictFloat, TypeAdapter, ValidationError

from botohe_moo._base.checks import nearest_first, quoted
from botohe_moo._base.files import read_bytes, replace_file
from botohe_moo._base.words import counted
from botohe_moo.mission.digest import mission_digest
from botohe_moo.mission.formats.files import read_mission
from botohe_moo.mission.model import Mission
from botohe_moo.mission.validation import MissionError
from botohe_moo.study.file.config import IndicatorName, StudyFile
from botohe_moo.study.file.digest import installed_versions
from botohe_moo.study.file.document import Document
from botohe_moo.study.file.model import (
    MANIFEST,
    ObjectiveBounds,
    Study,
    StudyAlgorithm,
    StudyError,
    StudyMission,
)

_ALGORITHM = TypeAdapter(StudyAlgorithm)
_MISSION = TypeAdapter(StudyMission)


def write_manifest(folder: Path, manifest: Mapping[str, Any]) -> None:
    """Write the manifest, whole or not at all; an OSError says why it cannot be written."""
    replace_file(folder / MANIFEST, (json.dumps(manifest, indent=1) + "\n").encode())


def read_manifest(folder: Path) -> dict[str, Any]:
    """Read the manifest of the study in a folder."""
    path = folder / MANIFEST
    try:
        content: dict[str, Any] = json.loads(read_bytes(path))
        _Manifest.model_validate(content)
    except FileNotFoundError:
        among = sorted(p.parent.name for p in folder.parent.glob(f"*/{MANIFEST}"))
        near = nearest_first(folder.name, among)
        known = f"; studies beside it are {', '.join(near)}" if near else ""
        raise StudyError(f"{folder}: there is no study in this folder{known}.") from None
    except (OSError, ValueError, RecursionError) as error:
        said = f"{path}: cannot be read ({_reason(error)}); run the study again."
        raise StudyError(said) from error
    return content


def tabled_manifest(manifest: Mapping[str, Any]) -> dict[str, Any] | None:
    """Give the manifest of the tables that are there, which may be an earlier one."""
    return dict(manifest) if manifest["tables"] is not None else manifest.get("previous")


def dump_study(study: Study) -> dict[str, Any]:
    """Give a study as JSON values, without the graphs of its missions."""
    return {
        "text": study.text,
        "seeds": list(study.seeds),
        "versions": dict(study.versions),
        "missions": [
            _MISSION.dump_python(mission, mode="json", exclude={"mission"})
            for mission in study.missions
        ],
        "algorithms": [
            _ALGORITHM.dump_python(algorithm, mode="json") for algorithm in study.algorithms
        ],
    }


def restore_study(folder: Path) -> Study:
    """Read the study that a folder holds, as it was checked when its runs were planned.

    No code is called: missions are read from the folder, and the packages that algorithms come
    from need not be installed.
    """
    manifest = read_manifest(folder)
    path = folder / MANIFEST
    if "kept" not in manifest:
        raise StudyError(
            f"{path}: written by an earlier version of this package, which did not keep all that "
            "its tables depend on; run the study again."
        )
    try:
        dump = _Dump.model_validate(manifest["kept"])
        missions = []
        for entry in dump.missions:
            digest = entry["digest"]
            if not re.fullmatch("[0-9a-f]+", digest):
                raise ValueError(f"kept.missions: expected a digest, got {quoted(digest)}")
            mission = saved_mission(folder / "missions" / f"{digest}.json", digest)
            missions.append(_MISSION.validate_python({**entry, "mission": mission}))
        file = StudyFile.model_validate(Document(dump.text).content)
    except StudyError:
        raise
    except (ValueError, TypeError, KeyError, RecursionError) as error:
        said = f"{path}: cannot be read ({_reason(error)}); run the study again."
        raise StudyError(said) from error
    return Study(file, dump.text, tuple(missions), dump.algorithms, dump.seeds, dump.versions)


def saved_mission(path: Path, digest: str) -> Mission:
    """Read a mission file of a study's folder; a StudyError if it is not the mission expected."""
    try:
        mission = read_mission(path)
    except MissionError as error:
        others = len(error.faults) - 1
        more = f", and {counted(others, 'more fault')}" if others else ""
        raise StudyError(f"{path}: {error.faults[0]}{more}; run the study again.") from error
    if mission_digest(mission) != digest:
        raise StudyError(
            f"{path}: not the mission that was planned for any more; run the study again."
        )
    return mission


def _reason(error: Exception) -> str:
    """Say in a line why a file cannot be read."""
    if isinstance(error, ValidationError):
        first = error.errors(include_url=False)[0]
        return f"{'.'.join(map(str, first['loc'])) or 'its content'}: {first['msg']}"
    return " ".join((getattr(error, "strerror", None) or str(error)).split()[:20])


def _of_each_package(versions: dict[str, str]) -> dict[str, str]:
    if versions.keys() != installed_versions().keys():
        raise ValueError(f"expected versions of {', '.join(installed_versions())}")
    return versions


class _Dump(BaseModel):
    text: str
    seeds: tuple[int, ...]
    versions: Annotated[dict[str, str], AfterValidator(_of_each_package)]
    missions: list[dict[str, Any]]
    algorithms: tuple[StudyAlgorithm, ...]


class _ManifestMission(BaseModel):
    file: str
    digest: str
    source: dict[str, Any]
    package: str | None
    version: str | None
    min_survival: float
    max_length: float | None = None  # not in earlier versions' files
    budget: dict[str, float | None]
    objective_bounds: ObjectiveBounds | None = None  # of a problem of one's own


class _ManifestAlgorithm(BaseModel):
    algorithm: str
    parameters: dict[str, Any]
    package: str | None
    version: str | None


class _ManifestProblem(BaseModel):
    problem: str
    package: str | None
    version: str | None


class _ManifestComparison(BaseModel):
    control: str | None
    significance: StrictFloat


class _ManifestBounds(BaseModel):
    seconds: StrictFloat


class _Manifest(BaseModel):
    """The part of a manifest that readers rely on."""

    name: str
    title: str | None
    description: str | None
    version: str
    missions: dict[str, _ManifestMission]
    algorithms: dict[str, _ManifestAlgorithm]
    problem: _ManifestProblem | None = None
    seeds: list[int]
    indicators: list[IndicatorName]
    comparison: _ManifestComparison
    bounds: _ManifestBounds | None = None
    tables: dict[str, str] | None
    previous: "_Manifest | None" = None  # what the tables were made for, if not this study
