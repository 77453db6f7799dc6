"""Figures of a study's plots: all algorithms on the same axes, or each on a panel of its own."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

import matplotlib.pyplot as plt
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection, PolyCollection

from botohe_moo._base.types import FloatArray
from botohe_moo.plots.draw.algorithms import AlgorithmStyle, names_of
from botohe_moo.plots.draw.labels import columns
from botohe_moo.plots.draw.scales import title_above
from botohe_moo.plots.draw.style import INK, Colour, theme

MANY = 12  # from so many algorithms on, one plot would be a tangle

_PANEL = (2.35, 1.6)  # inches
_GAP = 0.36
_NAME = 8.5  # points
_NAME_WIDTH = 32  # columns
_FEW_POINTS = 20_000  # more are drawn as an image in vector files, too


@dataclass(frozen=True)
class AlgorithmAxes:
    """The axes of each algorithm: the same, or each a panel with all others in grey."""

    of: dict[str, Axes]  # by label
    in_panels: bool

    @property
    def first(self) -> Axes:
        """The only axes, or those of the first panel, whose limits the others share."""
        return next(iter(self.of.values()))

    def finish(self, title: str | None, words: str, x: str, y: str) -> None:
        """Write title and words above everything, and the names of both axes."""
        if self.in_panels:
            self.first.grid(visible=False)
            _title_panels(list(self.of.values()), title, words, x, y)
        else:
            self.first.set(xlabel=x, ylabel=y)
            title_above(self.first, title, words)


def open_algorithm_axes(
    lines: Mapping[str, FloatArray],
    styles: Mapping[str, AlgorithmStyle],
    ax: Axes | None,
    *,
    size: tuple[float, float],
    stretch: float = 1.0,
    names: Mapping[str, str] | None = None,
) -> AlgorithmAxes:
    """Take ``ax`` for all algorithms, or open a figure, with panels from ``MANY`` algorithms on.

    ``lines`` are the points (n, 2) of each algorithm's line, for the background of panels. A single
    plot of ``size`` inches grows with the height of all names, times ``stretch``.
    """
    if ax is None and len(lines) >= MANY:
        panels = _open_panels(list(lines), styles, names)
        _add_background(panels, lines)
        return AlgorithmAxes(panels, in_panels=True)
    if ax is None:
        height, right = names_room(lines, styles)
        (ax,) = study_axes(size[0], max(size[1], stretch * height), right=right)
    return AlgorithmAxes(dict.fromkeys(lines, ax), in_panels=False)


def study_axes(
    width: float, height: float, *, right: float = 0.2, n_rows: int = 1, share: bool = False
) -> list[Axes]:
    """Open a figure with ``n_rows`` axes under each other, each of ``width`` x ``height`` inches.

    All places are fixed, so no layout has to be computed. ``right`` are the inches right of the
    axes. With ``share``, only the last axes show the numbers of their common horizontal axis.
    """
    left, below, above = 0.85, 0.6, 0.75
    between = 0.45 if share else 0.95
    full = (left + width + right, above + n_rows * height + (n_rows - 1) * between + below)
    axes: list[Axes] = []
    with theme():
        fig = plt.figure(figsize=full)
        for row in range(n_rows):
            low = below + (n_rows - 1 - row) * (height + between)
            place = (left / full[0], low / full[1], width / full[0], height / full[1])
            ax = fig.add_axes(place, sharex=axes[0] if share and axes else None)
            # The places of names are fixed, too: computing them takes longer than drawing.
            ax.xaxis.set_label_coords(0.5, -0.42 / height)
            ax.yaxis.set_label_coords(-0.6 / width, 0.5)
            axes.append(ax)
    for ax in axes[:-1]:
        ax.tick_params(labelbottom=not share)
    return axes


def names_room(labels: Iterable[str], styles: Mapping[str, AlgorithmStyle]) -> tuple[float, float]:
    """Give the inches that names right of axes take, in height and in width."""
    names = names_of(labels, styles)
    lines = sum(name.count("\n") + 1 for name in names.values())
    widest = max(map(columns, names.values()), default=0)
    return 0.155 * lines, 0.75 + 0.6 * 10 * widest / 72


def _open_panels(
    labels: Sequence[str],
    styles: Mapping[str, AlgorithmStyle],
    names: Mapping[str, str] | None = None,
) -> dict[str, Axes]:
    """Open a figure with a panel for each of ``labels``, named, and all with the same axes."""
    if names is None:
        names = names_of(labels, styles, _NAME_WIDTH, longest=_NAME_WIDTH)
    lines = max(name.count("\n") + 1 for name in names.values())
    n_columns = 4 if len(labels) <= 24 else 5
    n_rows = -(-len(labels) // n_columns)
    wide, high = _PANEL
    gap = (1.25 * lines * _NAME + 14) / 72
    left, below, above = 0.85, 0.6, 0.75 + gap
    width = left + n_columns * wide + (n_columns - 1) * _GAP + 0.2
    height = above + n_rows * high + (n_rows - 1) * gap + below
    fig = plt.figure(figsize=(width, height))
    panels: dict[str, Axes] = {}
    for place, label in enumerate(labels):
        row, column = divmod(place, n_columns)
        x, y = left + column * (wide + _GAP), below + (n_rows - 1 - row) * (high + gap)
        first = next(iter(panels.values()), None)
        ax = fig.add_axes(
            (x / width, y / height, wide / width, high / height), sharex=first, sharey=first
        )
        lowest = place + n_columns >= len(labels)
        ax.tick_params(labelsize=8)
        ax.spines[["top", "right"]].set_visible(False)
        # Numbers only at the edges: hundreds of ticks would take longer to draw than all curves.
        ax.xaxis.set_visible(lowest)
        ax.yaxis.set_visible(column == 0)
        ax.annotate(
            names[label],
            (0, 1),
            (0, 3),
            xycoords="axes fraction",
            textcoords="offset points",
            fontsize=_NAME,
            linespacing=1.1,
            color=INK,
            gid="name",
        )
        panels[label] = ax
    return panels


def add_band(ax: Axes, points: FloatArray, colour: Colour, alpha: float) -> None:
    """Shade what ``points`` (n, 2) enclose."""
    # Axes.fill would compute the extent segment by segment.
    band = PolyCollection(
        [points], facecolors=[colour], alpha=alpha, linewidths=0, zorder=1, gid="band"
    )
    ax.add_collection(band)


def _title_panels(axes: Sequence[Axes], title: str | None, words: str, x: str, y: str) -> None:
    """Write title and words above all panels, and the names of the axes once."""
    lines = max(text.get_text().count("\n") + 1 for ax in axes for text in ax.texts)
    fig = axes[0].figure.figure
    words = f"{words}; in grey all others"
    lift = 1.25 * lines * _NAME + 10
    title_above(axes[0], title, words, width=fig.get_figwidth() - 1.0, lift=lift)
    boxes = [ax.get_position() for ax in axes]
    middle = (min(box.x0 for box in boxes) + max(box.x1 for box in boxes)) / 2
    height, width = fig.get_figheight(), fig.get_figwidth()
    fig.text(middle, 0.18 / height, x, ha="center", va="center", gid="x label")
    centre = (min(box.y0 for box in boxes) + max(box.y1 for box in boxes)) / 2
    fig.text(0.2 / width, centre, y, ha="center", va="center", rotation=90, gid="y label")


def _add_background(panels: Mapping[str, Axes], lines: Mapping[str, FloatArray]) -> None:
    """Draw in every panel, pale, the lines of all other algorithms."""
    n_points = sum(map(len, lines.values())) * len(panels)
    for label, ax in panels.items():
        others = LineCollection(
            [points for other, points in lines.items() if other != label],
            colors="0.83",
            linewidths=0.7,
            zorder=0.5,
            rasterized=n_points > _FEW_POINTS,
            gid="others",
        )
        ax.add_collection(others, autolim=False)
