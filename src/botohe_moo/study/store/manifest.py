"""What a study's folder says that it holds: ``study.json``."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING, Any

from pydantic import BaseModel, ValidationError

from botohe_moo._base.checks import nearest_first
from botohe_moo._base.files import read_bytes, replace_file

if TYPE_CHECKING:
    from collections.abc import Mapping
    from pathlib import Path

__all__ = ["MANIFEST", "StudyError", "read_manifest", "reason", "tabled_manifest", "write_manifest"]

MANIFEST = "study.json"


class StudyError(ValueError):
    """What is wrong with a study or its folder, and where; one line for each fault."""


def write_manifest(folder: Path, manifest: Mapping[str, Any]) -> None:
    """Write what a study is.

    Parameters
    ----------
    folder
        The study's folder.
    manifest
        What :func:`read_manifest` will give.

    Raises
    ------
    OSError
        If the folder cannot be written to.
    """
    replace_file(folder / MANIFEST, (json.dumps(manifest, indent=1) + "\n").encode())


def tabled_manifest(manifest: Mapping[str, Any]) -> dict[str, Any] | None:
    """Give what the study was when its tables were made; None if they never were.

    Parameters
    ----------
    manifest
        As :func:`read_manifest` gives it.
    """
    return dict(manifest) if manifest["tables"] is not None else manifest.get("previous")


def read_manifest(folder: Path) -> dict[str, Any]:
    """Read what a folder's study is.

    Raises
    ------
    StudyError
        If the folder holds no study, or the file is damaged.
    """
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
        said = f"{path}: cannot be read ({reason(error)}); run the study again."
        raise StudyError(said) from error
    return content


def reason(error: Exception) -> str:
    """Say in a line why a file cannot be read.

    Parameters
    ----------
    error
        What reading it has raised.
    """
    if isinstance(error, ValidationError):
        first = error.errors(include_url=False)[0]
        return f"{'.'.join(map(str, first['loc'])) or 'its content'}: {first['msg']}"
    return " ".join((getattr(error, "strerror", None) or str(error)).split()[:20])


class _MissionEntry(BaseModel):
    file: str
    digest: str
    source: dict[str, Any]
    package: str | None
    version: str | None
    min_survival: float
    budget: dict[str, float | None]


class _AlgorithmEntry(BaseModel):
    algorithm: str
    parameters: dict[str, Any]
    package: str | None
    version: str | None


class _ComparisonEntry(BaseModel):
    control: str | None
    significance: float


class _Manifest(BaseModel):
    """What readers of a manifest rely on."""

    name: str
    title: str | None
    description: str | None
    version: str
    missions: dict[str, _MissionEntry]
    algorithms: dict[str, _AlgorithmEntry]
    seeds: list[int]
    indicators: list[str]
    comparison: _ComparisonEntry
    tables: dict[str, str] | None
    previous: _Manifest | None = None  # what its tables are of, where they are of another study
