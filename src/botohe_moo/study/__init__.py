"""Comparative studies: from one YAML file to tables, statistics and figures.

Names are imported when they are first used: the processes in which runs are performed need no
tables.
"""

from typing import TYPE_CHECKING

from botohe_moo._base.lazy import lazy_names

if TYPE_CHECKING:
    from botohe_moo.study.file.loading import load_study
    from botohe_moo.study.file.model import Study, StudyError
    from botohe_moo.study.merge import merge_studies
    from botohe_moo.study.runner import StudyInterrupted, make_tables, run_study
    from botohe_moo.study.store.schemas import SCHEMAS
    from botohe_moo.study.store.tables import StudyTables, read_study

__all__ = [
    "SCHEMAS",
    "Study",
    "StudyError",
    "StudyInterrupted",
    "StudyTables",
    "load_study",
    "make_tables",
    "merge_studies",
    "read_study",
    "run_study",
]

_HOMES = {
    ".file.model": ("Study", "StudyError"),
    ".file.loading": ("load_study",),
    ".merge": ("merge_studies",),
    ".runner": ("StudyInterrupted", "make_tables", "run_study"),
    ".store.schemas": ("SCHEMAS",),
    ".store.tables": ("StudyTables", "read_study"),
}
__getattr__, __dir__ = lazy_names(__name__, _HOMES)
