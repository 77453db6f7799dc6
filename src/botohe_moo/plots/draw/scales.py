"""Axes of a study's plots: logarithmic scales, labels at the ends of curves, titles."""

from collections.abc import Iterable, Mapping, Sequence
from typing import Any, Literal

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from matplotlib.markers import TICKDOWN, TICKLEFT
from matplotlib.ticker import FuncFormatter, LogLocator, NullLocator

from botohe_moo._base.types import FloatArray
from botohe_moo.plots.draw.algorithms import AlgorithmStyle, marks, names_of, stroke
from botohe_moo.plots.draw.labels import drawable, wrapped
from botohe_moo.plots.draw.style import INK, MUTED, dress

_END = 10.0  # points of the letters of names right of axes


def log_axis(
    ax: Axes, low: float, high: float, which: Literal["x", "y"] = "x", *, small: bool = True
) -> None:
    """Make an axis logarithmic, from ``low`` to ``high``, with numbers people read."""
    dress(ax)
    axis = ax.xaxis if which == "x" else ax.yaxis
    if high < 6.5 * low:  # less has no room for two of the numbers 1, 2 and 5
        middle = np.sqrt(low * high)
        low, high = min(low, middle / np.sqrt(10)), middle * np.sqrt(10)
    ax.set(**{f"{which}scale": "log", f"{which}lim": (low, high)})
    decades = np.log10(high / low)
    if decades > 8:
        axis.set_major_locator(LogLocator(numticks=8))
    else:
        subs = (1.0, 2.0, 5.0) if decades < 1.7 else (1.0,)
        axis.set_major_locator(LogLocator(subs=subs, numticks=12))
        if small:
            _small_ticks(ax, low, high, which)
    axis.set_minor_locator(NullLocator())
    # Matplotlib's own formatter writes mathematics, which the theme switches off for labels' sake.
    axis.set_major_formatter(FuncFormatter(lambda value, _: plain_number(value)))


def _small_ticks(ax: Axes, low: float, high: float, which: Literal["x", "y"]) -> None:
    """Mark 2, 3, ... 9 of every decade; as one line, since ticks are slow to draw."""
    decades = 10.0 ** np.arange(np.floor(np.log10(low)), np.ceil(np.log10(high)))
    at = np.outer(decades, np.arange(2, 10)).ravel()
    at = at[(low <= at) & (at <= high)]
    along = ax.get_xaxis_transform() if which == "x" else ax.get_yaxis_transform()
    edge = np.zeros(len(at))
    ax.plot(
        *((at, edge) if which == "x" else (edge, at)),
        linestyle="none",
        marker=TICKDOWN if which == "x" else TICKLEFT,
        markersize=2.5,
        color=MUTED,
        transform=along,
        clip_on=False,
        gid="small ticks",
    )


def plain_number(value: float) -> str:
    """Write a number without an exponent: 0.001, 1, 10,000; millions as 2M."""
    if value >= 1e6:
        return f"{value / 1e6:,.10g}M"
    return f"{value:,.0f}" if value >= 1 else f"{value:.10f}".rstrip("0")


def title_above(
    ax: Axes, title: str | None, words: str, *, width: float | None = None, lift: float = 0.0
) -> None:
    """Write what the plot is above it, and below that, paler, what it shows; or write it anew."""
    for text in [text for text in ax.texts if text.get_gid() in ("words", "subtitle")]:
        text.remove()
    if width is None:
        width = ax.get_window_extent().width / ax.figure.figure.dpi
    head, _, rest = (title or "").partition("\n")
    pale = {"color": "0.4"}
    at = stack_above(
        ax, [(words, "words", 9.5, pale), (rest, "subtitle", 10.0, pale)], width, 7.0 + lift
    )
    head = wrapped(drawable(head), _fitting(width, 13.5))
    # With its height given, matplotlib does not look at all numbers of the axes to find one.
    ax.set_title(head, loc="left", fontweight="bold", pad=at + 1.5, y=1.0)


def retitle(ax: Axes, title: str) -> None:
    """Give a plot another title, and leave the line below it."""
    words = [text.get_text() for text in ax.texts if text.get_gid() == "words"]
    title_above(ax, title, " ".join(" ".join(words).split()))


