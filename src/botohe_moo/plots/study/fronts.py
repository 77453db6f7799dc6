"""The picture of what algorithms have found on a mission: fronts of their median runs."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.axes import Axes

from botohe_moo._base.types import FloatArray
from botohe_moo.plots.draw.algorithms import (
    AlgorithmStyle,
    chosen_algorithms,
    marks,
    names_of,
    stroke,
    styles_of,
)
from botohe_moo.plots.draw.labels import WIDTH, columns
from botohe_moo.plots.draw.panels import AlgorithmAxes, open_algorithm_axes
from botohe_moo.plots.draw.style import INK, MUTED, dress, theme
from botohe_moo.plots.front import OBJECTIVES, staircase


def plot_fronts(
    plans: pd.DataFrame,
    runs: pd.DataFrame,
    *,
    reference: pd.DataFrame | None = None,
    bound: pd.DataFrame | None = None,
    algorithms: Sequence[str] | None = None,
    styles: Mapping[str, AlgorithmStyle] | None = None,
    title: str | None = None,
    ax: Axes | None = None,
) -> Axes:
    """Draw the final front of each algorithm's median run over each other.

    The median run is the one with the median area, of the middle two the lower.

    Parameters
    ----------
    plans
        Rows of one mission in a study's plans: columns ``algorithm``, ``seed``, ``reward`` and
        ``survivors``.
    runs
        Rows of the same mission in its runs: columns ``algorithm``, ``seed`` and ``area``.
    reference
        Points of the reference front, columns ``reward`` and ``survivors``; a thin line.
    bound
        Points that plans do not exceed, as in a study's bounds, in the same columns; a dashed line.
    algorithms, styles, title, ax
        As in :func:`plot_curves`, with panels from twelve algorithms on.

    Raises
    ------
    ValueError
        If a column is missing, there are rows of several missions, or an algorithm is not known.

    Examples
    --------
    >>> import pandas as pd
    >>> from botohe_moo.plots import plot_fronts, save_plot
    >>> runs = pd.DataFrame(
    ...     [("ants", 1, "done", 0.5), ("ants", 2, "done", 0.4), ("greedy", 1, "done", 0.3)],
    ...     columns=["algorithm", "seed", "status", "area"],
    ... )  # of a study: tables.runs.query("mission == 'museum'")
    >>> plans = pd.DataFrame(
    ...     [("ants", 1, 5, 1), ("ants", 2, 4, 1), ("greedy", 1, 3, 1)],
    ...     columns=["algorithm", "seed", "reward", "survivors"],
    ... )
    >>> save_plot(plot_fronts(plans, runs), "fronts.png")
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
        corners = {label: staircase(front) for label, front in shown.items()}
        lines = {label: found[:-1] for label, found in corners.items()}
        axes = open_algorithm_axes(lines, styles, ax, size=(5.6, 4.2), stretch=2.0, names=names)
        if reference is not None:
            look: dict[str, Any] = {"color": INK, "linewidth": 0.6, "zorder": 4}
            _draw_line(axes, reference, label="all runs together", gid="reference", **look)
        if bound is not None:
            look = {"color": MUTED, "linewidth": 1.0, "linestyle": "--", "zorder": 1}
            _draw_line(axes, bound, label="no plan lies beyond", gid="bound", **look)
        for label, own in axes.of.items():
            _draw(own, corners[label], styles[label])
            if not axes.in_panels:
                key = {**stroke(styles[label], 1.4), "marker": styles[label].marker}
                own.plot([], [], **key, markersize=5.5, label=names[label], gid="key")
        if axes.in_panels:
            words += "; thin: all runs together" if reference is not None else ""
            words += "; dashed: no plan lies beyond" if bound is not None else ""
        finish_objectives(axes, title, words)
    return axes.first


def _draw_line(axes: AlgorithmAxes, points: pd.DataFrame, **look: Any) -> None:
    """Draw the staircase of points on all panels."""
    line = staircase(points[["reward", "survivors"]].to_numpy(float))[:-1].T
    for own in dict.fromkeys(axes.of.values()):
        own.plot(*line, **look)


def _with_seed(name: str, seed: int, n_points: int) -> str:
    told = f"(seed {seed})" if n_points else f"(seed {seed}): no plans"
    room = columns(name.split("\n")[-1]) + 1 + len(told) <= WIDTH
    return f"{name} {told}" if room else f"{name}\n{told}"


def final_fronts(
    plans: pd.DataFrame, runs: pd.DataFrame, algorithms: Sequence[str] | None
) -> dict[str, dict[int, FloatArray]]:
    """Give the final front (n_plans, 2) of every run, perhaps empty, by label and seed."""
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


def finish_objectives(axes: AlgorithmAxes, title: str | None, words: str) -> None:
    """Begin both objectives at 0, write all texts, and add a legend where there are no panels."""
    if axes.in_panels:
        axes.first.set(xlim=(0, None), ylim=(0, None))
    else:
        objective_axes(axes.first)
    axes.finish(title, words, *OBJECTIVES)
    if not axes.in_panels:
        axes.first.legend(
            loc="upper left", bbox_to_anchor=(1.01, 1.0), frameon=False, borderaxespad=0.0
        )


def objective_axes(ax: Axes) -> None:
    """Let both objectives begin at 0, and name them."""
    dress(ax)
    ax.set(xlim=(0, None), ylim=(0, None), xlabel=OBJECTIVES[0], ylabel=OBJECTIVES[1])


def _draw(ax: Axes, corners: FloatArray, style: AlgorithmStyle) -> None:
    ax.plot(*corners[:-1].T, **stroke(style, 1.2), zorder=2, gid="stairs")
    # The corners that are plans: every second one, beginning at the front's upper end.
    best = corners[1:-1:2]
    ax.plot(
        *best.T,
        color=style.colour,
        linestyle="none",
        **marks(style, 4.0, rim=0.25),
        clip_on=False,
        zorder=3,
        gid="front",
    )
