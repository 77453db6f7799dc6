"""Pictures that compare algorithms at the end of their runs: areas, ranks, medians, shortfalls."""

from collections.abc import Sequence
from typing import Any

import networkx as nx
import numpy as np
import pandas as pd
import seaborn as sns
from matplotlib.axes import Axes

from botohe_moo.plots import shared
from botohe_moo.plots.shared import check_table, chosen_algorithms
from botohe_moo.plots.style import INK, Palette, new_axes, palette_of, theme

_GOLDEN = (5**0.5 - 1) / 2  # its multiples spread evenly, whatever their number
_LINEAR = 0.01  # per cent, below which shortfalls are drawn to a linear scale, down to 0
_NO_PARAMETERS = {"algorithm", "name", "family", "package", "version"}


def plot_areas(
    runs: pd.DataFrame,
    summary: pd.DataFrame,
    *,
    algorithms: Sequence[str] | None = None,
    palette: Palette | None = None,
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
    algorithms, palette, bound, title, ax
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
    labels = chosen_algorithms("runs", runs, ("algorithm", "seed", "status", "area"), algorithms)
    interval = ["area_median", "area_low", "area_high"]
    chosen_algorithms("summary", summary, ("algorithm", *interval), labels)
    rows = runs[runs["algorithm"].isin(labels)].sort_values("seed", kind="stable")
    row = rows["algorithm"].map({label: i for i, label in enumerate(labels)})
    # Spread by number: stripplot's jitter would come from numpy's global generator.
    spread = rows.groupby("algorithm").cumcount() * _GOLDEN % 1 - 0.5
    rows = rows.assign(row=row + 0.1 + 0.4 * spread, is_done=rows["status"] == "done")
    median, low, high = summary.set_index("algorithm").loc[labels, interval].to_numpy(float).T
    points = _in_colours(labels, palette) | {"style": "is_done", "alpha": 0.6}
    points["markers"] = {True: "o", False: "X"}
    diamonds: dict[str, Any] = {"fmt": "d", "color": INK, "markersize": 6, "elinewidth": 1.5}
    with theme():
        ax = ax or new_axes(7.5, 0.9 + 0.4 * max(len(labels), 2))
        sns.scatterplot(rows, x="area", y="row", ax=ax, legend=False, **points)
        above = np.arange(len(labels)) - 0.32
        ax.errorbar(median, above, xerr=[median - low, high - median], zorder=3, **diamonds)
        ax.set_ylim(len(labels) - 0.5, -0.7)
        ax.tick_params(axis="y", length=0)
        ax.set_yticks(range(len(labels)), shared.wrapped(labels))
        ax.locator_params(axis="x", nbins=7)  # areas that differ little have long numbers
        shared.draw_bound(ax, bound, "x")
        shared.finish(ax, title, "area of the final front (normalised hypervolume)", "")
    return ax


def _in_colours(labels: Sequence[str], palette: Palette | None) -> dict[str, Any]:
    """Return how points are drawn in the colours of their algorithms."""
    return {"hue": "algorithm", "palette": palette_of(labels, palette), "clip_on": False}


def plot_ranks(
    ranks: pd.DataFrame,
    posthoc: pd.DataFrame,
    *,
    palette: Palette | None = None,
    title: str | None = None,
    ax: Axes | None = None,
) -> Axes:
    """Draw average ranks on a line, the best left, and bars over those that do not differ.

    Parameters
    ----------
    ranks
        Rows of one indicator in a study's ranks: columns ``algorithm`` and ``average_rank``.
    posthoc
        Rows of the same indicator in its post-hoc tests: columns ``algorithm``, ``other`` and
        ``significant``, one row a pair.
    palette, title, ax
        As in :func:`plot_curves`.

    Raises
    ------
    ValueError
        If a column is missing, or there are fewer than two algorithms.

    References
    ----------
    Demšar, "Statistical comparisons of classifiers over multiple data sets", Journal of Machine
    Learning Research 7, 2006.

    Examples
    --------
    >>> import pandas as pd
    >>> from botohe_moo.plots import plot_ranks, save_plot
    >>> ranks = pd.DataFrame(
    ...     {"algorithm": ["ants", "greedy"], "average_rank": [1.2, 1.8]}
    ... )
    >>> posthoc = pd.DataFrame(
    ...     [("ants", "greedy", False)],
    ...     columns=["algorithm", "other", "significant"],
    ... )
    >>> save_plot(plot_ranks(ranks, posthoc), "ranks.png")
    """
    labels = chosen_algorithms("ranks", ranks, ("algorithm", "average_rank"), None)
    check_table("posthoc", posthoc, ("algorithm", "other", "significant"))
    if len(labels) < 2:
        raise ValueError(f"Expected ranks of at least two algorithms, got {len(labels)}.")
    average = ranks.set_index("algorithm")["average_rank"].astype(float).sort_values()
    apart = posthoc.loc[posthoc["significant"], ["algorithm", "other"]]
    alike = nx.complete_graph(labels)
    alike.remove_edges_from(map(tuple, apart.to_numpy()))
    joined = [average[[*group]] for group in nx.find_cliques(alike) if len(group) > 1]
    colours = palette_of(labels, palette)
    with theme():
        ax = ax or new_axes(8.5, 0.9 + 0.16 * len(labels))
        spans = sorted((group.min(), group.max()) for group in joined)
        for depth, span in enumerate(spans, start=1):
            ax.plot(span, [-depth, -depth], "k", linewidth=2, zorder=3)
        half = (len(average) + 1) // 2
        sides = [("right", average[:half], average.iloc[0] - 0.01)]
        sides.append(("left", average[half:][::-1], average.iloc[-1] + 0.01))
        for side, names, x in sides:
            for y, (label, rank) in enumerate(names.items(), start=len(spans) + 1):
                colour = colours[str(label)]
                said = f"{label}  ({rank:.2f})" if side == "right" else f"({rank:.2f})  {label}"
                ax.plot([x, rank, rank], [-y, -y, 0], color=colour)
                ax.scatter(rank, 0, color=colour, zorder=3)
                ax.text(x, -y, said, color=colour, ha=side, va="center")
        ax.yaxis.set_visible(False)
        ax.spines[["left", "right", "bottom"]].set_visible(False)
        ax.xaxis.set_ticks_position("top")
        ax.spines["top"].set_position("zero")
        ax.grid(visible=False)
        ax.spines["top"].set_visible(True)
        ax.set_xlim(1, len(labels))
        ax.set_title(title or "", pad=24)
    return ax


def plot_heat(
    medians: pd.DataFrame,
    *,
    palette: str = "crest",
    title: str | None = None,
    ax: Axes | None = None,
) -> Axes:
    """Draw the median of every combination of two parameters, the darker the larger.

    The largest is bold.

    Parameters
    ----------
    medians
        One row for each value of the first parameter, one column for each of the second; the names
        of index and columns are those of the parameters. What is missing stays empty.
    palette
        Name of a sequential palette.
    title, ax
        As in :func:`plot_curves`.

    Raises
    ------
    ValueError
        If no combination has a median.

    Examples
    --------
    >>> import pandas as pd
    >>> from botohe_moo.plots import plot_heat, save_plot
    >>> medians = pd.DataFrame(
    ...     [[0.48, 0.51], [0.50, 0.52]],
    ...     index=pd.Index([50, 100], name="n_ants"),
    ...     columns=pd.Index([0.04, 0.1], name="evaporation"),
    ... )
    >>> save_plot(plot_heat(medians), "grid.png")
    """
    values = medians.astype(float)
    if not values.notna().any(axis=None):
        raise ValueError("Expected the median of at least one combination, got none.")
    n_rows, n_columns = values.shape
    with theme():
        ax = ax or new_axes(1.8 + 1.0 * n_columns, 1.2 + 0.55 * n_rows)
        sns.heatmap(values, annot=True, fmt=".4f", cmap=palette, cbar=False, ax=ax)
        ax.grid(visible=False)
        ax.tick_params(length=0, rotation=0)
        ax.set_title(title or "")
        for text in ax.texts:
            if text.get_text() == f"{np.nanmax(values):.4f}":
                text.set_fontweight("bold")
    return ax


def plot_shortfalls(
    summary: pd.DataFrame,
    missions: pd.DataFrame,
    *,
    algorithms: Sequence[str] | None = None,
    palette: Palette | None = None,
    title: str | None = None,
    ax: Axes | None = None,
) -> Axes:
    """Draw how far each algorithm's mean area is from the reference front's, on each mission.

    Bars reach to what is certified: from the reference front up to the bound, where there is one.

    Parameters
    ----------
    summary
        A study's summary: columns ``mission``, ``algorithm``, ``area_mean`` and ``area_share``.
    missions
        Its missions: columns ``mission`` and ``bound_area``; from top to bottom.
    algorithms, palette, title, ax
        As in :func:`plot_curves`.

    Raises
    ------
    ValueError
        If a column is missing, or an algorithm is not known.

    Examples
    --------
    >>> import pandas as pd
    >>> from botohe_moo.plots import plot_shortfalls, save_plot
    >>> summary = pd.DataFrame(
    ...     [("toy", "ants", 0.4, 0.8), ("toy", "greedy", 0.45, 0.9)],
    ...     columns=["mission", "algorithm", "area_mean", "area_share"],
    ... )
    >>> missions = pd.DataFrame({"mission": ["toy"], "bound_area": [0.51]})
    >>> save_plot(plot_shortfalls(summary, missions), "shortfalls.png")
    """
    # Without rows, since tables have to be of one mission otherwise.
    check_table("missions", missions[:0], ("mission", "bound_area"))
    check_table("summary", summary[:0], ("mission", "area_mean", "area_share"))
    labels = chosen_algorithms(
        "summary", summary.drop(columns="mission"), ("algorithm",), algorithms
    )
    names = [name for name in missions["mission"] if name in set(summary["mission"])]
    rows = summary[summary["algorithm"].isin(labels)]
    rows = rows.assign(shortfall=(100 * (1 - rows["area_share"])).clip(lower=0.0))
    whole = (summary["area_mean"] / summary["area_share"]).groupby(summary["mission"]).first()
    bounds = missions.set_index("mission")["bound_area"].reindex(names)
    gaps = 100 * (bounds.to_numpy(float) / whole.reindex(names).to_numpy(float) - 1)
    with theme():
        ax = ax or new_axes(7.5, 1.2 + 0.26 * max(len(names), 4))
        meaning = "per cent below the reference front"
        if bounds.notna().any():
            ax.barh(names, gaps, 0.7, color="0.88", zorder=0, label="certified gap")
            meaning += " (points), or above it at most (bars)"
        points = {**_in_colours(labels, palette), "style": "algorithm", "alpha": 0.85, "zorder": 3}
        sns.scatterplot(rows, x="shortfall", y="mission", ax=ax, **points)
        ax.set_xscale("symlog", linthresh=_LINEAR)
        ax.set_xlim(left=0.0)
        ax.xaxis.set_major_formatter(lambda value, _: f"{value:g}")
        ax.set_ylim(len(names) - 0.5, -0.5)
        ax.tick_params(axis="y", length=0)
        shared.finish(ax, title, meaning, "")
    return ax


def two_parameter_grids(algorithms: pd.DataFrame) -> dict[str, pd.DataFrame]:
    """Find families of algorithms in which exactly two parameters vary, and nothing else does.

    Returns for each family the algorithms' labels: a row for each value of the first parameter, a
    column for each of the second, in ascending order; missing where there is no such algorithm.
    """
    parameters = [column for column in algorithms.columns if column not in _NO_PARAMETERS]
    grids = {}
    for family, rows in algorithms.groupby("family", sort=False):
        shown = rows[parameters].astype(object).where(rows[parameters].notna(), "default")
        varying = [name for name in parameters if len(set(shown[name])) > 1]
        if len(varying) != 2 or len(set(rows["name"])) > 1 or shown.duplicated(varying).any():
            continue
        by_values = pd.MultiIndex.from_frame(shown[varying])
        grids[str(family)] = rows["algorithm"].set_axis(by_values).unstack()  # noqa: PD010
    return grids
