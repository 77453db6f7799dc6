"""The picture of the share of targets that runs have reached, over time."""

from collections.abc import Mapping, Sequence

import numpy as np
import pandas as pd
from matplotlib.axes import Axes

from botohe_moo._base.types import FloatArray
from botohe_moo.indicators import TIE
from botohe_moo.plots.draw.algorithms import AlgorithmStyle, chosen_algorithms, stroke, styles_of
from botohe_moo.plots.draw.panels import open_algorithm_axes
from botohe_moo.plots.draw.scales import label_ends, log_axis
from botohe_moo.plots.draw.style import theme
from botohe_moo.plots.study.curves import NAMES, Progress, records_of, stairs

_Y = "share of runs × targets reached"


def plot_reached(
    trace: pd.DataFrame,
    runs: pd.DataFrame,
    targets: Sequence[float] | FloatArray,
    *,
    x: Progress = "evaluations",
    algorithms: Sequence[str] | None = None,
    styles: Mapping[str, AlgorithmStyle] | None = None,
    title: str | None = None,
    ax: Axes | None = None,
) -> Axes:
    """Draw the share of all pairs of a run and a target that are reached, over evaluations.

    A run reaches a target with its first recorded front of at least that area; one that never does,
    or has no record, counts, too.

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
    algorithms, styles, title, ax
        As in :func:`plot_curves`, with panels from twelve algorithms on.

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
    shares = reached_shares(trace, runs, targets, x=x, algorithms=algorithms)
    styles = styles_of(list(shares), styles)
    lasts = [points[-1, 0] for points in shares.values() if len(points)]
    starts = [points[0, 0] for points in shares.values() if len(points)]
    if not starts:
        raise ValueError("Expected at least one row of trace, got none.")
    low, high = float(min(starts)), float(max(lasts))
    lines = {label: _line(points, low, high) for label, points in shares.items()}
    words = f"{len(targets)} target{'' if len(targets) == 1 else 's'} for each run"
    with theme():
        axes = open_algorithm_axes(lines, styles, ax, size=(6.0, 3.7))
        log_axis(axes.first, low, high, small=not axes.in_panels)
        axes.first.set_ylim(-0.02, 1.02)
        for label, own in axes.of.items():
            own.plot(*lines[label].T, **stroke(styles[label], 2.0), zorder=3, gid="reached")
        axes.finish(title, words, NAMES[x], _Y)
        if not axes.in_panels:
            ends = {label: float(line[-1, 1]) for label, line in lines.items()}
            label_ends(axes.first, ends, styles)
    return axes.first


def reached_shares(
    trace: pd.DataFrame,
    runs: pd.DataFrame,
    targets: Sequence[float] | FloatArray,
    *,
    x: Progress = "evaluations",
    algorithms: Sequence[str] | None = None,
) -> dict[str, FloatArray]:
    """Give for each algorithm pairs (n, 2) of progress and share of reached targets, ascending.

    They go from the first record of any of its runs to the last one; (0, 2) if no run has a record.
    Options and errors are those of ``plot_reached``.
    """
    labels = chosen_algorithms("runs", runs, ("algorithm", "seed"), algorithms)
    chosen_algorithms("trace", trace, ("algorithm", "seed", x, "area"), None)
    wanted = np.sort(np.asarray(targets, float))
    if not len(wanted) or not np.isfinite(wanted).all():
        raise ValueError(f"Expected at least one target, all finite, got {list(targets)}.")
    n_runs = runs["algorithm"].value_counts()
    records = records_of(trace, x, "area", labels)
    return {label: _shares(records.get(label, []), wanted, int(n_runs[label])) for label in labels}


def _shares(runs: Sequence[FloatArray], targets: FloatArray, n_runs: int) -> FloatArray:
    if not runs:
        return np.empty((0, 2))
    at, n_reached = [], []
    for run in runs:
        best = np.maximum.accumulate(run[:, 1])
        done = np.searchsorted(targets, best + TIE, side="right")
        at.append(run[:, 0])
        n_reached.append(np.diff(done, prepend=0))
    x, steps = np.concatenate(at), np.concatenate(n_reached)
    order = np.argsort(x, kind="stable")
    share = np.cumsum(steps[order]) / (n_runs * len(targets))
    x = x[order]
    last = np.append(x[1:] != x[:-1], True)  # of several records at once, all count
    return np.column_stack([x[last], share[last]])


def _line(points: FloatArray, low: float, high: float) -> FloatArray:
    """Give the steps from the lower left to the right edge."""
    if not len(points):
        return np.array([[low, 0.0], [high, 0.0]])
    x = np.concatenate([[low], points[:, 0], [high]])
    share = np.concatenate([[0.0], points[:, 1], points[-1:, 1]])
    return stairs(x, share)
