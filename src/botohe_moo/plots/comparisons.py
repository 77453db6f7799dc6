"""Pictures that compare algorithms: their progress, and what they reach when runs end."""

from collections.abc import Sequence
from typing import Any, Literal

import networkx as nx
import numpy as np
import pandas as pd
import seaborn as sns
from matplotlib.axes import Axes

from botohe_moo.base.messages import check_choice
from botohe_moo.base.types import FloatArray
from botohe_moo.indicators import INDICATORS, TIE, further_indicators
from botohe_moo.plots import style as look
from botohe_moo.plots.style import Palette, check_table, chosen_algorithms, log_axis, new_axes

Spent = Literal["evaluations", "seconds"]
Band = Literal["quartiles", "range"]

NAMES = {"evaluations": "evaluations", "seconds": "seconds of the algorithm's own time"}
# Quantiles of the line and of the edges of its band.
_BANDS = {"quartiles": (0.5, 0.25, 0.75), "range": (0.5, 0.0, 1.0)}
_N_POINTS = 200
_GOLDEN = (5**0.5 - 1) / 2  # its multiples spread evenly, whatever their number
_LINEAR = 0.01  # per cent, below which shortfalls are drawn to a linear scale, down to 0
_NO_PARAMETERS = {"algorithm", "name", "family", "package", "version"}


def plot_curves(
    trace: pd.DataFrame,
    *,
    x: Spent = "evaluations",
    value: str = "area",
    algorithms: Sequence[str] | None = None,
    palette: Palette | None = None,
    band: Band = "quartiles",
    bound: float | None = None,
    title: str | None = None,
    ax: Axes | None = None,
) -> Axes:
    """Draw how the area grows over evaluations or seconds: median over runs and quartiles.

    Between two records a run's area is that of the last one, nothing is interpolated. A run that
    ended keeps its last area. A curve begins where all runs of its algorithm have a record. The
    legend lists the algorithms as their curves end, the highest first. The axes of areas begin
    where the upper half of what the curves reach does.

    Parameters
    ----------
    trace
        Rows of one mission in a study's trace: columns ``algorithm``, ``seed``, that of ``value``
        and that of ``x``, one row a recorded front. A run that failed has no rows and is not in
        the median; nor are rows without a value.
    x
        What the horizontal, logarithmic axis shows.
    value
        What the vertical axis shows: ``area``, or on a logarithmic axis ``igd_plus``, ``epsilon``
        or another indicator of the trace; what is a tie with 0 lies below that axis.
    algorithms
        Labels of the algorithms to draw. Default: all of them.
    palette
        Colours as seaborn takes them: the name of a palette, a list, or a colour for each label.
        Default: the colours of the theme that is set, or of seaborn's "colorblind".
    band
        Around the median: ``quartiles``, between a quarter and three quarters of the runs, or
        ``range``, from the smallest to the largest. An algorithm with one run has no band.
    bound
        An area that no front exceeds, such as ``FrontBound.area``: a dashed line, unless it is too
        far from what is shown. Only where ``value`` is ``area``.
    title
        Title of the picture. Default: none.
    ax
        Axes to draw on. A figure will be created if not given.

    Raises
    ------
    ValueError
        If a column is missing, there are rows of several missions or none at all, or an algorithm
        or option is not known, or ``bound`` is not in [0, 1] or given with another ``value``.

    Examples
    --------
    >>> import pandas as pd
    >>> from botohe_moo.plots import plot_curves, save_plot
    >>> trace = pd.DataFrame(
    ...     [("ants", 1, 10, 0.3), ("ants", 1, 100, 0.5), ("greedy", 1, 20, 0.4)],
    ...     columns=["algorithm", "seed", "evaluations", "area"],
    ... )  # of a study: tables.trace.query("mission == 'museum'")
    >>> save_plot(plot_curves(trace, title="The museum"), "curves.png")
    """
    if bound is not None and value != "area":
        raise ValueError(f"Expected no bound, which is of areas, with {value}, got {bound}.")
    check_choice("band", band, _BANDS)
    steps = progress(trace, x=x, value=value, algorithms=algorithms)
    steps[value] = steps[value].where(steps[value].abs() > TIE, 0.0)
    of_runs = steps.groupby(["algorithm", x], observed=True)[value]
    middle, low, high = (of_runs.quantile(share) for share in _BANDS[band])
    known = middle.index.unique("algorithm")
    chosen = [a for a in chosen_algorithms("trace", trace, (), algorithms) if a in known]
    ends = {label: middle[label].iloc[-1] for label in chosen}
    styles = look.line_styles(chosen, palette)
    with look.theme():
        ax = ax or new_axes(7.5, max(4.0, 0.42 * len(chosen)))
        for label in sorted(chosen, key=lambda label: -ends[label]):
            line, style = middle[label], styles[label]
            # Markers are at other places on each curve.
            style["markevery"] = (5 * chosen.index(label) % min(40, len(line)), 40)
            ax.step(line.index, line, where="post", **style)
            shade = {"step": "post", "color": style["color"], "alpha": 0.2, "linewidth": 0}
            ax.fill_between(line.index, low[label], high[label], **shade)
        log_axis(ax)
        if value == "area":
            # Where curves end has to be seen, and at least the upper half of the way there.
            worst, best = min(ends.values()), max(ends.values())
            bottom, top = ax.get_ylim()
            ax.set_ylim(max(bottom, min(2 * worst - best, 0.5 * best)), top)
            look.draw_bound(ax, bound, "y")
        elif (steps[value] > 0).any():
            log_axis(ax, "y")
        return look.finish(ax, title, NAMES[x], INDICATORS[value].in_words)


