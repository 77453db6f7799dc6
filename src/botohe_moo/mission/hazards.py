"""Positions and distances; survivals and rewards by rasters, circles and polygons."""

from __future__ import annotations

import math
from collections.abc import Callable, Hashable, Iterable, Mapping, Sequence
from itertools import pairwise
from typing import Any, NamedTuple

import networkx as nx
import numpy as np
from numpy.typing import ArrayLike

from botohe_moo.base.files import read_number
from botohe_moo.base.messages import as_float, quoted
from botohe_moo.base.parameters import NotNegative, Positive, checked
from botohe_moo.base.types import FloatArray, IntArray
from botohe_moo.mission.rules import MissionError

_NEAR = 1e-9  # places that are nearer to each other are one; in cells, or in the unit of ``pos``
_EARTH = 6_371_008.8  # mean radius in metres

Places = dict[Hashable, tuple[float, float]]


def places_of(nodes: Mapping[Hashable, Mapping[str, Any]]) -> Places:
    """Return the positions (x, y) of those nodes that have one among their attributes."""
    numbers = {node: plain_numbers(attributes.get("pos")) for node, attributes in nodes.items()}
    return {node: (xy.item(0), xy.item(1)) for node, xy in numbers.items() if xy.shape == (2,)}


def distance_of(graph_attributes: Mapping[str, Any]) -> Callable[[Any, Any], float]:
    """Return the function that measures the distance between two positions.

    If the graph is ``geographic``, positions are longitudes and latitudes in degrees, and distances
    are metres on a sphere.
    """
    return _on_earth if graph_attributes.get("geographic") else math.dist


def _on_earth(one: Sequence[float], other: Sequence[float]) -> float:
    """Compute a distance by the haversine formula, which is accurate for short ways, too."""
    (east, north), (east_2, north_2) = np.radians(one), np.radians(other)
    half = math.sin((north_2 - north) / 2) ** 2
    half += math.cos(north) * math.cos(north_2) * math.sin((east_2 - east) / 2) ** 2
    return 2.0 * _EARTH * math.asin(math.sqrt(min(half, 1.0)))


def survived(loss: float, where: str, *, length: float) -> float:
    """Return exp(−loss), the survival of an arc.

    Parameters
    ----------
    loss
        Integral of the rate of loss along the arc. Below 0 and NaN count as 0: they come from a
        length that is wrong, which the rules of missions report.
    where
        The arc, with which the message begins, such as ``Arc 'dock' -> 'reef'``.
    length
        Length of the arc. The message names it, and ``loss / length``, the mean danger.

    Raises
    ------
    ValueError
        If the survival is below the least positive float, 5e-324: above a loss of some 744.
    """
    if (survival := math.exp(-max(0.0, loss))) == 0.0:
        fault = f"danger * length <= 744, got {loss / length:g} * {length:g} = {loss:g}"
        raise ValueError(f"{where}: expected survival >= 5e-324, so {fault}.")
    return survival


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
        If a parameter is out of its range, a node has no position or lies outside of the map, or
        the survival of an arc would be 0 as a float.

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
    return _survivals(graph, scale, _raster(values, resolution, origin), [])


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
    """Return the reward of each node of a graph: the interest that is visible from it on a map.

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
    return seen_from(_places(graph), _raster(values, resolution, origin), radius, scale)


def seen_from(places: Places, raster: Raster, radius: float, scale: float) -> dict[Hashable, float]:
    """Return the rewards of places (x, y) by a map; see :func:`rewards_from_raster`."""
    from scipy.spatial import KDTree

    cells = raster.values[::-1] * (scale * raster.resolution**2)
    seen = np.argwhere(cells)
    centres = (seen[:, ::-1] + 0.5) * raster.resolution + raster.origin
    tree = KDTree(np.reshape([*places.values()], (-1, 2)))
    _, nearest = tree.query(centres, distance_upper_bound=np.nextafter(radius, np.inf))
    rewards = np.bincount(nearest, cells[tuple(seen.T)], minlength=len(places))
    return dict(zip(places, rewards.tolist(), strict=False))  # after these: seen from nowhere


def _raster(values: ArrayLike, resolution: float, origin: tuple[float, float]) -> Raster:
    """Return the map of a user's table; a ValueError if it is none, or holds other numbers."""
    cells = plain_numbers(values)
    is_table = cells.ndim == 2 and cells.size > 0
    if not is_table or cells.min() < 0.0:
        expected = "values to be a table (n_rows, n_columns) of finite numbers >= 0"
        found = quoted(cells.min().item() if is_table else values)
        raise ValueError(f"Expected {expected}, got {found}.")
    return Raster(cells, resolution, origin)


