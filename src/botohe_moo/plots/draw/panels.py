"""To go."""

import matplotlib.pyplot as plt
from matplotlib.axes import Axes

from botohe_moo.plots.draw.style import theme


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
