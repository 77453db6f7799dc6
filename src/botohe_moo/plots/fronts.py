"""The picture of what algorithms have found on a mission: fronts of their median runs."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from botohe_moo.plots.algorithms import chosen_algorithms, shortened, styles_of
from botohe_moo.plots.front import staircase
from botohe_moo.plots.scales import dress, title_above
from botohe_moo.plots.style import INK, new_axes, theme

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    import pandas as pd
    from matplotlib.axes import Axes

    from botohe_moo._types import FloatArray
    from botohe_moo.plots.algorithms import AlgorithmStyle

__all__ = ["final_fronts", "median_run", "objective_axes", "plot_fronts"]


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
    algorithms
        Labels of the algorithms to draw. Default: all of them.
    styles
        Style of each label, as ``algorithm_styles`` gives them.
    title
        Name of the mission.
    ax
        Axes to draw on. One will be created if not given.

    Returns
    -------
    matplotlib.axes.Axes
        The axes drawn on.

    Raises
    ------
    ValueError
        If a column is missing, there are rows of several missions, or an algorithm is not known.
    """
    fronts = final_fronts(plans, runs, algorithms)
    styles = styles_of(list(fronts), styles)
    with theme():
        if ax is None:
            ax = new_axes(8.4, 5.2)
        if reference is not None:
            corners = staircase(reference[["reward", "survivors"]].to_numpy(float))
            ax.plot(
                *corners[:-1].T,
                color=INK,
                linewidth=0.6,
                zorder=4,
                label="all runs together",
                gid="reference",
            )
        short = shortened(fronts)
        for label, found in fronts.items():
            seed = median_run(runs[runs["algorithm"] == label])
            _draw(ax, found[seed], styles[label], f"{short[label]} (seed {seed})")
        objective_axes(ax)
        title_above(ax, title, "final fronts of the runs with the median area")
        ax.legend(loc="upper left", bbox_to_anchor=(1.01, 1.0), frameon=False)
    return ax


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
    found = {
        key: front[point].to_numpy(float) for key, front in plans.groupby(["algorithm", "seed"])
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
    ax.set_xlabel("expected team reward E[R]")
    ax.set_ylabel("expected number of survivors E[S]")


def _draw(ax: Axes, front: FloatArray, style: AlgorithmStyle, label: str) -> None:
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
    ax.plot(
        [],
        [],
        color=style.colour,
        linestyle=style.line,
        linewidth=1.4,
        marker=style.marker,
        markersize=5.5,
        label=label if len(best) else f"{label}: no plans",
        gid="key",
    )
