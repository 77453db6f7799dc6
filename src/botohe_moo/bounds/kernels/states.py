"""What a relaxed trail remembers: states (node, memory), and the links between them.

Bridges (edges without a way round) cut the graph into pieces, which form a tree. A trail takes the
arc into a piece at most once, and has to come back over the same bridge: its part beyond the bridge
is an *excursion*. Each piece has states of its own, and a link for each excursion that begins in
it, which leads back to the gate. So nothing beyond a bridge has to be remembered on this side of
it, or the other way round.

Inside a piece, a relaxed trail may take an arc any number of times, and collect a node's reward or
make an excursion more than once where it has forgotten that it did. A memory is a mask of bits. At
each node some rewards and excursions can be remembered; what the next node cannot remember is
forgotten on the way there. These are ng-routes: Baldacci, Mingozzi and Roberti, "New route
relaxation and pricing strategies for the vehicle routing problem", Operations Research 59(5), 2011.
"""

from typing import NamedTuple

import numpy as np

from botohe_moo.base.types import BoolArray, FloatArray, OffsetArray
from botohe_moo.core.compile import inlined, kernel
from botohe_moo.core.world import CHECKING, Graph, World

# What exceeds limits by no more than this, relative, still keeps them. It is twice what searches
# allow, which multiply and add in another order.
ROUNDING = 2 * CHECKING
EPSILON = float(np.finfo(float).eps)

# Instead of a bit.
NONE = -1
NEVER = -2


class Pieces(NamedTuple):
    """The pieces between bridges, each after the one above it; that of the base is the first."""

    of: OffsetArray  # the piece of each node (n_nodes)
    # Of each piece: the node where trails enter and leave it, which is the base in the first; the
    # node above it on the other side of the bridge; and the arcs over the bridge (n_pieces). The
    # first piece has −1 for what it lacks.
    entry: OffsetArray
    gate: OffsetArray
    arc: OffsetArray
    back: OffsetArray
    # An option of an excursion is one pair of survival and worth that it may have. Those of piece i
    # have the moves n_arcs + ``first_option[i]`` to n_arcs + ``first_option[i + 1]``: one if the
    # piece is a dead end of one node (n_pieces + 1).
    first_option: OffsetArray
    of_option: OffsetArray  # the piece of each option (n_options)
    into: OffsetArray  # the piece that each arc enters over a bridge, or −1 (n_arcs)
    is_back: BoolArray  # whether each arc leaves a piece over its bridge (n_arcs)


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
    pieces: Pieces

    @property
    def graph(self) -> Graph:
        """The graph, for Python."""
        return self.world.graph

    @property
    def base(self) -> int:
        """The base, for Python."""
        return int(self.world.team.start[0])


class Memory(NamedTuple):
    """What the bits of the nodes' masks mean for arcs.

    An arc into another piece stands for the whole excursion, and ends at its own tail.
    """

    n_bits: OffsetArray  # of each node's mask (n_nodes)
    # Bits that are remembered at both ends of arc a, as pairs (at its tail, at its end):
    # ``kept[first_kept[a]:first_kept[a + 1]]``.
    first_kept: OffsetArray
    kept: OffsetArray
    adds: OffsetArray  # the mask that each arc adds at its end (n_arcs)
    # The bit at the arc's tail with which its head pays nothing: ``NONE`` where it always pays,
    # ``NEVER`` where it never does (n_arcs).
    unpaid: OffsetArray
    # The bit at the arc's tail with which its excursion is barred, or ``NONE`` (n_arcs).
    barred: OffsetArray


class States(NamedTuple):
    """States of all pieces; the first of each piece is its entry with nothing to remember."""

    begin: OffsetArray  # those of piece i are ``begin[i]`` to ``begin[i + 1]`` (n_pieces + 1)
    node: OffsetArray  # (n_states)
    # The links that leave state s are ``first[s]`` to ``first[s + 1]`` (n_states + 1).
    first: OffsetArray
    # Of each link its move (an arc within the piece, or an option of an excursion), the state that
    # it ends in, and whether it collects what the move pays (n_links).
    move: OffsetArray
    to: OffsetArray
    pays: BoolArray


