"""The picture of what algorithms have found on a mission: fronts of their median runs."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from botohe_moo.plots.draw.algorithms import chosen_algorithms, names_of, styles_of
from botohe_moo.plots.draw.labels import WIDTH, columns
from botohe_moo.plots.draw.panels import (
    MANY,
    add_background,
    names_room,
    open_panels,
    study_axes,
    title_panels,
)
from botohe_moo.plots.draw.scales import dress, title_above
from botohe_moo.plots.draw.style import INK, theme
from botohe_moo.plots.front import staircase

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    import pandas as pd
    from matplotlib.axes import Axes

    from botohe_moo._base.types import FloatArray
    from botohe_moo.plots.draw.algorithms import AlgorithmStyle

__all__ = [
    "OBJECTIVES",
    "final_fronts",
    "legend_beside",
    "median_run",
    "objective_axes",
    "plot_fronts",
]

OBJECTIVES = ("expected team reward E[R]", "expected number of survivors E[S]")


def plot_fronts(
    plans: pd.DataFrame,
    runs: pd.DataFrame,
    *,
    reference: pd.DataFrame | None = None,
    algorithms: Sequence[str] | None = None,
    styles: Mapping[str, AlgorithmStyle] | None = None,
    title: str | None = None,
    ax: Axes | None = None,
) -> Axes:
    """Draw the final front of each algorithm's median run over each other.

    The median run is the one with the median area, of the middle two the lower. From twelve
    algorithms on each has a panel of its own, with all others in grey.

    Parameters
    ----------
    plans
        Rows of one mission in a study's plans: columns ``algorithm``, ``seed``, ``reward`` and
        ``survivors``.
    runs
        Rows of the same mission in its runs: columns ``algorithm``, ``seed`` and ``area``.
    reference
        Points of the reference front, columns ``reward`` and ``survivors``; a thin line.
    algorithms
        Labels of the algorithms to draw. Default: all of them.
    styles
        Style of each label, as ``algorithm_styles`` gives them.
    title
        Name of the mission; what follows a line break is paler.
    ax
        Axes to draw on, for all algorithms. A figure will be created if not given.

    Returns
    -------
    matplotlib.axes.Axes
        The axes drawn on; those of the first panel where there are several.

    Raises
    ------
    ValueError
        If a column is missing, there are rows of several missions, or an algorithm is not known.
    """
    fronts = final_fronts(plans, runs, algorithms)
    styles = styles_of(list(fronts), styles)
    seeds = {label: median_run(runs[runs["algorithm"] == label]) for label in fronts}
    shown = {label: found[seeds[label]] for label, found in fronts.items()}
    words = "final fronts of the runs with the median area"
    with theme():
        names = {
            label: _with_seed(name, seeds[label], len(shown[label]))
            for label, name in names_of(fronts, styles, longest=WIDTH).items()
        }
        if ax is None and len(fronts) >= MANY:
            panels = open_panels(list(fronts), styles, names)
            add_background(panels, {k: staircase(front)[:-1] for k, front in shown.items()})
            for label, own in panels.items():
                _draw_reference(own, reference)
                _draw(own, shown[label], styles[label], None)
            first = next(iter(panels.values()))
            first.set(xlim=(0, None), ylim=(0, None))
            title_panels(panels, title, f"{words}; thin: all runs together", *OBJECTIVES)
            return first
        if ax is None:
            height, right = names_room(fronts, styles)
            (ax,) = study_axes(5.6, max(4.2, 2 * height), right=right)
        _draw_reference(ax, reference)
        for label, front in shown.items():
            _draw(ax, front, styles[label], names[label])
        objective_axes(ax)
        title_above(ax, title, words)
        legend_beside(ax)
    return ax


def _with_seed(name: str, seed: int, n_points: int) -> str:
    told = f"(seed {seed})" if n_points else f"(seed {seed}): no plans"
    room = columns(name.split("\n")[-1]) + 1 + len(told) <= WIDTH
    return f"{name} {told}" if room else f"{name}\n{told}"


def legend_beside(ax: Axes) -> None:
    """Say right of the axes what is what."""
    ax.legend(loc="upper left", bbox_to_anchor=(1.01, 1.0), frameon=False, borderaxespad=0.0)


def _draw_reference(ax: Axes, reference: pd.DataFrame | None) -> None:
    if reference is None:
        return
    corners = staircase(reference[["reward", "survivors"]].to_numpy(float))
    ax.plot(
        *corners[:-1].T,
        color=INK,
        linewidth=0.6,
        zorder=4,
        label="all runs together",
        gid="reference",
    )


def final_fronts(
    plans: pd.DataFrame, runs: pd.DataFrame, algorithms: Sequence[str] | None
) -> dict[str, dict[int, FloatArray]]:
    """Give the points (n_plans, 2) of the final front of every run, by label and seed.

    A run without plans has an empty front.

    Raises
    ------
    ValueError
        If a column is missing, there are rows of several missions, or an algorithm is not known.
    """
    labels = chosen_algorithms("runs", runs, ("algorithm", "seed", "area"), algorithms)
    point = ["reward", "survivors"]
    chosen_algorithms("plans", plans, ("algorithm", "seed", *point), None)
    points = plans[point].to_numpy(float)
    found = {
        key: points[rows] for key, rows in plans.groupby(["algorithm", "seed"]).indices.items()
    }
    return {
        label: {
            seed: found.get((label, seed), np.empty((0, 2)))
            for seed in sorted(runs.loc[runs["algorithm"] == label, "seed"].tolist())
        }
        for label in labels
    }


def median_run(runs: pd.DataFrame) -> int:
    """Give the seed of the run with the median area, of the middle two the lower."""
    ranked = runs.sort_values(["area", "seed"], kind="stable")["seed"].tolist()
    return int(ranked[(len(ranked) - 1) // 2])


def objective_axes(ax: Axes) -> None:
    """Let both objectives begin at 0, and name them."""
    dress(ax)
    ax.set_xlim(left=0)
    ax.set_ylim(bottom=0)
    ax.set_xlabel(OBJECTIVES[0])
    ax.set_ylabel(OBJECTIVES[1])


def _draw(ax: Axes, front: FloatArray, style: AlgorithmStyle, label: str | None) -> None:
    corners = staircase(front)
    ax.plot(
        *corners[:-1].T,
        color=style.colour,
        linestyle=style.line,
        linewidth=1.2,
        zorder=2,
        gid="stairs",
    )
    # The corners that are plans: every second one, beginning at the front's upper end.
    best = corners[1:-1:2]
    ax.plot(
        *best.T,
        color=style.colour,
        linestyle="none",
        marker=style.marker,
        markersize=4.0,
        markeredgecolor="white",
        markeredgewidth=0.25,
        clip_on=False,
        zorder=3,
        gid="front",
    )
    if label is None:
        return
    ax.plot(
        [],
        [],
        color=style.colour,
        linestyle=style.line,
        linewidth=1.4,
        marker=style.marker,
        markersize=5.5,
        label=label,
        gid="key",
    )
