"""Sheets of maps: a large place and small ones on a grid, with names, and a key of shades."""

from collections.abc import Sequence

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import Normalize
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from botohe_moo._base.types import FloatArray
from botohe_moo.plots.draw.canvas import add_colour_bar, crowding, frame_of
from botohe_moo.plots.draw.style import reach_palette
from botohe_moo.plots.draw.titles import title_above
from botohe_moo.plots.draw.trails import RobotStyle

Place = tuple[float, float, float, float]  # left, bottom, width, height in parts of the figure

_NAME, _ABOVE, _RIGHT, _GAP = 0.34, 0.8, 0.95, 0.15  # inches: over a map, the title, the key
_SHAPE, _EMPTY = 1.4, 0.25  # width of a figure in parts of its height; what an empty place costs


def map_size(xy: FloatArray, widest: float, *, room: float = 20.0) -> tuple[float, float]:
    """Give the inches at which most nodes have ``room`` points, by default for numbers."""
    _, half = frame_of(xy)
    spacing = crowding(xy) if len(xy) > 1 else np.inf
    # In points, on a map an inch wide; nodes may lie on each other.
    wide = float(np.clip(room / max(72 * spacing / (2 * half[0]), 1e-9), 4.2, widest))
    return wide, wide * half[1] / half[0]


def open_sheet(size: tuple[float, float], n_small: int, span: int) -> tuple[Figure, list[Place]]:
    """Open a figure for maps of ``size`` inches; give their places.

    The first is ``span`` times as wide and high as the ``n_small`` others.
    """
    wide, high = size[0], size[1] + _NAME
    cells = n_small + span**2
    shapes = [(n, max(span, -(-cells // n))) for n in range(span, cells + 1)]
    n_columns, n_rows = min(shapes, key=lambda shape: _fault(shape, wide / high, cells))
    width = 0.1 + n_columns * (wide + _GAP) - _GAP + _RIGHT
    height = _ABOVE + n_rows * high + 0.1
    grid = [divmod(place, n_columns) for place in range(n_columns * n_rows)]
    small = [(*cell, 1) for cell in grid if max(cell) >= span]
    places: list[Place] = []
    for row, column, n in [(0, 0, span), *small][: n_small + 1]:
        own = (n * wide + (n - 1) * _GAP, n * high - _NAME)
        left, bottom = 0.1 + column * (wide + _GAP), height - _ABOVE - (row + n) * high
        places.append((left / width, bottom / height, own[0] / width, own[1] / height))
    return plt.figure(figsize=(width, height)), places


def _fault(shape: tuple[int, int], aspect: float, cells: int) -> float:
    """Say how much columns and rows differ from the shape of a page."""
    n_columns, n_rows = shape
    empty = n_columns * n_rows - cells
    return float(abs(np.log(aspect * n_columns / n_rows / _SHAPE)) + _EMPTY * empty)


def title_sheet(first: Axes, title: str, words: str) -> None:
    """Write title and words above all maps."""
    width = first.figure.figure.get_figwidth() - _RIGHT
    title_above(first, title, words, width=width, lift=72 * _NAME)


def add_reach_bar(ax: Axes) -> None:
    """Put the key of the nodes' shades right of a map."""
    add_colour_bar(ax, reach_palette(), Normalize(0, 1), "probability of being reached")


def rightmost(maps: Sequence[Axes]) -> Axes:
    """Give the map at the right edge, the highest of them."""
    return max(maps, key=lambda ax: (round(ax.get_position().x1, 6), ax.get_position().y1))


def key_of(text: str, style: RobotStyle) -> Line2D:
    """Give the line of a robot, for a legend."""
    return Line2D([], [], color=style.colour, linestyle=style.line, linewidth=2.4, label=text)


def name_map(ax: Axes, text: str, style: RobotStyle | None = None) -> None:
    """Name a map above its upper left corner, with the line of its robot."""
    key = Line2D([], [], linestyle="none", label=text) if style is None else key_of(text, style)
    ax.legend(
        handles=[key],
        loc="lower left",
        bbox_to_anchor=(0.0, 1.0),
        borderaxespad=0.1,
        borderpad=0.2,
        handlelength=0.0 if style is None else 2.4,
        handletextpad=0.0 if style is None else 0.8,
        fontsize=9.5,
        frameon=False,
    )
