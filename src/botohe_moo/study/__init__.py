"""Comparative studies: from one YAML file to tables, statistics and figures.

Names are imported when they are first used: the processes in which runs are performed need no
tables.
"""

from typing import TYPE_CHECKING

from botohe_moo.base.runtime import lazy_names

if TYPE_CHECKING:
    from botohe_moo.study.file.loading import load_study as load_study
    from botohe_moo.study.file.model import Study as Study
    from botohe_moo.study.file.model import StudyError as StudyError
    from botohe_moo.study.merge import merge_studies as merge_studies
    from botohe_moo.study.runner import StudyInterrupted as StudyInterrupted
    from botohe_moo.study.runner import make_tables as make_tables
    from botohe_moo.study.runner import run_study as run_study
    from botohe_moo.study.store.schemas import SCHEMAS as SCHEMAS
    from botohe_moo.study.store.tables import StudyTables as StudyTables
    from botohe_moo.study.store.tables import read_study as read_study

__getattr__, __dir__, __all__ = lazy_names(__name__)
