"""What pictures of studies share: which algorithms they show, in which colours, on which axes."""

from __future__ import annotations

import textwrap
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from typing import TYPE_CHECKING, Any, Literal

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.axes import Axes
from matplotlib.cbook import STEP_LOOKUP_MAP
from matplotlib.collections import LineCollection
from matplotlib.lines import Line2D
from matplotlib.ticker import FuncFormatter, LogLocator, MaxNLocator, NullFormatter

from botohe_moo.base.messages import check_choice, check_frame
from botohe_moo.base.types import FloatArray
from botohe_moo.plots.draw.style import MARKERS, MUTED, Palette, new_axes, palette_of

if TYPE_CHECKING:
    import pandas as pd

DASHES = ("-", "--", ":", "-.")
_MANY = 12  # algorithms from which on each gets a panel: one plot would be a tangle
_COLUMNS = 4  # of panels
_NAME = 30  # most letters in a line of an algorithm's name
_LEAST_ROOM = 0.01  # of the area, above what is shown, in which a bound is always drawn


def check_table(name: str, frame: pd.DataFrame, columns: Sequence[str]) -> None:
    """Refuse what is not a table, lacks a column, or is of several missions."""
    check_frame(name, frame)
    if missing := [column for column in columns if column not in frame.columns]:
        raise ValueError(f"Expected {name} with columns {tuple(columns)}, it lacks {missing}.")
    missions = frame["mission"].unique() if "mission" in frame.columns else ()
    if len(missions) > 1:
        found = ", ".join(map(repr, missions))
        raise ValueError(f"Expected {name} of one mission, got {found}.")


def chosen_algorithms(
    name: str, frame: pd.DataFrame, columns: Sequence[str], algorithms: Sequence[str] | None
) -> list[str]:
    """Check a table of one mission, and return the algorithms to draw: all by default."""
    check_table(name, frame, columns)
    known = list(frame["algorithm"].unique())
    for label in algorithms or ():
        check_choice(f"an algorithm of {name}", label, known)
    labels = known if algorithms is None else list(dict.fromkeys(algorithms))
    if not labels:
        raise ValueError("Expected at least one algorithm, got none.")
    return labels


def wrapped(labels: Iterable[str]) -> list[str]:
    """Return names as pictures show them, on lines of at most 30 letters."""
    return [textwrap.fill(str(label), _NAME) for label in labels]


def line_styles(labels: Iterable[str], palette: Palette | None) -> dict[str, dict[str, Any]]:
    """Return colour, dash, marker and name of each line; dashes of the same colour differ."""
    styles: dict[str, dict[str, Any]] = {}
    taken: Counter[Any] = Counter()
    for i, (label, colour) in enumerate(palette_of(labels, palette).items()):
        dash = DASHES[taken[colour] % len(DASHES)]
        taken[colour] += 1
        marker = MARKERS[i % len(MARKERS)]
        styles[label] = {"color": colour, "linestyle": dash, "marker": marker, "label": label}
    return styles


def axes_of(labels: Sequence[str], ax: Axes | None) -> dict[str, Axes]:
    """Return the axes of each algorithm: the same for all, or a panel each if there are many."""
    if ax is not None or len(labels) < _MANY:
        return dict.fromkeys(labels, ax or new_axes(7.5, 4.0))
    n_rows = -(-len(labels) // _COLUMNS)
    _, grid = plt.subplots(
        n_rows,
        _COLUMNS,
        sharex=True,
        sharey=True,
        figsize=(11.0, 0.6 + 1.9 * n_rows),
        layout="constrained",
    )
    panels = dict(zip(labels, grid.flat, strict=False))
    for panel, name in zip(panels.values(), wrapped(labels), strict=True):
        panel.set_title(name, fontsize="small", fontweight="normal")
        panel.tick_params(labelsize="x-small")
    for empty in grid.flat[len(labels) :]:
        empty.set_visible(False)
    for above_empty in grid[-2, len(labels) % _COLUMNS or _COLUMNS :]:
        above_empty.xaxis.set_tick_params(labelbottom=True)
    return panels


def finish(axes: Mapping[str, Axes], title: str | None, x: str, y: str, **limits: Any) -> Axes:
    """Write the title and the names of both axes, and return the first axes.

    Axes that all algorithms share get a legend, panels the lines of the other algorithms in grey.
    Panels have the same limits, which may be given.
    """
    first = next(iter(axes.values()))
    first.set(**limits)
    if len(set(axes.values())) == 1:
        first.set(xlabel=x, ylabel=y, title=title or "")
        add_legend_beside(first)
        return first
    lines = {label: _corners(panel.lines[0]) for label, panel in axes.items() if panel.lines}
    handles = first.get_legend_handles_labels()[0]
    further = [handle for handle in handles if handle is not first.lines[0]]
    for label, panel in axes.items():
        panel.set(xlabel="", ylabel="")
        if legend := panel.get_legend():
            legend.remove()
        others = [line for other, line in lines.items() if other != label]
        grey = LineCollection(others, colors="0.85", linewidths=0.7, zorder=0.5)
        panel.add_collection(grey, autolim=False)
    fig = first.figure.figure
    fig.suptitle(title or "", x=0.01, ha="left", fontweight="bold")
    fig.supxlabel(x)
    fig.supylabel(y)
    if further:
        fig.legend(handles=further, loc="outside lower right")
    return first


def add_legend_beside(ax: Axes) -> None:
    """Put the legend right of ``ax``, if something there has a name."""
    handles, names = ax.get_legend_handles_labels()
    if handles:
        ax.legend(handles, wrapped(names), loc="upper left", bbox_to_anchor=(1.0, 1.0))


def _corners(line: Line2D) -> FloatArray:
    """Return the points (n, 2) of a line as it is drawn, in steps or not."""
    return np.transpose(STEP_LOOKUP_MAP[line.get_drawstyle()](*line.get_data()))


def log_axis(ax: Axes, which: Literal["x", "y"] = "x") -> None:
    """Make an axis logarithmic, with numbers that people read: 0.01, 200, 10,000, 2M."""
    ax.set(**{f"{which}scale": "log"})
    axis = ax.xaxis if which == "x" else ax.yaxis
    low, high = ax.get_xlim() if which == "x" else ax.get_ylim()
    if high < 5 * low:
        axis.set_major_locator(MaxNLocator(4))
    elif high < 50 * low:
        axis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
    # The formatter of matplotlib writes mathematics, which the theme switches off.
    axis.set_major_formatter(FuncFormatter(lambda value, _: tick_text(value)))
    axis.set_minor_formatter(NullFormatter())


def tick_text(value: float) -> str:
    """Write a number without an exponent: 0.001, 1, 10,000; millions as 2M."""
    return f"{value / 1e6:,.10g}M" if value >= 1e6 else f"{value:,.10f}".rstrip("0").rstrip(".")


def draw_bound(axes: Iterable[Axes], bound: float, which: Literal["x", "y"]) -> None:
    """Draw a dashed line at the area ``bound`` on axes with the same limits, which then reach it.

    A line that would more than double the areas that are shown is left out.
    """
    for ax in axes:
        low, high = ax.get_xlim() if which == "x" else ax.get_ylim()
        if bound <= high + max(high - low, _LEAST_ROOM):
            draw = ax.axhline if which == "y" else ax.axvline
            label = f"no front exceeds {bound:.4f}"
            draw(bound, color=MUTED, ls="--", lw=1.0, zorder=1, label=label)
            ax.set(**{f"{which}lim": (low, max(high, bound))})
