"""Titles above maps and fronts: what the picture is, and below that, paler, what it shows."""

import textwrap

from matplotlib.axes import Axes

_WORDS, _SUBTITLE = "_words", "_subtitle"


def title_above(
    ax: Axes, title: str | None, words: str, *, width: float | None = None, lift: float = 0.0
) -> None:
    """Write a title above a picture and pale ``words`` below it, or write them anew.

    What follows a line break in the title is pale, too. Lines are broken at ``width`` inches, by
    default those of ``ax``; all is lifted by ``lift`` points.
    """
    for text in [text for text in ax.texts if text.get_label() in (_WORDS, _SUBTITLE)]:
        text.remove()
    if width is None:
        width = ax.get_window_extent().width / ax.figure.figure.dpi
    head, _, rest = (title or "").partition("\n")
    at = 7.0 + lift
    for pale, size, name in ((words, 9.5, _WORDS), (rest, 10.0, _SUBTITLE)):
        if pale:
            lines = textwrap.wrap(pale, _fitting(width, size))
            ax.annotate(
                "\n".join(lines),
                (0, 1),
                (0, at),
                xycoords="axes fraction",
                textcoords="offset points",
                fontsize=size,
                color="0.4",
                label=name,
            )
            at += 1.25 * size * len(lines) + 1.5
    head = textwrap.fill(head, _fitting(width, 12.0))
    ax.set_title(head, loc="left", fontsize=12, fontweight="bold", pad=at + 1.5)


def _fitting(width: float, size: float) -> int:
    """Return how many letters of ``size`` points fit on ``width`` inches."""
    return max(8, int(width * 72 / (0.56 * size)))
