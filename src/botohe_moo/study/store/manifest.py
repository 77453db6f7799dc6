"""``study.json``: what study a folder is of, for its readers and to make its tables anew."""

import json
from pathlib import Path
from typing import Any

from pydantic import TypeAdapter, ValidationError

from botohe_moo._base.checks import nearest_first
from botohe_moo._base.files import read_bytes
from botohe_moo.mission.formats.files import read_mission
from botohe_moo.study.file.model import MANIFEST, Study, StudyError

_STUDY = TypeAdapter(Study)
_LONG = 200  # characters of a reason


def pack_study(study: Study) -> bytes:
    """Return the content of ``study.json``: the manifest, and all else that a study consists of.

    Missions are in files of their own.
    """
    kept = _STUDY.dump_python(
        study,
        mode="json",
        exclude={"missions": {"__all__": {"mission"}}},
        exclude_defaults=True,  # a study file need not have them, and some have no value to write
    )
    return (json.dumps({**study.manifest(), "kept": kept}, indent=1) + "\n").encode()


def read_manifest(folder: Path) -> dict[str, Any]:
    """Read what ``study.json`` says; a StudyError if a folder has none."""
    path = folder / MANIFEST
    try:
        content: dict[str, Any] = json.loads(read_bytes(path))
        content["name"]
    except FileNotFoundError:
        among = sorted(p.parent.name for p in folder.parent.glob(f"*/{MANIFEST}"))
        near = nearest_first(folder.name, among)
        known = f"; studies beside it are {', '.join(near)}" if near else ""
        raise StudyError(f"{folder}: there is no study in this folder{known}.") from None
    except (OSError, ValueError, LookupError, TypeError, RecursionError) as error:
        raise _unreadable(path, error) from error
    return content


def restore_study(folder: Path) -> Study:
    """Read the study that a folder holds, as it was checked when its runs were planned.

    No code is called: missions are read from the folder, and the packages that algorithms come
    from need not be installed.
    """
    manifest = read_manifest(folder)
    try:
        kept = manifest["kept"]
        for mission in kept["missions"]:
            mission["mission"] = read_mission(folder / "missions" / f"{mission['digest']}.json")
        return _STUDY.validate_python(kept)
    except ValidationError:
        raise StudyError(
            f"{folder / MANIFEST}: written by another version; `botohe study run` with the study's "
            "file takes its runs over."
        ) from None
    except (OSError, ValueError, LookupError, TypeError) as error:
        raise _unreadable(folder / MANIFEST, error) from error


def _unreadable(path: Path, error: Exception) -> StudyError:
    said = " ".join(f"{error}".split())[:_LONG]
    return StudyError(f"{path}: cannot be read ({said}); remove it, and run the study again.")
