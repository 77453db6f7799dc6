"""The critical-difference diagram: average ranks, and whose differences may be chance."""

import pandas as pd
from matplotlib.axes import Axes

from botohe_moo.plots.draw.algorithms import chosen_algorithms
from botohe_moo.plots.draw.style import Palette, new_axes, palette_of, theme


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
    Learning Research 7, 2006; drawn by ``scikit_posthocs.critical_difference_diagram``.

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
    chosen_algorithms("posthoc", posthoc, ("algorithm", "other", "significant"), None)
    if len(labels) < 2:
        raise ValueError(f"Expected ranks of at least two algorithms, got {len(labels)}.")
    # Late, as it imports statsmodels, which no other picture needs.
    from scikit_posthocs import critical_difference_diagram

    average = ranks.set_index("algorithm")["average_rank"].astype(float)
    p_values = pd.DataFrame(1.0, index=labels, columns=labels)
    drawn = posthoc["algorithm"].isin(labels) & posthoc["other"].isin(labels)
    apart = posthoc.loc[drawn & posthoc["significant"], ["algorithm", "other"]]
    for one, other in apart.to_numpy():
        p_values.loc[one, other] = p_values.loc[other, one] = 0.0
    with theme():
        ax = ax or new_axes(8.5, 0.9 + 0.16 * len(labels))
        critical_difference_diagram(
            average,
            p_values,
            ax=ax,
            label_fmt_left="{label}  ({rank:.2f})",
            label_fmt_right="({rank:.2f})  {label}",
            color_palette=palette_of(labels, palette),
        )
        ax.grid(visible=False)
        ax.spines["top"].set_visible(True)
        ax.set_xlim(1, len(labels))
        ax.set_title(title or "", pad=24)
    return ax


def overruled(posthoc: pd.DataFrame) -> bool:
    """Return whether Friedman's test finds no difference, so that pairs apart do not count."""
    apart = posthoc["difference"].abs() > posthoc["critical_difference"] + 1e-9  # by rounding
    return bool(apart.any() and not posthoc["significant"].any())
