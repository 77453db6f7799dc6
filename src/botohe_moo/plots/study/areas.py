"""The picture of the final areas of all runs on a mission."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.axes import Axes

from botohe_moo._base.checks import check_number
from botohe_moo.plots.draw.algorithms import (
    AlgorithmStyle,
    chosen_algorithms,
    marks,
    names_of,
    styles_of,
)
from botohe_moo.plots.draw.panels import study_axes
from botohe_moo.plots.draw.scales import title_above
from botohe_moo.plots.draw.style import INK, dress, theme, tint
from botohe_moo.plots.study.bounds import draw_bound

_GOLDEN = (5**0.5 - 1) / 2  # its multiples spread evenly, whatever their number


def plot_areas(
    runs: pd.DataFrame,
    summary: pd.DataFrame,
    *,
    algorithms: Sequence[str] | None = None,
    styles: Mapping[str, AlgorithmStyle] | None = None,
    bound: float | None = None,
    title: str | None = None,
    ax: Axes | None = None,
) -> Axes:
    """Draw the final area of every run as a point, and each algorithm's median with its interval.

    Parameters
    ----------
    runs
        Rows of one mission in a study's runs: columns ``algorithm``, ``seed``, ``status`` and
        ``area``. Runs that are not done are crosses, where they are scored: at 0 without a front.
    summary
        Rows of the same mission in the summary: columns ``algorithm``, ``area_median``,
        ``area_low`` and ``area_high``.
    algorithms, styles, bound, title, ax
        As in :func:`plot_curves`; algorithms from top to bottom.

    Raises
    ------
    ValueError
        If a column is missing, there are rows of several missions, or an algorithm is not known or
        has no row in ``summary``, or ``bound`` is not in [0, 1].

    Examples
    --------
    >>> import pandas as pd
    >>> from botohe_moo.plots import plot_areas, save_plot
    >>> runs = pd.DataFrame(
    ...     [("ants", 1, "done", 0.5), ("ants", 2, "done", 0.4), ("greedy", 1, "done", 0.3)],
    ...     columns=["algorithm", "seed", "status", "area"],
    ... )  # of a study: tables.runs.query("mission == 'museum'")
    >>> summary = pd.DataFrame(
    ...     [("ants", 0.45, 0.4, 0.5), ("greedy", 0.3, 0.3, 0.3)],
    ...     columns=["algorithm", "area_median", "area_low", "area_high"],
    ... )
    >>> save_plot(plot_areas(runs, summary), "areas.png")
    """
    if bound is not None:
        check_number("bound", bound, at_least=0, at_most=1)
    labels = chosen_algorithms("runs", runs, ("algorithm", "seed", "status", "area"), algorithms)
    interval = ("algorithm", "area_median", "area_low", "area_high")
    chosen_algorithms("summary", summary, interval, labels)
    medians = summary.set_index("algorithm")
    styles = styles_of(labels, styles)
    with theme():
        names = names_of(labels, styles)
        if ax is None:
            lines = max(name.count("\n") + 1 for name in names.values())
            (ax,) = study_axes(6.0, max(0.42, 0.18 * lines + 0.08) * max(len(labels), 2))
        dress(ax)
        for row, label in enumerate(labels):
            _draw_runs(ax, row, runs[runs["algorithm"] == label], styles[label])
            median, *ends = medians.loc[label, list(interval[1:])].to_numpy(float)
            above = row - 0.28  # where it hides no run
            ax.plot(ends, [above] * 2, color=INK, linewidth=1.8, zorder=3, gid="interval")
            ax.plot([median], [above], color=INK, marker="d", markersize=6, zorder=4, gid="median")
        ax.set_yticks(range(len(labels)), list(names.values()))
        ax.set_ylim(len(labels) - 0.4, -0.6)
        ax.tick_params(axis="y", length=0)
        ax.set_xlabel("area of the final front (normalised hypervolume)")
        crosses = "; crosses: runs that are not done" if (runs["status"] != "done").any() else ""
        words = f"points: runs; above them their median and its interval{crosses}"
        low, high = ax.dataLim.intervalx
        if bound is not None:
            high, said = draw_bound([ax], bound, low, high, "x")
            words += said
        title_above(ax, title, words)
        margin = max(0.04 * (high - low), 0.005)
        ax.set_xlim(max(low - margin, -0.3 * margin), high + margin)
    return ax


def _draw_runs(ax: Axes, row: int, runs: pd.DataFrame, style: AlgorithmStyle) -> None:
    runs = runs.sort_values("seed", kind="stable")
    # Spread by number, not by chance: the same runs lie at the same places every time.
    places = row + 0.1 + 0.44 * ((np.arange(len(runs)) + 1) * _GOLDEN % 1 - 0.5)
    done = (runs["status"] == "done").to_numpy()
    areas = runs["area"].to_numpy(float)
    points: dict[str, Any] = {"linestyle": "none", "clip_on": False, "zorder": 2}
    pale = {**marks(style, 5.0, rim=0.4), "color": tint(style.colour, 0.75)}
    ax.plot(areas[done], places[done], gid="runs", **pale, **points)
    cross: dict[str, Any] = {"marker": "x", "markersize": 5.5, "markeredgewidth": 1.4}
    ax.plot(areas[~done], places[~done], color=style.colour, gid="not done", **cross, **points)
