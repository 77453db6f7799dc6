"""The picture of how the area of fronts grows, or their distance shrinks, while algorithms run."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Literal, get_args

import numpy as np
import pandas as pd
from matplotlib.axes import Axes

from botohe_moo._base.checks import check_integer, check_number
from botohe_moo._base.types import FloatArray
from botohe_moo.indicators import INDICATORS, further_indicators
from botohe_moo.plots.draw.algorithms import (
    AlgorithmStyle,
    chosen_algorithms,
    marks,
    stroke,
    styles_of,
)
from botohe_moo.plots.draw.panels import add_band, open_algorithm_axes
from botohe_moo.plots.draw.scales import label_ends, log_axis
from botohe_moo.plots.draw.style import theme
from botohe_moo.plots.study.bounds import draw_bound

Progress = Literal["evaluations", "seconds"]
Band = Literal["quartiles", "sd", "range"]

NAMES = {"evaluations": "evaluations", "seconds": "seconds of the algorithm's own time"}
_BANDS: dict[Band, tuple[str, str]] = {
    "quartiles": ("median", "and quartiles"),
    "sd": ("mean", "± 1 standard deviation"),
    "range": ("median", "and range"),
}
_COLOURS_ALONE = 6  # with more curves than this, colours alone are hard to follow


@dataclass(frozen=True, eq=False)
class Curve:
    """The progress of the runs of one algorithm on one mission."""

    x: FloatArray  # evaluations or seconds, ascending; each value holds until the next
    middle: FloatArray  # median over runs, or mean if the band is of standard deviations
    low: FloatArray  # edges of the band
    high: FloatArray
    n_runs: int
    ended: float  # where the last record of any run is; later values are held


def plot_curves(
    trace: pd.DataFrame,
    *,
    x: Progress = "evaluations",
    value: str = "area",
    algorithms: Sequence[str] | None = None,
    styles: Mapping[str, AlgorithmStyle] | None = None,
    band: Band = "quartiles",
    bound: float | None = None,
    title: str | None = None,
    ax: Axes | None = None,
) -> Axes:
    """Draw how the area grows over evaluations or seconds: median over runs and quartiles.

    Between two records a run's area is that of the last one, nothing is interpolated. A run that
    ended keeps its last area; where all runs of an algorithm have ended, its curve is thinner.
    From twelve algorithms on each has a panel of its own, with all others in grey; the axes of the
    first one are returned.

    Parameters
    ----------
    trace
        Rows of one mission in a study's trace: columns ``algorithm``, ``seed``, that of ``value``
        and that of ``x``, one row a recorded front. A run that failed has no rows and is not in
        the median; nor are rows without a value.
    x
        What the horizontal, logarithmic axis shows.
    value
        What the vertical axis shows: ``area``, or on a logarithmic axis ``igd_plus``, ``epsilon``
        or another indicator of the trace.
    algorithms
        Labels of the algorithms to draw. Default: all of them.
    styles
        Style of each label, as ``algorithm_styles`` gives them.
    band
        ``quartiles``: median, between a quarter and three quarters of the runs; ``sd``: mean plus
        and minus one standard deviation, where runs are; ``range``: median, smallest to largest.
        The line under the title says which. An algorithm with one run has no band.
    bound
        An area that no front exceeds, such as ``FrontBound.area``: a dashed line, unless it is too
        far from what is shown. Only where ``value`` is ``area``.
    title
        Name of the mission; what follows a line break is paler.
    ax
        Axes to draw on, for all algorithms. A figure will be created if not given.

    Raises
    ------
    ValueError
        If a column is missing, there are rows of several missions or none at all, or an algorithm
        or option is not known, or ``bound`` is not in [0, 1] or given with another ``value``.

    Examples
    --------
    >>> import pandas as pd
    >>> from botohe_moo.plots import plot_curves, save_plot
    >>> trace = pd.DataFrame(
    ...     [("ants", 1, 10, 0.3), ("ants", 1, 100, 0.5), ("greedy", 1, 20, 0.4)],
    ...     columns=["algorithm", "seed", "evaluations", "area"],
    ... )  # of a study: tables.trace.query("mission == 'museum'")
    >>> save_plot(plot_curves(trace, title="The museum"), "curves.png")
    """
    if bound is not None:
        check_number("bound", bound, at_least=0, at_most=1)
        if value != "area":
            raise ValueError(f"Expected no bound, which is of areas, with {value}, got {bound}.")
    curves = progress_curves(trace, x=x, value=value, algorithms=algorithms, band=band)
    styles = styles_of(list(curves), styles)
    found = list(curves.values())
    with theme():
        lines = {label: stairs(curve.x, curve.middle) for label, curve in curves.items()}
        axes = open_algorithm_axes(lines, styles, ax, size=(6.0, 3.7))
        first, last = min(float(c.x[0]) for c in found), max(float(c.x[-1]) for c in found)
        log_axis(axes.first, first, last, small=not axes.in_panels)
        if value == "area":
            panels = list(dict.fromkeys(axes.of.values()))
            cut = _area_axis(panels, found, bound)
        else:
            cut = _distance_axis(axes.first, found, small=not axes.in_panels)
        marked = not axes.in_panels and len(curves) > _COLOURS_ALONE
        for i, (label, own) in enumerate(axes.of.items()):
            _draw(own, label, curves[label], styles[label], i if marked else None)
        axes.finish(title, _in_words(found, band) + cut, NAMES[x], INDICATORS[value].in_words)
        if not axes.in_panels:
            low = axes.first.get_ylim()[0]
            ends = {label: max(float(c.middle[-1]), low) for label, c in curves.items()}
            label_ends(axes.first, ends, styles)
    return axes.first


def _draw(ax: Axes, label: str, curve: Curve, style: AlgorithmStyle, many: int | None) -> None:
    """Draw a curve, with markers where there are too ``many`` for colours alone: its number."""
    colour = style.colour
    if curve.n_runs > 1:
        low, high = stairs(curve.x, curve.low), stairs(curve.x, curve.high)
        add_band(ax, np.concatenate([low, high[::-1]]), colour, 0.16 if many is None else 0.1)
    held = curve.x >= curve.ended
    running = ~held
    running[np.argmax(held)] = True  # both parts meet where the last record is
    alone = running.sum() == 1  # no line to be seen
    steps = stairs(curve.x[running], curve.middle[running])
    ax.plot(*steps.T, **stroke(style, 2.0), zorder=3, label=label, gid="curve")
    if alone or many is not None:
        every = max(1, len(curve.x) // 6)
        at = np.arange(0 if alone or many is None else many * 29 % every, running.sum(), every)
        ax.plot(
            curve.x[running][at],
            curve.middle[running][at],
            linestyle="none",
            color=colour,
            zorder=3,
            gid="marks",
            **marks(style, 5.5, rim=0.6),
        )
    last = ax.get_xlim()[1]
    if curve.ended < last:
        end = curve.middle[[-1, -1]]
        ax.plot([curve.ended, last], end, **stroke(style, 1.0), zorder=2, gid="held")


def _area_axis(axes: Sequence[Axes], curves: Sequence[Curve], bound: float | None) -> str:
    """Show where curves end, and at least the upper half of the way there; say what is cut off."""
    ends = [float(curve.middle[-1]) for curve in curves]
    lowest = min(float(curve.low.min()) for curve in curves)
    low = max(lowest, min(2 * min(ends) - max(ends), 0.5 * max(ends)))
    high = max(float(curve.high.max()) for curve in curves)
    said = ""
    if bound is not None:
        high, said = draw_bound(axes, bound, low, high, "y")
    margin = max(0.05 * (high - low), 0.005)
    bottom = max(low - margin, -0.3 * margin)
    axes[0].set_ylim(bottom, high + margin)
    return (f"; areas below {bottom:.2f} cut off" if lowest < bottom else "") + said


def _distance_axis(ax: Axes, curves: Sequence[Curve], *, small: bool) -> str:
    """Show all distances; those of 0, which a logarithmic axis has not, at its lower edge."""
    values = np.concatenate([part for c in curves for part in (c.low, c.middle, c.high)])
    positive = values[values > 0]
    if not len(positive):
        ax.set_ylim(-0.05, 1.0)
        return ""
    low, high = float(positive.min()), float(positive.max())
    zeros = len(positive) < len(values)
    log_axis(ax, low / 1.12 / (1.5 if zeros else 1), high * 1.12, "y", small=small)
    return "; 0 lies at the lower edge" if zeros else ""


def _in_words(curves: Sequence[Curve], band: Band) -> str:
    fewest, most = min(c.n_runs for c in curves), max(c.n_runs for c in curves)
    if most == 1:
        return "one run of each"
    runs = f"{most}" if fewest == most else f"{fewest} to {most}"
    middle, around = _BANDS[band]
    return f"{middle} of {runs} runs {around}"


def progress_curves(
    trace: pd.DataFrame,
    *,
    x: Progress = "evaluations",
    value: str = "area",
    algorithms: Sequence[str] | None = None,
    band: Band = "quartiles",
    n_points: int = 400,
) -> dict[str, Curve]:
    """Give the curves that ``plot_curves`` draws, on a logarithmic grid.

    The grid spans the records of all algorithms. An algorithm's curve begins where all of its runs
    have a record, and ends where the grid does. Algorithms without a value are left out. Options
    and errors are those of ``plot_curves``.
    """
    values = ("area", *further_indicators())
    options = (
        ("x", x, get_args(Progress)),
        ("value", value, values),
        ("band", band, get_args(Band)),
    )
    for name, given, known in options:
        if given not in known:
            raise ValueError(f"Expected {name} to be {' or '.join(known)}, got {given!r}.")
    check_integer("n_points", n_points, at_least=2)
    labels = chosen_algorithms("trace", trace, ("algorithm", "seed", x, value), algorithms)
    runs = records_of(trace, x, value, labels)
    if not runs:
        raise ValueError("Expected at least one row of trace, got none.")
    everything = np.concatenate([run[:, 0] for found in runs.values() for run in found])
    low, high = everything.min(), everything.max()
    # Rounding could put the ends beside the records there.
    grid = np.unique(np.clip(np.geomspace(low, high, n_points), low, high))
    return {label: _curve(found, grid, band) for label, found in runs.items()}


def records_of(
    trace: pd.DataFrame, x: Progress, value: str, labels: Sequence[str]
) -> dict[str, list[FloatArray]]:
    """Give the records of every run, pairs of x and value, for each label that has any, by seed."""
    number = {label: i for i, label in enumerate(labels)}
    owner = trace["algorithm"].map(number).to_numpy(float, na_value=np.nan)
    values = trace[value].to_numpy(float, na_value=np.nan)
    rows = np.flatnonzero(~np.isnan(owner) & ~np.isnan(values))
    at = trace[x].to_numpy(float, na_value=np.nan)[rows]
    if not (np.isfinite(at).all() and (at >= 0).all()):
        raise ValueError(f"Expected {x} in [0, inf), got {at[~(np.isfinite(at) & (at >= 0))][0]}.")
    if not len(at):
        return {}
    if at.max() == 0:
        at = at + 1.0
    at = np.maximum(at, at[at > 0].min())  # a logarithmic axis has no 0
    seeds = trace["seed"].to_numpy(np.int64)[rows]
    order = np.lexsort((at, seeds, owner[rows]))
    records = np.column_stack([at, values[rows]])[order]
    owner, seeds = owner[rows][order], seeds[order]
    first = np.flatnonzero((np.diff(owner) != 0) | (np.diff(seeds) != 0)) + 1
    runs: dict[str, list[FloatArray]] = {}
    owners = owner[np.concatenate([[0], first])].astype(int)
    for i, run in zip(owners.tolist(), np.split(records, first), strict=True):
        runs.setdefault(labels[i], []).append(run)
    return runs


def _curve(runs: Sequence[FloatArray], grid: FloatArray, band: Band) -> Curve:
    start = max(run[0, 0] for run in runs)
    at = np.concatenate([[start], grid[grid > start]])
    values = np.array([run[np.searchsorted(run[:, 0], at, side="right") - 1, 1] for run in runs])
    if band == "sd":
        middle = values.mean(axis=0)
        sd = values.std(axis=0, ddof=1) if len(values) > 1 else np.zeros(len(at))
        # The band must not exceed what runs have reached.
        low = np.maximum(middle - sd, values.min(axis=0))
        high = np.minimum(middle + sd, values.max(axis=0))
    else:
        percent = (25, 50, 75) if band == "quartiles" else (0, 50, 100)
        low, middle, high = np.percentile(values, percent, axis=0)
    return Curve(at, middle, low, high, len(runs), max(float(run[-1, 0]) for run in runs))


def stairs(x: FloatArray, y: FloatArray) -> FloatArray:
    """Points (n, 2) of the steps through values that each hold until the next, without repeats."""
    kept = np.concatenate([[True], y[1:] != y[:-1]])
    kept[-1] = True
    x, y = x[kept], y[kept]
    return np.column_stack([np.repeat(x, 2)[1:], np.repeat(y, 2)[:-1]])
