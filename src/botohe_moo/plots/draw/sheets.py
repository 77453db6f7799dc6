"""Sheets of maps: a large place and small ones on a grid, with names, and a key of shades."""

from collections.abc import Sequence

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import Normalize
from matplotlib.lines import Line2D

from botohe_moo.mission import Mission
from botohe_moo.plots.draw.canvas import add_colour_bar, crowding, frame_of, open_axes
from botohe_moo.plots.draw.places import node_positions
from botohe_moo.plots.draw.style import reach_palette
from botohe_moo.plots.draw.titles import title_above
from botohe_moo.plots.draw.trails import RobotStyle

_NAME, _ABOVE, _RIGHT, _GAP = 0.34, 0.8, 0.95, 0.15  # inches: over a map, the title, the key
_ROOM = 20.0  # points between most nodes, for numbers
_SHAPE, _EMPTY = 1.4, 0.25  # width of a figure in parts of its height; what an empty place costs


def open_sheet(
    mission: Mission, n_small: int, span: int, *, widest: float = 5.2, room: float = 0.0
) -> list[Axes]:
    """Open a figure with large axes, ``span`` times as wide and high as the maps beside them.

    Maps have ``room`` points, or what numbers need, between most nodes, within ``widest`` inches.
    """
    xy = node_positions(mission)
    _, half = frame_of(xy)
    # In points, on a map an inch wide; nodes may lie on each other.
    spacing = max(72 * crowding(xy) / (2 * half[0]), 1e-9)
    inner = float(np.clip(max(room, _ROOM) / spacing, 4.2, widest))
    wide, high = inner + _GAP, inner * half[1] / half[0] + _NAME
    cells = n_small + span**2
    shapes = [(n, max(span, -(-cells // n))) for n in range(span, cells + 1)]
    n_columns, n_rows = min(
        shapes,
        key=lambda s: abs(np.log(wide * s[0] / (high * s[1]) / _SHAPE)) + _EMPTY * s[0] * s[1],
    )
    width, height = n_columns * wide + _RIGHT, _ABOVE + n_rows * high
    fig = plt.figure(figsize=(width, height))
    # Every cell has a name above it, so the highest ones begin below that.
    grid = fig.add_gridspec(
        n_rows,
        n_columns,
        left=0.1 / width,
        right=1 - (_RIGHT + _GAP - 0.1) / width,
        bottom=0.1 / height,
        top=1 - (_ABOVE + _NAME - 0.1) / height,
        wspace=_GAP / inner,
        hspace=_NAME / (high - _NAME),
    )
    cells_of = [grid[row, column] for row, column in np.ndindex(n_rows, n_columns)]
    small = [c for c in cells_of if max(c.rowspan.start, c.colspan.start) >= span][:n_small]
    axes = [fig.add_subplot(cell) for cell in (grid[:span, :span], *small)]
    for ax in axes[1:]:
        open_axes(xy, ax)
    return axes


def add_reach_bar_right(maps: Sequence[Axes]) -> None:
    """Put the key of the nodes' shades right of the highest of the rightmost maps."""
    add_reach_bar(max(maps, key=lambda ax: (round(ax.get_position().x1, 6), ax.get_position().y1)))


def title_sheet(first: Axes, title: str, words: str) -> None:
    """Write title and words above all maps."""
    width = first.figure.figure.get_figwidth() - _RIGHT
    title_above(first, title, words, width=width, lift=72 * _NAME)


def add_reach_bar(ax: Axes) -> None:
    """Put the key of the nodes' shades right of a map."""
    add_colour_bar(ax, reach_palette(), Normalize(0, 1), "probability of being reached")


def key_of(text: str, style: RobotStyle) -> Line2D:
    """Return the line of a robot, for a legend."""
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
