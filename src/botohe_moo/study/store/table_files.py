"""The files of a study's tables: new ones replace the old all at once, or not at all.

New files are written to a folder of their own. The manifest, which is replaced in one step, holds
the digests of the tables that count; after it is replaced, the new files move to where the old ones
were. A reader looks in both places, so the tables that the manifest names are there at every
moment, even after a kill.
"""

import contextlib
import hashlib
import json
import shutil
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import filelock

from botohe_moo._base.files import read_bytes, replace_file
from botohe_moo.study.file.model import StudyError
from botohe_moo.study.store.manifest import read_manifest, tabled_manifest, write_manifest

AGAIN = "run the study again to make it"

_NEW = ".tables-"
_LONGEST_WAIT = 600.0
_HEAVY = ("kept", "previous")  # keys that are not needed to read tables
_OF_TABLES = ("tables", "made_from", "previous")  # keys that speak of tables, not of the study


@contextlib.contextmanager
def tables_locked(folder: Path) -> Iterator[None]:
    """Keep other processes from making the tables, and finish a replacement that was killed."""
    lock = filelock.FileLock(folder / ".tables.lock")
    try:
        lock.acquire(timeout=_LONGEST_WAIT)
    except filelock.Timeout:
        raise StudyError(
            f"{folder}: another process is making its tables and does not end."
        ) from None
    except OSError as error:
        raise StudyError(f"{folder}: cannot be written to ({error.strerror}).") from None
    try:
        _finish_replacement(folder)
        yield
    finally:
        lock.release()


def put_study(folder: Path, manifest: Mapping[str, Any]) -> None:
    """Write the manifest of a study; tables that were made for an earlier one stay readable."""
    new: dict[str, Any] = json.loads(json.dumps(manifest))
    with contextlib.suppress(StudyError):  # there is none, or it is damaged
        there = read_manifest(folder)
        if _study_of(there) == _study_of(new):
            if there.get("kept") != new.get("kept"):  # such as another comment in its file
                write_manifest(folder, {**there, "kept": new["kept"]})
            return
        if previous := tabled_manifest(there):
            new["previous"] = {key: previous[key] for key in previous if key not in _HEAVY}
    write_manifest(folder, new)


def _study_of(manifest: Mapping[str, Any]) -> dict[str, Any]:
    """Give the part of a manifest that tables depend on, without the text of the study file."""
    found = {key: value for key, value in manifest.items() if key not in _OF_TABLES}
    kept = found.get("kept", {})
    return {**found, "kept": {key: kept[key] for key in kept if key != "text"}}


def put_tables(folder: Path, files: Mapping[str, bytes], manifest: Mapping[str, Any]) -> None:
    """Replace the tables by new files in one step; the manifest gets their digests."""
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
        _finish_replacement(folder)


def note_inputs(folder: Path, digest: str) -> None:
    """Note the digest of all that the tables were made from; they are made again if it changes."""
    write_manifest(folder, {**read_manifest(folder), "made_from": digest})


def read_file(folder: Path, name: str, digests: Mapping[str, str]) -> bytes:
    """Read the file of a table, whose digest the manifest has."""
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
    """Give the folder that holds new tables until the manifest names them."""
    named = hashlib.sha256(json.dumps(sorted(digests.items())).encode()).hexdigest()[:16]
    return folder / f"{_NEW}{named}"


def _finish_replacement(folder: Path) -> None:
    """Move new tables to their place if the manifest names them; remove them otherwise."""
    tabled = None
    with contextlib.suppress(StudyError):
        tabled = tabled_manifest(read_manifest(folder))
    for new in folder.glob(f"{_NEW}*"):
        if tabled is not None and new == _new_folder(folder, tabled["tables"]):
            for path in new.iterdir():
                path.replace(folder / path.name)
        shutil.rmtree(new, ignore_errors=True)
