"""The pictures of a report, with their captions."""

import base64
import functools
import multiprocessing
from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.axes import Axes

from botohe_moo.indicators import INDICATORS, further_indicators
from botohe_moo.objectives import Objectives
from botohe_moo.plots.comparisons import (
    overruled,
    plot_areas,
    plot_heat,
    plot_ranks,
    plot_shortfalls,
    two_parameter_grids,
)
from botohe_moo.plots.curves import NAMES, Spent, plot_curves, plot_reached
from botohe_moo.plots.front import (
    median_run,
    plot_attainment,
    plot_attainment_difference,
    plot_fronts,
    plot_pairs,
)
from botohe_moo.plots.style import palette_of, save_plot
from botohe_moo.study.tables import StudyTables
from botohe_moo.study.words import level, main_indicator, reference_words, slug

FORMATS = ("png", "pdf", "svg")
_SHARES = np.arange(50, 100) / 100  # of the reference front's area, as targets

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
    pictures = [*_shortfalls(tables, palette), *_ranks(tables, palette)]
    of_study = [_saved(folder, kind, ax, caption) for kind, ax, caption in pictures]
    parts = [tables.of_mission(label) for label in labels]
    draw = functools.partial(_draw_mission, folder, palette)
    if min(workers, len(labels)) == 1:
        return {"": of_study, **dict(zip(labels, map(draw, parts, labels), strict=True))}
    context = multiprocessing.get_context("spawn")
    with ProcessPoolExecutor(min(workers, len(labels)), mp_context=context) as pool:
        return {"": of_study, **dict(zip(labels, pool.map(draw, parts, labels), strict=True))}


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


def _shortfalls(tables: StudyTables, palette: dict[str, Any]) -> Iterator[Picture]:
    """Draw all missions in one picture, where there are several."""
    if len(set(tables.summary["mission"])) > 1 and tables.summary["area_share"].notna().any():
        caption = (
            "By how much the mean area of each algorithm is smaller than that of the reference "
            f"front: {reference_words(tables)}. Below 0.01 per cent the scale is linear."
        )
        if tables.missions["bound_area"].notna().any():
            caption += (
                " Grey bars say how much larger the reference front itself may be at most: that is "
                "proved."
            )
        yield (
            "shortfalls",
            plot_shortfalls(tables.summary, tables.missions, palette=palette),
            caption,
        )


