"""The folder of a study's report: LaTeX tables, figures, and one page with all of it."""

from pathlib import Path

from botohe_moo._base.files import replace_file
from botohe_moo.study.report.latex import (
    comparisons_latex,
    outcome_latex,
    ranks_latex,
    summary_latex,
)
from botohe_moo.study.report.page import render_page
from botohe_moo.study.report.pictures import draw_figures
from botohe_moo.study.store.tables import StudyTables


def write_report(tables: StudyTables) -> list[Path]:
    """Write the report of a study into the folder ``report`` in the study's own; return its files.

    They are ``report.html``, ``outcome.tex``, ``summary.tex``, ``comparisons.tex``, ``ranks.tex``,
    and in the folder ``figures`` the figures. Files of other names stay.
    """
    folder = tables.folder / "report"
    drawings = folder / "figures"
    drawings.mkdir(parents=True, exist_ok=True)
    figures = draw_figures(tables, drawings)
    texts = {
        "report.html": render_page(tables, figures),
        "outcome.tex": outcome_latex(tables),
        "summary.tex": summary_latex(tables),
        "comparisons.tex": comparisons_latex(tables),
        "ranks.tex": ranks_latex(tables),
    }
    for name, text in texts.items():
        replace_file(folder / name, text.encode())
    drawn = [path for shown in figures.values() for figure in shown for path in figure.paths]
    return [*(folder / name for name in texts), *drawn]
