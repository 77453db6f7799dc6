"""What relaxed trails remember: rewards near by, bridges used, and what they have come back to.

A bit stands for a node whose reward has been collected (the node's index), or an arc that has been
taken (the number of nodes, and the arc's index).
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise

import numpy as np

from botohe_moo._base.types import FloatArray, OffsetArray
from botohe_moo.kernels.beam.prospects import find_near
from botohe_moo.kernels.bounds.states import NEVER, NONE, Memory, Net
from botohe_moo.search.bounds.net import Piece, pieces_of

# Ways into pieces that a node chooses from, and how many pieces up it looks for them.
_MOST_GATES, _MOST_UP = 256, 64
# By how much survivals of ways are raised: paths are compared by sums of rounded logarithms.
_ABOVE = 1e-9


class Remembered:
    """Which bits each node remembers.

    ``nearest`` rewards that a round trip from the node survives best, and bridges into parts that
    hang on them, up to ``n_bits`` together. A trail gets into such a part once, and what it comes
    out to it has visited before: where all arcs to a node are of bridges, no bit is needed for its
    reward.
    """

    def __init__(self, net: Net, nearest: int, n_bits: int, most_compared: int) -> None:
        graph = net.graph
        self.net = net
        self.bits: list[list[int]] = [[] for _ in range(graph.n_nodes)]
        self.between: FloatArray | None = None
        self._next: list[list[int]] = [[] for _ in range(graph.n_nodes)]
        self._backs: dict[int, int] = {}
        if n_bits == 0:
            return
        pieces = pieces_of(graph)
        self._backs = {piece.back: piece.arc for piece in pieces[1:]}
        bridges = [*self._backs, *self._backs.values()]
        not_by_bridges = np.ones(graph.n_arcs, bool)
        not_by_bridges[bridges] = False
        pays = np.intersect1d(graph.head[not_by_bridges], np.flatnonzero(graph.reward > 0.0))
        if graph.n_nodes <= most_compared:
            self.between = _best_between(net)
        hanging: list[list[int]] = [[] for _ in pieces]
        for number, piece in enumerate(pieces[1:], 1):
            hanging[piece.above].append(number)
        for number, piece in enumerate(pieces):
            gates = _gates_around(pieces, hanging, number)
            for node in piece.nodes:
                rewards, ways = self._nearest(node, pays, [pieces[gate] for gate in gates])
                bits = rewards[:nearest] + [graph.n_nodes + way.arc for way in ways]
                self.bits[node] = bits[:n_bits]
                self._next[node] = rewards

    def widen(self, n_bits: int) -> None:
        """Add the next rewards near by to nodes that remember fewer than ``n_bits``."""
        self.bits = [list(bits) for bits in self.bits]
        for bits, rewards in zip(self.bits, self._next, strict=True):
            more = [reward for reward in rewards if reward not in bits]
            bits += more[: max(0, n_bits - len(bits))]

    def add(self, wanted: Sequence[tuple[int, Sequence[int]]], n_bits: int) -> bool:
        """Add bits to nodes, each where all its nodes have room; returns whether any is new."""
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
        nearness = near[pays] + (pays == node)  # before all others
        order = np.argsort([-near[way.gate] for way in ways], kind="stable")
        rewards = pays[np.argsort(-nearness, kind="stable")].tolist()
        return rewards, [ways[i] for i in order.tolist()]

    def pack(self) -> Memory:
        """Return the meaning of the masks' bits as arrays."""
        graph = self.net.graph
        n_nodes = graph.n_nodes
        places = [{bit: i for i, bit in enumerate(bits)} for bits in self.bits]
        kept: list[tuple[int, int]] = []
        first_kept = [0]
        adds, unpaid, barred = (np.full(graph.n_arcs, NONE) for _ in range(3))
        ends = zip(graph.tail.tolist(), graph.head.tolist(), strict=True)
        pays = (graph.reward > 0.0).tolist()
        for arc, (tail, head) in enumerate(ends):
            there, here = places[tail], places[head]
            kept += [(there[bit], here[bit]) for bit in there.keys() & here.keys()]
            first_kept.append(len(kept))
            # Who comes back over a bridge has taken it before.
            bits = {n_nodes + arc, n_nodes + self._backs.get(arc, arc)}
            if pays[head]:
                bits.add(head)
            adds[arc] = sum(1 << here[bit] for bit in bits & here.keys())
            unpaid[arc] = there.get(head, NONE)
            if not pays[head] or arc in self._backs:
                unpaid[arc] = NEVER
            barred[arc] = there.get(n_nodes + arc, NONE)
        pairs: OffsetArray = np.array(kept, np.int64).reshape(-1, 2)
        n_bits = np.array([len(bits) for bits in self.bits])
        return Memory(n_bits, np.array(first_kept), pairs, adds, unpaid, barred)

    def forgets(self, arcs: Sequence[int], paid: Sequence[bool]) -> list[tuple[int, list[int]]]:
        """Find what a relaxed trail does twice: a bit, and the nodes that do not remember it.

        The fewest nodes first. Both need the bit from the first time to the second.
        """
        graph = self.net.graph
        nodes = [graph.base, *graph.head[list(arcs)].tolist()]
        times: dict[int, list[int]] = {}
        for step, (arc, pays) in enumerate(zip(arcs, paid, strict=True), 1):
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
    """Return the survival of the safest way from each node to each other (n_nodes, n_nodes).

    It is a little more than that, never less.
    """
    n_nodes = net.graph.n_nodes
    near, between = find_near(net.graph, n_nodes), np.zeros((n_nodes, n_nodes))
    np.put_along_axis(between, near.near, near.reach, axis=1)
    np.fill_diagonal(between, 1.0)
    return np.minimum(between * (1.0 + _ABOVE) + np.finfo(float).tiny, 1.0)


def _gates_around(pieces: list[Piece], hanging: list[list[int]], number: int) -> list[int]:
    """Find pieces into which a trail gets from this one, or on its way back to the base.

    Those that hang on it, and on the pieces above it, beside the way up; not into parts of those.
    """
    found: list[int] = []
    came_from = -1
    for _ in range(_MOST_UP):
        found += [piece for piece in hanging[number] if piece != came_from][:_MOST_GATES]
        came_from, number = number, pieces[number].above
        if number < 0 or len(found) > _MOST_GATES:
            break
    return found[:_MOST_GATES]
