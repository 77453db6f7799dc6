"""What pictures of studies share: which algorithms they show, how, and on which axes."""

from __future__ import annotations

import textwrap
from collections.abc import Iterable, Sequence
from itertools import cycle
from typing import TYPE_CHECKING, Any, Literal

from matplotlib.axes import Axes
from matplotlib.ticker import LogLocator, MaxNLocator, NullFormatter

from botohe_moo.base.messages import check_choice, check_frame
from botohe_moo.base.parameters import Probability, check
from botohe_moo.plots.style import MARKERS, MUTED, Palette, palette_of

if TYPE_CHECKING:
    import pandas as pd

_NAME = 30  # most letters in a line of an algorithm's name


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
    """Return colour, marker and name of each line."""
    pairs = zip(palette_of(labels, palette).items(), cycle(MARKERS), strict=False)
    return {
        label: {"color": colour, "marker": marker, "label": label}
        for (label, colour), marker in pairs
    }


def finish(ax: Axes, title: str | None, x: str, y: str) -> Axes:
    """Write the title, the names of both axes, and right of them the legend, if there is one."""
    ax.set(xlabel=x, ylabel=y, title=title or "")
    handles, names = ax.get_legend_handles_labels()
    if handles:
        ax.legend(handles, wrapped(names), loc="upper left", bbox_to_anchor=(1.0, 1.0))
    return ax


def log_axis(ax: Axes, which: Literal["x", "y"] = "x") -> None:
    """Make an axis logarithmic, with numbers that people read: 0.01, 200, 10,000."""
    ax.set(**{f"{which}scale": "log"})
    axis = ax.xaxis if which == "x" else ax.yaxis
    low, high = axis.get_view_interval()
    if high < 5 * low:
        axis.set_major_locator(MaxNLocator(4))
    elif high < 50 * low:
        axis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
    # The formatter of matplotlib writes mathematics, which the theme switches off.
    axis.set_major_formatter(lambda value, _: f"{value:,.10f}".rstrip("0").rstrip("."))
    axis.set_minor_formatter(NullFormatter())


def draw_bound(ax: Axes, bound: float | None, which: Literal["x", "y"]) -> None:
    """Draw a dashed line at the area ``bound``, which the axis then reaches.

    A line that would more than double the areas that are shown is left out.
    """
    low, high = (ax.xaxis if which == "x" else ax.yaxis).get_view_interval()
    if bound is not None and check("bound", bound, Probability) <= 2 * high - low:
        draw = ax.axvline if which == "x" else ax.axhline
        label = f"no front exceeds {bound:.4f}"
        draw(bound, color=MUTED, ls="--", lw=1.0, zorder=1, label=label)
        ax.set(**{f"{which}lim": (low, max(high, bound))})
