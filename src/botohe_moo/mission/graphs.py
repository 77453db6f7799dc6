"""What a mission takes from its graph: a copy that cannot be changed, arrays, and positions."""

from __future__ import annotations

import math
from collections.abc import Callable, Hashable, Mapping, Sequence
from typing import Any, NoReturn

import networkx as nx
import numpy as np

from botohe_moo._base.checks import quoted
from botohe_moo._base.types import FloatArray


class _Attributes(dict[str, Any]):
    """Attributes, and mappings among them, that stay what they are."""

    __slots__ = ()

    @classmethod
    def of(cls, attributes: Mapping[str, Any]) -> _Attributes:
        return cls(
            (name, cls(value) if isinstance(value, Mapping) else value)
            for name, value in attributes.items()
        )

    def copy(self) -> dict[str, Any]:
        """Return a plain dictionary, also of mappings, as ``graph.copy()`` needs it."""
        return {
            name: value.copy() if isinstance(value, _Attributes) else value
            for name, value in self.items()
        }

    def _refuse(self, *_: object, **__: object) -> NoReturn:
        raise TypeError(
            "The graph of a mission cannot be changed: change mission.graph.copy(), and make a "
            "Mission of that."
        )

    __setitem__ = __delitem__ = __ior__ = _refuse
    clear = pop = popitem = setdefault = update = _refuse

    def __reduce__(self) -> tuple[Any, ...]:
        return type(self), (dict(self),)  # by default it would be filled item by item


def freeze(graph: nx.DiGraph[Any]) -> nx.DiGraph[Any]:
    """Let neither nodes and arcs nor their attributes be changed any more.

    :func:`networkx.freeze` leaves the attributes as they are.
    """
    graph.graph = _Attributes.of(graph.graph)
    inside: Any = graph  # networkx has no public way to replace its dictionaries
    for node, attributes in inside._node.items():
        inside._node[node] = _Attributes.of(attributes)
    for tail, heads in inside._succ.items():
        for head, attributes in heads.items():
            heads[head] = inside._pred[head][tail] = _Attributes.of(attributes)
    frozen: nx.DiGraph[Any] = nx.freeze(graph)
    return frozen


def given_places(graph: nx.DiGraph[Any]) -> dict[Hashable, tuple[float, float] | None]:
    """Return the attribute ``pos`` of each node of a mission, or None."""
    places: dict[Hashable, tuple[float, float] | None] = {}
    place: Any
    for node, place in graph.nodes(data="pos"):
        places[node] = None if place is None else (float(place[0]), float(place[1]))
    return places


def positions(graph: Any) -> dict[Hashable, FloatArray]:
    """Return where nodes are; a ValueError names one without a position."""
    if not isinstance(graph, nx.Graph):
        raise TypeError(f"Expected graph to be an nx.DiGraph, got {quoted(graph)}.")
    places = {node: plain_numbers(place) for node, place in graph.nodes(data="pos")}
    for node, place in places.items():
        if place.shape != (2,):
            found = quoted(graph.nodes[node].get("pos"))
            raise ValueError(f"Node {quoted(node)}: expected pos (x, y), got {found}.")
    return places


def plain_numbers(value: Any) -> FloatArray:
    """Return an array of finite numbers, an empty one if there are others."""
    try:
        numbers = np.array(value, float)
    except (TypeError, ValueError):
        return np.empty(0)
    return numbers if np.isfinite(numbers).all() else np.empty(0)


def distance_of(graph_attributes: Mapping[str, Any]) -> Callable[[Any, Any], float]:
    """Return what measures how far two positions are apart.

    Where the graph is ``geographic``, these are longitudes and latitudes in degrees, and the
    distance is that on a sphere, in metres.
    """
    return _on_earth if graph_attributes.get("geographic") else math.dist


_EARTH = 6_371_008.8  # mean radius in metres


def _on_earth(one: Sequence[float], other: Sequence[float]) -> float:
    """Return the distance on a sphere by the haversine formula, which is exact for short ways."""
    (east, north), (east_2, north_2) = np.radians(one), np.radians(other)
    half = math.sin((north_2 - north) / 2) ** 2
    half += math.cos(north) * math.cos(north_2) * math.sin((east_2 - east) / 2) ** 2
    return 2.0 * _EARTH * math.asin(math.sqrt(min(half, 1.0)))
