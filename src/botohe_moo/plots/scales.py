"""Axes that the plots of a study share: logarithmic ones, labels at the ends of curves, titles."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter, NullLocator

from botohe_moo.plots.style import INK, MUTED

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from matplotlib.axes import Axes

    from botohe_moo._types import FloatArray
    from botohe_moo.plots.algorithms import AlgorithmStyle

__all__ = ["dress", "label_ends", "log_axis", "spread", "title_above"]


def dress(ax: Axes) -> None:
    """Give axes the grid and the frame of all plots."""
    ax.grid(color="0.92", linewidth=0.8)
    ax.set_axisbelow(True)
    ax.spines[["top", "right"]].set_visible(False)


def log_axis(ax: Axes, low: float, high: float) -> None:
    """Make the horizontal axis logarithmic, from ``low`` to ``high``, with numbers people read."""
    dress(ax)
    ax.set_xscale("log")
    if high < 6.5 * low:  # less has no room for two of the numbers 1, 2 and 5
        middle = np.sqrt(low * high)
        low, high = min(low, middle / np.sqrt(10)), middle * np.sqrt(10)
    ax.set_xlim(low, high)
    decades = np.log10(high / low)
    if decades > 8:
        ax.xaxis.set_major_locator(LogLocator(numticks=8))
        ax.xaxis.set_minor_locator(NullLocator())
    else:
        subs = (1.0, 2.0, 5.0) if decades < 1.7 else (1.0,)
        ax.xaxis.set_major_locator(LogLocator(subs=subs, numticks=12))
        ax.xaxis.set_minor_locator(LogLocator(subs=range(2, 10), numticks=12))
    # Matplotlib's own formatter writes mathematics, which the theme switches off for labels' sake.
    ax.xaxis.set_major_formatter(FuncFormatter(lambda value, _: plain_number(value)))
    ax.xaxis.set_minor_formatter(NullFormatter())
    ax.tick_params(which="minor", length=2.5, color=MUTED)


def plain_number(value: float) -> str:
    """Write a number without an exponent: 0.001, 1, 10,000; millions as 2M."""
    if value >= 1e6:
        return f"{value / 1e6:,.10g}M"
    return f"{value:,.0f}" if value >= 1 else f"{value:.10f}".rstrip("0")


def title_above(ax: Axes, title: str | None, words: str) -> None:
    """Write what the plot is above it, and below that, paler, what it shows."""
    ax.set_title(title or "", loc="left", fontweight="bold", pad=24 if title else 6)
    ax.annotate(
        words,
        (0, 1),
        (0, 7),
        xycoords="axes fraction",
        textcoords="offset points",
        fontsize=9.5,
        color="0.4",
        gid="words",
    )


def label_ends(ax: Axes, ends: Mapping[str, float], styles: Mapping[str, AlgorithmStyle]) -> None:
    """Write names right of ``ax`` at the heights where their curves end, none over another.

    Parameters
    ----------
    ax
        Axes with its limits set.
    ends
        Height of each name, in data units.
    styles
        Style of each name.
    """
    low, high = ax.get_ylim()
    points = ax.get_window_extent().height / ax.figure.figure.dpi * 72
    size = float(np.clip(points / (1.35 * len(ends)), 6.5, 10.0))
    wanted = (np.array(list(ends.values())) - low) / (high - low)
    places = spread(wanted, 1.35 * size / points)
    for name, wish, place in zip(ends, wanted, places, strict=True):
        style = styles[name]
        ax.plot(
            [1.0, 1.022, 1.034],
            [wish, place, place],
            transform=ax.transAxes,
            color=style.colour,
            linewidth=0.8,
            clip_on=False,
            gid="leader",
        )
        ax.plot(
            [1.034, 1.075],
            [place, place],
            transform=ax.transAxes,
            color=style.colour,
            linewidth=2.0,
            linestyle=style.line,
            marker=style.marker,
            markevery=[1],
            markersize=6,
            markeredgecolor="white",
            markeredgewidth=0.6,
            clip_on=False,
            gid="end",
        )
        ax.annotate(
            name,
            (1.075, place),
            (6, 0),
            xycoords="axes fraction",
            textcoords="offset points",
            va="center_baseline",
            fontsize=size,
            color=INK,
            gid="name",
        )


def spread(wanted: Sequence[float] | FloatArray, gap: float) -> FloatArray:
    """Move places in [0, 1] as little as needed so that they lie ``gap`` apart, in their order.

    The least sum of squared moves: neighbours that are too close share their mean (pool adjacent
    violators). Where there is no room for all, they run over 1.

    Parameters
    ----------
    wanted
        Where the places would be if there were room.
    gap
        Least distance.

    Returns
    -------
    numpy.ndarray
        The places, in the order of ``wanted``.

    Examples
    --------
    >>> spread([0.5, 0.5, 0.9], 0.2).round(9).tolist()
    [0.4, 0.6, 0.9]
    """
    order = np.argsort(wanted, kind="stable")
    pools: list[tuple[float, int]] = []
    for at in np.asarray(wanted, float)[order] - gap * np.arange(len(order)):
        mean, size = float(at), 1
        while pools and pools[-1][0] >= mean:
            before, n = pools.pop()
            mean, size = (before * n + mean * size) / (n + size), n + size
        pools.append((mean, size))
    moved = np.concatenate([np.full(n, mean) for mean, n in pools] or [np.empty(0)])
    moved = np.clip(moved, 0.0, max(0.0, 1.0 - gap * (len(order) - 1)))
    places = np.empty(len(order))
    places[order] = moved + gap * np.arange(len(order))
    return places
