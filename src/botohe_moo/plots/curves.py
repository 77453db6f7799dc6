"""The picture of how the area grows while algorithms run."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal

import numpy as np

from botohe_moo._checks import check_integer
from botohe_moo.plots.algorithms import chosen_algorithms, shortened, styles_of
from botohe_moo.plots.scales import label_ends, log_axis, title_above
from botohe_moo.plots.style import new_axes, theme

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    import pandas as pd
    from matplotlib.axes import Axes

    from botohe_moo._types import FloatArray
    from botohe_moo.plots.algorithms import AlgorithmStyle

__all__ = ["Curve", "Progress", "area_curves", "plot_curves"]

Progress = Literal["evaluations", "seconds"]
Band = Literal["sd", "range"]

_N_POINTS = 500
_NAMES = {"evaluations": "evaluations", "seconds": "seconds of the algorithm's own time"}
_BANDS = {"sd": "± 1 standard deviation", "range": "and their range"}
_MANY = 6  # with more curves than this, colours alone are hard to follow


@dataclass(frozen=True, eq=False)
class Curve:
    """What the runs of one algorithm on one mission have reached, over their progress.

    Attributes
    ----------
    x
        Evaluations or seconds, ascending; the value at ``x[i]`` holds until ``x[i + 1]``.
    mean
        Mean area over runs.
    low
        Lower edge of the band.
    high
        Upper edge of the band.
    n_runs
        Number of runs.
    ended
        Where the last record of any run is; later values are held.
    """

    x: FloatArray
    mean: FloatArray
    low: FloatArray
    high: FloatArray
    n_runs: int
    ended: float


def plot_curves(
    trace: pd.DataFrame,
    *,
    x: Progress = "evaluations",
    algorithms: Sequence[str] | None = None,
    styles: Mapping[str, AlgorithmStyle] | None = None,
    band: Band = "sd",
    title: str | None = None,
    ax: Axes | None = None,
) -> Axes:
    """Draw how the area grows over evaluations or seconds: mean over runs and a band.

    Between two records a run's area is that of the last one, nothing is interpolated. A run that
    ended keeps its last area; where all runs of an algorithm have ended, its curve is thinner.

    Parameters
    ----------
    trace
        Rows of one mission in a study's trace: columns ``algorithm``, ``seed``, ``area`` and that
        of ``x``, one row a recorded front. A run that failed has no rows and is not in the mean.
    x
        What the horizontal, logarithmic axis shows.
    algorithms
        Labels of the algorithms to draw. Default: all of them.
    styles
        Style of each label, as ``algorithm_styles`` gives them.
    band
        ``sd``: mean plus and minus one standard deviation, where runs are; ``range``: smallest to
        largest. The line under the title says which. An algorithm with one run has no band.
    title
        Name of the mission.
    ax
        Axes to draw on. One will be created if not given.

    Returns
    -------
    matplotlib.axes.Axes
        The axes drawn on.

    Raises
    ------
    ValueError
        If a column is missing, there are rows of several missions or none at all, or an algorithm
        or option is not known.
    """
    curves = area_curves(trace, x=x, algorithms=algorithms, band=band)
    styles = styles_of(list(curves), styles)
    with theme():
        if ax is None:
            ax = new_axes(8.4, 4.8)
        xs = [curve.x for curve in curves.values()]
        log_axis(ax, min(float(at[0]) for at in xs), max(float(at[-1]) for at in xs))
        for i, (label, curve) in enumerate(curves.items()):
            _draw(ax, label, curve, styles[label], i if len(curves) > _MANY else None)
        cut = _area_axis(ax, list(curves.values()))
        ax.set_xlabel(_NAMES[x])
        ax.set_ylabel("area (normalised hypervolume)")
        title_above(ax, title, _in_words(list(curves.values()), band) + cut)
        short = shortened(curves)
        ends = {short[label]: float(curve.mean[-1]) for label, curve in curves.items()}
        marks = {short[label]: styles[label] for label in curves}
        label_ends(ax, ends, marks)
    return ax


def area_curves(
    trace: pd.DataFrame,
    *,
    x: Progress = "evaluations",
    algorithms: Sequence[str] | None = None,
    band: Band = "sd",
    n_points: int = _N_POINTS,
) -> dict[str, Curve]:
    """Give the curves that ``plot_curves`` draws, on a logarithmic grid.

    The grid spans the records of all algorithms. An algorithm's curve begins where all of its runs
    have a record, and ends where the grid does.

    Parameters
    ----------
    trace
        As in ``plot_curves``.
    x
        As in ``plot_curves``; records at 0 seconds count as of the first moment after it.
    algorithms
        As in ``plot_curves``.
    band
        As in ``plot_curves``.
    n_points
        Points of the grid.

    Returns
    -------
    dict
        A ``Curve`` for each label.

    Raises
    ------
    ValueError
        As ``plot_curves``.
    """
    for name, value, known in (("x", x, _NAMES), ("band", band, _BANDS)):
        if value not in known:
            raise ValueError(f"Expected {name} to be {' or '.join(known)}, got {value!r}.")
    check_integer("n_points", n_points, at_least=2)
    labels = chosen_algorithms("trace", trace, ("algorithm", "seed", x, "area"), algorithms)
    trace = trace[trace["algorithm"].isin(labels)]
    if trace.empty:
        raise ValueError("Expected at least one row of trace, got none.")
    at = trace[x].to_numpy(float)
    if not (np.isfinite(at).all() and (at >= 0).all()):
        raise ValueError(f"Expected {x} in [0, inf), got {at[~(np.isfinite(at) & (at >= 0))][0]}.")
    if at.max() == 0:
        at = at + 1.0
    at = np.maximum(at, at[at > 0].min())  # a logarithmic axis has no 0
    trace = trace.assign(**{x: at})
    # Rounding could put the ends beside the records there.
    grid = np.unique(np.clip(np.geomspace(at.min(), at.max(), n_points), at.min(), at.max()))
    return {label: _curve(trace[trace["algorithm"] == label], x, grid, band) for label in labels}


def _curve(rows: pd.DataFrame, x: Progress, grid: FloatArray, band: Band) -> Curve:
    runs = [
        run.sort_values(x, kind="stable")[[x, "area"]].to_numpy(float)
        for _, run in rows.groupby("seed", sort=True)
    ]
    start = max(run[0, 0] for run in runs)
    at = np.concatenate([[start], grid[grid > start]])
    areas = np.array([run[np.searchsorted(run[:, 0], at, side="right") - 1, 1] for run in runs])
    mean = areas.mean(axis=0)
    if band == "range":
        low, high = areas.min(axis=0), areas.max(axis=0)
    else:
        sd = areas.std(axis=0, ddof=1) if len(areas) > 1 else np.zeros(len(at))
        # A band must not promise what no run has reached.
        low = np.maximum(mean - sd, areas.min(axis=0))
        high = np.minimum(mean + sd, areas.max(axis=0))
    return Curve(at, mean, low, high, len(runs), float(rows[x].max()))


def _draw(ax: Axes, label: str, curve: Curve, style: AlgorithmStyle, many: int | None) -> None:
    colour = style.colour
    if curve.n_runs > 1:
        ax.fill_between(
            curve.x,
            curve.low,
            curve.high,
            step="post",
            facecolor=colour,
            alpha=0.16 if many is None else 0.1,
            linewidth=0,
            zorder=1,
            gid="band",
        )
    held = curve.x >= curve.ended
    running = ~held
    running[np.argmax(held)] = True  # both parts meet where the last record is
    alone = running.sum() == 1  # no line to be seen
    every = max(1, len(curve.x) // 6)
    ax.plot(
        curve.x[running],
        curve.mean[running],
        drawstyle="steps-post",
        color=colour,
        linestyle=style.line,
        linewidth=2.0,
        marker=style.marker if alone or many is not None else None,
        markersize=5.5,
        markeredgecolor="white",
        markeredgewidth=0.6,
        markevery=(0 if alone or many is None else many * 29 % every, every),
        zorder=3,
        label=label,
        gid="mean",
    )
    last = ax.get_xlim()[1]
    if curve.ended < last:
        ax.plot(
            [curve.ended, last],
            curve.mean[[-1, -1]],
            color=colour,
            linestyle=style.line,
            linewidth=1.0,
            zorder=2,
            gid="held",
        )


def _area_axis(ax: Axes, curves: Sequence[Curve]) -> str:
    """Show where curves end, and at least the upper half of the way there; say what is cut off."""
    ends = [float(curve.mean[-1]) for curve in curves]
    lowest = min(float(curve.low.min()) for curve in curves)
    low = max(lowest, min(2 * min(ends) - max(ends), 0.5 * max(ends)))
    high = max(float(curve.high.max()) for curve in curves)
    margin = max(0.05 * (high - low), 0.005)
    bottom = max(low - margin, -0.3 * margin)
    ax.set_ylim(bottom, high + margin)
    return f"; areas below {bottom:.2f} cut off" if lowest < bottom else ""


def _in_words(curves: Sequence[Curve], band: Band) -> str:
    fewest, most = min(c.n_runs for c in curves), max(c.n_runs for c in curves)
    if most == 1:
        return "one run of each"
    runs = f"{most}" if fewest == most else f"{fewest} to {most}"
    return f"mean of {runs} runs {_BANDS[band]}"
