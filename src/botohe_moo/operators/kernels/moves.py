"""Moves that change one trail and leave it a trail.

Seven are those of the simulated annealing in Simon, Richley, Overbey and Perez-Lavin, PeerJ
Computer Science, 2025. An eighth deletes loops; a ninth takes detours, see ``change``. A trail lies
in a buffer, with a length and with its arcs marked, and moves work in place. No move uses a missing
arc, or an arc twice. Only detours may insert the base.
"""

from typing import NamedTuple

import numpy as np

from botohe_moo._base.types import OffsetArray, SeedArray
from botohe_moo.core.compile import helper
from botohe_moo.core.graph import Graph, find_arc
from botohe_moo.core.kinds import end_of
from botohe_moo.core.paths import Paths, new_paths
from botohe_moo.core.rng import below, uniform

CANNOT = -1  # instead of a length, where the move cannot be made: the trail stays as it is

# The kinds of moves, as indices into their weights.
INSERT = 0
DELETE = 1
SUBSTITUTE = 2
SWAP = 3
GRAB = 4
DELETE_SEGMENT = 5
REVERSE = 6
# Not published:
DELETE_LOOP = 7
DETOUR = 8
N_KINDS = 9


class MoveScratch(NamedTuple):
    """Scratch of moves."""

    mark: OffsetArray  # the number of the trail that is changed (1)
    # The last trail that used each arc (n_arcs): this one takes arc a where used[a] == mark[0].
    used: OffsetArray
    spare: OffsetArray  # a trail as it was before a move (n_arcs + 1)
    way: OffsetArray  # arcs of a detour (2 · n_nodes)
    paths: Paths  # of detours


def new_move_scratch(graph: Graph) -> MoveScratch:
    """Make room for moves of trails of a graph."""
    return MoveScratch(
        mark=np.zeros(1, np.int64),
        used=np.zeros(graph.n_arcs, np.int64),
        spare=np.zeros(graph.n_arcs + 1, np.int64),
        way=np.zeros(2 * graph.n_nodes, np.int64),
        paths=new_paths(graph),
    )


@helper
def mark_trail(graph: Graph, scratch: MoveScratch, nodes: OffsetArray, length: int) -> None:
    """Take the next mark, and mark every arc of a trail."""
    scratch.mark[0] += 1
    for i in range(length - 1):
        scratch.used[find_arc(graph, nodes[i], nodes[i + 1])] = scratch.mark[0]


@helper
def _between(graph: Graph, scratch: MoveScratch, tail: int, head: int, states: SeedArray) -> int:
    """Draw a node between two others, joined to them by unused arcs; −1 where there is none.

    It is not the base, where trails end.
    """
    used, mark = scratch.used, scratch.mark[0]
    n = 0
    drawn = -1
    for arc in range(graph.first[tail], graph.first[tail + 1]):
        node = graph.head[arc]
        if used[arc] == mark or node == end_of(graph.kinds, graph.base, node):
            continue
        onward = find_arc(graph, node, head)
        if onward < 0 or used[onward] == mark:
            continue
        n += 1
        if n == 1 or uniform(states, 0) * n < 1.0:
            drawn = node
    return drawn


@helper
def shift(nodes: OffsetArray, length: int, start: int, by: int) -> int:
    """Move the nodes of a trail from a position on by some places; return its new length."""
    if by > 0:
        for i in range(length - 1, start - 1, -1):
            nodes[i + by] = nodes[i]
    else:
        for i in range(start, length):
            nodes[i + by] = nodes[i]
    return length + by


@helper
def _add_node(
    graph: Graph,
    scratch: MoveScratch,
    nodes: OffsetArray,
    length: int,
    kind: int,
    states: SeedArray,
) -> int:
    """Insert a node, substitute it for another, or grab it: go there and straight back."""
    if kind == SUBSTITUTE:
        if length < 3:
            return CANNOT
        at = 1 + below(states, length - 2)
        longer = 0
    else:
        at = 1 + below(states, length if kind == INSERT else max(1, length - 1))
        # Behind the return to base, inserting is grabbing: it opens another loop.
        longer = 2 if kind == GRAB or at == length else 1
    before = nodes[at - 1]
    after = before if longer == 2 else nodes[at + 1 - longer]
    node = _between(graph, scratch, before, after, states)
    if node < 0:
        return CANNOT
    length = shift(nodes, length, at, longer)
    nodes[at] = node
    if longer == 2:
        nodes[at + 1] = before
    return length


