"""The critical-difference diagram: average ranks, and whose differences may be chance."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.axes import Axes

from botohe_moo.plots.draw.algorithms import AlgorithmStyle, chosen_algorithms, names_of, styles_of
from botohe_moo.plots.draw.panels import study_axes
from botohe_moo.plots.draw.scales import title_above
from botohe_moo.plots.draw.style import INK, theme

_LINE = 0.19  # inches
_WIDTH = 5.4
_GROUP = 0.11


def plot_ranks(
    ranks: pd.DataFrame,
    posthoc: pd.DataFrame,
    *,
    styles: Mapping[str, AlgorithmStyle] | None = None,
    title: str | None = None,
) -> Axes:
    """Draw average ranks on a line, the best left, and bars over those that do not differ.

    Parameters
    ----------
    ranks
        Rows of one indicator in a study's ranks: columns ``algorithm``, ``average_rank`` and
        ``n_missions``.
    posthoc
        Rows of the same indicator in its post-hoc tests: columns ``algorithm``, ``other``,
        ``difference``, ``critical_difference`` and ``significant``, one row a pair.
    styles, title
        As in :func:`plot_curves`; the title is that of the study.

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
    ...     {"algorithm": ["ants", "greedy"], "average_rank": [1.2, 1.8], "n_missions": 5}
    ... )
    >>> posthoc = pd.DataFrame(
    ...     [("ants", "greedy", -0.6, 0.9, False)],
    ...     columns=["algorithm", "other", "difference", "critical_difference", "significant"],
    ... )
    >>> save_plot(plot_ranks(ranks, posthoc), "ranks.png")
    """
    columns = ("algorithm", "average_rank", "n_missions")
    labels = chosen_algorithms("ranks", ranks, columns, None)
    tested = ("algorithm", "other", "difference", "critical_difference", "significant")
    chosen_algorithms("posthoc", posthoc, tested, None)
    if len(labels) < 2:
        raise ValueError(f"Expected ranks of at least two algorithms, got {len(labels)}.")
    average = dict(zip(ranks["algorithm"], ranks["average_rank"].astype(float), strict=True))
    labels = sorted(labels, key=lambda label: (average[label], labels.index(label)))
    groups = groups_alike(labels, posthoc)
    styles = styles_of(labels, styles)
    names = names_of(labels, styles)
    difference = posthoc["critical_difference"].dropna().astype(float)
    n_left = (len(labels) + 1) // 2
    with theme():
        first = 0.2 + _GROUP * len(groups) + 0.12  # inches below the axis of the first name
        drops = _drops(labels[:n_left], names, first), _drops(labels[n_left:][::-1], names, first)
        height = max(d for side in drops for d in side.values()) + 0.2
        (ax,) = study_axes(_WIDTH, height)
        ax.set(xlim=(1, len(labels)), ylim=(height, 0))
        ax.spines[["left", "right", "bottom"]].set_visible(False)
        ax.spines["top"].set_linewidth(1.2)
        ax.xaxis.tick_top()
        ax.set_xticks(np.arange(1, len(labels) + 1, max(1, len(labels) // 10)))
        ax.tick_params(axis="x", pad=1, labelsize=9)
        ax.set_yticks([])
        for side, left in zip(drops, (True, False), strict=True):
            for label, drop in side.items():
                _draw_name(ax, names[label], average[label], drop, styles[label], left=left)
        for i, group in enumerate(groups):
            ends = [average[group[0]] - 0.04, average[group[-1]] + 0.04]
            at = 0.2 + _GROUP * i
            ax.plot(ends, [at, at], color=INK, linewidth=3.2, clip_on=False, gid="alike")
        lift = 20.0
        if len(difference) and not overruled(posthoc):
            _draw_difference(ax, float(difference.iloc[0]))
            lift = 50.0
        n_missions = int(ranks["n_missions"].iloc[0])
        over = f"{n_missions} mission{'' if n_missions == 1 else 's'}"
        words = f"average ranks over {over}, 1 is best; bars join what may be chance"
        title_above(ax, title, words, lift=lift)
    return ax


def overruled(posthoc: pd.DataFrame) -> bool:
    """Tell whether pairs that lie apart do not count, since Friedman's test finds no difference."""
    apart = posthoc["difference"].abs() > posthoc["critical_difference"] + 1e-9  # by rounding
    return bool(apart.any() and not posthoc["significant"].any())


def groups_alike(labels: Sequence[str], posthoc: pd.DataFrame) -> list[list[str]]:
    """Give the largest groups of neighbours by rank of which no two differ significantly."""
    differ = {
        frozenset(pair)
        for *pair, found in posthoc[["algorithm", "other", "significant"]].itertuples(index=False)
        if found
    }
    groups: list[list[str]] = []
    reach = 0
    for i in range(len(labels)):
        end = i + 1
        while end < len(labels) and not any(
            frozenset((labels[end], inside)) in differ for inside in labels[i:end]
        ):
            end += 1
        if end > max(reach, i + 1):
            groups.append(list(labels[i:end]))
        reach = max(reach, end)
    return groups


def _drops(labels: Sequence[str], names: Mapping[str, str], first: float) -> dict[str, float]:
    """How many inches below the axis each name stands, under each other."""
    drops, at = {}, first
    for label in labels:
        lines = names[label].count("\n") + 1
        drops[label] = at + _LINE * (lines - 1) / 2
        at += _LINE * lines + 0.05
    return drops


def _draw_name(
    ax: Axes, name: str, rank: float, drop: float, style: AlgorithmStyle, *, left: bool
) -> None:
    edge = ax.get_xlim()[0 if left else 1]
    line: dict[str, Any] = {"color": style.colour, "linewidth": 1.4, "clip_on": False}
    ax.plot([rank, rank, edge], [0, drop, drop], **line, zorder=1, gid="rank")
    ax.plot(rank, 0, **line, marker=style.marker, markersize=6, zorder=3)
    ax.annotate(
        f"{name}  ({rank:.2f})",
        (edge, drop),
        (-6 if left else 6, 0),
        textcoords="offset points",
        ha="right" if left else "left",
        va="center",
        fontsize=9.5,
        linespacing=1.1,
        annotation_clip=False,
        gid="name",
    )


def _draw_difference(ax: Axes, difference: float) -> None:
    """How far ranks have to be apart, above the axis."""
    at, first = -0.42, ax.get_xlim()[0]
    ends = [first, first + difference]
    ax.plot(ends, [at, at], color=INK, linewidth=1.4, marker="|", clip_on=False, gid="difference")
    ax.annotate(
        f"critical difference {difference:.2f}",
        (first, at),
        (0, 5),
        textcoords="offset points",
        fontsize=9,
        annotation_clip=False,
    )
