"""Comparative studies: from one YAML file to tables, statistics and figures."""

from botohe_moo.study.grid import Study
from botohe_moo.study.loading import load_study
from botohe_moo.study.merge import merge_studies
from botohe_moo.study.runner import StudyInterrupted, make_tables, run_study
from botohe_moo.study.tables import SCHEMAS, StudyError, StudyTables, read_study

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