@inlined
def _next_mask(pieces: Pieces, memory: Memory, arc: int, mask: int) -> int:
    """Return the mask behind an arc; −1 where it is barred, or leads back over a bridge."""
    if pieces.is_back[arc] or (memory.barred[arc] >= 0 and (mask >> memory.barred[arc]) & 1):
        return -1
    after = memory.adds[arc]
    for i in range(memory.first_kept[arc], memory.first_kept[arc + 1]):
        after |= ((mask >> memory.kept[i, 0]) & 1) << memory.kept[i, 1]
    return int(after)


@inlined
def _n_links(pieces: Pieces, arc: int) -> int:
    """Return how many links an arc gives: one, or one for each option of its excursion."""
    into = pieces.into[arc]
    return int(pieces.first_option[into + 1] - pieces.first_option[into]) if into >= 0 else 1


@kernel
def find_states(net: Net, memory: Memory, n_most: int, n_masks: int) -> States:
    """Find all states that are reached from the entries.

    There are none if they would be over ``n_most``, or masks of bits over ``n_masks``.

    Links of each state come by descending ratio of their arcs: those that stay above a level first.
    """
    graph, pieces = net.world.graph, net.pieces
    n_nodes, n_arcs, n_pieces = graph.reward.shape[0], graph.head.shape[0], pieces.entry.shape[0]
    order = np.empty(n_arcs, np.int64)
    for node in range(n_nodes):
        first, end = graph.first[node], graph.first[node + 1]
        order[first:end] = first + np.argsort(-net.ratio[first:end], kind="mergesort")
    offset = np.zeros(n_nodes + 1, np.int64)
    for i in range(n_nodes):
        offset[i + 1] = offset[i] + (1 << memory.n_bits[i])
    if offset[n_nodes] > n_masks:
        n_most = 0
        offset[n_nodes] = 1
    number = np.full(offset[n_nodes], -1, np.int32)
    node_of, mask = np.empty(n_most + 1, np.int64), np.empty(n_most + 1, np.int64)
    begin = np.zeros(n_pieces + 1, np.int64)
    n = n_links = at = 0
    for piece in range(n_pieces):
        if n < n_most:
            number[offset[pieces.entry[piece]]] = n
            node_of[n], mask[n] = pieces.entry[piece], 0
        n += 1
        while at < n and n <= n_most:
            tail = node_of[at]
            for arc in order[graph.first[tail] : graph.first[tail + 1]]:
                after = _next_mask(pieces, memory, arc, mask[at])
                if after < 0:
                    continue
                n_links += _n_links(pieces, arc)
                to = graph.head[arc] if pieces.into[arc] < 0 else tail
                if number[offset[to] + after] < 0 and n <= n_most:
                    number[offset[to] + after] = n
                    node_of[n], mask[n] = to, after
                    n += 1
            at += 1
        begin[piece + 1] = n
    if n > n_most:
        n = n_links = 0
    first_link, pays = np.zeros(n + 1, np.int64), np.zeros(n_links, np.bool_)
    move, target = np.empty(n_links, np.int64), np.empty(n_links, np.int64)
    link = 0
    for state in range(n):
        tail = node_of[state]
        for arc in order[graph.first[tail] : graph.first[tail + 1]]:
            after = _next_mask(pieces, memory, arc, mask[state])
            if after < 0:
                continue
            into, unpaid = pieces.into[arc], memory.unpaid[arc]
            is_paid = unpaid == NONE or (unpaid >= 0 and not (mask[state] >> unpaid) & 1)
            for i in range(_n_links(pieces, arc)):
                move[link] = arc if into < 0 else n_arcs + pieces.first_option[into] + i
                target[link] = number[offset[graph.head[arc] if into < 0 else tail] + after]
                pays[link] = into >= 0 or is_paid
                link += 1
        first_link[state + 1] = link
    return States(begin, node_of[:n].copy(), first_link, move, target, pays)
