"""Where a study's tables are put: new ones replace the old all at once, or not at all.

New files are written to a folder beside the old ones. The manifest, which is replaced in one step,
says which of both count; then the new ones move to where the old ones were. A reader looks in both
places, so that at every moment, also after a kill, the tables that the manifest names are there.
"""

from __future__ import annotations

import contextlib
import hashlib
import json
import shutil
from typing import TYPE_CHECKING, Any

import filelock

from botohe_moo._base.files import read_bytes, replace_file
from botohe_moo.study.store.manifest import (
    StudyError,
    read_manifest,
    tabled_manifest,
    write_manifest,
)

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping
    from pathlib import Path

__all__ = ["AGAIN", "note_origin", "put_study", "put_tables", "read_file", "tables_locked"]

AGAIN = "run the study again to make it"

_NEW = ".tables-"
_LONGEST_WAIT = 600.0
_HEAVY = ("kept", "previous")  # of no use where only tables are read
_OF_TABLES = (
    "tables",
    "made_from",
    "previous",
)  # in a manifest: what the study itself does not say


@contextlib.contextmanager
def tables_locked(folder: Path) -> Iterator[None]:
    """Keep others from making a study's tables meanwhile, and finish what a killed process began.

    Parameters
    ----------
    folder
        The study's folder.

    Raises
    ------
    StudyError
        If somebody else is making them and does not come to an end, or nobody may.
    """
    lock = filelock.FileLock(folder / ".tables.lock")
    try:
        lock.acquire(timeout=_LONGEST_WAIT)
    except filelock.Timeout:
        raise StudyError(
            f"{folder}: somebody else is making its tables and does not end."
        ) from None
    except OSError as error:
        raise StudyError(f"{folder}: cannot be written to ({error.strerror}).") from None
    try:
        _end_moving(folder)
        yield
    finally:
        lock.release()


def put_study(folder: Path, manifest: Mapping[str, Any]) -> None:
    """Say what the study in a folder is; tables of what it was before stay readable.

    Parameters
    ----------
    folder
        Its folder.
    manifest
        What the study is.
    """
    new: dict[str, Any] = json.loads(json.dumps(manifest))
    with contextlib.suppress(StudyError):  # there is none, or it is damaged
        there = read_manifest(folder)
        if _study_of(there) == _study_of(new):
            if there.get("kept") != new.get("kept"):  # another comment in its file, say
                write_manifest(folder, {**there, "kept": new["kept"]})
            return
        if previous := tabled_manifest(there):
            new["previous"] = {key: previous[key] for key in previous if key not in _HEAVY}
    write_manifest(folder, new)


def _study_of(manifest: Mapping[str, Any]) -> dict[str, Any]:
    """Give what tables depend on: all but how the study's file is written, and the tables."""
    found = {key: value for key, value in manifest.items() if key not in _OF_TABLES}
    kept = found.get("kept", {})
    return {**found, "kept": {key: kept[key] for key in kept if key != "text"}}


def put_tables(folder: Path, files: Mapping[str, bytes], manifest: Mapping[str, Any]) -> None:
    """Put tables in the place of those that are there, in one step.

    Parameters
    ----------
    folder
        The study's folder.
    files
        The tables by the names of their files.
    manifest
        What the study is; the digests of the tables are added, so that tables of different
        moments are never taken for one study's.

    Raises
    ------
    OSError
        If the folder cannot be written to: then nothing has changed.
    """
    digests = {
        name.removesuffix(".parquet"): hashlib.sha256(data).hexdigest()
        for name, data in files.items()
        if name.endswith(".parquet")
    }
    kept = {}
    with contextlib.suppress(StudyError):
        kept = {key: value for key, value in read_manifest(folder).items() if key == "kept"}
    new = _new_folder(folder, digests)
    try:
        new.mkdir(exist_ok=True)
        for name, data in files.items():
            replace_file(new / name, data)
        write_manifest(folder, {**manifest, **kept, "tables": digests})
    finally:
        _end_moving(folder)


def note_origin(folder: Path, made_from: str) -> None:
    """Note what the tables in a folder were made from, to make them again only where it changes.

    Parameters
    ----------
    folder
        The study's folder.
    made_from
        Digest of everything they depend on.
    """
    write_manifest(folder, {**read_manifest(folder), "made_from": made_from})


def read_file(folder: Path, name: str, digests: Mapping[str, str]) -> bytes:
    """Read the file of a table.

    Parameters
    ----------
    folder
        The study's folder.
    name
        Its name, which ends in ``.parquet``.
    digests
        Of all tables, as the manifest has them.

    Raises
    ------
    StudyError
        If there is no such file, or it is another one.
    """
    missing = True
    for path in (folder / name, _new_folder(folder, digests) / name):
        try:
            data = read_bytes(path)
        except FileNotFoundError:
            continue
        except OSError as error:
            raise StudyError(f"{path}: cannot be read ({error}); {AGAIN}.") from error
        missing = False
        if hashlib.sha256(data).hexdigest() == digests[name.removesuffix(".parquet")]:
            return data
    if missing:
        raise StudyError(f"{folder / name}: there is no such table; {AGAIN}.")
    raise StudyError(f"{folder / name}: damaged, or of another moment than the others; {AGAIN}.")


def _new_folder(folder: Path, digests: Mapping[str, str]) -> Path:
    """Give the folder in which tables are until the manifest counts them."""
    named = hashlib.sha256(json.dumps(sorted(digests.items())).encode()).hexdigest()[:16]
    return folder / f"{_NEW}{named}"


def _end_moving(folder: Path) -> None:
    """Move new tables to their place if the manifest counts them; remove what it does not."""
    tabled = None
    with contextlib.suppress(StudyError):
        tabled = tabled_manifest(read_manifest(folder))
    for new in folder.glob(f"{_NEW}*"):
        if tabled is not None and new == _new_folder(folder, tabled["tables"]):
            for path in new.iterdir():
                path.replace(folder / path.name)
        shutil.rmtree(new, ignore_errors=True)