class Raster(NamedTuple):
    """A map of rates, or of shares of a rate."""

    values: FloatArray  # at least 0, the first row at the top (n_rows, n_columns)
    resolution: float  # width of a cell
    origin: tuple[float, float]  # the lower left corner
    cells: IntArray | None = None  # what cells are, if it is a map of obstacles
    path: str = "values"

    def means(self, points: FloatArray) -> FloatArray:
        """Return the means along the straight pieces between points (n, 2): (n − 1,).

        A MissionError names the first point that is not on the map.
        """
        at = (points - self.origin) / self.resolution
        is_off = ((at < -_NEAR) | (at > np.add(self.values.shape[::-1], _NEAR))).any(axis=1)
        if off := points[is_off].round(6).tolist():
            ends = np.add(self.origin, np.multiply(self.values.shape[::-1], self.resolution))
            found = f"it goes from {[*self.origin]} to {ends.tolist()}"
            raise MissionError(f"expected a map that covers {off[0]}, but {found}", self.path)
        cells = self.values[::-1]
        return np.array([mean_along(cells, *ends) for ends in pairwise(at - 0.5)])


def mean_along(cells: FloatArray, start: FloatArray, end: FloatArray) -> float:
    """Return the mean of values along a straight line between places in cells.

    Between lines through centres of cells they are quadratic, where Simpson's rule is exact. Within
    half a cell of the edge they are as on the nearest of these lines.
    """
    from scipy.ndimage import map_coordinates

    way, cuts = end - start, [0.0, 1.0]
    for axis in np.flatnonzero(way):
        low, high = sorted((start[axis], start[axis] + way[axis]))
        cuts += ((np.arange(np.ceil(low), np.floor(high) + 1) - start[axis]) / way[axis]).tolist()
    at = np.unique(np.clip(cuts, 0.0, 1.0))
    at = np.sort(np.append(at, (at[1:] + at[:-1]) / 2))
    values = map_coordinates(cells, (start + np.outer(at, way)).T[::-1], order=1, mode="nearest")
    return float((values[2::2] + values[:-2:2] + 4.0 * values[1::2]) / 6.0 @ np.diff(at[::2]))


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
        If a parameter is out of its range, a zone cannot be read, a node has no position, or the
        survival of an arc would be 0 as a float.

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
    return _survivals(graph, danger, None, read_zones(zones, "zones"))


def _survivals(
    graph: Any, danger: float, raster: Raster | None, zones: list[Zone]
) -> dict[tuple[Hashable, Hashable], float]:
    places, survivals = _places(graph), {}
    for u, v in graph.edges:
        ends = places[u], places[v]
        length = math.dist(*ends)
        loss = mean_rate(ends, danger, raster, zones) * length
        survivals[u, v] = survived(loss, f"Arc {quoted(u)} -> {quoted(v)}", length=length)
    return survivals


def mean_rate(ends: ArrayLike, danger: float, raster: Raster | None, zones: list[Zone]) -> float:
    """Return the mean rate of loss along a straight line between two places (2, 2).

    It is ``danger``, times the mean of the map if there is one, and the rates of zones.
    """
    line = np.array(ends)
    mean = 1.0 if raster is None else float(raster.means(line)[0])
    return danger * mean + sum(zone.rate * zone.share(*line) for zone in zones)


