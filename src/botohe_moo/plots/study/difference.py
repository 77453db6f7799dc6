"""The picture of where one algorithm reaches more often than another."""

from collections.abc import Sequence

import matplotlib.pyplot as plt
import numpy as np
import pandas as pd
import seaborn as sns
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.collections import PolyCollection
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from botohe_moo._base.types import FloatArray
from botohe_moo.plots.draw.algorithms import wrapped
from botohe_moo.plots.draw.style import INK, Colour, Palette, palette_of, theme
from botohe_moo.plots.front import OBJECTIVES, staircase
from botohe_moo.plots.study.attainment import attainment_difference, attainment_surface
from botohe_moo.plots.study.fronts import final_fronts

_SHADES = 5  # as many as are told apart
_MANY = 1_500  # more rectangles are drawn as an image in vector files, too


def plot_attainment_difference(
    plans: pd.DataFrame,
    runs: pd.DataFrame,
    algorithm: str,
    other: str,
    *,
    palette: Palette | None = None,
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
    palette, title
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
    colour = palette_of(fronts, palette)
    mine, theirs = (list(fronts[label].values()) for label in (algorithm, other))
    rectangles, difference = attainment_difference(mine, theirs)
    reach = staircase(attainment_surface([*mine, *theirs], 0))[:-1]
    with theme():
        if axes is None:
            _, axes = plt.subplots(
                1, 2, sharex=True, sharey=True, figsize=(9.7, 5.0), layout="constrained"
            )
        left, right = axes
        sides = ((left, algorithm, mine, difference), (right, other, theirs, -difference))
        for ax, label, found, ahead in sides:
            shades = sns.light_palette(colour[label], _SHADES + 1)[1:]
            for level, shade in enumerate(shades):
                # A difference of 1/5 is still in the first.
                shown = np.ceil(ahead * _SHADES - 1e-9) == level + 1
                _shade(ax, rectangles[shown], shade)
            half = staircase(attainment_surface(found, 50))[:-1]
            ax.plot(*reach.T, color=INK, linewidth=1.0)
            ax.plot(*half.T, color=INK, linewidth=1.0, linestyle="--")
            ax.set(xlim=(0, None), ylim=(0, None), xlabel=OBJECTIVES[0])
            ax.set_title(f"{wrapped([label])[0]} reaches more often", fontweight="normal")
            steps = [f"{100 * i // _SHADES}–{100 * (i + 1) // _SHADES} %" for i in range(_SHADES)]
            keys: list[Artist] = [
                Patch(color=c, label=step) for c, step in zip(shades, steps, strict=True)
            ]
            keys += [
                Line2D([], [], color=INK, linewidth=1.0, label="any run of both"),
                Line2D([], [], color=INK, linewidth=1.0, linestyle="--", label="half of its runs"),
            ]
            ax.legend(
                handles=keys,
                loc="upper center",
                bbox_to_anchor=(0.5, -0.13),
                ncols=3,
                columnspacing=1.2,
                fontsize="small",
                title="share of its runs, ahead by",
            )
        left.set_ylabel(OBJECTIVES[1])
        if title:
            left.figure.suptitle(title, x=0.01, ha="left", fontweight="bold")
    return left, right


def _shade(ax: Axes, rectangles: FloatArray, shade: Colour) -> None:
    """Fill rectangles (n, 4): left, bottom, right and top."""
    left, low, right, top = rectangles.T
    corners = np.stack([left, low, right, low, right, top, left, top], axis=1).reshape(-1, 4, 2)
    # Edges of the same colour hide the seams between neighbours.
    filled = PolyCollection(
        list(corners), color=[shade], linewidths=0.3, zorder=1, rasterized=len(corners) > _MANY
    )
    ax.add_collection(filled)
