"""Empirical attainment: the share of runs that reach a reward and a number of survivors."""

import math
from collections.abc import Iterable, Sequence

import numpy as np
import pandas as pd
from matplotlib.axes import Axes

from botohe_moo._base.types import FloatArray
from botohe_moo.plots.draw.algorithms import axes_of, dashes_of, finish
from botohe_moo.plots.draw.style import MARKERS, Palette, palette_of, theme
from botohe_moo.plots.front import OBJECTIVES, staircase
from botohe_moo.plots.study.fronts import final_fronts

_MAX_STEPS = 120  # more would take half a minute


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
    colour = palette_of(fronts, palette)
    dashes = dashes_of(colour)
    with theme():
        axes = axes_of(list(fronts), ax)
        for i, (label, found) in enumerate(fronts.items()):
            few, half, most = (
                staircase(attainment_surface(found.values(), p))[:-1] for p in (25, 50, 75)
            )
            axes[label].plot(
                *half.T,
                color=colour[label],
                linestyle=dashes[label],
                marker=MARKERS[i % len(MARKERS)],
                # Not plans: a few are enough to tell the lines apart.
                markevery=max(1, len(half) // 8),
                markersize=5,
                label=label,
            )
            if len(found) > 1:
                band = np.concatenate([few, most[::-1]])
                axes[label].fill(*band.T, color=colour[label], alpha=0.2, linewidth=0)
        for own in dict.fromkeys(axes.values()):
            own.set(xlim=(0, None), ylim=(0, None))
        return finish(axes, title, *OBJECTIVES)


def attainment_surface(fronts: Iterable[FloatArray], percent: float) -> FloatArray:
    """Return the non-dominated corners (n, 2) of what at least ``percent`` of the runs reach.

    Fronts are points (n_plans, 2), to be maximised; an empty one reaches the origin only. A
    ``percent`` of 0 means one run.

    Fonseca, Guerreiro, López-Ibáñez and Paquete, "On the computation of the empirical attainment
    function", EMO 2011.
    """
    import moocore  # late, as other pictures need none of it

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
    import moocore

    fronts, others = list(fronts), list(others)
    pooled = [*fronts, *others]
    if np.array_equal(attainment_surface(pooled, 0), attainment_surface(pooled, 100)):
        return np.empty((0, 4)), np.empty(0)  # all alike, which moocore cannot say
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
    """Points of all runs with the number of their run; moocore does not take empty sets."""
    points = [front if len(front) else np.zeros((1, 2)) for front in fronts]
    if not points:
        raise ValueError("Expected the front of at least one run, got none.")
    numbers = np.repeat(np.arange(len(points), dtype=float), list(map(len, points)))
    return np.column_stack([np.concatenate(points), numbers])