def stack_above(
    ax: Axes, parts: Iterable[tuple[str, str, float, Mapping[str, Any]]], width: float, at: float
) -> float:
    """Write texts above each other, the lowest first, and give the points that they reach up to."""
    for text, name, size, style in parts:
        if text:
            lines = wrapped(drawable(text), _fitting(width, size))
            ax.annotate(
                lines,
                (0, 1),
                (0, at),
                xycoords="axes fraction",
                textcoords="offset points",
                fontsize=size,
                gid=name,
                **style,
            )
            at += 1.25 * size * (lines.count("\n") + 1) + 1.5
    return at


def _fitting(width: float, size: float) -> int:
    """Columns that fit on ``width`` inches in letters of ``size`` points."""
    return max(8, int(width * 72 / (0.56 * size)))


def label_ends(ax: Axes, ends: Mapping[str, float], styles: Mapping[str, AlgorithmStyle]) -> None:
    """Write names right of ``ax`` at the heights where their curves end, none over another."""
    names = names_of(ends, styles)
    n_lines = np.array([name.count("\n") + 1 for name in names.values()])
    box = ax.get_window_extent()
    points = box.height / ax.figure.figure.dpi * 72
    size = float(np.clip(points / (1.35 * n_lines.sum()), 6.5, _END))
    heights = np.array([ax.transData.transform((1.0, end))[1] for end in ends.values()])
    wanted = (heights - box.y0) / box.height
    places = spread(wanted, (1.2 * n_lines + 0.15) * size / points)
    width = box.width / ax.figure.figure.dpi * 72
    start, bend, mark, end = (1 + part / width for part in (0, 9, 14, 31))
    ax.add_collection(
        LineCollection(
            [
                [(start, wish), (bend, place), (mark, place)]
                for wish, place in zip(wanted, places, strict=True)
            ],
            colors=[styles[label].colour for label in names],
            linewidths=0.8,
            transform=ax.transAxes,
            clip_on=False,
            gid="leaders",
        ),
        autolim=False,
    )
    for (label, name), place in zip(names.items(), places, strict=True):
        style = styles[label]
        ax.plot(
            [mark, end],
            [place, place],
            transform=ax.transAxes,
            **stroke(style, 2.0),
            **marks(style, 6, rim=0.6),
            markevery=[1],
            clip_on=False,
            gid="end",
        )
        ax.annotate(
            name,
            (end, place),
            (6, 0),
            xycoords="axes fraction",
            textcoords="offset points",
            va="center" if "\n" in name else "center_baseline",
            fontsize=size,
            linespacing=1.1,
            color=INK,
            gid="name",
        )


def spread(
    wanted: Sequence[float] | FloatArray, gap: float | Sequence[float] | FloatArray
) -> FloatArray:
    """Move places in [0, 1] as little as needed so that they lie ``gap`` apart, in their order.

    The least sum of squared moves: neighbours that are too close share their mean (pool adjacent
    violators). A ``gap`` may also be the height of each place. Without room for all, they exceed 1.

    >>> spread([0.5, 0.5, 0.9], 0.2).round(9).tolist()
    [0.4, 0.6, 0.9]
    """
    order = np.argsort(wanted, kind="stable")
    heights = np.broadcast_to(np.asarray(gap, float), len(order))[order]
    offsets = np.concatenate([[0.0], np.cumsum((heights[:-1] + heights[1:]) / 2)])[: len(order)]
    pools: list[tuple[float, int]] = []
    for at in np.asarray(wanted, float)[order] - offsets:
        mean, size = float(at), 1
        while pools and pools[-1][0] >= mean:
            before, n = pools.pop()
            mean, size = (before * n + mean * size) / (n + size), n + size
        pools.append((mean, size))
    moved = np.concatenate([np.full(n, mean) for mean, n in pools] or [np.empty(0)])
    moved = np.clip(moved, 0.0, max(0.0, 1.0 - offsets[-1:].sum()))
    places = np.empty(len(order))
    places[order] = moved + offsets
    return places
