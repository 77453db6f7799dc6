"""The pictures of a report; their captions are in ``captions.toml``."""

import functools
import multiprocessing
import tomllib
from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.axes import Axes

from botohe_moo.indicators import INDICATORS
from botohe_moo.plots import comparisons, curves, front
from botohe_moo.plots.style import palette_of, save_plot
from botohe_moo.study.tables import StudyTables
from botohe_moo.study.words import further_of, main_indicator, slug

FORMATS = ("png", "pdf", "svg")
_SHARES = np.arange(50, 100) / 100  # of the reference front's area, as targets
_CAPTIONS = tomllib.loads(Path(__file__).with_name("captions.toml").read_text("utf-8"))

Picture = tuple[str, Axes, str]  # name, axes, caption
Figure = tuple[list[Path], str]  # its files, one for each of FORMATS, and its caption


def draw_figures(tables: StudyTables, folder: Path, *, workers: int = 1) -> dict[str, list[Figure]]:
    """Draw and save all figures of a study; return them by mission.

    Under ``""`` are those of the study as a whole; a mission without runs has none. Each of
    several workers is a process that draws the figures of one mission after the other.
    """
    palette, labels = palette_of(tables.algorithm_labels), tables.mission_labels
    figures = {"": [_saved(folder, *picture) for picture in _of_study(tables, palette)]}
    parts = [tables.of_mission(label) for label in labels]
    draw = functools.partial(_draw_mission, folder, palette)
    if min(workers, len(labels)) == 1:
        return figures | dict(zip(labels, map(draw, parts, labels), strict=True))
    context = multiprocessing.get_context("spawn")
    with ProcessPoolExecutor(min(workers, len(labels)), mp_context=context) as pool:
        return figures | dict(zip(labels, pool.map(draw, parts, labels), strict=True))


def _draw_mission(
    folder: Path, palette: dict[str, Any], tables: StudyTables, label: str
) -> list[Figure]:
    pictures = _of_mission(tables, label, palette)
    return [_saved(folder, f"{name}-{slug(label)}", ax, said) for name, ax, said in pictures]


def _saved(folder: Path, name: str, ax: Axes, caption: str) -> Figure:
    paths = [folder / f"{name}.{end}" for end in FORMATS]
    save_plot(ax, *paths)
    return paths, caption


def _caption(name: str, **values: Any) -> str:
    return " ".join(_CAPTIONS[name].split()).format(**values)


def _of_study(tables: StudyTables, palette: dict[str, Any]) -> Iterator[Picture]:
    """Draw the pictures of several missions, if there are several."""
    summary, main = tables.summary, main_indicator(tables)
    if len(summary["mission"].unique()) > 1 and summary["area_share"].notna().any():
        ax = comparisons.plot_shortfalls(summary, tables.missions, palette=palette)
        yield "shortfalls", ax, _caption("shortfalls")
    ranks = tables.ranks[tables.ranks["indicator"] == main]
    pairs = tables.posthoc[tables.posthoc["indicator"] == main]
    if not pairs.empty:  # otherwise their differences were not tested
        critical = pairs["critical_difference"].iloc[0]
        caption = _caption("ranks", indicator=INDICATORS[main].label, critical=critical)
        ax = comparisons.plot_ranks(ranks, pairs, palette=palette)
        yield f"critical-difference-{main}", ax, caption


def _of_mission(tables: StudyTables, label: str, palette: dict[str, Any]) -> Iterator[Picture]:
    """Draw the pictures of one mission, each when it is asked for; it has all rows of tables."""
    runs, trace, plans, summary = tables.runs, tables.trace, tables.plans, tables.summary
    if runs.empty:
        return
    area = tables.missions["bound_area"].iloc[0]
    bound = None if pd.isna(area) else float(area)
    if not trace.empty:
        yield from _over_time(tables, palette, bound)
    ax = comparisons.plot_areas(runs, summary, bound=bound, palette=palette)
    yield "areas", ax, _caption("areas")
    medians = summary.set_index("algorithm")["area_median"]
    grids = comparisons.two_parameter_grids(tables.algorithms)
    for i, (family, grid) in enumerate(grids.items(), start=1):
        values = grid.apply(lambda column: column.map(medians)).astype(float)
        if values.notna().any(axis=None):
            yield f"grid-{i}", comparisons.plot_heat(values), _caption("grid", family=family)
    if plans.empty:
        return
    objectives = tables.objectives(label)
    if not objectives.is_plain:
        seeds = {name: front.median_run(own) for name, own in runs.groupby("algorithm")}
        shown = plans[plans["seed"] == plans["algorithm"].map(seeds)]
        ax = front.plot_pairs(shown, objectives, hue="algorithm", palette=palette)
        yield "fronts", ax, _caption("pairs")
        return
    lines: Any = {"reference": tables.references, "bound": None if bound is None else tables.bounds}
    yield "fronts", front.plot_fronts(plans, runs, **lines, palette=palette), _caption("fronts")
    yield "attainment", front.plot_attainment(plans, runs, palette=palette), _caption("attainment")
    if pair := rivals(tables):
        ax, _ = front.plot_attainment_difference(plans, runs, *pair, palette=palette)
        yield "difference", ax, _caption("difference", first=pair[0], second=pair[1])


def _over_time(
    tables: StudyTables, palette: dict[str, Any], bound: float | None
) -> Iterator[Picture]:
    """Draw how areas grow, how targets are reached, and how distances shrink."""
    trace, targets = tables.trace, tables.targets
    spent: tuple[curves.Spent, ...] = ("evaluations", "seconds")
    for x, name in zip(spent, ("curves", "seconds"), strict=True):
        ax = curves.plot_curves(trace, x=x, bound=bound, palette=palette)
        yield name, ax, _caption("curves", spent=curves.NAMES[x])
    if not targets.empty:  # else the reference front has no area
        shown = _SHARES * (targets["target"].iloc[0] / targets["share"].iloc[0])
        ax = curves.plot_reached(trace, tables.runs, shown, palette=palette)
        yield "reached", ax, _caption("reached")
    for value in further_of(tables):
        rows = trace.dropna(subset=value)
        if INDICATORS[value].is_distance and not rows.empty:
            caption = _caption("distances", indicator=INDICATORS[value].label)
            yield value, curves.plot_curves(rows, value=value, palette=palette), caption


def rivals(tables: StudyTables) -> tuple[str, str] | None:
    """Return the two algorithms of one mission whose attainment is compared, if there are two.

    They are the two with the largest median areas, or the control and the best of the others.
    """
    ranked = tables.summary.sort_values("area_median", ascending=False, kind="stable")
    labels = sorted(ranked["algorithm"], key=lambda label: label != tables.control)
    return (labels[0], labels[1]) if len(labels) > 1 else None
