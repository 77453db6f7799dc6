"""Empirical attainment: the share of runs that reach a reward and a number of survivors."""

import math
from collections.abc import Iterable, Sequence
from typing import Any

import matplotlib.pyplot as plt
import moocore
import numpy as np
import pandas as pd
import seaborn as sns
from matplotlib.axes import Axes
from matplotlib.collections import PolyCollection

from botohe_moo.base.types import FloatArray
from botohe_moo.plots.draw.algorithms import axes_of, finish, line_styles, wrapped
from botohe_moo.plots.draw.style import INK, Colour, Palette, palette_of, theme
from botohe_moo.plots.front import OBJECTIVES, staircase
from botohe_moo.plots.study.fronts import final_fronts

_SHADES = 5  # more are hard to distinguish
_MANY = 1_500  # rectangles; more are drawn as an image in vector files, too
_MAX_STEPS = 120  # of differences; more would take half a minute


def plot_attainment(
    plans: pd.DataFrame,
    runs: pd.DataFrame,
    *,
    algorithms: Sequence[str] | None = None,
    palette: Palette | None = None,
    title: str | None = None,
    ax: Axes | None = None,
) -> Axes:
    """Draw each algorithm's median attainment surface, between those of a quarter of its runs.

    Below and left of the line lies what at least half of the runs reach; the band lies between
    what a quarter and what three quarters of them reach. A run without a front reaches nothing.

    Parameters
    ----------
    plans, runs
        As in :func:`plot_fronts`.
    algorithms, palette, title, ax
        As in :func:`plot_curves`, with panels from twelve algorithms on.

    Raises
    ------
    ValueError
        If a column is missing, there are rows of several missions, or an algorithm is not known.

    Examples
    --------
    >>> import pandas as pd
    >>> from botohe_moo.plots import plot_attainment, save_plot
    >>> runs = pd.DataFrame(
    ...     [("ants", 1, "done", 0.5), ("ants", 2, "done", 0.4), ("greedy", 1, "done", 0.3)],
    ...     columns=["algorithm", "seed", "status", "area"],
    ... )  # of a study: tables.runs.query("mission == 'museum'")
    >>> plans = pd.DataFrame(
    ...     [("ants", 1, 5, 1), ("ants", 2, 4, 1), ("greedy", 1, 3, 1)],
    ...     columns=["algorithm", "seed", "reward", "survivors"],
    ... )
    >>> save_plot(plot_attainment(plans, runs), "attainment.png")
    """
    fronts = final_fronts(plans, runs, algorithms)
    with theme():
        axes = axes_of(list(fronts), ax)
        for label, style in line_styles(fronts, palette).items():
            runs_of = list(fronts[label].values())
            few, half, most = (staircase(attainment_surface(runs_of, p))[:-1] for p in (25, 50, 75))
            # Markers are not plans: a few are enough to tell the lines apart.
            axes[label].plot(*half.T, markevery=max(1, len(half) // 8), markersize=5, **style)
            if len(runs_of) > 1:
                band = np.concatenate([few, most[::-1]])
                axes[label].fill(*band.T, color=style["color"], alpha=0.2, linewidth=0)
        return finish(axes, title, *OBJECTIVES, xlim=(0, None), ylim=(0, None))


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
    colours = palette_of(fronts, palette)
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
            shades = sns.light_palette(colours[label], _SHADES + 1)[1:]
            for level, shade in enumerate(shades, start=1):
                # Each step includes its upper end: a difference of 1/5 is in the first.
                shown = np.ceil(ahead * _SHADES - 1e-9) == level
                step = f"{100 * (level - 1) // _SHADES}–{100 * level // _SHADES} %"
                _shade(ax, rectangles[shown], shade, step)
            half = staircase(attainment_surface(found, 50))[:-1]
            ax.plot(*reach.T, color=INK, linewidth=1.0, label="any run of both")
            ax.plot(*half.T, color=INK, linewidth=1.0, linestyle="--", label="half of its runs")
            ax.set(xlim=(0, None), ylim=(0, None), xlabel=OBJECTIVES[0])
            ax.set_title(f"{wrapped([label])[0]} reaches more often", fontweight="normal")
            ax.legend(
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


def attainment_surface(fronts: Iterable[FloatArray], percent: float) -> FloatArray:
    """Return the non-dominated corners (n, 2) of what at least ``percent`` of the runs reach.

    Fronts are points (n_plans, 2), to be maximised; an empty one reaches the origin only. A
    ``percent`` of 0 means one run.

    Fonseca, Guerreiro, López-Ibáñez and Paquete, "On the computation of the empirical attainment
    function", EMO 2011.
    """
    sets = _sets(fronts)
    surface = moocore.eaf(-sets[:, :2], sets[:, 2], percentiles=[percent])
    return np.asarray(-surface[:, :2] + 0.0)  # no negative zeros


def attainment_difference(
    fronts: Iterable[FloatArray], others: Iterable[FloatArray]
) -> tuple[FloatArray, FloatArray]:
    """Return rectangles (n, 4) that runs reach unequally often, and the differences (n,).

    Rectangles are left, bottom, right and top, and do not overlap. A difference, in [-1, 1], is the
    share of the first runs that reach the inside, less that of the others. If the numbers of runs
    have no common multiple up to 120, it is off by up to one run's share.
    """
    fronts, others = list(fronts), list(others)
    pooled = [*fronts, *others]
    if np.array_equal(attainment_surface(pooled, 0), attainment_surface(pooled, 100)):
        return np.empty((0, 4)), np.empty(0)  # all runs reach the same, which moocore cannot say
    # Moocore gives whole steps, at most half as many as there are runs: with equally many runs
    # of both, all differences are whole.
    steps = math.lcm(len(fronts), len(others))
    if 0 < steps <= _MAX_STEPS:
        fronts, others = fronts * (steps // len(fronts)), others * (steps // len(others))
    else:
        steps = len(pooled) // 2
    found = moocore.eafdiff(
        _sets(fronts), _sets(others), intervals=steps, maximise=True, rectangles=True
    )
    corners = np.maximum(found[:, :4], 0.0)  # unbounded ones reach to the axes
    low = np.minimum(corners[:, :2], corners[:, 2:])
    high = np.maximum(corners[:, :2], corners[:, 2:])
    real = (low < high).all(axis=1) & (found[:, 4] != 0)
    return np.hstack([low, high])[real], found[real, 4] / steps


def _sets(fronts: Iterable[FloatArray]) -> FloatArray:
    """Return points of all runs with the number of their run; moocore does not take empty sets."""
    points = [front if len(front) else np.zeros((1, 2)) for front in fronts]
    numbers = np.repeat(np.arange(len(points), dtype=float), list(map(len, points)))
    return np.column_stack([np.concatenate(points), numbers])


def _shade(ax: Axes, rectangles: FloatArray, shade: Colour, name: str) -> None:
    """Fill rectangles (n, 4): left, bottom, right and top; name them in the legend."""
    left, low, right, top = rectangles.T
    corners = np.stack([left, low, right, low, right, top, left, top], axis=1).reshape(-1, 4, 2)
    # Edges of the same colour hide the seams between neighbours.
    style: dict[str, Any] = {"color": [shade], "linewidths": 0.3, "zorder": 1, "label": name}
    ax.add_collection(PolyCollection(list(corners), rasterized=len(corners) > _MANY, **style))
