"""The picture of the final areas of all runs on a mission."""

from collections.abc import Sequence

import pandas as pd
import seaborn as sns
from matplotlib.axes import Axes

from botohe_moo._base.checks import check_number
from botohe_moo.plots.draw.algorithms import chosen_algorithms, draw_bound, wrapped
from botohe_moo.plots.draw.style import INK, Palette, new_axes, palette_of, theme

_GOLDEN = (5**0.5 - 1) / 2  # its multiples spread evenly, whatever their number


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
    if bound is not None:
        check_number("bound", bound, at_least=0, at_most=1)
    labels = chosen_algorithms("runs", runs, ("algorithm", "seed", "status", "area"), algorithms)
    if not labels:
        raise ValueError("Expected at least one algorithm, got none.")
    interval = ["area_median", "area_low", "area_high"]
    chosen_algorithms("summary", summary, ("algorithm", *interval), labels)
    rows = runs[runs["algorithm"].isin(labels)].sort_values("seed", kind="stable")
    row = rows["algorithm"].map({label: i for i, label in enumerate(labels)})
    # Spread by number: stripplot's jitter would come from numpy's global generator.
    spread = rows.groupby("algorithm").cumcount() * _GOLDEN % 1 - 0.5
    rows = rows.assign(row=row + 0.1 + 0.4 * spread, is_done=rows["status"] == "done")
    # The median of the three is the median, and their range the interval; above the runs.
    medians = summary[["algorithm", *interval]].melt("algorithm", value_name="area")
    medians["row"] = medians["algorithm"].map({label: i - 0.32 for i, label in enumerate(labels)})
    with theme():
        ax = ax or new_axes(7.5, 0.9 + 0.4 * max(len(labels), 2))
        sns.scatterplot(
            rows,
            x="area",
            y="row",
            hue="algorithm",
            palette=palette_of(labels, palette),
            style="is_done",
            markers={True: "o", False: "X"},
            alpha=0.6,
            legend=False,
            clip_on=False,
            ax=ax,
        )
        sns.pointplot(
            medians,
            x="area",
            y="row",
            estimator="median",
            errorbar=("pi", 100),
            orient="y",
            native_scale=True,
            linestyle="none",
            color=INK,
            marker="d",
            markersize=6,
            err_kws={"linewidth": 1.5},
            ax=ax,
        )
        ax.set_ylim(len(labels) - 0.5, -0.7)
        ax.tick_params(axis="y", length=0)
        ax.set_yticks(range(len(labels)), wrapped(labels))
        ax.set(xlabel="area of the final front (normalised hypervolume)", ylabel="")
        ax.set_title(title or "")
        if bound is not None:
            low, high = ax.get_xlim()
            ax.set_xlim(low, draw_bound([ax], bound, low, high, "x"))
            if ax.get_legend_handles_labels()[0]:
                ax.legend(loc="upper left", bbox_to_anchor=(1.0, 1.0))
    return ax
