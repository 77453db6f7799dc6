"""Making a study's tables again where their inputs have changed."""

import contextlib
import functools
import hashlib
from collections.abc import Mapping
from pathlib import Path

from botohe_moo.study.file.digest import canonical
from botohe_moo.study.file.model import Study, StudyError
from botohe_moo.study.store.folder import StudyFolder, writing
from botohe_moo.study.store.manifest import read_manifest
from botohe_moo.study.store.run_files import IndexedFile, write_index
from botohe_moo.study.store.table_files import note_inputs
from botohe_moo.study.store.tables import SMALL, StudyTables, read_study


def refresh_tables(
    study: Study, folder: StudyFolder, finished: Mapping[str, IndexedFile], *, anew: bool = False
) -> StudyTables:
    """Make the tables, unless those in the folder were made from the same inputs.

    Nobody else may make tables there meanwhile. ``finished`` holds the files of finished runs by
    digest of the run; with ``anew`` the tables are made in any case.
    """
    path, inputs = folder.path, _inputs_digest(study, folder, finished)
    with writing(path):
        write_index(path, finished)
    if not anew:
        with contextlib.suppress(StudyError):  # damaged, or not there: they are made again
            if read_manifest(path).get("made_from") == inputs and _csv_are_there(path):
                return read_study(path)
    # Imported late: scipy.stats takes half a second, which a study without new runs can save.
    from botohe_moo.study.judge.collect import collect_tables

    collect_tables(study, folder)
    with writing(path):
        note_inputs(path, inputs)
    return read_study(path)


def _csv_are_there(path: Path) -> bool:
    return all((path / f"{name}.csv").exists() for name in SMALL)


def _inputs_digest(study: Study, folder: StudyFolder, finished: Mapping[str, IndexedFile]) -> str:
    """Give the digest of all that tables depend on: the study, its runs' files, and the code."""
    missing = {run.digest for run in study.runs()} - finished.keys()
    failures = {
        digest: hashlib.sha256(data).hexdigest()
        for digest, data in folder.failures().items()
        if digest in missing
    }
    contents = {digest: file.content for digest, file in finished.items()}
    parts = [study.manifest(), contents, failures, _code_digest()]
    return hashlib.sha256(canonical(parts).encode()).hexdigest()


@functools.cache
def _code_digest() -> str:
    """Give the digest of this package's study code, which may change within a version."""
    hashed = hashlib.sha256()
    for path in sorted(Path(__file__).parent.rglob("*.py")):
        hashed.update(path.read_bytes())
    return hashed.hexdigest()
