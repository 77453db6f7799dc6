"""The part of a mission that plans may need, and the memory of relaxed trails, as arrays."""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import pairwise
from typing import Any, NamedTuple

import networkx as nx
import numpy as np

from botohe_moo.base.types import BoolArray, FloatArray, OffsetArray
from botohe_moo.bounds.kernels.states import NEVER, NONE, ROUNDING, Memory, Net
from botohe_moo.core.paths import find_near
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


_MOST_BRIDGES = 256  # that a node chooses from: more than it can remember
# By what share survivals of ways are raised: paths are compared by sums of rounded logarithms.
_ABOVE = 1e-9


class RelaxedTrail(NamedTuple):
    """A trail that may repeat what it has forgotten."""

    arcs: list[int]
    paid: list[bool]  # whether the visit at the head of each arc pays


class Remembered:
    """The bits that each node remembers, ``n_bits`` at most.

    These are the ``nearest`` rewards, by the survival of a round trip from the node, and bridges
    into parts that hang on them. A trail can enter such a part once, and comes out to nodes that it
    has visited. So a node needs no bit for its reward if all arcs to it belong to bridges.
    """

    def __init__(self, net: Net, nearest: int, n_bits: int, most_compared: int) -> None:
        graph = net.graph
        self.net = net
        self.bits: list[list[int]] = [[] for _ in range(graph.n_nodes)]
        self.between: FloatArray | None = None
        self._backs: dict[int, int] = {}  # the arc into a piece, by the arc back over its bridge
        if n_bits == 0:
            return
        pieces = pieces_of(net.world)
        self._backs = {piece.back: piece.arc for piece in pieces[1:]}
        bridges = [*self._backs, *self._backs.values()]
        not_by_bridges = np.ones(graph.n_arcs, bool)
        not_by_bridges[bridges] = False
        pays = np.intersect1d(graph.head[not_by_bridges], np.flatnonzero(graph.reward > 0.0))
        if graph.n_nodes <= most_compared:
            self.between = _best_between(net)
        # Of each piece those that a trail may enter next, or on its way to the base: they hang on
        # it, or on one of the pieces above it.
        around: list[list[Piece]] = [[] for _ in pieces]
        for piece in pieces[1:]:
            around[piece.above].append(piece)
        for number, piece in enumerate(pieces):
            if number > 0:
                around[number] += [other for other in around[piece.above] if other is not piece]
                del around[number][_MOST_BRIDGES:]
            for node in piece.nodes:
                rewards, ways = self._nearest(node, pays, around[number])
                bits = rewards[:nearest] + [graph.n_nodes + way.arc for way in ways]
                self.bits[node] = bits[:n_bits]

    def add(self, wanted: Sequence[tuple[int, Sequence[int]]], n_bits: int) -> bool:
        """Add each bit whose nodes all have room for it; return whether any is new."""
        self.bits = [list(bits) for bits in self.bits]
        is_new = False
        for bit, nodes in wanted:
            lacking = [node for node in nodes if bit not in self.bits[node]]
            if all(len(self.bits[node]) < n_bits for node in lacking):
                is_new = is_new or bool(lacking)
                for node in lacking:
                    self.bits[node].append(bit)
        return is_new

    def _nearest(
        self, node: int, pays: OffsetArray, ways: list[Piece]
    ) -> tuple[list[int], list[Piece]]:
        """Sort nodes that pay, and ways into pieces, by the survival of a round trip."""
        if self.between is None:
            return [node] if node in pays else [], ways
        near = self.between[node] * self.between[:, node]
        nearness = near[pays] + (pays == node)  # the node itself comes first
        order = np.argsort([-near[way.gate] for way in ways], kind="stable")
        rewards = pays[np.argsort(-nearness, kind="stable")].tolist()
        return rewards, [ways[i] for i in order.tolist()]

    def pack(self) -> Memory:
        """Return the memory as arrays, as kernels take it."""
        graph = self.net.graph
        n_nodes = graph.n_nodes
        places = [{bit: i for i, bit in enumerate(bits)} for bits in self.bits]
        kept: list[tuple[int, int]] = []
        first_kept = [0]
        adds, unpaid, barred = (np.full(graph.n_arcs, NONE) for _ in range(3))
        ends = zip(graph.tail.tolist(), graph.head.tolist(), strict=True)
        pays = (graph.reward > 0.0).tolist()
        for arc, (tail, head) in enumerate(ends):
            before, after = places[tail], places[head]
            kept += [(before[bit], after[bit]) for bit in before.keys() & after.keys()]
            first_kept.append(len(kept))
            # A trail that comes back over a bridge has taken it before.
            bits = {n_nodes + arc, n_nodes + self._backs.get(arc, arc)}
            if pays[head]:
                bits.add(head)
            adds[arc] = sum(1 << after[bit] for bit in bits & after.keys())
            unpaid[arc] = before.get(head, NONE)
            if not pays[head] or arc in self._backs:
                unpaid[arc] = NEVER
            barred[arc] = before.get(n_nodes + arc, NONE)
        pairs: OffsetArray = np.array(kept, np.int64).reshape(-1, 2)
        n_bits = np.array([len(bits) for bits in self.bits])
        return Memory(n_bits, np.array(first_kept), pairs, adds, unpaid, barred)

    def forgets(self, trail: RelaxedTrail) -> list[tuple[int, list[int]]]:
        """Return what a relaxed trail does twice: bits, each with the nodes that lack it.

        These are nodes between the first time and the second. Bits with the fewest come first.
        """
        graph = self.net.graph
        nodes = [self.net.base, *graph.head[trail.arcs].tolist()]
        times: dict[int, list[int]] = {}
        for step, (arc, pays) in enumerate(zip(*trail, strict=True), 1):
            times.setdefault(graph.n_nodes + arc, []).append(step)
            if pays:
                times.setdefault(nodes[step], []).append(step)
        found = []
        for bit, steps in times.items():
            for before, after in pairwise(steps):
                need = {node for node in nodes[before:after] if bit not in self.bits[node]}
                if need:
                    found.append((bit, sorted(need)))
        return sorted(found, key=lambda item: len(item[1]))


def _best_between(net: Net) -> FloatArray:
    """Return the survival of the safest way from each node to each (n_nodes, n_nodes), or more."""
    n_nodes = net.graph.n_nodes
    near, between = find_near(net.world, n_nodes), np.zeros((n_nodes, n_nodes))
    np.put_along_axis(between, near.nodes, near.reach, axis=1)
    np.fill_diagonal(between, 1.0)
    return np.minimum(between * (1.0 + _ABOVE) + np.finfo(float).tiny, 1.0)
