"""The memory of relaxed trails: which rewards they have collected, and which bridges taken.

Bits are numbers: a node's index says that its reward has been collected; the number of nodes plus
an arc's index says that the arc has been taken.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from botohe_moo.base.types import FloatArray, OffsetArray
from botohe_moo.bounds.kernels.states import NEVER, NONE, Memory, Net
from botohe_moo.bounds.net import Piece, pieces_of
from botohe_moo.core.paths import find_near

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
