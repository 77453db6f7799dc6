"""The picture of what algorithms have found on a mission: fronts of their median runs."""

from collections.abc import Sequence
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.axes import Axes

from botohe_moo.base.types import FloatArray
from botohe_moo.plots.draw.algorithms import (
    axes_of,
    check_table,
    chosen_algorithms,
    finish,
    line_styles,
)
from botohe_moo.plots.draw.style import INK, MUTED, Palette, theme
from botohe_moo.plots.front import OBJECTIVES, staircase


def plot_fronts(
    plans: pd.DataFrame,
    runs: pd.DataFrame,
    *,
    reference: pd.DataFrame | None = None,
    bound: pd.DataFrame | None = None,
    algorithms: Sequence[str] | None = None,
    palette: Palette | None = None,
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
    algorithms, palette, title, ax
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
    seeds = {label: median_run(runs[runs["algorithm"] == label]) for label in fronts}
    further: list[tuple[pd.DataFrame | None, dict[str, Any]]] = [
        (reference, {"color": INK, "linewidth": 0.6, "label": "reference front"}),
        (bound, {"color": MUTED, "linestyle": "--", "label": "no plan lies beyond"}),
    ]
    with theme():
        axes = axes_of(list(fronts), ax)
        for label, style in line_styles(fronts, palette).items():
            front = fronts[label][seeds[label]]
            style["label"] += f" (seed {seeds[label]})" + ("" if len(front) else ": no plans")
            # The corners that are plans are every second one, from the upper end of the front.
            style |= {"markevery": (1, 2), "markersize": 4, "linewidth": 1.2}
            style |= {"markeredgecolor": "white", "markeredgewidth": 0.3}
            axes[label].plot(*staircase(front)[:-1].T, **style)
        for panel in dict.fromkeys(axes.values()):
            for points, style in further:
                if points is not None:
                    corners = staircase(points[["reward", "survivors"]].to_numpy(float))[:-1]
                    panel.plot(*corners.T, **{"linewidth": 1.0, **style})
        return finish(axes, title, *OBJECTIVES, xlim=(0, None), ylim=(0, None))


def final_fronts(
    plans: pd.DataFrame, runs: pd.DataFrame, algorithms: Sequence[str] | None
) -> dict[str, dict[int, FloatArray]]:
    """Return the final front (n_plans, 2) of every run, perhaps empty, by label and seed."""
    labels = chosen_algorithms("runs", runs, ("algorithm", "seed", "area"), algorithms)
    point = ["reward", "survivors"]
    check_table("plans", plans, ("algorithm", "seed", *point))
    points = plans[point].to_numpy(float)
    of_runs = plans.groupby(["algorithm", "seed"], observed=True).indices
    found = {key: points[rows] for key, rows in of_runs.items()}
    return {
        label: {
            seed: found.get((label, seed), np.empty((0, 2)))
            for seed in sorted(runs.loc[runs["algorithm"] == label, "seed"].tolist())
        }
        for label in labels
    }


def median_run(runs: pd.DataFrame) -> int:
    """Return the seed of the run with the median area, of the middle two the lower."""
    ranked = runs.sort_values(["area", "seed"], kind="stable")["seed"].tolist()
    return int(ranked[(len(ranked) - 1) // 2])
