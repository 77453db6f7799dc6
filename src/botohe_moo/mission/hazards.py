"""Dangers that are drawn on a map: what arcs cross, and how likely a robot survives that."""

from __future__ import annotations

import math
from collections.abc import Hashable
from typing import Any

import networkx as nx
import numpy as np
from numpy.typing import ArrayLike

from botohe_moo._base.checks import quoted
from botohe_moo._base.types import FloatArray
from botohe_moo._plugins.checks import checked
from botohe_moo._plugins.types import NotNegative, Positive

_EDGE = 1e-9  # of a cell: points so far outside count as on the edge


@checked
def survival_from_raster(
    graph: Any,
    values: ArrayLike,
    *,
    resolution: Positive,
    origin: tuple[float, float] = (0.0, 0.0),
    scale: NotNegative = 1.0,
) -> dict[tuple[Hashable, Hashable], float]:
    """Return how likely a robot survives each arc of a graph that crosses a map of dangers.

    Between the centres of cells the rate of loss is bilinear, and arcs are straight: survival is
    exp(−the integral of the rate along the arc), which is exact but for rounding.

    Parameters
    ----------
    graph
        An ``nx.DiGraph`` whose nodes have ``pos`` (x, y). Only these are read.
    values
        How dangerous each cell is, at least 0 (n_rows, n_columns); rows as in an image, the first
        one at the top, where y is the largest.
    resolution
        Width of a cell, above 0, in the unit of ``pos``.
    origin
        The lower left corner of the map (x, y).
    scale
        Rate of loss for a unit of length where a value is 1, at least 0.

    Returns
    -------
    dict
        Survivals by arcs, as ``nx.set_edge_attributes(graph, survivals, "survival")`` takes them.

    Raises
    ------
    TypeError
        If ``graph`` is not a graph.
    ValueError
        If a parameter is out of its range, or if a node has no position or lies outside of the map.

    Examples
    --------
    >>> import networkx as nx
    >>> from botohe_moo import survival_from_raster
    >>> graph = nx.DiGraph([("dock", "reef")])
    >>> graph.add_node("dock", pos=(0.0, 0.5))
    >>> graph.add_node("reef", pos=(4.0, 0.5))
    >>> dangers = [[0, 0, 1, 1]]
    >>> survival_from_raster(graph, dangers, resolution=1, scale=0.1)
    {('dock', 'reef'): 0.818730...}
    """
    if not isinstance(graph, nx.Graph):
        raise TypeError(f"Expected graph to be an nx.DiGraph, got {quoted(graph)}.")
    try:
        cells = np.array(values, float)
    except (TypeError, ValueError):
        raise ValueError(
            f"Expected values to be a table of numbers, got {quoted(values)}."
        ) from None
    if cells.ndim != 2 or cells.size == 0:
        raise ValueError(f"Expected values (n_rows, n_columns), got an array {cells.shape}.")
    if not (is_valid := np.isfinite(cells) & (cells >= 0.0)).all():
        raise ValueError(f"Expected finite values >= 0, got {float(cells[~is_valid][0])}.")
    cells = cells[::-1]  # from the origin
    places = {
        node: _place(node, place, cells, resolution, origin)
        for node, place in graph.nodes(data="pos")
    }
    rate = scale * resolution  # for a cell
    return {
        (tail, head): math.exp(-rate * _integral(cells, places[tail], places[head]))
        for tail, head in graph.edges
    }


def _place(
    node: Hashable, place: Any, cells: FloatArray, resolution: float, origin: tuple[float, float]
) -> FloatArray:
    """Return where a node is, in cells from the centre of the first one (2)."""
    try:
        at = (np.array(place, float) - origin) / resolution
        is_inside = bool((at >= -_EDGE).all() and (at <= np.add(cells.shape[::-1], _EDGE)).all())
    except (TypeError, ValueError):
        is_inside = False
    if place is None or not is_inside or at.shape != (2,):
        ends = np.add(origin, np.multiply(cells.shape[::-1], resolution)).tolist()
        raise ValueError(
            f"Node {quoted(node)}: expected pos (x, y) on the map, from {list(origin)} to {ends}, "
            f"got {quoted(place)}."
        )
    return at - 0.5


def _integral(cells: FloatArray, start: FloatArray, end: FloatArray) -> float:
    """Integrate values along a straight line, in units of cells.

    Between lines through centres of cells they are quadratic, where Simpson's rule is exact. Within
    half a cell of the edge they are as on the nearest of these lines.
    """
    from scipy.ndimage import map_coordinates

    way, cuts = end - start, [np.array([0.0, 1.0])]
    for origin, step in zip(start, way, strict=True):
        if step != 0.0:
            low, high = sorted((origin, origin + step))
            cuts.append((np.arange(np.ceil(low), np.floor(high) + 1) - origin) / step)
    at = np.unique(np.clip(np.concatenate(cuts), 0.0, 1.0))
    middle = (at[1:] + at[:-1]) / 2

    def value(shares: FloatArray) -> Any:
        x, y = start[:, None] + way[:, None] * shares
        return map_coordinates(cells, [y, x], order=1, mode="nearest")

    ends = value(at)
    pieces = (ends[1:] + ends[:-1] + 4.0 * value(middle)) / 6.0
    return float(np.hypot(*way) * (pieces @ np.diff(at)))
