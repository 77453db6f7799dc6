"""Free room on a picture: texts go where they cover neither a mark nor another text."""

from dataclasses import dataclass, field, replace
from functools import cache
from typing import Any, Self

import numpy as np
from matplotlib.axes import Axes
from matplotlib.font_manager import FontProperties
from matplotlib.patheffects import withStroke
from matplotlib.textpath import text_to_path
from numpy.typing import NDArray

from botohe_moo._base.types import FloatArray
from botohe_moo.plots.draw.style import MUTED

_SIDES = np.array([(1, 0), (1, 1), (1, -1), (0, 1), (0, -1), (-1, 1), (-1, -1), (-1, 0)])
_AWAY = (1.5, 6.0, 12.0, 20.0, 30.0, 45.0, 60.0)  # points between a mark and its text
_LEADER = 4.0  # points from which on a line ties them
_FARTHER = 4.0  # points by which other marks are farther from a text that is not tied
PAD = 1.5  # points that texts keep from each other, on either side


@cache
def text_size(text: str, size: float, *, bold: bool = False) -> tuple[float, float]:
    """Return width and height of a text in letters of ``size`` points, with some air around it."""
    font = FontProperties(size=size, weight="bold" if bold else "normal")
    lines = text.split("\n")
    widths = [
        text_to_path.get_text_width_height_descent(line, font, ismath=False)[0] for line in lines
    ]
    return max(widths) + 0.4 * size, 1.15 * size * len(lines)


@dataclass
class Space:
    """What is taken on a picture: its frame, marks, and texts as they are placed. In points."""

    marks: FloatArray  # centres of discs that no text covers (n, 2)
    radius: float
    frame: tuple[FloatArray, FloatArray]  # lower left and upper right corner
    lines: FloatArray  # points (n, 2) that texts should not cover if possible
    boxes: list[tuple[float, ...]] = field(default_factory=list)

    def copy(self) -> Self:
        """Give the same room, to try something in."""
        return replace(self, boxes=list(self.boxes))

    def beside(
        self, at: FloatArray, text: str, size: float, *, bold: bool = False, reach: float = 30.0
    ) -> FloatArray | None:
        """Take room up to ``reach`` from a mark, and give the offset of its centre, if any."""
        width, height = text_size(text, size, bold=bold)
        half = np.array([width, height]) / 2
        # On a diagonal, a box comes closer to a disc.
        sides = np.where(_SIDES.all(axis=1), 0.7, 1.0)[:, None] * _SIDES
        away = [sides * (self.radius + gap) + _SIDES * half for gap in _AWAY if gap <= reach]
        centres = at + np.concatenate(away)
        clear = self._is_clear(centres, half, at)
        for some in (centres[clear], centres[~clear]):
            found = self.place(some, width, height) if len(some) else None
            if found is not None:
                return np.asarray(found - at)
        return None

    def _is_clear(self, centres: FloatArray, half: FloatArray, at: FloatArray) -> NDArray[np.bool_]:
        """Tell where a text belongs to its mark: a line ties them, or all others are farther."""
        own = _gaps(centres, half, at[None])[:, 0]
        others = _gaps(centres, half, self.marks[(self.marks != at).any(axis=1)])
        tied = own > self.radius + _LEADER
        return np.asarray(tied | (others.min(axis=1, initial=np.inf) > own + _FARTHER))

    def place(self, centres: FloatArray, width: float, height: float) -> FloatArray | None:
        """Take room for a box at the best of ``centres`` (n, 2), and give it; None without room.

        The best is where the box covers the fewest points of lines, of those equal the first.
        """
        half = np.array([width / 2 + PAD, height / 2])
        low, high = centres - half, centres + half
        free = ((low >= self.frame[0]) & (high <= self.frame[1])).all(axis=1)
        if self.boxes:
            boxes = np.array(self.boxes)[:, None]
            apart = (low >= boxes[..., 2:]) | (high <= boxes[..., :2])
            free &= apart.any(axis=2).all(axis=0)
        around = (low.min(axis=0) - self.radius, high.max(axis=0) + self.radius)
        marks, lines = (_within(points, *around) for points in (self.marks, self.lines))
        best, fewest = -1, np.inf
        for i in np.flatnonzero(free):
            gap = np.maximum(low[i] - marks, marks - high[i]).clip(min=0.0)
            if ((gap**2).sum(axis=1) < self.radius**2).any():
                continue
            covered = len(_within(lines, low[i], high[i]))
            if covered < fewest:
                best, fewest = int(i), covered
        if best < 0:
            return None
        self.boxes.append((*low[best], *high[best]))
        return np.asarray(centres[best])


def _gaps(centres: FloatArray, half: FloatArray, points: FloatArray) -> FloatArray:
    """Compute how far points (m, 2) are from boxes around centres (n, 2), as (n, m)."""
    beyond = (np.abs(points - centres[:, None]) - half).clip(min=0.0)
    return np.asarray(np.hypot(beyond[..., 0], beyond[..., 1]))


def _within(points: FloatArray, low: FloatArray, high: FloatArray) -> FloatArray:
    """Give the points (n, 2) in a box."""
    x, y = points.T
    inside = (x > low[0]) & (x < high[0]) & (y > low[1]) & (y < high[1])
    return np.asarray(points[inside])


def write_beside(
    ax: Axes, at: FloatArray, offset: FloatArray, text: str, *, radius: float, **style: Any
) -> None:
    """Write a text centred ``offset`` points from a mark at data ``at``, tied to it if far."""
    if offset.any():
        style["path_effects"] = [withStroke(linewidth=1.8, foreground="white")]
        bold = style.get("fontweight") == "bold"
        half = np.array(text_size(text, style["fontsize"], bold=bold)) / 2
        beyond = (np.abs(offset) - half).clip(min=0.0)
        if np.hypot(*beyond) > radius + _LEADER:
            # From the text's edge that faces the mark.
            edge = 0.5 - np.clip(offset / half, -1, 1).round() / 2
            tie = {"arrowstyle": "-", "color": MUTED, "linewidth": 0.6, "relpos": tuple(edge)}
            style["arrowprops"] = {**tie, "shrinkA": 1.0, "shrinkB": radius}
    ax.annotate(
        text,
        tuple(at),
        tuple(offset),
        textcoords="offset points",
        ha="center",
        va="center" if "\n" in text else "center_baseline",
        linespacing=1.0,
        zorder=6,
        **style,
    )
