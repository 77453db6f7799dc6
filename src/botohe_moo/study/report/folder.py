"""The folder of a study's report: LaTeX tables, figures, and one page with all of it."""

from pathlib import Path

from botohe_moo._base.files import replace_file
from botohe_moo.study.report.latex import comparisons_latex, ranks_latex, summary_latex
from botohe_moo.study.report.page import render_page
from botohe_moo.study.report.pictures import FORMATS, draw_figures
from botohe_moo.study.store.tables import StudyTables

_FORMER = "summary.csv"  # written by earlier versions
_DRAWN = ".figures"  # names of the figures that are in the folder


def write_report(tables: StudyTables) -> list[Path]:
    """Write the report of a study into the folder ``report`` in the study's own; give its files.

    They are ``report.html``, ``summary.tex``, ``comparisons.tex``, ``ranks.tex`` and the figures.
    The same tables give the same bytes. Figures of an earlier report that are not in this one are
    removed; other files in the folder stay.
    """
    folder = tables.folder / "report"
    folder.mkdir(exist_ok=True)
    figures = draw_figures(tables, folder)
    drawn = [path for shown in figures.values() for figure in shown for path in figure.paths]
    _remove_others(folder, {path.name for path in drawn})
    texts = {
        "report.html": render_page(tables, figures),
        "summary.tex": summary_latex(tables),
        "comparisons.tex": comparisons_latex(tables),
        "ranks.tex": ranks_latex(tables),
    }
    for name, text in texts.items():
        replace_file(folder / name, text.encode())
    return [*(folder / name for name in texts), *drawn]


def _remove_others(folder: Path, names: set[str]) -> None:
    """Remove figures of the earlier report that this one lacks; note the names of its own."""
    try:
        noted = (folder / _DRAWN).read_text("utf-8").splitlines()
    except (OSError, ValueError):
        noted = []
    ends = tuple(f".{end}" for end in FORMATS)
    before = {name for name in noted if name == Path(name).name and name.endswith(ends)}
    # Noted now, too, in case this is stopped in between.
    replace_file(folder / _DRAWN, "\n".join(sorted(before | names)).encode())
    for name in {*before, _FORMER} - names:
        (folder / name).unlink(missing_ok=True)
    replace_file(folder / _DRAWN, "\n".join(sorted(names)).encode())
