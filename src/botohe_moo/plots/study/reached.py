"""The picture of the share of targets that runs have reached, over time."""

from collections.abc import Sequence

import numpy as np
import pandas as pd
import seaborn as sns
from matplotlib.axes import Axes

from botohe_moo._base.types import FloatArray
from botohe_moo.indicators import TIE
from botohe_moo.plots.draw.algorithms import axes_of, chosen_algorithms, dashes_of, finish, log_axis
from botohe_moo.plots.draw.style import Palette, palette_of, theme
from botohe_moo.plots.study.curves import NAMES, Progress


def plot_reached(
    trace: pd.DataFrame,
    runs: pd.DataFrame,
    targets: Sequence[float] | FloatArray,
    *,
    x: Progress = "evaluations",
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
    spent = first_reached(trace, runs, targets, x=x, algorithms=algorithms)
    shown = trace.loc[trace["algorithm"].isin(list(spent)) & (trace[x] > 0), x]
    if shown.empty:
        raise ValueError("Expected at least one row of trace, got none.")
    low, high = float(shown.min()), float(shown.max())
    colour = palette_of(spent, palette)
    dashes = dashes_of(colour)
    labels = sorted(spent, key=lambda label: -np.isfinite(spent[label]).mean())
    with theme():
        axes = axes_of(labels, ax)
        for label in labels:
            # What is never reached lies beyond the edge, since seaborn leaves out the infinite.
            within = np.clip(spent[label], low, 2 * high)
            sns.ecdfplot(
                x=within,
                color=colour[label],
                linestyle=dashes[label],
                label=label,
                ax=axes[label],
            )
        first = axes[labels[0]]
        first.set(xlim=(low, high * 1.01), ylim=(-0.02, 1.02))
        log_axis(first)
        return finish(axes, title, NAMES[x], "share of runs × targets reached")


def first_reached(
    trace: pd.DataFrame,
    runs: pd.DataFrame,
    targets: Sequence[float] | FloatArray,
    *,
    x: Progress = "evaluations",
    algorithms: Sequence[str] | None = None,
) -> dict[str, FloatArray]:
    """Return for each algorithm what each pair of a run and a target took; infinite for never.

    Shape (n_runs * n_targets,). Options and errors are those of ``plot_reached``.
    """
    labels = chosen_algorithms("runs", runs, ("algorithm", "seed"), algorithms)
    chosen_algorithms("trace", trace, ("algorithm", "seed", x, "area"), None)
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