@helper
def _delete(
    graph: Graph, scratch: MoveScratch, nodes: OffsetArray, length: int, start: int, stop: int
) -> int:
    """Delete nodes from ``start`` to before ``stop``, where an arc joins what is left."""
    before, after = nodes[start - 1], nodes[stop]
    arc = find_arc(graph, before, after)
    if arc < 0:
        return CANNOT
    if scratch.used[arc] == scratch.mark[0]:
        inside = False
        for i in range(start, stop + 1):
            inside = inside or (nodes[i - 1] == before and nodes[i] == after)
        if not inside:
            return CANNOT
    return shift(nodes, length, stop, start - stop)


@helper
def _delete_loop(nodes: OffsetArray, length: int, position: int, states: SeedArray) -> int:
    """Delete what lies between a visit to a node and another visit to it, drawn uniformly."""
    n = 0
    drawn = position
    for i in range(length):
        if i != position and nodes[i] == nodes[position]:
            n += 1
            if n == 1 or uniform(states, 0) * n < 1.0:
                drawn = i
    if n == 0:
        return CANNOT
    return shift(nodes, length, max(position, drawn) + 1, -abs(position - drawn))


@helper
def _swap(
    graph: Graph, scratch: MoveScratch, nodes: OffsetArray, length: int, low: int, high: int
) -> int:
    """Swap the nodes at two inner positions."""
    one, other = nodes[low], nodes[high]
    if one == other:
        return CANNOT
    after, before = (one, other) if high == low + 1 else (nodes[low + 1], nodes[high - 1])
    # The hops to and from the first position, then those to and from the second.
    hops = (nodes[low - 1], other), (other, after), (before, one), (one, nodes[high + 1])
    for tail, head in hops:
        arc = find_arc(graph, tail, head)
        if arc < 0:
            return CANNOT
        if scratch.used[arc] == scratch.mark[0]:
            is_freed = False
            for at in (low - 1, low, high - 1, high):
                is_freed = is_freed or (nodes[at] == tail and nodes[at + 1] == head)
            if not is_freed:
                return CANNOT
    nodes[low], nodes[high] = other, one
    return length


@helper
def _reverse(graph: Graph, nodes: OffsetArray, length: int) -> int:
    """Reverse the trail, if it is closed."""
    if nodes[0] != nodes[length - 1]:
        return CANNOT
    for i in range(length - 1):
        if find_arc(graph, nodes[i + 1], nodes[i]) < 0:
            return CANNOT
    for i in range(length // 2):
        nodes[i], nodes[length - 1 - i] = nodes[length - 1 - i], nodes[i]
    return length


@helper
def move_trail(
    graph: Graph,
    scratch: MoveScratch,
    nodes: OffsetArray,
    length: int,
    kind: int,
    states: SeedArray,
) -> int:
    """Try one move of a kind but a detour, in place, at positions and with nodes drawn uniformly.

    - ``INSERT``: a node between two consecutive ones, or behind the return to base, which opens
      another loop;
    - ``DELETE``: a node, by the arc between its neighbours, or with one of them if they are equal;
    - ``SUBSTITUTE``: another node for one;
    - ``SWAP``: two nodes change places;
    - ``GRAB``: from a node to a neighbour and straight back;
    - ``DELETE_SEGMENT``: two or more consecutive nodes, by the arc that joins what is left;
    - ``REVERSE``: the whole trail;
    - ``DELETE_LOOP``: what lies between two visits to a node, with one of them.

    Positions are drawn first, among the inner ones; for ``INSERT`` and ``GRAB`` among those behind
    which a node may come, for ``DELETE_LOOP`` among all. Then a node or a visit is drawn among the
    possible ones.

    ``nodes`` is a buffer of at least n_arcs + 1 nodes that begins with a valid trail. The arcs
    marked (``mark_trail``) are those of the trail before the move, also after it.

    Returns the new length; ``CANNOT`` where the move cannot be made, and nothing has changed.
    """
    if kind in (INSERT, GRAB, SUBSTITUTE):
        return _add_node(graph, scratch, nodes, length, kind, states)
    n_inner = length - 2
    if n_inner < 1:
        return CANNOT
    if kind == REVERSE:
        return _reverse(graph, nodes, length)
    if kind == DELETE_LOOP:
        return _delete_loop(nodes, length, below(states, length), states)
    low = high = 1 + below(states, n_inner)
    if kind == DELETE:
        if nodes[low - 1] == nodes[low + 1]:  # a spur
            return shift(nodes, length, low + 2, -2)
    else:
        if n_inner < 2:
            return CANNOT
        high = 1 + below(states, n_inner - 1)
        high += high >= low
        low, high = min(low, high), max(low, high)
        if kind == SWAP:
            return _swap(graph, scratch, nodes, length, low, high)
    return _delete(graph, scratch, nodes, length, low, high + 1)
