"""What a mission makes of its graph: a frozen copy, the arrays of kernels, and positions."""

from __future__ import annotations

import math
from collections.abc import Callable, Hashable, Mapping, Sequence
from typing import Any, NoReturn

import networkx as nx
import numpy as np

from botohe_moo._base.numbers import plain_numbers
from botohe_moo.kernels.graph.graph import Graph, new_graph
from botohe_moo.kernels.graph.kinds import AT_NEXT_DEPOT, AT_THIS_DEPOT, ON_ARRIVAL, Kinds
from botohe_moo.kernels.graph.ways import leading
from botohe_moo.mission.rules import Kind, by_kind

_EARTH = 6_371_008.8  # mean radius in metres

Places = dict[Hashable, tuple[float, float]]


class _Attributes(dict[str, Any]):
    """Attributes that cannot be changed, and neither can mappings among their values."""

    __slots__ = ()

    @classmethod
    def of(cls, attributes: Mapping[str, Any]) -> _Attributes:
        return cls((k, cls(v) if isinstance(v, Mapping) else v) for k, v in attributes.items())

    def copy(self) -> dict[str, Any]:
        """Return plain dictionaries, as ``graph.copy()`` needs them."""
        return {name: dict(v) if isinstance(v, _Attributes) else v for name, v in self.items()}

    def _refuse(self, *_: object, **__: object) -> NoReturn:
        remedy = "change mission.graph.copy(), and make a Mission of that"
        raise TypeError(f"The graph of a mission cannot be changed: {remedy}.")

    __setitem__ = __delitem__ = __ior__ = _refuse
    clear = pop = popitem = setdefault = update = _refuse

    def __reduce__(self) -> tuple[Any, ...]:
        return type(self), (dict(self),)  # by default it would be filled item by item


def freeze(graph: nx.DiGraph[Any]) -> nx.DiGraph[Any]:
    """Make a graph immutable, also its attributes, which :func:`networkx.freeze` leaves open."""
    graph.graph = _Attributes.of(graph.graph)
    inside: Any = graph  # networkx has no public way to replace its dictionaries
    for node, attributes in inside._node.items():
        inside._node[node] = _Attributes.of(attributes)
    for tail, heads in inside._succ.items():
        for head, attributes in heads.items():
            heads[head] = inside._pred[head][tail] = _Attributes.of(attributes)
    return nx.freeze(graph)  # type: ignore[no-any-return]


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


def graph_of_kinds(graph: Any, base: Hashable, kinds: Sequence[Kind], pays: str) -> Graph:
    """Return the graph of a valid mission for kernels: with a layer for each kind, or a plain one.

    A mission is plain if its robots are alike and start and end at the base, nodes pay on arrival,
    and there are neither shares nor closed arcs.
    """
    index_of = {node: i for i, node in enumerate(graph)}
    arcs = sorted((index_of[u], index_of[v], arc) for u, v, arc in graph.edges(data=True))
    tail, head = (np.array([arc[i] for arc in arcs], np.int64) for i in (0, 1))
    survival = np.array([by_kind(a["survival"], kinds) for *_, a in arcs]).reshape(-1, len(kinds))
    length = np.array([a.get("length", 1.0) for *_, a in arcs], np.float64)
    nodes, n = [node for _, node in graph.nodes(data=True)], len(graph)
    reward = np.array([node["reward"] for node in nodes], np.float64)
    share = np.array([by_kind(node.get("share", 1.0), kinds) for node in nodes])
    on_return = [node.get("pays", pays) == "return" for node in nodes]
    is_depot = [bool(node.get("depot")) for node in nodes]
    credit = np.where(is_depot, AT_THIS_DEPOT, np.where(on_return, AT_NEXT_DEPOT, ON_ARRIVAL))
    credit[index_of[base]] = AT_THIS_DEPOT
    has_returns = bool((reward[credit == AT_NEXT_DEPOT] > 0.0).any())
    ends = np.array([[index_of[label] for label in kind.ends(base)] for kind in kinds])
    is_plain = len(kinds) == 1 and (ends == index_of[base]).all() and not has_returns
    if is_plain and (share == 1.0).all() and (survival > 0.0).all():
        return new_graph(tail, head, survival[:, 0], length, reward, index_of[base])

    aboard = [[index_of[v] for v in kind.aboard if reward[index_of[v]] > 0.0] for kind in kinds]
    taken = survival > 0.0
    for k, (start, end) in enumerate(ends.tolist()):
        ways = tail[taken[:, k]], head[taken[:, k]]
        is_open = leading(*ways, [end], n) & leading(*ways[::-1], [start], n)
        taken[:, k] &= is_open[tail] & is_open[head]
        is_open[aboard[k]] = True  # what robots carry may come from nodes that are closed now
        share[~is_open, k] = 0.0
        aboard[k] = [node for node in aboard[k] if node != start]  # which the trail visits

    # Each kind has a layer of nodes, and of the arcs that it may take.
    layer, arc = np.nonzero(taken.T)
    of_arcs = tail[arc] + n * layer, head[arc] + n * layer, survival[arc, layer], length[arc]
    ends += n * np.arange(len(kinds))[:, None]
    origin, end = np.tile(np.arange(n), len(kinds)), np.repeat(ends[:, 1], n)
    of_nodes = origin, share.T.ravel(), np.tile(credit, len(kinds)), end
    counts = [kind.robots for kind in kinds]
    kind_of, first = np.repeat(np.arange(len(kinds)), counts), np.cumsum([0, *counts])
    of_robots = ends[kind_of, 0], first[kind_of], first[kind_of + 1]
    carried = np.array([node for nodes in aboard for node in nodes], np.int64)
    first = np.cumsum([0, *map(len, aboard)])
    of_aboard = carried, first[kind_of], first[kind_of + 1]
    described = Kinds(*of_nodes, reward, *of_robots, *of_aboard, has_returns)
    return new_graph(*of_arcs, (reward[:, None] * share).T.ravel(), int(ends[0, 1]), described)
