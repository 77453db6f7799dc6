"""The figures of a report, with what stands under them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from botohe_moo.plots.algorithms import algorithm_styles
from botohe_moo.plots.areas import plot_areas
from botohe_moo.plots.attainment import plot_attainment
from botohe_moo.plots.curves import plot_curves
from botohe_moo.plots.difference import plot_attainment_difference
from botohe_moo.plots.fronts import plot_fronts
from botohe_moo.plots.style import save_plot
from botohe_moo.study.report_words import level

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping
    from pathlib import Path

    import pandas as pd
    from matplotlib.axes import Axes

    from botohe_moo.plots.algorithms import AlgorithmStyle
    from botohe_moo.plots.curves import Progress
    from botohe_moo.study.tables import StudyTables

__all__ = ["KINDS", "ReportFigure", "draw_figures", "rivals"]

KINDS = ("curves", "seconds", "areas", "fronts", "attainment", "difference")


@dataclass(frozen=True)
class ReportFigure:
    """A figure of a report.

    Attributes
    ----------
    path
        The PNG file.
    caption
        What it shows, what its lines and bands mean, and what is not in it.
    alternative
        What it shows, for those who do not see it.
    """

    path: Path
    caption: str
    alternative: str


def draw_figures(
    tables: StudyTables, folder: Path, slugs: Mapping[str, str]
) -> dict[str, list[ReportFigure]]:
    """Draw and save all figures of a study.

    Parameters
    ----------
    tables
        The study.
    folder
        Where to put the figures; it exists already.
    slugs
        What stands for each mission in the names of files.

    Returns
    -------
    dict
        The figures of each mission; none for a mission without runs.
    """
    styles = algorithm_styles(tables.algorithm_labels)
    figures: dict[str, list[ReportFigure]] = {}
    for label in tables.mission_labels:
        figures[label] = []
        for kind, ax, caption, alternative in _Pictures(tables, label, styles):
            path = folder / f"{kind}-{slugs[label]}.png"
            save_plot(ax, path)
            figures[label].append(ReportFigure(path, caption, f"{alternative} on {label}."))
    return figures


def rivals(tables: StudyTables, mission: str) -> tuple[str, str] | None:
    """Give the two algorithms whose attainment is compared: the control and the best other one.

    Without a control these are the two with the largest median areas, in the order of the file.
    None where there is only one.
    """
    rows = tables.summary[tables.summary["mission"] == mission]
    order = [label for label in tables.algorithm_labels if label in set(rows["algorithm"])]
    if len(order) < 2:
        return None
    medians = rows.set_index("algorithm")["area_median"]
    ranked = sorted(order, key=lambda label: -float(medians[label]))
    if tables.control in order:
        other = next(label for label in ranked if label != tables.control)
        return tables.control, other
    first, second = sorted(ranked[:2], key=order.index)
    return first, second


class _Pictures:
    """The pictures of one mission, each drawn when its turn comes."""

    def __init__(
        self, tables: StudyTables, mission: str, styles: Mapping[str, AlgorithmStyle]
    ) -> None:
        self._tables, self._mission, self._styles = tables, mission, styles
        self._title = tables.mission(mission).title
        self._runs = self._rows(tables.runs)
        known = set(self._runs["algorithm"])
        self._labels = [label for label in tables.algorithm_labels if label in known]

    def _rows(self, table: pd.DataFrame) -> pd.DataFrame:
        return table[table["mission"] == self._mission]

    def __iter__(self) -> Iterator[tuple[str, Axes, str, str]]:
        if self._labels:
            yield from self._curves()
            yield from self._areas()
        if not self._rows(self._tables.plans).empty:
            yield from self._fronts()
            yield from self._difference()

    def _names(self) -> str:
        return ", ".join(self._labels)

    def _without_front(self, table: pd.DataFrame) -> list[str]:
        """Say which algorithms have runs that no row of a table speaks of."""
        found = table.groupby("algorithm")["run"].nunique()
        runs = self._runs.groupby("algorithm")["run"].nunique()
        missing = {label: runs[label] - found.get(label, 0) for label in self._labels}
        return [f"{n} of {label}" for label, n in missing.items() if n]

    def _curves(self) -> Iterator[tuple[str, Axes, str, str]]:
        trace = self._rows(self._tables.trace)
        recorded = set(trace["algorithm"])
        labels = [label for label in self._labels if label in recorded]
        if not labels:
            return
        absent = self._without_front(trace)
        lost = f" Runs without any recorded front are not in it: {', '.join(absent)}."
        reading = (
            "Lines are means over runs, bands reach one standard deviation up and down, but not "
            "beyond what runs have reached; a single run has no band. Between two records the area "
            "is that of the last one. A curve begins where all runs have a record, and is thin "
            f"where all have ended.{lost if absent else ''}"
        )
        captions: dict[Progress, str] = {
            "evaluations": f"The area of the front over the number of evaluations. {reading}",
            "seconds": "The same over the algorithms' own time, which recording is no part of.",
        }
        for (x, caption), kind in zip(captions.items(), ("curves", "seconds"), strict=True):
            ax = plot_curves(
                trace,
                x=x,
                algorithms=labels,
                styles=self._styles,
                title=self._title,
            )
            yield kind, ax, caption, f"Area over {x} of {', '.join(labels)}"

    def _areas(self) -> Iterator[tuple[str, Axes, str, str]]:
        ax = plot_areas(
            self._runs,
            self._rows(self._tables.summary),
            algorithms=self._labels,
            styles=self._styles,
            title=self._title,
        )
        caption = (
            "The area of every run's final front, a point each. Above them the median (diamond) "
            f"and its {level(self._tables)} bootstrap interval (line)."
        )
        if (self._runs["status"] != "done").any():
            caption += " Crosses are runs that are not done; without a front their area is 0."
        yield "areas", ax, caption, f"Final areas of the runs of {self._names()}"

    def _fronts(self) -> Iterator[tuple[str, Axes, str, str]]:
        plans, reference = self._rows(self._tables.plans), self._rows(self._tables.references)
        chosen = {
            "algorithms": self._labels,
            "styles": self._styles,
            "title": self._title,
        }
        ax = plot_fronts(plans, self._runs, reference=reference, **chosen)  # type: ignore[arg-type]
        caption = (
            "For each algorithm the final front of the run with the median area, of the middle two "
            "the one with less; its seed is in the legend. The thin line is the reference front: "
            "what all runs on this mission found together."
        )
        yield "fronts", ax, caption, f"Final fronts of the median runs of {self._names()}"
        ax = plot_attainment(plans, self._runs, **chosen)  # type: ignore[arg-type]
        caption = (
            "Empirical attainment surfaces. What lies below and left of a line, at least half of "
            "the runs reach; bands lie between what a quarter and what three quarters of them "
            "reach."
        )
        if absent := self._without_front(plans):
            caption += f" Runs without a front reach nothing: {', '.join(absent)}."
        yield "attainment", ax, caption, f"Attainment surfaces of {self._names()}"

    def _difference(self) -> Iterator[tuple[str, Axes, str, str]]:
        pair = rivals(self._tables, self._mission)
        if pair is None:
            return
        first, second = pair
        left, _ = plot_attainment_difference(
            self._rows(self._tables.plans),
            self._runs,
            first,
            second,
            styles=self._styles,
            title=self._title,
        )
        why = (
            "the control and the best of the others"
            if first == self._tables.control
            else "the two with the largest median areas"
        )
        caption = (
            f"Where {first} reaches more often than {second} (left), and less often (right): {why}."
            " The darker, the larger the difference between the shares of their runs. The solid "
            "line bounds what any run of both reaches, the dashed one what half of the panel's "
            "algorithm's runs reach."
        )
        alternative = f"Differences between the attainment of {first} and {second}"
        yield "difference", left, caption, alternative
