"""Zones in which it is dangerous: circles and polygons that arcs cross."""

from __future__ import annotations

import math
from collections.abc import Hashable, Iterable, Mapping
from typing import Any, NamedTuple

import numpy as np

from botohe_moo._base.checks import as_float, quoted
from botohe_moo._base.types import BoolArray, FloatArray
from botohe_moo._plugins.checks import checked
from botohe_moo._plugins.types import NotNegative
from botohe_moo.mission.graphs import plain_numbers, positions


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