def progress(
    trace: pd.DataFrame,
    *,
    x: Spent = "evaluations",
    value: str = "area",
    algorithms: Sequence[str] | None = None,
) -> pd.DataFrame:
    """Return what every run has reached at each point of a common logarithmic grid.

    Columns ``algorithm``, ``seed``, those of ``x`` and ``value``; the rows of an algorithm begin
    where all of its runs have a record. Options and errors are those of ``plot_curves``.
    """
    check_choice("x", x, NAMES)
    check_choice("value", value, ("area", *further_indicators([value])))
    labels = chosen_algorithms("trace", trace, ("algorithm", "seed", x, value), algorithms)
    run = ["algorithm", "seed"]
    records = trace.loc[trace["algorithm"].isin(labels), [*run, x, value]].dropna(subset=value)
    if records.empty:
        raise ValueError("Expected at least one row of trace, got none.")
    at = records[x].to_numpy(float)
    # A logarithmic axis has no 0.
    records = records.assign(**{x: np.maximum(at, at[at > 0].min(initial=at.max() or 1.0))})
    records = records.sort_values(x, kind="stable")
    starts = records.groupby(run, observed=True)[x].min()
    starts = starts.groupby("algorithm", observed=True).max()
    low, high = records[x].iloc[[0, -1]]
    grid = np.clip(np.geomspace(low, high, _N_POINTS), low, high)  # rounding may exceed the ends
    points = pd.DataFrame({x: np.unique(np.concatenate([grid, starts]))})
    every = records[run].drop_duplicates().merge(points, how="cross")
    steps = pd.merge_asof(every.sort_values(x, kind="stable"), records, on=x, by=run)
    return steps[steps[x] >= steps["algorithm"].map(starts)]


