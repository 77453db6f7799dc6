"""What a relaxed trail remembers: states (node, memory), and the links between them.

A relaxed trail may collect a node's reward, or take an arc, more than once where it has forgotten
that it did. A memory is a mask of bits. At each node some visits and arcs can be remembered; what
the next node cannot remember is forgotten on the way there. These are ng-routes: Baldacci, Mingozzi
and Roberti, "New route relaxation and pricing strategies for the vehicle routing problem",
Operations Research 59(5), 2011.
"""

from typing import NamedTuple

import numpy as np

from botohe_moo.base.types import BoolArray, FloatArray, OffsetArray
from botohe_moo.core.compile import inlined, kernel
from botohe_moo.core.world import CHECKING, Graph, World

# What exceeds limits by no more than this, relative, still keeps them. It is twice what searches
# allow, which multiply and add in another order.
ROUNDING = 2 * CHECKING

# Masks of all nodes together, whether they are reached or not: there is a number for each.
MOST_MASKS = 50_000_000

# Instead of a bit.
NONE = -1
NEVER = -2


class Net(NamedTuple):
    """A mission as a bound sees it: without arcs that no plan needs."""

    # Without limits. Rewards are those that the bound counts, and the base has none.
    world: World
    # Survival of the safest way from the base, 1 at the base (n_nodes).
    reach: FloatArray
    # The share of the head's reach that is left to a robot that comes by an arc on the safest way
    # to its tail: reach[tail] × survival / reach[head], at most 1 (n_arcs).
    ratio: FloatArray
    home_length: FloatArray  # of the shortest way home (n_nodes)
    min_survival: float
    max_length: float

    @property
    def graph(self) -> Graph:
        """The graph, for Python."""
        return self.world.graph

    @property
    def base(self) -> int:
        """The base, for Python."""
        return int(self.world.team.start[0])


class Memory(NamedTuple):
    """What the bits of the nodes' masks mean for arcs."""

    n_bits: OffsetArray  # of each node's mask (n_nodes)
    # Bits that are remembered at both ends of arc a, as pairs (at its tail, at its head):
    # ``kept[first_kept[a]:first_kept[a + 1]]``.
    first_kept: OffsetArray
    kept: OffsetArray
    adds: OffsetArray  # the mask that each arc adds at its head (n_arcs)
    # The bit at the arc's tail with which its head pays nothing: ``NONE`` where it always pays,
    # ``NEVER`` where it never does (n_arcs).
    unpaid: OffsetArray
    barred: OffsetArray  # the bit at the arc's tail with which it is barred, or ``NONE`` (n_arcs)


class States(NamedTuple):
    """States that are reached from base; the first is the base with nothing to remember."""

    node: OffsetArray  # (n_states)
    # The links that leave state s are ``first[s]`` to ``first[s + 1]`` (n_states + 1).
    first: OffsetArray
    # Of each link its arc, the state that it enters, and whether the reward of the arc's head is
    # collected (n_links).
    arc: OffsetArray
    to: OffsetArray
    pays: BoolArray


class Worth(NamedTuple):
    """What a trail is worth: the prices of its visits, and ``mu`` for survival."""

    prices: FloatArray  # (n_nodes, n_levels + 1)
    mu: float


@inlined
def _next_mask(memory: Memory, arc: int, mask: int) -> int:
    """Return the mask behind an arc; −1 where that is barred."""
    if memory.barred[arc] >= 0 and (mask >> memory.barred[arc]) & 1:
        return -1
    after = memory.adds[arc]
    for i in range(memory.first_kept[arc], memory.first_kept[arc + 1]):
        after |= ((mask >> memory.kept[i, 0]) & 1) << memory.kept[i, 1]
    return int(after)


@kernel
def find_states(net: Net, memory: Memory, n_most: int) -> States:
    """Find all states that are reached from base; none where there are more than ``n_most``.

    The links of each state descend by the ratio of their arcs.
    """
    graph, base = net.world.graph, net.world.team.start[0]
    n_nodes, order = graph.reward.shape[0], np.empty(graph.head.shape[0], np.int64)
    for node in range(n_nodes):
        first, end = graph.first[node], graph.first[node + 1]
        order[first:end] = first + np.argsort(-net.ratio[first:end], kind="mergesort")
    offset = np.zeros(n_nodes + 1, np.int64)
    for i in range(n_nodes):
        offset[i + 1] = offset[i] + (1 << memory.n_bits[i])
    if offset[n_nodes] > MOST_MASKS:
        n_most = 0
        offset[n_nodes] = 1
    number = np.full(offset[n_nodes], -1, np.int32)
    node_of, mask = np.empty(n_most + 1, np.int64), np.empty(n_most + 1, np.int64)
    n, n_links, at = 1, 0, 0
    node_of[0], mask[0] = base, 0
    if n_most > 0:
        number[offset[base]] = 0
    while at < n and n <= n_most:
        tail = node_of[at]
        for arc in order[graph.first[tail] : graph.first[tail + 1]]:
            after = _next_mask(memory, arc, mask[at])
            if after < 0:
                continue
            n_links += 1
            to = graph.head[arc]
            if number[offset[to] + after] < 0 and n <= n_most:
                number[offset[to] + after] = n
                node_of[n], mask[n] = to, after
                n += 1
        at += 1
    if n > n_most:
        n = n_links = 0
    first_link, pays = np.zeros(n + 1, np.int64), np.zeros(n_links, np.bool_)
    way, target = np.empty(n_links, np.int64), np.empty(n_links, np.int64)
    link = 0
    for state in range(n):
        tail = node_of[state]
        for arc in order[graph.first[tail] : graph.first[tail + 1]]:
            after = _next_mask(memory, arc, mask[state])
            if after < 0:
                continue
            way[link], target[link] = arc, number[offset[graph.head[arc]] + after]
            unpaid = memory.unpaid[arc]
            pays[link] = unpaid == NONE or (unpaid >= 0 and not (mask[state] >> unpaid) & 1)
            link += 1
        first_link[state + 1] = link
    return States(node_of[:n].copy(), first_link, way, target, pays)
