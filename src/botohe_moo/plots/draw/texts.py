"""Texts on pictures: titles above them, and labels that cover neither marks nor each other."""

import textwrap
from functools import cache
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.font_manager import FontProperties
from matplotlib.patheffects import withStroke
from matplotlib.textpath import text_to_path

from botohe_moo.base.types import FloatArray
from botohe_moo.plots.draw.style import INK, MUTED, readable_on

_WORDS, _SUBTITLE = "_words", "_subtitle"
_SIDES = np.array([(1, 0), (1, 1), (1, -1), (0, 1), (0, -1), (-1, 1), (-1, -1), (-1, 0)])

# In points:
_AWAY = (1.5, 6.0, 12.0, 20.0, 30.0, 45.0, 60.0)  # distances of a text from its mark
_LEADER = 4.0  # distance from which on a line ties them
_FARTHER = 4.0  # how much farther other marks are from a text that no line ties to its own
_LEAST = 5.8  # least height of letters in a mark
_PAD = 1.5  # left and right of texts


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


def objectives_text(reward: float, survivors: float) -> str:
    """Write the objectives of a plan."""
    return f"E[R] = {reward:.2f}, E[S] = {survivors:.2f}"


@cache
def text_size(text: str, size: float, *, bold: bool = False) -> tuple[float, float]:
    """Return width and height of a text in letters of ``size`` points, with some air around it."""
    font = FontProperties(size=size, weight="bold" if bold else "normal")
    lines = text.split("\n")
    widths = [
        text_to_path.get_text_width_height_descent(line, font, ismath=False)[0] for line in lines
    ]
    return max(widths) + 0.2 * size, 1.15 * size * len(lines)


class Space:
    """Room on axes whose scale is known. ``boxes`` are the texts, in points, as they are placed.

    Texts cover no mark at ``marks`` (n, 2), a disc of ``radius`` points, and as few of the points
    ``lines`` (n, 2) as possible.
    """

    def __init__(self, ax: Axes, marks: FloatArray, radius: float, lines: FloatArray) -> None:
        self.ax, self.radius = ax, radius
        self.marks, self.lines = self.in_points(marks), self.in_points(lines.reshape(-1, 2))
        box = ax.get_window_extent()
        self._frame = np.array([box.min, box.max]) * 72 / ax.figure.figure.dpi
        self.boxes: list[tuple[float, ...]] = []

    def in_points(self, xy: FloatArray) -> FloatArray:
        """Return where data (n, 2) lie on paper."""
        return np.asarray(self.ax.transData.transform(xy)) * 72 / self.ax.figure.figure.dpi

    def place(
        self, centres: FloatArray, width: float, height: float, costs: FloatArray
    ) -> int | None:
        """Take room for a box at one of ``centres`` (n, 2), and return which; None without room.

        The box covers the fewest points of lines, plus ``costs`` (n); of equal places the first.
        """
        half = np.array([width / 2 + _PAD, height / 2])
        low, high = centres - half, centres + half
        free = ((low >= self._frame[0]) & (high <= self._frame[1])).all(axis=1)
        if self.boxes:
            boxes = np.array(self.boxes)[:, None]
            free &= ((low >= boxes[..., 2:]) | (high <= boxes[..., :2])).any(axis=2).all(axis=0)
        around = low.min(axis=0) - self.radius, high.max(axis=0) + self.radius
        marks, lines = (_within(points, *around) for points in (self.marks, self.lines))
        free &= _gaps(centres, half, marks).min(axis=1, initial=np.inf) >= self.radius
        if not free.any():
            return None
        covered = (_gaps(centres, half, lines) == 0).sum(axis=1) + costs
        best = int(np.argmin(np.where(free, covered, np.inf)))
        self.boxes.append((*low[best], *high[best]))
        return best

    def write_inside(self, at: FloatArray, text: str, fill: Any) -> bool:
        """Write a text into a mark at data ``at``, if it fits there."""
        room = 1.75 * self.radius
        size = min(9.0, 0.6 * room, room / max(text_size(text, 1.0)[0], 1e-9))
        if size < _LEAST:
            return False
        look: dict[str, Any] = {"fontsize": size, "color": readable_on(fill), "zorder": 6}
        self.ax.annotate(text, tuple(at), ha="center", va="center_baseline", **look)
        return True

    def write_beside(
        self, at: FloatArray, text: str, size: float, *, reach: float, bold: bool = False
    ) -> bool:
        """Write a text up to ``reach`` points from a mark at data ``at``, if there is room.

        The text belongs to its mark: a line ties them, or all other marks are farther, if possible.
        """
        width, height = text_size(text, size, bold=bold)
        half, (mark,) = np.array([width, height]) / 2, self.in_points(at[None])
        # On a diagonal, a box comes closer to a disc.
        sides = np.where(_SIDES.all(axis=1), 0.7, 1.0)[:, None] * _SIDES
        away = [sides * (self.radius + gap) + _SIDES * half for gap in _AWAY if gap <= reach]
        offsets = np.concatenate(away)
        distance = _gaps(offsets, half, np.zeros((1, 2)))[:, 0]
        tied = distance > self.radius + _LEADER
        others = _gaps(mark + offsets, half, self.marks[(self.marks != mark).any(axis=1)])
        clear = tied | (others.min(axis=1, initial=np.inf) > distance + _FARTHER)
        best = self.place(mark + offsets, width, height, np.where(clear, 0.0, 1e6))
        if best is None:
            return False
        look: dict[str, Any] = {"fontsize": size, "fontweight": "bold" if bold else "normal"}
        if tied[best]:
            # From the text's edge that faces the mark.
            edge = tuple(0.5 - np.clip(offsets[best] / half, -1, 1).round() / 2)
            look["arrowprops"] = {"arrowstyle": "-", "color": MUTED, "lw": 0.6, "relpos": edge}
            look["arrowprops"] |= {"shrinkA": 1.0, "shrinkB": self.radius}
        self.ax.annotate(
            text,
            tuple(at),
            tuple(offsets[best]),
            textcoords="offset points",
            ha="center",
            va="center" if "\n" in text else "center_baseline",
            linespacing=1.0,
            color=INK,
            path_effects=[withStroke(linewidth=1.8, foreground="white")],
            zorder=6,
            annotation_clip=False,
            **look,
        )
        return True


def _gaps(centres: FloatArray, half: FloatArray, points: FloatArray) -> FloatArray:
    """Compute how far points (m, 2) are from boxes around centres (n, 2), as (n, m)."""
    beyond = (np.abs(points - centres[:, None]) - half).clip(min=0.0)
    return np.asarray(np.hypot(beyond[..., 0], beyond[..., 1]))


def _within(points: FloatArray, low: FloatArray, high: FloatArray) -> FloatArray:
    """Return the points (n, 2) in a box."""
    return np.asarray(points[((points > low) & (points < high)).all(axis=1)])
