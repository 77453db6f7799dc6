"""Survivals and rewards by what is drawn on a map: rasters, circles and polygons."""

from __future__ import annotations

import math
from collections.abc import Hashable, Iterable, Mapping
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from botohe_moo._base.checks import as_float, quoted
from botohe_moo._base.types import BoolArray, FloatArray
from botohe_moo._plugins.checks import checked
from botohe_moo._plugins.types import NotNegative, Positive
from botohe_moo.mission.arrays import plain_numbers, positions

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


@checked
def survival_from_zones(
    graph: Any, zones: Iterable[Mapping[str, Any]], *, danger: NotNegative = 0.0
) -> dict[tuple[Hashable, Hashable], float]:
    """Return how likely a robot survives each arc of a graph that crosses dangerous zones.

    Arcs are straight: survival is exp(−the integral of the rate of loss along the arc). The rate is
    ``danger``, and within a zone also that of the zone; rates of zones that overlap add up.

    Parameters
    ----------
    graph
        An ``nx.DiGraph`` whose nodes have ``pos`` (x, y). Only these are read.
    zones
        Mappings with ``rate``, the rate of loss for a unit of length, at least 0, and either
        ``circle`` [x, y, radius] or ``polygon``, its corners in order [[x, y], ...], or a list of
        such rings: then the others are holes in the first, as in GeoJSON. A point is in a polygon
        if a ray from it crosses the rings an odd number of times.
    danger
        Rate of loss everywhere, at least 0.

    Returns
    -------
    dict
        Survivals by arcs, as ``nx.set_edge_attributes(graph, survivals, "survival")`` takes them.

    Raises
    ------
    TypeError
        If ``graph`` is not a graph.
    ValueError
        If a parameter is out of its range, a zone cannot be read, or a node has no position.

    Examples
    --------
    >>> import networkx as nx
    >>> from botohe_moo import survival_from_zones
    >>> graph = nx.DiGraph([("dock", "reef")])
    >>> graph.add_node("dock", pos=(0.0, 0.0))
    >>> graph.add_node("reef", pos=(4.0, 0.0))
    >>> survival_from_zones(graph, [{"circle": [2, 0, 1], "rate": 0.1}])
    {('dock', 'reef'): 0.818730...}
    """
    places, read = positions(graph), read_zones(zones, "zones")
    survivals = {}
    for tail, head in graph.edges:
        start, way = places[tail], places[head] - places[tail]
        rate = danger + sum(zone.rate * zone.share(start, way) for zone in read)
        survivals[tail, head] = math.exp(-rate * float(np.hypot(*way)))
    return survivals


class Zone(NamedTuple):
    """A circle or a polygon within which it is more dangerous."""

    rate: float
    circle: FloatArray | None  # x, y, radius
    sides: FloatArray  # of the polygon's rings, from one corner to the next (n_sides, 2, 2)

    def share(self, start: FloatArray, way: FloatArray) -> float:
        """Return how much of the line from ``start`` along ``way`` is in the zone."""
        cuts = self._cuts(start, way)
        at = np.unique(np.clip(np.concatenate([[0.0, 1.0], cuts]), 0.0, 1.0))
        middles = start + np.outer((at[1:] + at[:-1]) / 2, way)
        return float(np.diff(at) @ self._has(middles))

    def _cuts(self, start: FloatArray, way: FloatArray) -> FloatArray:
        """Return the shares of the line after which it crosses the edge of the zone."""
        with np.errstate(all="ignore"):  # of lines that never cross the edge
            if self.circle is not None:
                away, square = start - self.circle[:2], way @ way
                nearest = -(away @ way) / square
                apart = np.hypot(*(away + nearest * way))
                half = np.sqrt((self.circle[2] ** 2 - apart**2) / square)
                cuts = np.array([nearest - half, nearest + half])
            else:
                first, side = self.sides[:, 0], self.sides[:, 1] - self.sides[:, 0]
                cuts = _cross(first - start, side) / _cross(way, side)
        crossed: FloatArray = cuts[np.isfinite(cuts)]
        return crossed

    def _has(self, points: FloatArray) -> BoolArray:
        """Return which points are in the zone; on its edge either may be."""
        if self.circle is not None:
            within: BoolArray = np.hypot(*(points - self.circle[:2]).T) < self.circle[2]
            return within
        (x1, y1), (x2, y2) = self.sides[:, 0].T, self.sides[:, 1].T
        x, y = points[:, :1], points[:, 1:]
        is_beside = (y1 > y) != (y2 > y)
        with np.errstate(all="ignore"):  # of sides that are not beside
            is_right = x < x1 + (x2 - x1) * (y - y1) / (y2 - y1)
        is_odd: BoolArray = (is_beside & is_right).sum(axis=1) % 2 == 1
        return is_odd


def _cross(one: FloatArray, other: FloatArray) -> FloatArray:
    return one[..., 0] * other[..., 1] - one[..., 1] * other[..., 0]


def read_zones(zones: Iterable[Any], name: str) -> list[Zone]:
    """Read zones; a ValueError names what is wrong, such as ``zones[0]``."""
    read = []
    for i, zone in enumerate(zones):
        try:
            read.append(read_zone(zone))
        except ValueError as error:
            raise ValueError(f"{name}[{i}]: {error}") from None
    return read


def read_zone(zone: Any) -> Zone:
    """Read a zone; a ValueError says what is wrong."""
    given = {"circle", "polygon"} & {*zone} if isinstance(zone, Mapping) else set()
    if len(given) != 1:
        raise ValueError(
            f"expected an object with rate, and circle or polygon, got {quoted(zone)}."
        )
    rate, [shape] = as_float(zone.get("rate")), given
    if not 0.0 <= rate < math.inf:
        raise ValueError(f"expected a rate >= 0, got {quoted(zone.get('rate'))}.")
    if shape == "circle":
        circle = plain_numbers(zone["circle"])
        if circle.shape != (3,) or circle[2] <= 0.0:
            raise ValueError(
                f"expected a circle [x, y, radius], radius > 0, got {quoted(zone['circle'])}."
            )
        return Zone(rate, circle, np.empty((0, 2, 2)))
    single = plain_numbers(zone["polygon"])
    listed = zone["polygon"] if isinstance(zone["polygon"], list | tuple) else []
    rings = [single] if single.ndim == 2 else [plain_numbers(ring) for ring in listed]
    if not rings or any(ring.shape[1:] not in ((2,), (3,)) or len(ring) < 3 for ring in rings):
        raise ValueError(
            f"expected a polygon of at least three corners [[x, y], ...], got "
            f"{quoted(zone['polygon'])}."
        )
    flat = [ring[:, :2] for ring in rings]  # without heights
    sides = [np.stack([ring, np.roll(ring, -1, axis=0)], axis=1) for ring in flat]
    return Zone(rate, None, np.concatenate(sides))


def survived(rate: float, length: float) -> float:
    """Return exp(-rate * length)."""
    survival = math.exp(-rate * length)
    if survival == 0.0:
        raise ValueError(f"rate {rate:g} length {length:g}")
    return survival
