"""Free room on a map: texts go where they cover neither a node nor another text."""

from dataclasses import dataclass, field
from typing import Any, Self

import numpy as np
from matplotlib.patheffects import withStroke
from numpy.typing import NDArray

from botohe_moo._base.types import FloatArray
from botohe_moo.plots.draw.canvas import Canvas
from botohe_moo.plots.draw.labels import columns
from botohe_moo.plots.draw.style import MUTED

_SIDES = np.array([(1, 0), (1, 1), (1, -1), (0, 1), (0, -1), (-1, 1), (-1, -1), (-1, 0)])
_AWAY = (1.5, 6.0, 12.0, 20.0, 30.0)  # points between a node and its text
_LEADER = 4.0  # points from which on a line ties them
_PAD = 1.5  # points that texts keep from each other, on either side


def text_size(text: str, size: float) -> tuple[float, float]:
    """Estimate width and height of a text in letters of ``size`` points."""
    narrow = min(line.count(",") + line.count(" ") for line in text.split("\n"))
    return size * (0.64 * columns(text) - 0.3 * narrow), 1.15 * size * (text.count("\n") + 1)


@dataclass
class Space:
    """What is taken on a canvas: the nodes, and texts as they are placed. All units are points."""

    canvas: Canvas
    lines: FloatArray  # points (n, 2) that texts had better not cover
    drawn: NDArray[np.bool_]  # the nodes that are there to be covered (n_nodes,)
    boxes: list[tuple[float, ...]] = field(default_factory=list)

    def __post_init__(self) -> None:
        self._nodes = self.canvas.xy * self.canvas.scale
        self._discs = self._nodes[self.drawn]
        limits = np.array([self.canvas.ax.get_xlim(), self.canvas.ax.get_ylim()])
        self._low, self._high = limits.T * self.canvas.scale

    def copy(self) -> Self:
        """Give the same room, to try something in."""
        return type(self)(self.canvas, self.lines, self.drawn, list(self.boxes))

    def beside(self, node: int, text: str, size: float) -> FloatArray | None:
        """Take room beside a node, and give the offset of its centre; None without room."""
        width, height = text_size(text, size)
        half = np.array([width, height]) / 2
        # On a diagonal, a box comes closer to a disc.
        reach = np.where(_SIDES.all(axis=1), 0.7, 1.0)[:, None] * _SIDES
        away = [reach * (self.canvas.radius + gap) + _SIDES * half for gap in _AWAY]
        found = self.place(self._nodes[node] + np.concatenate(away), width, height)
        return None if found is None else found - self._nodes[node]

    def place(self, centres: FloatArray, width: float, height: float) -> FloatArray | None:
        """Take room for a box at the best of ``centres`` (n, 2), and give it; None without room.

        The best is where the box covers the fewest points of lines, of those equal the first.
        """
        half = np.array([width / 2 + _PAD, height / 2])
        low, high = centres - half, centres + half
        free = ((low >= self._low) & (high <= self._high)).all(axis=1)
        if self.boxes:
            boxes = np.array(self.boxes)[:, None]
            apart = (low >= boxes[..., 2:]) | (high <= boxes[..., :2])
            free &= apart.any(axis=2).all(axis=0)
        best, fewest = -1, np.inf
        for i in np.flatnonzero(free):
            gap = np.maximum(low[i] - self._discs, self._discs - high[i]).clip(min=0.0)
            if (gap**2).sum(axis=1).min() < self.canvas.radius**2:
                continue
            covered = ((self.lines > low[i]) & (self.lines < high[i])).all(axis=1).sum()
            if covered < fewest:
                best, fewest = int(i), covered
        if best < 0:
            return None
        self.boxes.append((*low[best], *high[best]))
        return np.asarray(centres[best])


def write_at(canvas: Canvas, node: int, offset: FloatArray, text: str, **style: Any) -> None:
    """Write a text centred ``offset`` points from a node, tied to it if that is far."""
    if offset.any():
        style["path_effects"] = [withStroke(linewidth=1.8, foreground="white")]
        width, height = text_size(text, style["fontsize"])
        beyond = (np.abs(offset) - (width / 2, height / 2)).clip(min=0.0)
        if np.hypot(*beyond) > canvas.radius + _LEADER:
            tie = {"arrowstyle": "-", "color": MUTED, "linewidth": 0.5}
            style["arrowprops"] = {**tie, "shrinkA": 1.0, "shrinkB": canvas.radius}
    canvas.ax.annotate(
        text,
        tuple(canvas.xy[node]),
        tuple(offset),
        textcoords="offset points",
        ha="center",
        va="center" if "\n" in text else "center_baseline",
        linespacing=1.0,
        zorder=6,
        **style,
    )
