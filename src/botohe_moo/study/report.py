"""The report of a study: LaTeX tables, figures, and one page with all of it."""

from __future__ import annotations

import hashlib
import re
from typing import TYPE_CHECKING

from botohe_moo._files import replace_file
from botohe_moo.study.report_figures import FORMATS, KINDS, draw_figures
from botohe_moo.study.report_latex import comparisons_latex, ranks_latex, summary_latex
from botohe_moo.study.report_page import render_page

if TYPE_CHECKING:
    from pathlib import Path

    from botohe_moo.study.tables import StudyTables

__all__ = ["slug", "write_report"]

_LONGEST_SLUG = 60
_FORMER = "summary.csv"  # of earlier versions: the table in the folder above, rounded
_OURS = re.compile(rf"({'|'.join(KINDS)})-[a-z0-9][a-z0-9._-]*\.({'|'.join(FORMATS)})")


def write_report(tables: StudyTables) -> list[Path]:
    """Write the report of a study into the folder ``report`` in the study's own.

    The same tables give the same bytes. Figures of missions that are no longer in the study are
    removed; other files in the folder stay.

    Parameters
    ----------
    tables
        The study, as ``read_study`` gives it.

    Returns
    -------
    list of pathlib.Path
        The files written: ``report.html``, ``summary.tex``, ``comparisons.tex``, ``ranks.tex`` and
        the figures.

    Raises
    ------
    OSError
        If the folder cannot be written to.
    """
    folder = tables.folder / "report"
    folder.mkdir(exist_ok=True)
    slugs = {label: slug(label) for label in tables.mission_labels}
    figures = draw_figures(tables, folder, slugs)
    drawn = [path for shown in figures.values() for figure in shown for path in figure.paths]
    names = {path.name for path in drawn}
    for path in folder.iterdir():
        if (_OURS.fullmatch(path.name) and path.name not in names) or path.name == _FORMER:
            path.unlink()
    texts = {
        "report.html": render_page(tables, slugs, figures),
        "summary.tex": summary_latex(tables),
        "comparisons.tex": comparisons_latex(tables),
        "ranks.tex": ranks_latex(tables),
    }
    for name, text in texts.items():
        replace_file(folder / name, text.encode())
    return [*(folder / name for name in texts), *drawn]


def slug(label: str) -> str:
    """Give the part of a file's name that stands for a mission, another for every label."""
    plain = re.sub(r"[^a-z0-9._-]+", "-", label.lower()).strip(".-_")[:_LONGEST_SLUG]
    if plain == label:
        return plain
    # What was left out may be all that tells two labels apart.
    digest = hashlib.sha256(label.encode()).hexdigest()[:8]
    return f"{plain}-{digest}" if plain else digest
