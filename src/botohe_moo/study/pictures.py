"""The pictures of a report; their captions are in ``captions.toml``."""

import base64
import functools
import multiprocessing
import tomllib
from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import jinja2
import numpy as np
import pandas as pd
from matplotlib.axes import Axes

from botohe_moo.indicators import INDICATORS
from botohe_moo.plots import comparisons, curves, front
from botohe_moo.plots.style import palette_of, save_plot
from botohe_moo.study.tables import StudyTables
from botohe_moo.study.words import further_of, level, main_indicator, reference_words, slug

FORMATS = ("png", "pdf", "svg")
_SHARES = np.arange(50, 100) / 100  # of the reference front's area, as targets
_SPENT: tuple[curves.Spent, ...] = ("evaluations", "seconds")
_CAPTIONS = tomllib.loads(Path(__file__).with_name("captions.toml").read_text("utf-8"))

Picture = tuple[str, Axes, str]  # kind, axes, caption


@dataclass(frozen=True)
class ReportFigure:
    """A figure of a report."""

    paths: tuple[Path, ...]  # its files, as PNG, PDF and SVG
    caption: str  # what it shows, what its lines and bands mean, and what is not in it
    alternative: str  # text for readers who cannot see it

    @property
    def data(self) -> str:
        """The PNG file as base64, to be embedded in a page."""
        return base64.b64encode(self.paths[0].read_bytes()).decode()


def draw_figures(
    tables: StudyTables, folder: Path, *, workers: int = 1
) -> dict[str, list[ReportFigure]]:
    """Draw and save all figures of a study; return them by mission.

    Under ``""`` are those of the study as a whole; a mission without runs has none. Each of
    several workers is a process that draws the figures of one mission after the other.
    """
    palette, labels = palette_of(tables.algorithm_labels), tables.mission_labels
    of_study = [*_shortfalls(tables, palette), *_ranks(tables, palette)]
    figures = {"": [_saved(folder, *picture) for picture in of_study]}
    parts = [tables.of_mission(label) for label in labels]
    draw = functools.partial(_draw_mission, folder, palette)
    if min(workers, len(labels)) == 1:
        return figures | dict(zip(labels, map(draw, parts, labels), strict=True))
    context = multiprocessing.get_context("spawn")
    with ProcessPoolExecutor(min(workers, len(labels)), mp_context=context) as pool:
        return figures | dict(zip(labels, pool.map(draw, parts, labels), strict=True))


def _draw_mission(
    folder: Path, palette: dict[str, Any], tables: StudyTables, label: str
) -> list[ReportFigure]:
    return [
        _saved(folder, f"{kind}-{slug(label)}", ax, caption, f" On {label}.")
        for kind, ax, caption in MissionPictures(tables, label, palette)
    ]


def _saved(folder: Path, name: str, ax: Axes, caption: str, where: str = "") -> ReportFigure:
    paths = tuple(folder / f"{name}.{end}" for end in FORMATS)
    save_plot(ax, *paths)
    first = caption.split(". ")[0].removesuffix(".")  # sentence
    return ReportFigure(paths, caption, f"{first}.{where}")


def _caption(name: str, **values: Any) -> str:
    return str(jinja2.Template(" ".join(_CAPTIONS[name].split())).render(values))


def _shortfalls(tables: StudyTables, palette: dict[str, Any]) -> Iterator[Picture]:
    """Draw all missions in one picture, where there are several."""
    summary, missions = tables.summary, tables.missions
    if len(summary["mission"].unique()) > 1 and summary["area_share"].notna().any():
        is_bounded = missions["bound_area"].notna().any()
        ax = comparisons.plot_shortfalls(summary, missions, palette=palette)
        reference = reference_words(tables)
        yield "shortfalls", ax, _caption("shortfalls", reference=reference, is_bounded=is_bounded)


def _ranks(tables: StudyTables, palette: dict[str, Any]) -> Iterator[Picture]:
    """Draw the ranks by the main indicator, if their differences were tested."""
    main = main_indicator(tables.ranks)
    ranks = tables.ranks[tables.ranks["indicator"] == main]
    pairs = tables.posthoc[tables.posthoc["indicator"] == main]
    if not pairs.empty:
        caption = _caption(
            "ranks",
            indicator=INDICATORS[main].label,
            overruled=comparisons.overruled(pairs),
            critical=pairs["critical_difference"].iloc[0],
        )
        ax = comparisons.plot_ranks(ranks, pairs, palette=palette)
        yield f"critical-difference-{main}", ax, caption


def rivals(tables: StudyTables, mission: str) -> tuple[str, str] | None:
    """Return the two algorithms whose attainment is compared; None if there are fewer.

    They are the control and the best of the others. Without a control they are the two with the
    largest median areas, in the order of the study file.
    """
    rows = tables.summary[tables.summary["mission"] == mission]
    ranked = rows.sort_values("area_median", ascending=False, kind="stable")["algorithm"].tolist()
    if len(ranked) < 2:
        return None
    if (control := tables.control) is not None and control in ranked:
        return control, next(label for label in ranked if label != control)
    first, second = sorted(ranked[:2], key=tables.algorithm_labels.index)
    return first, second


