"""Pictures of runs over time: how areas grow or distances shrink, and targets that are reached."""

from collections.abc import Sequence
from typing import Literal

import numpy as np
import pandas as pd
import seaborn as sns
from matplotlib.axes import Axes

from botohe_moo.base.messages import check_choice
from botohe_moo.base.types import FloatArray
from botohe_moo.indicators import INDICATORS, TIE, further_indicators
from botohe_moo.plots import shared
from botohe_moo.plots.shared import check_table, chosen_algorithms, log_axis
from botohe_moo.plots.style import Palette, new_axes, theme

Spent = Literal["evaluations", "seconds"]
Band = Literal["quartiles", "range"]

NAMES = {"evaluations": "evaluations", "seconds": "seconds of the algorithm's own time"}
# Quantiles of the line and of the edges of its band.
_BANDS = {"quartiles": (0.5, 0.25, 0.75), "range": (0.5, 0.0, 1.0)}
_N_POINTS = 200


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
    styles = shared.line_styles(chosen, palette)
    with theme():
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
            shared.draw_bound(ax, bound, "y")
        elif (steps[value] > 0).any():
            log_axis(ax, "y")
        return shared.finish(ax, title, NAMES[x], INDICATORS[value].in_words)


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
    styles = shared.line_styles(spent, palette)
    labels = sorted(spent, key=lambda label: -np.isfinite(spent[label]).mean())
    with theme():
        ax = ax or new_axes(7.5, max(4.0, 0.42 * len(labels)))
        for label in labels:
            # What is never reached lies beyond the edge, since seaborn leaves out the infinite.
            within = np.clip(spent[label], low, 2 * high)
            sns.ecdfplot(x=within, ax=ax, markevery=0.15, **styles[label])
        ax.set(xlim=(low, high * 1.01), ylim=(-0.02, 1.02))
        log_axis(ax)
        return shared.finish(ax, title, NAMES[x], "share of runs × targets reached")


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
    records = dict(
        iter(trace.sort_values(x, kind="stable").groupby(["algorithm", "seed"], observed=True))
    )
    spent: dict[str, list[FloatArray]] = {label: [] for label in labels}
    for label, seed in runs.loc[runs["algorithm"].isin(labels), ["algorithm", "seed"]].to_numpy():
        run = records.get((label, seed), trace.iloc[:0])
        best = np.maximum.accumulate(run["area"].to_numpy(float))
        first = np.searchsorted(best, wanted - TIE)
        spent[label].append(np.append(run[x].to_numpy(float), np.inf)[first])
    return {label: np.concatenate(of_runs) for label, of_runs in spent.items()}
