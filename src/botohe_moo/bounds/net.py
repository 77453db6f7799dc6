"""The part of a mission that plans may need, as arrays for bounds."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import networkx as nx
import numpy as np

from botohe_moo.base.types import BoolArray, FloatArray, OffsetArray
from botohe_moo.bounds.kernels.states import ROUNDING, Net
from botohe_moo.core.world import Graph, World, cheapest_ways, new_limits, new_world

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


def new_net(world: World, unit: float = 1.0) -> Net:
    """Leave out arcs that no trail within the limits takes, or that lead to no reward.

    ``world`` is that of a plain mission with limits. Rewards are counted in units; that of the base
    is set to 0, since every plan collects it.
    """
    reward = world.graph.reward / unit
    reward[world.team.start[0]] = 0.0
    min_survival, max_length = float(world.limits.floors[0]), float(world.limits.budgets[0])
    kept = np.ones(world.graph.n_arcs, bool)
    while True:
        world = _rebuilt(world, np.flatnonzero(kept), reward)
        graph = world.graph
        # With all arcs reversed, ways home are the ways out.
        order = np.lexsort((graph.tail, graph.head))
        outward = _rebuilt(world, order, reward, is_reversed=True)
        kept = _needed(world, outward, min_survival, max_length)
        if kept.all():
            break
    # Nodes that no arc leads to pay nothing.
    reward[np.bincount(graph.head, minlength=graph.n_nodes) == 0] = 0.0
    world = _rebuilt(world, np.flatnonzero(kept), reward)
    graph = world.graph
    reach = _best_reach(graph, outward.ways.home)
    ratio = np.minimum(reach[graph.tail] * graph.survival / reach[graph.head], 1.0)
    return Net(world, reach, ratio, _lengths_home(world), min_survival, max_length)


def pieces_of(world: World) -> list[Piece]:
    """Return the pieces between bridges, each after the one above it; the base's comes first."""
    arcs, base = arcs_by_ends(world.graph), int(world.team.start[0])
    undirected: nx.Graph[int] = nx.Graph(arcs.keys())
    undirected.add_node(base)
    bridges: nx.Graph[int] = nx.Graph(nx.bridges(undirected))  # type: ignore[arg-type]
    undirected.remove_edges_from(bridges.edges)
    found: list[Piece] = []
    # The node where each piece is entered, the piece above, and the gate.
    entrances = [(base, -1, -1)]
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
    world: World, arcs: OffsetArray, reward: FloatArray, *, is_reversed: bool = False
) -> World:
    """Return a world without limits of some of the arcs in their order, with other rewards."""
    graph, team = world.graph, world.team._replace(reward=reward.copy())
    tail, head = (graph.head, graph.tail) if is_reversed else (graph.tail, graph.head)
    of_arcs = tail[arcs], head[arcs], graph.survival[arcs], graph.length[arcs]
    limits = new_limits([0.0], [math.inf], [world.n_robots])
    return new_world(*of_arcs, team.reward, team, limits, None)


def _lengths_home(world: World) -> FloatArray:
    """Return the length of the shortest way from each node to the base, inf where there is none."""
    graph = world.graph
    return cheapest_ways(graph._replace(cost=graph.length), world.team.end)[1]


def _needed(world: World, outward: World, min_survival: float, max_length: float) -> Any:
    """Return which arcs a trail within the limits may take to collect a reward."""
    graph = world.graph
    kept = _arrives(outward)[graph.tail] & _arrives(world)[graph.head]
    alive = outward.ways.home[graph.tail] * graph.survival * world.ways.home[graph.head]
    kept &= alive >= min_survival * (1.0 - ROUNDING)
    out, home = map(_lengths_home, (outward, world))
    length = out[graph.tail] + graph.length + home[graph.head]
    kept &= length * (1.0 - ROUNDING) <= max_length
    pieces = pieces_of(world)
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


def _arrives(world: World) -> BoolArray:
    """Return which nodes have a way to the base."""
    arrives = world.ways.homeward >= 0
    arrives[world.team.start[0]] = True
    return arrives
