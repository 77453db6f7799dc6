"""The part of a mission that plans may need, as arrays for bounds."""

from __future__ import annotations

from typing import Any, NamedTuple

import networkx as nx
import numpy as np

from botohe_moo._base.types import BoolArray, FloatArray, OffsetArray
from botohe_moo.bounds.kernels.states import ROUNDING, Net
from botohe_moo.core.graph import Graph, Limits, new_graph, with_costs

_LEAST_REACH = 1e-290  # it is divided by reach, which underflows on long ways


class Piece(NamedTuple):
    """Nodes between bridges, which a trail can enter once only.

    The first piece is that of the base, with −1 for everything about its bridge.
    """

    nodes: tuple[int, ...]
    above: int  # the piece on the other side of the bridge, nearer to the base
    gate: int  # the bridge's node in that piece
    arc: int  # the arc from the gate, −1 where there is none
    back: int  # the arc to the gate, −1 where there is none


def new_net(graph: Graph, limits: Limits) -> Net:
    """Leave out arcs that no trail within the limits takes, or that lead to no reward.

    The reward of the base is set to 0: every plan collects it.
    """
    reward = graph.reward.copy()
    reward[graph.base] = 0.0
    kept = np.ones(graph.n_arcs, bool)
    while True:
        graph = _rebuilt(graph, np.flatnonzero(kept), reward)
        # With all arcs reversed, ways home are the ways out.
        order = np.lexsort((graph.tail, graph.head))
        outward = _rebuilt(graph, order, reward, is_reversed=True)
        kept = _needed(graph, outward, limits)
        if kept.all():
            break
    # Nodes that no arc leads to pay nothing.
    reward[np.bincount(graph.head, minlength=graph.n_nodes) == 0] = 0.0
    graph = _rebuilt(graph, np.flatnonzero(kept), reward)
    reach = _best_reach(graph, outward.home)
    ratio = np.minimum(reach[graph.tail] * graph.survival / reach[graph.head], 1.0)
    home_length = with_costs(graph, graph.length).home
    return Net(graph, reach, ratio, home_length, limits.min_survival, limits.max_length)


def pieces_of(graph: Graph) -> list[Piece]:
    """Return the pieces between bridges, each after the one above it; the base's comes first."""
    arcs = arcs_by_ends(graph)
    undirected: nx.Graph[int] = nx.Graph(arcs.keys())
    undirected.add_node(graph.base)
    bridges: nx.Graph[int] = nx.Graph(nx.bridges(undirected))  # type: ignore[arg-type]
    undirected.remove_edges_from(bridges.edges)
    found: list[Piece] = []
    # The node where each piece is entered, the piece above, and the gate.
    entrances = [(graph.base, -1, -1)]
    for entrance, above, gate in entrances:  # the list grows as it is read
        nodes = tuple(nx.node_connected_component(undirected, entrance))
        arc, back = arcs.get((gate, entrance), -1), arcs.get((entrance, gate), -1)
        for node in nodes:
            onward = [other for other in bridges.adj.get(node, ()) if other != gate]
            entrances += [(other, len(found), node) for other in onward]
        found.append(Piece(nodes, above, gate, arc, back))
    return found


def arcs_by_ends(graph: Graph) -> dict[tuple[int, int], int]:
    """Return the index of each arc by its tail and its head."""
    ends = zip(graph.tail.tolist(), graph.head.tolist(), strict=True)
    return {pair: arc for arc, pair in enumerate(ends)}


def _best_reach(graph: Graph, reach: FloatArray) -> FloatArray:
    """Raise probabilities, which come from logarithms, until no product along an arc is larger."""
    reach = np.maximum(reach, _LEAST_REACH)
    while True:
        better = reach.copy()
        np.maximum.at(better, graph.head, reach[graph.tail] * graph.survival)
        if np.array_equal(better, reach):
            return reach
        reach = better


def _rebuilt(
    graph: Graph, arcs: OffsetArray, reward: FloatArray, *, is_reversed: bool = False
) -> Graph:
    """Return a graph of some of the arcs in their order, with other rewards."""
    tail, head = (graph.head, graph.tail) if is_reversed else (graph.tail, graph.head)
    survival, length = graph.survival[arcs], graph.length[arcs]
    return new_graph(tail[arcs], head[arcs], survival, length, reward.copy(), graph.base)


def _needed(graph: Graph, outward: Graph, limits: Limits) -> Any:
    """Return which arcs a trail within the limits may take to collect a reward."""
    kept = _arrives(outward)[graph.tail] & _arrives(graph)[graph.head]
    alive = outward.home[graph.tail] * graph.survival * graph.home[graph.head]
    kept &= alive >= limits.min_survival * (1.0 - ROUNDING)
    out, home = (with_costs(each, each.length).home for each in (outward, graph))
    length = out[graph.tail] + graph.length + home[graph.head]
    kept &= length * (1.0 - ROUNDING) <= limits.max_length
    pieces = pieces_of(graph)
    worth = [float(graph.reward[list(piece.nodes)].sum()) for piece in pieces]
    is_useless = np.zeros(graph.n_nodes, bool)
    for number in range(len(pieces) - 1, 0, -1):  # from the outermost pieces inwards
        piece = pieces[number]
        if piece.back < 0 or worth[number] == 0.0:
            is_useless[list(piece.nodes)] = True
        else:
            worth[piece.above] += worth[number]
    kept &= ~(is_useless[graph.tail] | is_useless[graph.head])
    return kept


def _arrives(graph: Graph) -> BoolArray:
    """Return which nodes have a way to the base."""
    arrives = graph.homeward >= 0
    arrives[graph.base] = True
    return arrives
