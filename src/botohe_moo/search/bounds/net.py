"""The part of a mission that plans may need, as arrays for bounds."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any, NamedTuple

import networkx as nx
import numpy as np

from botohe_moo._base.types import BoolArray, FloatArray, OffsetArray
from botohe_moo.kernels.bounds.states import Net
from botohe_moo.kernels.graph.graph import Graph, Limits, measured_by_length, new_graph

# Limits are kept by what exceeds them by no more than this, relative.
_ROUNDING = 1e-12


class Part(NamedTuple):
    """Nodes that hang on a bridge: a trail gets there by one arc, and away by another."""

    arc: int  # the bridge's arc into the part
    gate: int  # the node that it leaves
    back: int  # the bridge's arc out of the part, or −1
    nodes: frozenset[int]


def new_net(graph: Graph, limits: Limits) -> Net:
    """Leave out arcs that no trail within the limits takes, or that lead to no reward.

    The base's reward counts for nothing: every plan collects it.
    """
    reward = graph.reward.copy()
    reward[graph.base] = 0.0
    while True:
        graph = _with_arcs(graph, reward, np.ones(graph.n_arcs, bool))
        outward = _reversed(graph)
        kept = _needed(graph, outward, limits)
        if kept.all():
            break
        graph = _with_arcs(graph, reward, kept)
    # What no arc leads to pays nothing.
    reward[np.bincount(graph.head, minlength=graph.n_nodes) == 0] = 0.0
    graph = _with_arcs(graph, reward, np.ones(graph.n_arcs, bool))
    reach = outward.home
    ratio = np.minimum(reach[graph.tail] * graph.survival / reach[graph.head], 1.0)
    home_length = measured_by_length(graph).home
    return Net(graph, reach, ratio, home_length, limits.min_survival, limits.max_length)


def hanging_parts(graph: Graph) -> Iterator[Part]:
    """Find the parts that hang on each bridge, seen from the base."""
    arcs = {ends: arc for arc, ends in enumerate(_ends(graph))}
    undirected: nx.Graph[int] = nx.Graph(arcs.keys())
    undirected.add_node(graph.base)
    bridges: list[tuple[int, int]] = list(nx.bridges(undirected))  # type: ignore[arg-type]
    undirected.remove_edges_from(bridges)
    pieces = list(nx.connected_components(undirected))
    piece_of = {node: i for i, piece in enumerate(pieces) for node in piece}
    tree: nx.Graph[int] = nx.Graph()
    tree.add_nodes_from(range(len(pieces)))
    for a, b in bridges:
        tree.add_edge(piece_of[a], piece_of[b], ends=(a, b))
    root = piece_of[graph.base]
    below: dict[int, set[int]] = {i: set(piece) for i, piece in enumerate(pieces)}
    order: list[tuple[int, int]] = list(nx.bfs_edges(tree, root))
    for above, piece in reversed(order):
        a, b = tree.edges[above, piece]["ends"]
        gate, entrance = (a, b) if piece_of[a] == above else (b, a)
        if (gate, entrance) in arcs:
            yield Part(
                arcs[gate, entrance],
                gate,
                arcs.get((entrance, gate), -1),
                frozenset(below[piece]),
            )
        below[above] |= below[piece]


def _ends(graph: Graph) -> Iterator[tuple[int, int]]:
    return zip(graph.tail.tolist(), graph.head.tolist(), strict=True)


def _with_arcs(graph: Graph, reward: FloatArray, kept: BoolArray) -> Graph:
    return new_graph(
        graph.tail[kept],
        graph.head[kept],
        graph.survival[kept],
        graph.length[kept],
        reward.copy(),
        graph.base,
    )


def _reversed(graph: Graph) -> Graph:
    """Turn all arcs round: the way home is the way out then."""
    order: OffsetArray = np.lexsort((graph.tail, graph.head))
    return new_graph(
        graph.head[order],
        graph.tail[order],
        graph.survival[order],
        graph.length[order],
        graph.reward.copy(),
        graph.base,
    )


def _needed(graph: Graph, outward: Graph, limits: Limits) -> Any:
    known, comes = (_arrives(each) for each in (outward, graph))
    kept = known[graph.tail] & comes[graph.head]
    alive = outward.home[graph.tail] * graph.survival * graph.home[graph.head]
    kept &= alive >= limits.min_survival * (1.0 - _ROUNDING)
    out, home = (measured_by_length(each).home for each in (outward, graph))
    length = out[graph.tail] + graph.length + home[graph.head]
    kept &= length * (1.0 - _ROUNDING) <= limits.max_length
    for part in hanging_parts(graph):
        if part.back < 0 or graph.reward[list(part.nodes)].sum() == 0.0:
            inside = np.isin(np.arange(graph.n_nodes), list(part.nodes))
            kept &= ~(inside[graph.tail] | inside[graph.head])
    return kept


def _arrives(graph: Graph) -> BoolArray:
    """Tell which nodes have a way to the base."""
    there = graph.homeward >= 0
    there[graph.base] = True
    return there
