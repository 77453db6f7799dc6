"""The part of a mission that plans may need, and the memory of relaxed trails, as arrays."""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import pairwise
from typing import Any, NamedTuple

import networkx as nx
import numpy as np

from botohe_moo.base.types import BoolArray, FloatArray, OffsetArray
from botohe_moo.bounds.kernels.states import NEVER, NONE, ROUNDING, Memory, Net, Pieces
from botohe_moo.core.paths import find_near
from botohe_moo.core.world import Chances, Graph, World, cheapest_ways, new_limits, new_world

MOST_SLOPES = 16  # of the hull of a piece's excursions
_MOST_JOINED = 12  # nodes on the way to the largest piece that are taken into it
_LEAST_REACH = 1e-290  # it is divided by reach, which underflows on long ways


class Piece(NamedTuple):
    """Nodes that no bridge (an edge without a way round) separates; a trail enters them once.

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
    ratio = np.minimum(reach[graph.tail] * graph.mean_survival / reach[graph.head], 1.0)
    pieces = _packed(world, pieces_of(world))
    return Net(world, reach, ratio, _lengths_home(world), min_survival, max_length, pieces)


def pieces_of(world: World) -> list[Piece]:
    """Return the pieces between bridges, each after the one above it; the base's comes first.

    Where a short way leads from the base to the largest piece, all of these are one piece: its
    excursions would not be shorter than trails.
    """
    arcs, base = arcs_by_ends(world.graph), int(world.team.start[0])
    undirected: nx.Graph[int] = nx.Graph(arcs.keys())
    undirected.add_node(base)
    bridges: nx.Graph[int] = nx.Graph(nx.bridges(undirected))  # type: ignore[arg-type]
    found = _between(bridges, undirected, arcs, base)
    piece, way = max(found, key=lambda piece: len(piece.nodes)), list[tuple[int, int]]()
    n_nodes = 0
    while piece.above >= 0:
        way.append((piece.gate, int(world.graph.head[piece.arc])))
        piece = found[piece.above]
        n_nodes += len(piece.nodes)
    if not way or n_nodes > _MOST_JOINED:
        return found
    bridges.remove_edges_from(way)
    return _between(bridges, undirected, arcs, base)


def _between(
    bridges: nx.Graph[int], graph: nx.Graph[int], arcs: dict[tuple[int, int], int], base: int
) -> list[Piece]:
    """Return the pieces between some bridges."""
    parts = nx.restricted_view(graph, [], list(bridges.edges))
    found: list[Piece] = []
    # The node where each piece is entered, the piece above, and the gate.
    entrances = [(base, -1, -1)]
    for entrance, above, gate in entrances:  # the list grows as it is read
        nodes = tuple(sorted(nx.node_connected_component(parts, entrance)))
        arc, back = arcs.get((gate, entrance), -1), arcs.get((entrance, gate), -1)
        for node in nodes:
            onward = [other for other in bridges.adj.get(node, ()) if other != gate]
            entrances += [(other, len(found), node) for other in onward]
        found.append(Piece(nodes, above, gate, arc, back))
    return found


def _packed(world: World, found: list[Piece]) -> Pieces:
    """Return pieces as arrays, as kernels take them."""
    graph, numbers = world.graph, np.arange(len(found))
    of = np.zeros(graph.n_nodes, np.int64)  # also of nodes that no arc leads to
    for number, piece in enumerate(found):
        of[list(piece.nodes)] = number
    gate, arc, back = np.array([piece[2:] for piece in found], np.int64).reshape(-1, 3).T
    entry = np.append(world.team.start[0], graph.head[arc[1:]]).astype(np.int64)
    into, is_back = np.full(graph.n_arcs, -1), np.zeros(graph.n_arcs, bool)
    into[arc[1:]], is_back[back[1:]] = numbers[1:], True
    has_more = np.bincount(of[gate[1:]], minlength=len(found)) > 0
    is_dead_end = ~has_more & (np.bincount(of, minlength=len(found)) == 1)
    n_options = np.where(is_dead_end, 1, MOST_SLOPES)
    n_options[0] = 0
    first_option = np.append(0, n_options.cumsum())
    of_option = np.repeat(numbers, n_options)
    return Pieces(of, entry, gate, arc, back, first_option, of_option, into, is_back)


def arcs_by_ends(graph: Graph) -> dict[tuple[int, int], int]:
    """Return the index of each arc by its tail and its head."""
    ends = zip(graph.tail.tolist(), graph.head.tolist(), strict=True)
    return {pair: arc for arc, pair in enumerate(ends)}


def _best_reach(graph: Graph, reach: FloatArray) -> FloatArray:
    """Raise probabilities, which come from logarithms, until no product along an arc is larger."""
    reach = np.maximum(reach, _LEAST_REACH)
    while True:
        better = reach.copy()
        np.maximum.at(better, graph.head, reach[graph.tail] * graph.mean_survival)
        if np.array_equal(better, reach):
            return reach
        reach = better


def _rebuilt(
    world: World, arcs: OffsetArray, reward: FloatArray, *, is_reversed: bool = False
) -> World:
    """Return a world without limits of some of the arcs in their order, with other rewards."""
    own = reward.copy()
    graph, team = world.graph, world.team._replace(reward=own, worth=own)
    tail, head = (graph.head, graph.tail) if is_reversed else (graph.tail, graph.head)
    chances = Chances(graph.probability, graph.survival[:, arcs])
    of_arcs = tail[arcs], head[arcs], chances, graph.length[arcs]
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
    alive = outward.ways.home[graph.tail] * graph.mean_survival * world.ways.home[graph.head]
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


_NEAREST, _COMPARED = 8, 24  # bits that nodes remember at first, of so many nodes near by


class RelaxedTrail(NamedTuple):
    """A walk from the base that may repeat arcs, and be paid again for what it has forgotten.

    It need not come home.
    """

    arcs: list[int]
    paid: list[bool]  # whether the visit at the head of each arc pays


class Remembered:
    """What each node remembers: bits of its own first, then of near nodes, ``n_bits`` at most.

    Bit v is the reward of node v. Bit n_nodes + a is the excursion that begins with arc a, which
    leads into another piece. Nodes remember bits of their own piece only. Other arcs are not
    remembered, since they pay nothing.

    Attributes
    ----------
    bits
        The bits of each node.
    worth
        What each bit can pay at most.
    """

    def __init__(self, net: Net, n_bits: int) -> None:
        graph, pieces = net.graph, net.pieces
        self.net = net
        # A reward is paid where a trail enters a piece, and not again.
        pays = np.setdiff1d(np.flatnonzero(graph.reward > 0.0), pieces.entry)
        own: list[list[int]] = [[node] if node in pays else [] for node in range(graph.n_nodes)]
        self.worth = {node: float(graph.reward[node]) for node in pays.tolist()}
        inside = np.bincount(pieces.of, graph.reward, len(pieces.entry))
        for piece in range(len(inside) - 1, 0, -1):  # from the outermost pieces inwards
            inside[pieces.of[pieces.gate[piece]]] += inside[piece]
        for piece, gate in enumerate(pieces.gate[1:].tolist(), 1):
            bit = graph.n_nodes + int(pieces.arc[piece])
            own[gate].append(bit)
            self.worth[bit] = float(inside[piece])
        near = find_near(net.world, min(_COMPARED, graph.n_nodes - 1)).nodes
        self.bits: list[list[int]] = []
        for node, others in enumerate(near.tolist()):
            within = [other for other in others if pieces.of[other] == pieces.of[node]]
            around = [bit for other in within if other != node for bit in own[other]]
            n_more = max(0, _NEAREST - len(own[node]))
            self.bits.append([*own[node], *dict.fromkeys(around[:n_more])][:n_bits])

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

    def pack(self) -> Memory:
        """Return the memory as arrays, as kernels take it."""
        graph, pieces = self.net.graph, self.net.pieces
        n_nodes = graph.n_nodes
        places = [{bit: i for i, bit in enumerate(bits)} for bits in self.bits]
        kept: list[tuple[int, int]] = []
        first_kept = [0]
        adds, unpaid, barred = np.zeros((3, graph.n_arcs), np.int64)
        ends = np.where(pieces.into >= 0, graph.tail, graph.head)
        for arc, (tail, end) in enumerate(zip(graph.tail.tolist(), ends.tolist(), strict=True)):
            before, after = places[tail], places[end]
            if pieces.of[tail] == pieces.of[end]:
                kept += [(before[bit], after[bit]) for bit in before.keys() & after.keys()]
            first_kept.append(len(kept))
            bit = n_nodes + arc if pieces.into[arc] >= 0 else end
            adds[arc] = 1 << after[bit] if bit in after else 0
            unpaid[arc] = before.get(end, NONE) if end in self.worth else NEVER
            barred[arc] = before.get(n_nodes + arc, NONE)
        pairs: OffsetArray = np.array(kept, np.int64).reshape(-1, 2)
        n_bits = np.array([len(bits) for bits in self.bits])
        return Memory(n_bits, np.array(first_kept), pairs, adds, unpaid, barred)

    def forgets(self, trail: RelaxedTrail) -> list[tuple[int, list[int]]]:
        """Return what nodes have to remember for a relaxed trail to be impossible.

        These are the bits of what it does twice, each with the nodes of the piece between both
        times that lack it. Bits that are worth the most come first.
        """
        found = []
        for walk in self._walks(trail):
            nodes = [node for node, _ in walk]
            times: dict[int, list[int]] = {}
            for step, (_, bit) in enumerate(walk):
                if bit is not None:
                    times.setdefault(bit, []).append(step)
            for bit, steps in times.items():
                for before, after in pairwise(steps):
                    need = {node for node in nodes[before:after] if bit not in self.bits[node]}
                    if need:
                        found.append((bit, sorted(need)))
        return sorted(found, key=lambda item: -self.worth[item[0]])

    def _walks(self, trail: RelaxedTrail) -> list[list[tuple[int, int | None]]]:
        """Return the walks inside pieces that a relaxed trail consists of.

        Each step of a walk is a node, and the bit of what was collected to get there, if anything.
        """
        graph, pieces = self.net.graph, self.net.pieces
        found: list[list[tuple[int, int | None]]] = [[(self.net.base, None)]]
        inside = [found[0]]
        for arc, pays in zip(*trail, strict=True):
            tail, head = int(graph.tail[arc]), int(graph.head[arc])
            if pieces.into[arc] >= 0:
                inside[-1].append((tail, graph.n_nodes + arc))
                inside.append([(head, None)])
                found.append(inside[-1])
            elif pieces.is_back[arc]:
                inside.pop()
            else:
                inside[-1].append((head, head if pays else None))
        return found