def _ranks(tables: StudyTables, palette: dict[str, Any]) -> Iterator[Picture]:
    """Draw the ranks by the main indicator, if their differences were tested."""
    main = main_indicator(tables.ranks)
    rows = tables.ranks[tables.ranks["indicator"] == main]
    pairs = tables.posthoc[tables.posthoc["indicator"] == main]
    if pairs.empty:
        return
    caption = (
        f"Average ranks over missions of the algorithms' medians by {INDICATORS[main].label}; 1 is "
        "best. Bars join algorithms of which no two differ significantly by the Nemenyi test"
    )
    if overruled(pairs):
        caption += "; here Friedman's test finds no difference, so that no pair counts."
    else:
        critical = float(pairs["critical_difference"].iloc[0])
        caption += f": their ranks lie less than the critical difference, {critical:.2f}, apart."
    yield f"critical-difference-{main}", plot_ranks(rows, pairs, palette=palette), caption


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
    """The pictures of one mission, each drawn when it is asked for."""

    def __init__(self, tables: StudyTables, mission: str, palette: dict[str, Any]) -> None:
        self._tables, self._mission = tables, mission
        self._runs, self._palette = self._rows(tables.runs), palette
        bound = self._rows(tables.missions)["bound_area"].iloc[0]
        self._bound_area = None if pd.isna(bound) else float(bound)

    def _rows(self, table: pd.DataFrame) -> pd.DataFrame:
        return table[table["mission"] == self._mission]

    def __iter__(self) -> Iterator[Picture]:
        if not self._runs.empty:
            trace = self._rows(self._tables.trace)
            if not trace.empty:
                yield from self._curves(trace)
                yield from self._reached(trace)
                yield from self._distances(trace)
            yield from self._areas()
            yield from self._grids()
        if not self._rows(self._tables.plans).empty:
            objectives = self._tables.objectives(self._mission)
            yield from self._fronts() if objectives.is_plain else self._pairs(objectives)

    def _without_front(self, table: pd.DataFrame) -> str:
        """Return how many runs of which algorithms have no row in a table; empty if none."""
        missing = self._runs.loc[~self._runs["run"].isin(table["run"]), "algorithm"]
        counts: Any = missing.groupby(missing, sort=False).size()
        return ", ".join(f"{n} of {label}" for label, n in counts.items())

    def _curves(self, trace: pd.DataFrame) -> Iterator[Picture]:
        reading = (
            "Lines are medians over runs, bands reach from their lower to their upper quartile. "
            "Between two records the area is that of the last one, and a run that has ended keeps "
            "its last area. A curve begins where all runs have a record."
        )
        if absent := self._without_front(trace):
            reading += f" Runs without any recorded front are not in it: {absent}."
        further = "Lines and bands as above; without the time that recording takes."
        kinds: dict[Spent, tuple[str, str]] = {
            "evaluations": ("curves", reading),
            "seconds": ("seconds", further),
        }
        for x, (kind, how) in kinds.items():
            caption = f"The area of the front over {NAMES[x]}. {how}"
            ax = plot_curves(trace, x=x, bound=self._bound_area, palette=self._palette)
            yield kind, ax, caption

    def _reached(self, trace: pd.DataFrame) -> Iterator[Picture]:
        targets = self._rows(self._tables.targets)
        if targets.empty:  # the reference front has no area
            return
        whole = float(targets["target"].iloc[0] / targets["share"].iloc[0])
        kinds: dict[Spent, str] = {"evaluations": "reached", "seconds": "reached-seconds"}
        for x, kind in kinds.items():
            caption = (
                f"The share of all pairs of a run and a target that are reached, over {NAMES[x]}. "
                f"Targets are the {len(_SHARES)} whole percents from 50 to 99 of the reference "
                f"front's area, {whole:.4f}. All runs count, also those that never get there."
            )
            ax = plot_reached(trace, self._runs, _SHARES * whole, x=x, palette=self._palette)
            yield kind, ax, caption

    def _distances(self, trace: pd.DataFrame) -> Iterator[Picture]:
        for value in further_indicators():
            rows = trace[trace[value].notna()]
            if INDICATORS[value].is_distance and not rows.empty:
                caption = (
                    f"{INDICATORS[value].label}: how far fronts are from the reference front, over "
                    "evaluations. Less is better; 0 lies below the axis. Lines are medians over "
                    "runs, bands reach from their lower to their upper quartile."
                )
                yield value, plot_curves(rows, value=value, palette=self._palette), caption

    def _areas(self) -> Iterator[Picture]:
        summary = self._rows(self._tables.summary)
        caption = (
            "The area of every run's final front, a point each. Above them the median (diamond) "
            f"and its {level(self._tables)} bootstrap interval (line)."
        )
        if (self._runs["status"] != "done").any():
            caption += " Crosses are runs that are not done; without a front their area is 0."
        ax = plot_areas(self._runs, summary, bound=self._bound_area, palette=self._palette)
        yield "areas", ax, caption

    def _grids(self) -> Iterator[Picture]:
        medians = self._rows(self._tables.summary).set_index("algorithm")["area_median"]
        grids = two_parameter_grids(self._tables.algorithms)
        for i, (family, grid) in enumerate(grids.items(), start=1):
            values = grid.apply(lambda column: column.map(medians)).astype(float)
            if values.notna().any(axis=None):
                caption = (
                    f"The median area of {family} for each combination of {grid.index.name} (rows) "
                    f"and {grid.columns.name} (columns). The largest is bold."
                )
                yield f"grid-{i}", plot_heat(values), caption

    def _pairs(self, objectives: Objectives) -> Iterator[Picture]:
        plans = self._rows(self._tables.plans)
        groups: Any = self._runs[self._runs["run"].isin(plans["run"])].groupby("algorithm")
        seeds = {label: median_run(runs) for label, runs in groups}
        shown = plans[plans["seed"] == plans["algorithm"].map(seeds)]
        caption = (
            "For each algorithm the final front of the run with the median area, of the middle two "
            "the one with less: its objectives pair by pair, and how each of them is distributed."
        )
        ax = plot_pairs(shown, objectives, hue="algorithm", palette=self._palette)
        yield "fronts", ax, caption

    def _fronts(self) -> Iterator[Picture]:
        plans, reference = self._rows(self._tables.plans), self._rows(self._tables.references)
        bound = None if self._bound_area is None else self._rows(self._tables.bounds)
        ax = plot_fronts(plans, self._runs, reference=reference, bound=bound, palette=self._palette)
        caption = (
            "For each algorithm the final front of the run with the median area, of the middle two "
            "the one with less. The thin line is the reference front: "
            f"{reference_words(self._tables)}."
        )
        if bound is not None:
            caption += " No plan lies beyond the dashed line: that is proved."
        yield "fronts", ax, caption
        ax = plot_attainment(plans, self._runs, palette=self._palette)
        caption = (
            "Empirical attainment surfaces. What lies below and left of a line, at least half of "
            "the runs reach; bands lie between what a quarter and what three quarters of them "
            "reach."
        )
        if absent := self._without_front(plans):
            caption += f" Runs without a front reach nothing: {absent}."
        yield "attainment", ax, caption
        if pair := rivals(self._tables, self._mission):
            first, second = pair
            ax, _ = plot_attainment_difference(plans, self._runs, *pair, palette=self._palette)
            why = (
                "the control and the best of the others"
                if first == self._tables.control
                else "the two with the largest median areas"
            )
            caption = (
                f"Where {first} reaches more often than {second} (left), and less often (right): "
                f"{why}. The darker, the larger the difference between the shares of their runs. "
                "The solid line bounds what any run of both reaches, the dashed one what half of "
                "the panel's algorithm's runs reach."
            )
            yield "difference", ax, caption
