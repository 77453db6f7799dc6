"""Titles above pictures of missions."""

from collections.abc import Iterable, Mapping
from typing import Any

from matplotlib.axes import Axes

from botohe_moo.plots.draw.labels import drawable, wrapped


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
