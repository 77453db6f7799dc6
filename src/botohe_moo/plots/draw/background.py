"""A map behind the graph, as map servers have it; without matplotlib, for the explorer too."""

from __future__ import annotations

import os
from typing import NamedTuple

import numpy as np

from botohe_moo.base.types import FloatArray
from botohe_moo.mission.formats.maps import MODES, read_raster
from botohe_moo.mission.model import Mission
from botohe_moo.plots.draw.places import layout_notes

_MOST_CELLS = 1000  # along each side; of larger maps several cells are one


class Background(NamedTuple):
    """What is drawn behind a graph: shares of black, the first row at the top, and where."""

    shares: FloatArray  # in [0, 1] (n_rows, n_columns)
    extent: tuple[float, float, float, float]  # left, right, bottom and top, in units of ``pos``


def read_background(
    path: str | os.PathLike[str] | None, mission: Mission, *, most_cells: int = _MOST_CELLS
) -> Background | None:
    """Read a map of a site; a ValueError says that its nodes lack positions, or what is wrong."""
    if path is None:
        return None
    if notes := layout_notes(mission):
        raise ValueError(
            f"Expected nodes with positions for the background {os.fspath(path)}, but {notes[0]}."
        )
    raster = read_raster(path, modes=MODES)
    shares, (left, bottom) = raster.values, raster.origin
    top = bottom + len(shares) * raster.resolution
    n_joined = -(-max(shares.shape) // most_cells)
    # The darkest of the cells that become one: walls are thin.
    for axis, n_cells in enumerate(shares.shape):
        shares = np.maximum.reduceat(shares, np.arange(0, n_cells, n_joined), axis=axis)
    height, width = np.multiply(shares.shape, n_joined * raster.resolution).tolist()
    return Background(shares, (left, left + width, top - height, top))
