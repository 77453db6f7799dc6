"""Making a study's tables where what they are made from has changed."""

from __future__ import annotations

import contextlib
import functools
import hashlib
from pathlib import Path
from typing import TYPE_CHECKING

from botohe_moo.study.file.grid import Study, canonical
from botohe_moo.study.store.index import Entry, write_index
from botohe_moo.study.store.manifest import StudyError, read_manifest
from botohe_moo.study.store.shelf import note_origin
from botohe_moo.study.store.store import Store, writing
from botohe_moo.study.store.tables import SMALL, StudyTables, read_study

if TYPE_CHECKING:
    from collections.abc import Mapping

__all__ = ["refresh_tables"]


def refresh_tables(
    study: Study, store: Store, finished: Mapping[str, Entry], *, anew: bool = False
) -> StudyTables:
    """Make the tables, unless those that are there are made from the same.

    Parameters
    ----------
    study
        The study.
    store
        Its folder; nobody else may make its tables meanwhile.
    finished
        The files of finished runs, by name of the run.
    anew
        Whether they are made in any case.

    Raises
    ------
    StudyError
        If the folder cannot be written to.
    """
    folder = store.folder
    made_from = _made_from(study, store, finished)
    with writing(folder):
        write_index(folder, finished)
    if not anew:
        with contextlib.suppress(StudyError):  # damaged, or not there: they are made again
            if read_manifest(folder).get("made_from") == made_from and _csv_are_there(folder):
                return read_study(folder)
    # scipy.stats takes half a second to import, which every worker's process would wait for.
    from botohe_moo.study.judge.collect import collect_tables

    collect_tables(study, store)
    with writing(folder):
        note_origin(folder, made_from)
    return read_study(folder)


def _csv_are_there(folder: Path) -> bool:
    return all((folder / f"{name}.csv").exists() for name in SMALL)


def _made_from(study: Study, store: Store, finished: Mapping[str, Entry]) -> str:
    """Give the digest of all that tables depend on: the study, its runs' files, and the code."""
    missing = {run.digest for run in study.runs()} - finished.keys()
    failures = {
        digest: hashlib.sha256(data).hexdigest()
        for digest, data in store.failures().items()
        if digest in missing
    }
    contents = {digest: entry.content for digest, entry in finished.items()}
    parts = [study.manifest(), contents, failures, _code()]
    return hashlib.sha256(canonical(parts).encode()).hexdigest()


@functools.cache
def _code() -> str:
    """Give the digest of what makes tables, which may change between two versions, too."""
    hashed = hashlib.sha256()
    for path in sorted(Path(__file__).parent.rglob("*.py")):
        hashed.update(path.read_bytes())
    return hashed.hexdigest()
