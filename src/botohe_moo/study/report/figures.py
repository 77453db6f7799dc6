"""The figures of a report, with their captions."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path

from matplotlib.axes import Axes

from botohe_moo.plots.draw.algorithms import AlgorithmStyle, algorithm_styles
from botohe_moo.plots.draw.style import save_plot
from botohe_moo.plots.study.ranks import overruled, plot_ranks
from botohe_moo.study.report.pictures import MissionPictures
from botohe_moo.study.report.words import INDICATORS, main_indicator
from botohe_moo.study.store.tables import StudyTables

FORMATS = ("png", "pdf", "svg")
_RANKS = "critical-difference"


@dataclass(frozen=True)
class ReportFigure:
    """A figure of a report."""

    path: Path  # the PNG file
    paths: tuple[Path, ...]  # the same as PNG, PDF and SVG
    caption: str  # what it shows, what its lines and bands mean, and what is not in it
    alternative: str  # text for readers who cannot see it


def draw_figures(
    tables: StudyTables, folder: Path, slugs: Mapping[str, str]
) -> dict[str, list[ReportFigure]]:
    """Draw and save all figures of a study; give them by mission.

    Under ``""`` are those of the study as a whole; a mission without runs has none. ``slugs`` stand
    for missions in the names of files.
    """
    styles = algorithm_styles(tables.algorithm_labels)
    figures: dict[str, list[ReportFigure]] = {
        "": [
            _saved(folder, f"{_RANKS}-{indicator}", ax, caption, alternative)
            for indicator, ax, caption, alternative in _ranks(tables, styles)
        ]
    }
    for label in tables.mission_labels:
        figures[label] = [
            _saved(folder, f"{kind}-{slugs[label]}", ax, caption, f"{alternative} on {label}.")
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
    named = INDICATORS.get(main, main)
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