def _places(graph: Any) -> Places:
    """Return the position of each node of any graph; a ValueError names a node without one."""
    if not isinstance(graph, nx.Graph):
        raise TypeError(f"Expected graph to be an nx.DiGraph, got {quoted(graph)}.")
    places = places_of(graph.nodes)
    for node, pos in graph.nodes(data="pos"):
        if node not in places:
            raise ValueError(f"Node {quoted(node)}: expected pos (x, y), got {quoted(pos)}.")
    return places


class Zone(NamedTuple):
    """A circle or a polygon within which it is more dangerous."""

    rate: float
    shape: FloatArray  # a circle [x, y, radius], or the sides of a polygon's rings (n_sides, 2, 2)

    def share(self, start: FloatArray, end: FloatArray) -> float:
        """Return how much of the line between two places is in the zone.

        A line without ends enters the zone where it first crosses the edge, leaves it where it
        crosses the edge again, and so on.
        """
        is_lift = math.dist(start, end) < _NEAR  # where any direction will do
        way = np.array([_NEAR, 0.0]) if is_lift else end - start
        if self.shape.ndim == 1:
            away, radius = start - self.shape[:2], self.shape[2]
            # Where the distance from the centre is the radius. A line that misses the circle has
            # complex roots, whose real parts are equal.
            cuts = np.roots([way @ way, 2.0 * (way @ away), away @ away - radius**2]).real
        else:
            x, y = (self.shape - start).T  # of both ends of each side (2, n_sides)
            left = way[0] * y - way[1] * x  # below 0: on the right of the line
            is_cut = (left[0] < 0.0) != (left[1] < 0.0)
            cuts = (x[0] * y[1] - y[0] * x[1])[is_cut] / (left[1] - left[0])[is_cut]
        at = np.sort(np.clip(cuts, 0.0, 1.0))
        return float((at[1::2] - at[::2]).sum())


def read_zones(zones: Iterable[Any], name: str) -> list[Zone]:
    """Read zones; a ValueError names what is wrong, such as ``zones[0]``."""
    if not isinstance(zones, Iterable) or isinstance(zones, str | Mapping):
        raise ValueError(f"Expected {name} to be a list, got {quoted(zones)}.")
    return [read_zone(zone, f"{name}[{i}]: ") for i, zone in enumerate(zones)]


def read_zone(zone: Any, where: str = "") -> Zone:
    """Read a zone; a ValueError, which begins with ``where``, says what is wrong."""

    def fault(expected: str, got: object) -> ValueError:
        return ValueError(f"{where}expected {expected}, got {quoted(got)}.")

    given = {"circle", "polygon"} & zone.keys() if isinstance(zone, Mapping) else ()
    if len(given) != 1:
        raise fault("an object with rate, and circle or polygon", zone)
    rate, [shape] = as_float(read_number(zone.get("rate"))), map(zone.get, given)
    if not 0.0 <= rate < math.inf:
        raise fault("a rate >= 0", zone.get("rate"))
    numbers = plain_numbers(shape)
    if "circle" in given:
        if numbers.shape != (3,) or numbers[2] <= 0.0:
            raise fault("a circle [x, y, radius], radius > 0", shape)
        return Zone(rate, numbers)
    listed = shape if isinstance(shape, list | tuple) else []
    rings = [numbers] if numbers.ndim == 2 else [plain_numbers(ring) for ring in listed]
    if not rings or any(ring.shape[1:] not in ((2,), (3,)) or len(ring) < 3 for ring in rings):
        raise fault("a polygon of at least three corners [[x, y], ...]", shape)
    sides = [np.stack([ring, np.roll(ring, -1, axis=0)], axis=1)[..., :2] for ring in rings]
    return Zone(rate, np.concatenate(sides))


def plain_numbers(value: Any) -> FloatArray:
    """Return an array of finite numbers; it is empty if ``value`` holds anything else."""
    try:
        numbers = np.array(value, float)
    except (TypeError, ValueError, OverflowError):
        return np.empty(0)
    return numbers if np.isfinite(numbers).all() else np.empty(0)
