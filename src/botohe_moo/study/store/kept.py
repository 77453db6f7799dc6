"""A study as its folder keeps it: read again without its file, and without anybody's code."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from pydantic import BaseModel, TypeAdapter

from botohe_moo.study.file.config import StudyFile
from botohe_moo.study.file.document import Document
from botohe_moo.study.file.grid import Study, StudyAlgorithm, StudyMission
from botohe_moo.study.store.manifest import MANIFEST, StudyError, read_manifest, reason
from botohe_moo.study.store.tables import saved_mission

if TYPE_CHECKING:
    from pathlib import Path

__all__ = ["keep_study", "kept_study"]

_ALGORITHM = TypeAdapter(StudyAlgorithm)
_MISSION = TypeAdapter(StudyMission)


class _Kept(BaseModel):
    text: str
    seeds: tuple[int, ...]
    versions: dict[str, str]
    missions: list[dict[str, Any]]
    algorithms: list[dict[str, Any]]


def keep_study(study: Study) -> dict[str, Any]:
    """Give all that a study is but its missions' graphs, as what JSON can hold.

    Parameters
    ----------
    study
        The study.
    """
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


def kept_study(folder: Path) -> Study:
    """Read the study that a folder holds, as it was checked when its runs were planned.

    Nothing is made or called: missions are those that are kept beside the runs, and packages that
    algorithms are from need not be installed.

    Parameters
    ----------
    folder
        The study's folder.

    Raises
    ------
    StudyError
        If it holds no study, or what it holds is damaged; names the file.
    """
    manifest = read_manifest(folder)
    path = folder / MANIFEST
    if "kept" not in manifest:
        raise StudyError(
            f"{path}: written by an earlier version of this package, which did not keep all that "
            "its tables depend on; run the study again."
        )
    try:
        kept = _Kept.model_validate(manifest["kept"])
        missions = tuple(_mission(folder, entry) for entry in kept.missions)
        algorithms = tuple(_ALGORITHM.validate_python(entry) for entry in kept.algorithms)
        file = StudyFile.model_validate(Document.parse(kept.text).content)
    except StudyError:
        raise
    except (ValueError, TypeError, KeyError, RecursionError) as error:
        said = f"{path}: cannot be read ({reason(error)}); run the study again."
        raise StudyError(said) from error
    return Study(file, kept.text, missions, algorithms, kept.seeds, kept.versions)


def _mission(folder: Path, kept: dict[str, Any]) -> StudyMission:
    mission = saved_mission(folder / "missions" / f"{kept['digest']}.json", kept["digest"])
    return _MISSION.validate_python({**kept, "mission": mission})
