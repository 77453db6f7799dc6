"""The folder of a study's report: LaTeX tables, figures, and one page with all of it."""

from collections.abc import Iterator, Mapping
from pathlib import Path

from matplotlib.axes import Axes

from botohe_moo._base.files import replace_file
from botohe_moo.indicators import INDICATORS
from botohe_moo.plots.draw.algorithms import AlgorithmStyle, algorithm_styles
from botohe_moo.plots.draw.style import save_plot
from botohe_moo.plots.study.ranks import overruled, plot_ranks
from botohe_moo.study.report.latex import (
    comparisons_latex,
    outcome_latex,
    ranks_latex,
    summary_latex,
)
from botohe_moo.study.report.page import ReportFigure, render_page
from botohe_moo.study.report.pictures import MissionPictures
from botohe_moo.study.report.words import main_indicator, slug
from botohe_moo.study.store.tables import StudyTables

FORMATS = ("png", "pdf", "svg")


def write_report(tables: StudyTables) -> list[Path]:
    """Write the report of a study into the folder ``report`` in the study's own; return its files.

    They are ``report.html``, ``outcome.tex``, ``summary.tex``, ``comparisons.tex``, ``ranks.tex``,
    and in the folder ``figures`` the figures, which replace all earlier ones.
    """
    folder = tables.folder / "report"
    drawings = folder / "figures"
    drawings.mkdir(parents=True, exist_ok=True)
    for path in drawings.iterdir():
        if path.suffix.removeprefix(".") in FORMATS:
            path.unlink()
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


def draw_figures(tables: StudyTables, folder: Path) -> dict[str, list[ReportFigure]]:
    """Draw and save all figures of a study; give them by mission.

    Under ``""`` are those of the study as a whole; a mission without runs has none.
    """
    styles = algorithm_styles(tables.algorithm_labels)
    figures: dict[str, list[ReportFigure]] = {
        "": [
            _saved(folder, f"critical-difference-{indicator}", ax, caption, alternative)
            for indicator, ax, caption, alternative in _ranks(tables, styles)
        ]
    }
    for label in tables.mission_labels:
        figures[label] = [
            _saved(folder, f"{kind}-{slug(label)}", ax, caption, f"{alternative} on {label}.")
            for kind, ax, caption, alternative in MissionPictures(tables, label, styles)
        ]
    return figures


def _saved(folder: Path, name: str, ax: Axes, caption: str, alternative: str) -> ReportFigure:
    paths = tuple(folder / f"{name}.{end}" for end in FORMATS)
    save_plot(ax, *paths)
    return ReportFigure(paths[0], paths, caption, alternative)


def _ranks(
    tables: StudyTables, styles: Mapping[str, AlgorithmStyle]
) -> Iterator[tuple[str, Axes, str, str]]:
    """Draw the ranks by the main indicator, if their differences were tested."""
    posthoc = tables.posthoc
    if posthoc.empty or tables.ranks.empty:
        return
    main = main_indicator(tables.ranks)
    rows = tables.ranks[tables.ranks["indicator"] == main]
    pairs = posthoc[posthoc["indicator"] == main]
    if pairs.empty or len(rows) < 2:
        return
    named = INDICATORS[main].label
    ax = plot_ranks(rows, pairs, styles=styles, title=f"{tables.title}\nranks by {named}")
    caption = (
        f"Average ranks over missions of the algorithms' medians by {named}; 1, on the left, is "
        "best. Bars join algorithms of which no two differ significantly by the Nemenyi test, "
        "which allows for all pairs"
    )
    if overruled(pairs):
        caption += "; here Friedman's test finds no difference, so no pair counts."
    else:
        caption += ": their ranks lie less than the critical difference apart."
    yield main, ax, caption, f"Average ranks of {', '.join(rows['algorithm'])}."
