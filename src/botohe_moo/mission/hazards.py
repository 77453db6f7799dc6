"""What is drawn on a map: dangers that arcs cross, and what there is to see from nodes."""

from __future__ import annotations

import math
from collections.abc import Hashable
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from botohe_moo._base.checks import quoted
from botohe_moo._base.types import FloatArray
from botohe_moo._plugins.checks import checked
from botohe_moo._plugins.types import NotNegative, Positive
from botohe_moo.mission.graphs import positions

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
    cells, places = table(values), positions(graph)
    at = {node: in_cells(place, cells, resolution, origin) for node, place in places.items()}
    if lost := [node for node in at if np.isnan(at[node]).any()]:
        ends = np.add(origin, np.multiply(cells.shape[::-1], resolution)).tolist()
        raise ValueError(
            f"Node {quoted(lost[0])}: expected pos (x, y) on the map, from {list(origin)} to "
            f"{ends}, got {places[lost[0]].tolist()}."
        )
    return {
        (tail, head): math.exp(
            -scale * math.dist(places[tail], places[head]) * mean_along(cells, at[tail], at[head])
        )
        for tail, head in graph.edges
    }


@checked
def rewards_from_raster(
    graph: Any,
    values: ArrayLike,
    *,
    resolution: Positive,
    radius: Positive,
    origin: tuple[float, float] = (0.0, 0.0),
    scale: NotNegative = 1.0,
) -> dict[Hashable, float]:
    """Return what there is to see from each node of a graph, from a map of what is of interest.

    A cell is seen from the nearest node, if its centre is within the ``radius``. So no cell counts
    twice, and the sum of all rewards is what robots see that get everywhere.

    Parameters
    ----------
    graph
        An ``nx.DiGraph`` whose nodes have ``pos`` (x, y). Only these are read.
    values
        How much of interest each cell is, at least 0 (n_rows, n_columns); rows as in an image, the
        first one at the top, where y is the largest.
    resolution
        Width of a cell, above 0, in the unit of ``pos``.
    radius
        How far robots see, above 0, in the unit of ``pos``.
    origin
        The lower left corner of the map (x, y).
    scale
        Reward for a unit of area where a value is 1, at least 0.

    Returns
    -------
    dict
        Rewards by nodes, as ``nx.set_node_attributes(graph, rewards, "reward")`` takes them; 0 for
        nodes that are away from the map.

    Raises
    ------
    TypeError
        If ``graph`` is not a graph.
    ValueError
        If a parameter is out of its range, or if a node has no position.

    Examples
    --------
    >>> import networkx as nx
    >>> from botohe_moo import rewards_from_raster
    >>> graph = nx.DiGraph([("dock", "reef")])
    >>> graph.add_node("dock", pos=(0.5, 0.5))
    >>> graph.add_node("reef", pos=(3.5, 0.5))
    >>> rewards_from_raster(graph, [[0, 1, 1, 1]], resolution=1, radius=1.5)
    {'dock': 1.0, 'reef': 2.0}
    """
    from scipy.spatial import KDTree

    cells, places = table(values), positions(graph)
    seen = np.argwhere(cells)
    centres = (seen[:, ::-1] + 0.5) * resolution + origin
    tree = KDTree(np.reshape([*places.values()], (-1, 2)))
    _, nearest = tree.query(centres, distance_upper_bound=np.nextafter(radius, np.inf))
    worth = cells[tuple(seen.T)] * (scale * resolution**2)
    sums = np.bincount(nearest, worth, minlength=len(places) + 1)  # the last one: of none
    return dict(zip(places, sums.tolist()[: len(places)], strict=True))


def table(values: ArrayLike) -> FloatArray:
    """Return the values of a map, the lowest row first."""
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
    return cells[::-1]


def in_cells(
    places: FloatArray, cells: FloatArray, resolution: float, origin: tuple[float, float]
) -> FloatArray:
    """Return places (..., 2) in cells from the centre of the first one, NaN for those off the map.

    ``cells`` have the lowest row first.
    """
    at = (places - origin) / resolution
    is_on = (at >= -_EDGE) & (at <= np.add(cells.shape[::-1], _EDGE))
    return np.where(is_on.all(axis=-1, keepdims=True), at - 0.5, np.nan)


def mean_along(cells: FloatArray, start: FloatArray, end: FloatArray) -> float:
    """Return the mean of values along a straight line between places in cells.

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
    return float(pieces @ np.diff(at))
