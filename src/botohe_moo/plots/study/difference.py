"""The picture of where one algorithm reaches more often than another."""

from collections.abc import Mapping, Sequence
from itertools import pairwise

import matplotlib.pyplot as plt
import numpy as np
import pandas as pd
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.collections import PolyCollection
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from botohe_moo._base.types import FloatArray
from botohe_moo.plots.draw.algorithms import AlgorithmStyle, names_of, styles_of
from botohe_moo.plots.draw.labels import columns
from botohe_moo.plots.draw.scales import stack_above
from botohe_moo.plots.draw.style import INK, MUTED, Colour, theme, tint
from botohe_moo.plots.front import staircase
from botohe_moo.plots.study.attainment import attainment_difference, attainment_surface
from botohe_moo.plots.study.fronts import final_fronts, objective_axes

_SHADES = 5  # as many as are told apart
_DASHED = (0, (4, 2))
_NAME_WIDTH = 44  # columns
_MANY = 1_500  # more rectangles are drawn as an image in vector files, too


def plot_attainment_difference(
    plans: pd.DataFrame,
    runs: pd.DataFrame,
    algorithm: str,
    other: str,
    *,
    styles: Mapping[str, AlgorithmStyle] | None = None,
    title: str | None = None,
    axes: Sequence[Axes] | None = None,
) -> tuple[Axes, Axes]:
    """Draw where more runs of one algorithm than of another reach, and where fewer do.

    On the left what ``algorithm`` reaches more often, on the right what ``other`` does, the darker
    the larger the difference between the shares of their runs. The solid line bounds what any run
    of both reaches, the dashed one what half of the panel's algorithm's runs reach. A run without a
    front reaches nothing.

    Parameters
    ----------
    plans, runs
        As in :func:`plot_fronts`.
    algorithm, other
        Labels of the algorithms on the left and on the right.
    styles, title
        As in :func:`plot_curves`.
    axes
        The two axes to draw on. A figure with two will be created if not given.

    Raises
    ------
    ValueError
        If a column is missing, there are rows of several missions, or an algorithm is not known.

    Examples
    --------
    >>> import pandas as pd
    >>> from botohe_moo.plots import plot_attainment_difference, save_plot
    >>> runs = pd.DataFrame(
    ...     [("ants", 1, "done", 0.5), ("ants", 2, "done", 0.4), ("greedy", 1, "done", 0.3)],
    ...     columns=["algorithm", "seed", "status", "area"],
    ... )  # of a study: tables.runs.query("mission == 'museum'")
    >>> plans = pd.DataFrame(
    ...     [("ants", 1, 5, 1), ("ants", 2, 4, 1), ("greedy", 1, 3, 1)],
    ...     columns=["algorithm", "seed", "reward", "survivors"],
    ... )
    >>> left, right = plot_attainment_difference(plans, runs, "ants", "greedy")
    >>> save_plot(left, "difference.png")
    """
    fronts = final_fronts(plans, runs, [algorithm, other])
    styles = styles_of([algorithm, other], styles)
    mine, theirs = (list(fronts[label].values()) for label in (algorithm, other))
    rectangles, difference = attainment_difference(mine, theirs)
    reach = staircase(attainment_surface([*mine, *theirs], 0))[:-1]
    with theme():
        if axes is None:
            axes = _two_axes()
        left, right = axes
        names = names_of([algorithm, other], styles, _NAME_WIDTH, longest=_NAME_WIDTH)
        for label, name in names.items():
            space = " " if columns(name) < _NAME_WIDTH - 20 else "\n"
            names[label] = f"{name}{space}reaches more often"
        sides = ((left, algorithm, mine, difference), (right, other, theirs, -difference))
        for ax, label, found, ahead in sides:
            colour = styles[label].colour
            _shade(ax, rectangles[ahead > 0], ahead[ahead > 0], colour)
            ax.plot(*reach.T, color=INK, linewidth=1.0, zorder=3, gid="best")
            half = staircase(attainment_surface(found, 50))[:-1]
            ax.plot(*half.T, color=INK, linewidth=1.0, linestyle=_DASHED, zorder=3, gid="median")
            objective_axes(ax)
            ax.set_title(names[label], fontsize=11, y=1.0)
            ax.legend(
                handles=_key(colour),
                loc="upper center",
                bbox_to_anchor=(0.5, -0.13),
                ncols=3,
                columnspacing=1.2,
                handlelength=1.6,
                fontsize=9,
                frameon=False,
                title="share of its runs, ahead by",
                title_fontsize=9,
            )
        right.set_ylabel("")
        if title:
            lines = max(name.count("\n") + 1 for name in names.values())
            head, _, rest = title.partition("\n")
            bold = {"fontweight": "bold", "color": INK}
            parts = [(rest, "subtitle", 10.0, {"color": "0.4"}), (head, "title", 12.0, bold)]
            stack_above(left, parts, 9.0, 1.3 * 11 * lines + 8)
    return left, right


def _two_axes() -> tuple[Axes, Axes]:
    """Open a figure with two axes beside each other, the same in both directions."""
    fig = plt.figure(figsize=(9.7, 4.9))
    left = fig.add_axes((0.07, 0.12, 0.435, 0.74))
    right = fig.add_axes((0.535, 0.12, 0.435, 0.74), sharex=left, sharey=left)
    right.tick_params(labelleft=False)
    for ax in (left, right):
        ax.xaxis.set_label_coords(0.5, -0.1)
        ax.yaxis.set_label_coords(-0.12, 0.5)
    return left, right


def _shade(ax: Axes, rectangles: FloatArray, ahead: FloatArray, colour: Colour) -> None:
    levels = np.ceil(ahead * _SHADES - 1e-9)  # from 1; a difference of 1/5 is still in the first
    shades = [tint(colour, level / _SHADES) for level in levels]
    left, low, right, top = rectangles.T
    corners = np.stack([left, low, right, low, right, top, left, top], axis=1).reshape(-1, 4, 2)
    # Edges of their own colour hide the seams between neighbours.
    ax.add_collection(
        PolyCollection(
            list(corners),
            facecolors=shades,
            edgecolors=shades,
            linewidths=0.3,
            zorder=1,
            rasterized=len(corners) > _MANY,
            gid="ahead",
        )
    )


def _key(colour: Colour) -> list[Artist]:
    steps = [round(100 * i / _SHADES) for i in range(_SHADES + 1)]
    shades = [
        Patch(
            facecolor=tint(colour, (i + 1) / _SHADES),
            edgecolor=MUTED,
            linewidth=0.4,
            label=f"{low}–{high} %",
        )
        for i, (low, high) in enumerate(pairwise(steps))
    ]
    lines = [
        Line2D([], [], color=INK, linewidth=1.0, label="any run of both"),
        Line2D([], [], color=INK, linewidth=1.0, linestyle=_DASHED, label="half of its runs"),
    ]
    return [*shades, *lines]
