"""How far algorithms are from the reference fronts of all missions, and what is certified."""

from collections.abc import Sequence

import pandas as pd
import seaborn as sns
from matplotlib.axes import Axes

from botohe_moo.plots.draw.algorithms import add_legend_beside, check_table, chosen_algorithms
from botohe_moo.plots.draw.style import Palette, new_axes, palette_of, theme

_LINEAR = 0.01  # per cent, below which shortfalls are drawn to a linear scale, down to 0


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
        ax.barh(names, gaps, 0.7, color="0.88", zorder=0, label="certified gap")
        sns.scatterplot(
            rows,
            x="shortfall",
            y="mission",
            hue="algorithm",
            style="algorithm",
            palette=palette_of(labels, palette),
            alpha=0.85,
            clip_on=False,
            zorder=3,
            ax=ax,
        )
        ax.set_xscale("symlog", linthresh=_LINEAR)
        ax.set_xlim(left=0.0)
        ax.xaxis.set_major_formatter(lambda value, _: f"{value:g}")
        ax.set_ylim(len(names) - 0.5, -0.5)
        ax.tick_params(axis="y", length=0)
        ax.set(
            xlabel="per cent below the reference front (points), or above it at most (bars)",
            ylabel="",
            title=title or "",
        )
        add_legend_beside(ax)
    return ax
