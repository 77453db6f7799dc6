"""What a mission takes from its graph: a copy that cannot be changed, arrays, and positions."""

from __future__ import annotations

from collections.abc import Hashable, Mapping
from typing import Any, NoReturn

import networkx as nx
import numpy as np

from botohe_moo.kernels.graph.graph import Graph, new_graph


class _Attributes(dict[str, Any]):
    """Attributes that stay what they are; ``copy`` gives a plain dictionary."""

    __slots__ = ()

    def _refuse(self, *_: object, **__: object) -> NoReturn:
        raise TypeError(
            "The graph of a mission cannot be changed: change mission.graph.copy(), and make a "
            "Mission of that."
        )

    __setitem__ = __delitem__ = __ior__ = _refuse
    clear = pop = popitem = setdefault = update = _refuse

    def __reduce__(self) -> tuple[Any, ...]:
        return type(self), (dict(self),)  # by default it would be filled item by item


def frozen_copy(graph: nx.DiGraph[Any]) -> nx.DiGraph[Any]:
    """Return a copy of which neither nodes and arcs nor their attributes can be changed.

    :func:`networkx.freeze` leaves the attributes as they are.
    """
    copied = graph.copy()
    copied.graph = _Attributes(copied.graph)
    inside: Any = copied  # networkx has no public way to replace its dictionaries
    for node, attributes in inside._node.items():
        inside._node[node] = _Attributes(attributes)
    for tail, heads in inside._succ.items():
        for head, attributes in heads.items():
            heads[head] = inside._pred[head][tail] = _Attributes(attributes)
    frozen: nx.DiGraph[Any] = nx.freeze(copied)
    return frozen


def arrays_of(graph: nx.DiGraph[Any], base: Hashable, index: Mapping[Any, int]) -> Graph:
    """Return a valid mission's graph as kernels take it; ``index`` numbers its nodes."""
    arcs = sorted(
        (index[u], index[v], arc["survival"], arc.get("length", 1.0))
        for u, v, arc in graph.edges(data=True)
    )
    return new_graph(
        tail=np.array([u for u, *_ in arcs], np.int64),
        head=np.array([v for _, v, *_ in arcs], np.int64),
        survival=np.array([s for _, _, s, _ in arcs], np.float64),
        length=np.array([d for *_, d in arcs], np.float64),
        reward=np.array([r for _, r in graph.nodes(data="reward")], np.float64),
        base=index[base],
    )


def given_places(graph: nx.DiGraph[Any]) -> dict[Hashable, tuple[float, float] | None]:
    """Return the attribute ``pos`` of each node of a mission, or None."""
    places: dict[Hashable, tuple[float, float] | None] = {}
    place: Any
    for node, place in graph.nodes(data="pos"):
        places[node] = None if place is None else (float(place[0]), float(place[1]))
    return places
