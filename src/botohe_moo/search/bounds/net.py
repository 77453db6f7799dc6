"""The part of a mission that plans may need, as arrays for bounds."""

from __future__ import annotations

from typing import Any, NamedTuple

import networkx as nx
import numpy as np

from botohe_moo._base.types import BoolArray, FloatArray, OffsetArray
from botohe_moo.kernels.bounds.states import ROUNDING, Net
from botohe_moo.kernels.graph.graph import Graph, Limits, measured_by_length, new_graph

_LEAST_REACH = 1e-290  # what is divided by: ways may be more dangerous than floats can say


class Piece(NamedTuple):
    """Nodes between bridges. A trail gets into a piece, and what hangs on it, by one arc at most.

    The first piece is the base's, which no arc of a bridge enters: −1 throughout.
    """

    nodes: tuple[int, ...]
    above: int  # the piece nearer to the base
    gate: int  # the node of that from which the bridge leads here
    arc: int  # the arc of the bridge to here, −1 where there is none
    back: int  # and that to the gate


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
    reach = _best_reach(graph, outward.home)
    ratio = np.minimum(reach[graph.tail] * graph.survival / reach[graph.head], 1.0)
    home_length = measured_by_length(graph).home
    return Net(graph, reach, ratio, home_length, limits.min_survival, limits.max_length)


def pieces_of(graph: Graph) -> list[Piece]:
    """Find the pieces between bridges, each behind the one above it; the base's comes first."""
    ends = zip(graph.tail.tolist(), graph.head.tolist(), strict=True)
    arcs = {pair: arc for arc, pair in enumerate(ends)}
    undirected: nx.Graph[int] = nx.Graph(arcs.keys())
    undirected.add_node(graph.base)
    bridges: list[tuple[int, int]] = list(nx.bridges(undirected))  # type: ignore[arg-type]
    undirected.remove_edges_from(bridges)
    between: dict[int, list[int]] = {}
    for one, other in bridges:
        between.setdefault(one, []).append(other)
        between.setdefault(other, []).append(one)
    found: list[Piece] = []
    # Where each piece is entered, and from which node of which piece.
    entrances = [(graph.base, -1, -1)]
    for entrance, above, gate in entrances:  # which grows
        nodes = tuple(nx.node_connected_component(undirected, entrance))
        arc, back = arcs.get((gate, entrance), -1), arcs.get((entrance, gate), -1)
        for node in nodes:
            onward = [other for other in between.get(node, ()) if other != gate]
            entrances += [(other, len(found), node) for other in onward]
        found.append(Piece(nodes, above, gate, arc, back))
    return found


def _best_reach(graph: Graph, reach: FloatArray) -> FloatArray:
    """Raise what was found in logarithms until no arc leads to more, as floats multiply."""
    reach = np.maximum(reach, _LEAST_REACH)
    while True:
        better = reach.copy()
        np.maximum.at(better, graph.head, reach[graph.tail] * graph.survival)
        if np.array_equal(better, reach):
            return reach
        reach = better


def _with_arcs(graph: Graph, reward: FloatArray, kept: BoolArray) -> Graph:
    """Return a graph of some of the arcs, with other rewards."""
    return _rebuilt(graph, (graph.tail, graph.head), np.flatnonzero(kept), reward)


def _reversed(graph: Graph) -> Graph:
    """Reverse all arcs: the ways home become the ways out."""
    order = np.lexsort((graph.tail, graph.head))
    return _rebuilt(graph, (graph.head, graph.tail), order, graph.reward)


def _rebuilt(
    graph: Graph, ends: tuple[OffsetArray, OffsetArray], arcs: OffsetArray, reward: FloatArray
) -> Graph:
    tail, head = ends
    figures = graph.survival[arcs], graph.length[arcs], reward.copy()
    return new_graph(tail[arcs], head[arcs], *figures, graph.base)


def _needed(graph: Graph, outward: Graph, limits: Limits) -> Any:
    """Return which arcs a trail within the limits may take to collect a reward."""
    known, comes = (_arrives(each) for each in (outward, graph))
    kept = known[graph.tail] & comes[graph.head]
    alive = outward.home[graph.tail] * graph.survival * graph.home[graph.head]
    kept &= alive >= limits.min_survival * (1.0 - ROUNDING)
    out, home = (measured_by_length(each).home for each in (outward, graph))
    length = out[graph.tail] + graph.length + home[graph.head]
    kept &= length * (1.0 - ROUNDING) <= limits.max_length
    pieces = pieces_of(graph)
    worth = [float(graph.reward[list(piece.nodes)].sum()) for piece in pieces]
    is_useless = np.zeros(graph.n_nodes, bool)
    for number in range(len(pieces) - 1, 0, -1):  # what hangs on a piece comes after it
        piece = pieces[number]
        if piece.back < 0 or worth[number] == 0.0:
            is_useless[list(piece.nodes)] = True
        else:
            worth[piece.above] += worth[number]
    kept &= ~(is_useless[graph.tail] | is_useless[graph.head])
    return kept


def _arrives(graph: Graph) -> BoolArray:
    """Return which nodes have a way to the base."""
    there = graph.homeward >= 0
    there[graph.base] = True
    return there