class MissionPictures:
    """The pictures of one mission, each drawn when it is asked for.

    ``tables`` have the rows of this mission only.
    """

    def __init__(self, tables: StudyTables, mission: str, palette: dict[str, Any]) -> None:
        self._tables, self._mission, self._palette = tables, mission, palette
        bound = tables.missions["bound_area"].iloc[0]
        self._bound = None if pd.isna(bound) else float(bound)

    def __iter__(self) -> Iterator[Picture]:
        tables = self._tables
        if not tables.runs.empty:
            if not tables.trace.empty:
                yield from self._curves()
                yield from self._distances()
            yield from self._areas()
            yield from self._grids()
        if not tables.plans.empty:
            is_plain = tables.objectives(self._mission).is_plain
            yield from self._fronts() if is_plain else self._pairs()

    def _without_front(self, table: pd.DataFrame) -> str:
        """Return how many runs of which algorithms have no row in a table; empty if none."""
        runs = self._tables.runs
        missing = runs.loc[~runs["run"].isin(table["run"]), "algorithm"]
        counts: Any = missing.groupby(missing, sort=False).size()
        return ", ".join(f"{n} of {label}" for label, n in counts.items())

    def _curves(self) -> Iterator[Picture]:
        trace, targets = self._tables.trace, self._tables.targets
        absent = self._without_front(trace)
        for x, kind in zip(_SPENT, ("curves", "seconds"), strict=True):
            ax = curves.plot_curves(trace, x=x, bound=self._bound, palette=self._palette)
            yield kind, ax, _caption(kind, spent=curves.NAMES[x], absent=absent)
        if targets.empty:  # the reference front has no area
            return
        area = float(targets["target"].iloc[0] / targets["share"].iloc[0])
        for x, kind in zip(_SPENT, ("reached", "reached-seconds"), strict=True):
            caption = _caption("reached", spent=curves.NAMES[x], n=len(_SHARES), area=area)
            shown, runs = _SHARES * area, self._tables.runs
            yield kind, curves.plot_reached(trace, runs, shown, x=x, palette=self._palette), caption

    def _distances(self) -> Iterator[Picture]:
        for value in further_of(self._tables):
            rows = self._tables.trace.dropna(subset=value)
            if INDICATORS[value].is_distance and not rows.empty:
                caption = _caption("distances", indicator=INDICATORS[value].label)
                yield value, curves.plot_curves(rows, value=value, palette=self._palette), caption

    def _areas(self) -> Iterator[Picture]:
        runs, summary = self._tables.runs, self._tables.summary
        any_lost = (runs["status"] != "done").any()
        ax = comparisons.plot_areas(runs, summary, bound=self._bound, palette=self._palette)
        yield "areas", ax, _caption("areas", level=level(self._tables), any_lost=any_lost)

    def _grids(self) -> Iterator[Picture]:
        medians = self._tables.summary.set_index("algorithm")["area_median"]
        grids = comparisons.two_parameter_grids(self._tables.algorithms)
        for i, (family, grid) in enumerate(grids.items(), start=1):
            values = grid.apply(lambda column: column.map(medians)).astype(float)
            if values.notna().any(axis=None):
                names = {"rows": grid.index.name, "columns": grid.columns.name}
                caption = _caption("grid", family=family, **names)
                yield f"grid-{i}", comparisons.plot_heat(values), caption

    def _pairs(self) -> Iterator[Picture]:
        runs, plans = self._tables.runs, self._tables.plans
        groups: Any = runs.groupby("algorithm")
        seeds = {label: front.median_run(of_label) for label, of_label in groups}
        shown = plans[plans["seed"] == plans["algorithm"].map(seeds)]
        objectives = self._tables.objectives(self._mission)
        ax = front.plot_pairs(shown, objectives, hue="algorithm", palette=self._palette)
        yield "fronts", ax, _caption("pairs")

    def _fronts(self) -> Iterator[Picture]:
        tables, palette = self._tables, self._palette
        runs, plans, is_bounded = tables.runs, tables.plans, self._bound is not None
        lines: Any = {"reference": tables.references}
        if is_bounded:
            lines["bound"] = tables.bounds
        caption = _caption("fronts", reference=reference_words(tables), is_bounded=is_bounded)
        yield "fronts", front.plot_fronts(plans, runs, **lines, palette=palette), caption
        caption = _caption("attainment", absent=self._without_front(plans))
        yield "attainment", front.plot_attainment(plans, runs, palette=palette), caption
        if pair := rivals(tables, self._mission):
            caption = _caption("difference", first=pair[0], second=pair[1], control=tables.control)
            ax, _ = front.plot_attainment_difference(plans, runs, *pair, palette=palette)
            yield "difference", ax, caption