def plot_reached(
    trace: pd.DataFrame,
    runs: pd.DataFrame,
    targets: Sequence[float] | FloatArray,
    *,
    x: Spent = "evaluations",
    algorithms: Sequence[str] | None = None,
    palette: Palette | None = None,
    title: str | None = None,
    ax: Axes | None = None,
) -> Axes:
    """Draw the share of all pairs of a run and a target that are reached, over evaluations.

    A run reaches a target with its first recorded front of at least that area; one that never does,
    or has no record, counts, too. The legend lists the algorithms as their curves end.

    Parameters
    ----------
    trace
        Rows of one mission in a study's trace: columns ``algorithm``, ``seed``, ``area`` and that
        of ``x``.
    runs
        Rows of the same mission in its runs: columns ``algorithm`` and ``seed``.
    targets
        Areas to be reached, at least one.
    x
        What the horizontal, logarithmic axis shows.
    algorithms, palette, title, ax
        As in :func:`plot_curves`.

    Raises
    ------
    ValueError
        If a column or a target is missing, there are rows of several missions, or an algorithm is
        not known or none has a record.

    References
    ----------
    Hansen, Auger, Ros, Mersmann, Tušar and Brockhoff, "COCO: a platform for comparing continuous
    optimizers in a black-box setting", Optimization Methods and Software 36, 2021: runtime
    distributions over pairs of runs and targets.

    Examples
    --------
    >>> import pandas as pd
    >>> from botohe_moo.plots import plot_reached, save_plot
    >>> trace = pd.DataFrame(
    ...     [("ants", 1, 10, 0.3), ("ants", 1, 100, 0.5), ("greedy", 1, 20, 0.4)],
    ...     columns=["algorithm", "seed", "evaluations", "area"],
    ... )  # of a study: tables.trace.query("mission == 'museum'")
    >>> runs = pd.DataFrame({"algorithm": ["ants", "greedy"], "seed": 1})
    >>> save_plot(plot_reached(trace, runs, targets=[0.35, 0.45]), "reached.png")
    """
    check_table("trace", trace, ("algorithm", "seed", x, "area"))
    spent = first_reached(trace, runs, targets, x=x, algorithms=algorithms)
    shown = trace.loc[trace["algorithm"].isin(list(spent)) & (trace[x] > 0), x]
    if shown.empty:
        raise ValueError("Expected at least one row of trace, got none.")
    low, high = float(shown.min()), float(shown.max())
    styles = look.line_styles(spent, palette)
    labels = sorted(spent, key=lambda label: -np.isfinite(spent[label]).mean())
    with look.theme():
        ax = ax or new_axes(7.5, max(4.0, 0.42 * len(labels)))
        for label in labels:
            # What is never reached lies beyond the edge, since seaborn leaves out the infinite.
            within = np.clip(spent[label], low, 2 * high)
            sns.ecdfplot(x=within, ax=ax, markevery=0.15, **styles[label])
        ax.set(xlim=(low, high * 1.01), ylim=(-0.02, 1.02))
        log_axis(ax)
        return look.finish(ax, title, NAMES[x], "share of runs × targets reached")


def first_reached(
    trace: pd.DataFrame,
    runs: pd.DataFrame,
    targets: Sequence[float] | FloatArray,
    *,
    x: Spent = "evaluations",
    algorithms: Sequence[str] | None = None,
) -> dict[str, FloatArray]:
    """Return for each algorithm what each pair of a run and a target took; infinite for never.

    Shape (n_runs * n_targets,). Options and errors are those of ``plot_reached``.
    """
    labels = chosen_algorithms("runs", runs, ("algorithm", "seed"), algorithms)
    wanted = np.sort(np.asarray(targets, float))
    if not len(wanted) or not np.isfinite(wanted).all():
        raise ValueError(f"Expected at least one target, all finite, got {list(targets)}.")
    ordered = trace.sort_values(x, kind="stable")
    records = dict(iter(ordered.groupby(["algorithm", "seed"], observed=True)))
    spent: dict[str, list[FloatArray]] = {label: [] for label in labels}
    for label, seed in runs.loc[runs["algorithm"].isin(labels), ["algorithm", "seed"]].to_numpy():
        run = records.get((label, seed), trace.iloc[:0])
        best = np.maximum.accumulate(run["area"].to_numpy(float))
        first = np.searchsorted(best, wanted - TIE)
        spent[label].append(np.append(run[x].to_numpy(float), np.inf)[first])
    return {label: np.concatenate(of_runs) for label, of_runs in spent.items()}


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
    diamonds: dict[str, Any] = {"fmt": "d", "color": look.INK, "markersize": 6, "elinewidth": 1.5}
    with look.theme():
        ax = ax or new_axes(7.5, 0.9 + 0.4 * max(len(labels), 2))
        sns.scatterplot(rows, x="area", y="row", ax=ax, legend=False, **points)
        above = np.arange(len(labels)) - 0.32
        ax.errorbar(median, above, xerr=[median - low, high - median], zorder=3, **diamonds)
        ax.set_ylim(len(labels) - 0.5, -0.7)
        ax.tick_params(axis="y", length=0)
        ax.set_yticks(range(len(labels)), look.wrapped(labels))
        ax.locator_params(axis="x", nbins=7)  # areas that differ little have long numbers
        look.draw_bound(ax, bound, "x")
        look.finish(ax, title, "area of the final front (normalised hypervolume)", "")
    return ax


def _in_colours(labels: Sequence[str], palette: Palette | None) -> dict[str, Any]:
    """Return how points are drawn in the colours of their algorithms."""
    return {"hue": "algorithm", "palette": look.palette_of(labels, palette), "clip_on": False}


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
    colours = look.palette_of(labels, palette)
    with look.theme():
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
    with look.theme():
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
    with look.theme():
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
        look.finish(ax, title, meaning, "")
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
