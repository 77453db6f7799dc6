"""What a mission takes from its graph: a frozen copy, arrays for kernels, and positions."""

from __future__ import annotations

import math
from collections.abc import Callable, Hashable, Mapping, Sequence
from typing import Any, NoReturn

import networkx as nx
import numpy as np

from botohe_moo._base.checks import quoted
from botohe_moo._base.types import FloatArray, OffsetArray
from botohe_moo.kernels.graph.graph import (
    Graph,
    Limits,
    join_layers,
    new_graph,
    with_costs,
)
from botohe_moo.kernels.graph.kinds import AT_NEXT_DEPOT, AT_THIS_DEPOT, ON_ARRIVAL, Kinds
from botohe_moo.mission.rules import Kind, by_kind


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


def graph_of_kinds(
    graph: nx.DiGraph[Any],
    base: Hashable,
    kinds: Sequence[Kind],
    pays: str,
    index_of: Mapping[Any, int],
) -> Graph:
    """Return a valid mission's graph as kernels take it; ``index_of`` numbers its nodes."""
    arcs = sorted(
        (index_of[u], index_of[v], by_kind(arc["survival"], kinds), float(arc.get("length", 1.0)))
        for u, v, arc in graph.edges(data=True)
    )
    tail, head = (np.array([arc[i] for arc in arcs], np.int64) for i in (0, 1))
    survival = np.array([s for _, _, s, _ in arcs], np.float64).reshape(-1, len(kinds))
    length = np.array([d for *_, d in arcs], np.float64)
    nodes = dict(graph.nodes(data=True))
    reward = np.array([node["reward"] for node in nodes.values()], np.float64)
    share = np.array([by_kind(node.get("share", 1.0), kinds) for node in nodes.values()])
    ends = [tuple(index_of[label] for label in kind.ends(base)) for kind in kinds]
    credit = np.array([_credit(node, pays) for node in nodes.values()])
    credit[index_of[base]] = AT_THIS_DEPOT
    is_plain = len(kinds) == 1 and ends[0] == (index_of[base],) * 2 and bool((share == 1.0).all())
    is_plain &= bool((survival > 0.0).all()) and not (reward[credit == AT_NEXT_DEPOT] > 0.0).any()
    aboard = [[index_of[v] for v in kind.aboard if reward[index_of[v]] > 0.0] for kind in kinds]
    if is_plain:
        return new_graph(tail, head, survival[:, 0], length, reward, index_of[base])
    layers, shares = [], []
    for k, (start, end) in enumerate(ends):
        stays, is_open = _passable(tail, head, survival[:, k] > 0.0, start, end, len(reward))
        shares.append(np.where(is_open, share[:, k], 0.0))
        shares[-1][aboard[k]] = share[aboard[k], k]  # also of nodes that are closed now
        aboard[k] = [node for node in aboard[k] if node != start]  # which the trail visits
        arrays = tail[stays], head[stays], survival[stays, k], length[stays]
        layers.append(new_graph(*arrays, reward * shares[-1], end))
    n, counts = len(reward), [kind.robots for kind in kinds]
    first = np.cumsum([0, *counts])
    kind_of = np.repeat(np.arange(len(kinds)), counts)
    n_aboard = np.cumsum([0, *map(len, aboard)])
    described = Kinds(
        origin=np.tile(np.arange(n), len(kinds)),
        share=np.concatenate(shares),
        credit=np.tile(credit, len(kinds)),
        end=np.repeat([end + k * n for k, (_, end) in enumerate(ends)], n),
        reward=reward,
        start=np.array([ends[k][0] + k * n for k in kind_of.tolist()]),
        first=first[kind_of],
        stop=first[kind_of + 1],
        aboard=np.array([node for nodes in aboard for node in nodes], np.int64),
        aboard_first=n_aboard[kind_of],
        aboard_stop=n_aboard[kind_of + 1],
        has_returns=bool(((credit == AT_NEXT_DEPOT) & (reward > 0.0)).any()),
    )
    return join_layers(layers, described)


def uncollected(graph: Graph) -> OffsetArray:
    """Return the nodes of a mission that pay, though no kind can collect their reward.

    A reward on return needs a way on to a depot.
    """
    kinds = graph.kinds
    if kinds is None:
        return np.empty(0, np.int64)
    ways = nx.DiGraph(zip(graph.tail.tolist(), graph.head.tolist(), strict=True))
    depots = np.flatnonzero(kinds.credit == AT_THIS_DEPOT).tolist()
    ways.add_edges_from((depot, -1) for depot in depots)  # to one node behind all depots
    is_credited = kinds.credit != AT_NEXT_DEPOT
    is_credited[list(nx.ancestors(ways, -1))] = True
    collects = (is_credited & (graph.reward > 0.0)).reshape(-1, len(kinds.reward))
    return np.flatnonzero((kinds.reward > 0.0) & ~collects.any(axis=0))


def ways_to_ends(graph: Graph, limits: Limits) -> list[list[int]]:
    """Return each robot's safest way from its start to its end, or the shortest if it is too long.

    ``graph`` has kinds.
    """
    if graph.kinds is None:
        raise TypeError("Expected a graph with kinds.")
    ways = []
    for start in graph.kinds.start.tolist():
        way, length = _way_home(graph, start)
        if limits.budgets is not None and length > limits.budgets[start]:
            way, _ = _way_home(with_costs(graph, graph.length), start)
        ways.append(way)
    return ways


def _way_home(graph: Graph, node: int) -> tuple[list[int], float]:
    """Return the nodes of the cheapest way home from a node, and its length."""
    way, length = [node], 0.0
    while (arc := int(graph.homeward[way[-1]])) >= 0:
        way.append(int(graph.head[arc]))
        length += float(graph.length[arc])
    return way, length


def _credit(node: Mapping[str, Any], pays: str) -> int:
    if node.get("depot", False):
        return AT_THIS_DEPOT
    return AT_NEXT_DEPOT if node.get("pays", pays) == "return" else ON_ARRIVAL


def _passable(
    tail: OffsetArray, head: OffsetArray, stays: Any, start: int, end: int, n_nodes: int
) -> tuple[Any, Any]:
    """Return which arcs and which nodes a kind can use on a way from its start to its end."""
    ways: nx.DiGraph[Any] = nx.DiGraph()
    ways.add_nodes_from(range(n_nodes))
    ways.add_edges_from(zip(tail[stays].tolist(), head[stays].tolist(), strict=True))
    used = (nx.descendants(ways, start) | {start}) & (nx.ancestors(ways, end) | {end})
    is_open = np.zeros(n_nodes, bool)
    is_open[list(used)] = True
    return stays & is_open[tail] & is_open[head], is_open
