"""What relaxed trails remember: rewards near by, bridges used, and what they have come back to.

A bit stands for a node whose reward has been collected (the node's index), or an arc that has been
taken (the number of nodes, and the arc's index).
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise

import numpy as np

from botohe_moo._base.types import FloatArray, OffsetArray
from botohe_moo.kernels.bounds.states import NEVER, NONE, Memory, Net
from botohe_moo.search.bounds.net import Part, hanging_parts

_MOST_COMPARED = 3_000  # nodes, of which all pairs are compared
_LEAST_COST = 1e-15


class Remembered:
    """Which bits each node remembers.

    ``nearest`` rewards that a round trip from the node survives best, and bridges into parts that
    hang on them, up to ``n_bits`` together. A trail gets into such a part once, and what it comes
    out to it has visited before: where all arcs to a node are of bridges, no bit is needed for its
    reward.
    """

    def __init__(self, net: Net, nearest: int, n_bits: int) -> None:
        graph = net.graph
        self.net = net
        parts = list(hanging_parts(graph))
        self._backs = {part.back: part.arc for part in parts}
        bridges = {part.arc for part in parts} | self._backs.keys()
        only_by_bridges = np.ones(graph.n_nodes, bool)
        for arc, head in enumerate(graph.head.tolist()):
            only_by_bridges[head] &= arc in bridges
        pays = np.flatnonzero((graph.reward > 0.0) & ~only_by_bridges & (net.reach > 0.0))
        near = best_between(net)
        if near is not None:
            near = near * near.T  # to the node and back
        self.bits: list[list[int]] = []
        for node, gates in enumerate(_entrances(graph.n_nodes, parts)):
            if near is None:
                rewards = [node] if node in pays else []
            else:
                nearness = near[node, pays] + (pays == node)
                rewards = pays[np.argsort(-nearness, kind="stable")[:nearest]].tolist()
                nearer = np.argsort([-near[node, part.gate] for part in gates], kind="stable")
                gates = [gates[i] for i in nearer.tolist()]
            room = max(0, n_bits - len(rewards))
            self.bits.append(rewards + [graph.n_nodes + part.arc for part in gates[:room]])

    def pack(self) -> Memory:
        """Give the masks' meaning as arrays."""
        graph = self.net.graph
        places = [{bit: i for i, bit in enumerate(bits)} for bits in self.bits]
        kept: list[tuple[int, int]] = []
        first_kept = [0]
        adds, unpaid, barred = (np.full(graph.n_arcs, NONE) for _ in range(3))
        for arc, (tail, head) in enumerate(zip(graph.tail, graph.head, strict=True)):
            there, here = places[tail], places[head]
            kept += [(there[bit], here[bit]) for bit in there.keys() & here.keys()]
            first_kept.append(len(kept))
            # Who comes back over a bridge has taken it before.
            bits = {graph.n_nodes + arc, graph.n_nodes + self._backs.get(arc, arc)}
            if graph.reward[head] > 0.0:
                bits.add(int(head))
            adds[arc] = sum(1 << here[bit] for bit in bits & here.keys())
            unpaid[arc] = there.get(int(head), NONE)
            if graph.reward[head] == 0.0 or arc in self._backs:
                unpaid[arc] = NEVER
            barred[arc] = there.get(graph.n_nodes + arc, NONE)
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


def best_between(net: Net) -> FloatArray | None:
    """Give the survival of the safest way from each node to each other (n_nodes, n_nodes).

    A little more than it is, never less; None where there are too many nodes.
    """
    from scipy.sparse import csr_array
    from scipy.sparse.csgraph import dijkstra

    graph = net.graph
    if graph.n_nodes > _MOST_COMPARED:
        return None
    shape = (graph.n_nodes, graph.n_nodes)
    # What costs nothing is no arc to scipy.
    costs = csr_array((graph.cost + _LEAST_COST, graph.head, graph.first), shape=shape)
    distance = dijkstra(costs) * (1.0 - 1e-12) - 2 * graph.n_nodes * _LEAST_COST
    best: FloatArray = np.exp(-np.maximum(distance, 0.0))
    return best


def _entrances(n_nodes: int, parts: list[Part]) -> list[list[Part]]:
    """Say for each node into which parts a trail gets from there, without crossing other bridges.

    Also by way of other parts that hang on the same piece: not into parts of those.
    """
    outside: list[list[Part]] = [[] for _ in range(n_nodes)]
    for part in parts:
        around = [other.nodes for other in parts if part.gate in other.nodes]
        region = min(around, key=len) if around else frozenset(range(n_nodes))
        for node in region - part.nodes:
            outside[node].append(part)
    return outside
