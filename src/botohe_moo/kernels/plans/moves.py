"""Moves that change one trail and leave it a trail.

Seven are those of the simulated annealing in Simon, Richley, Overbey and Perez-Lavin, PeerJ
Computer Science, 2025; an eighth deletes loops, a ninth takes detours. A trail lies in a buffer,
with a length and with its arcs marked, and moves work in place. No move uses a missing arc, or
uses an arc twice; only detours may insert the base, on their way.
"""

from botohe_moo._base.types import OffsetArray, SeedArray
from botohe_moo.kernels.compile import helper
from botohe_moo.kernels.graph.graph import Graph, find_arc
from botohe_moo.kernels.plans.detours import take_detour
from botohe_moo.kernels.plans.marks import CANNOT, MoveScratch
from botohe_moo.kernels.rng import below, uniform

# The kinds of moves, as indices into their weights.
INSERT = 0
DELETE = 1
SUBSTITUTE = 2
SWAP = 3
GRAB = 4
DELETE_SEGMENT = 5
REVERSE = 6
N_PUBLISHED = 7
DELETE_LOOP = 7  # ours
DETOUR = 8
N_KINDS = 9


@helper
def _between(graph: Graph, scratch: MoveScratch, tail: int, head: int, states: SeedArray) -> int:
    """Draw a node, not the base, to which and from which unused arcs lead; −1 if there is none."""
    used, mark = scratch.used, scratch.mark[0]
    n = 0
    drawn = -1
    for arc in range(graph.first[tail], graph.first[tail + 1]):
        node = graph.head[arc]
        if used[arc] == mark or node == graph.base:
            continue
        onward = find_arc(graph, node, head)
        if onward < 0 or used[onward] == mark:
            continue
        n += 1
        if n == 1 or uniform(states, 0) * n < 1.0:
            drawn = node
    return drawn


@helper
def _cut(nodes: OffsetArray, length: int, start: int, stop: int) -> int:
    """Take the positions ``start`` to ``stop`` out of a trail; give its new length."""
    for i in range(stop, length):
        nodes[start + i - stop] = nodes[i]
    return length - (stop - start)


@helper
def _add_node(
    graph: Graph,
    scratch: MoveScratch,
    nodes: OffsetArray,
    length: int,
    kind: int,
    states: SeedArray,
) -> int:
    """Insert or substitute a node, or grab it: go there and straight back."""
    if kind == SUBSTITUTE:
        if length < 3:
            return CANNOT
        at = 1 + below(states, length - 2)
        longer = 0
    else:
        at = 1 + below(states, length if kind == INSERT else max(1, length - 1))
        # Behind the return to base, where another loop opens, to insert is to grab.
        longer = 2 if kind == GRAB or at == length else 1
    before = nodes[at - 1]
    after = before if longer == 2 else nodes[at + 1 - longer]
    node = _between(graph, scratch, before, after, states)
    if node < 0:
        return CANNOT
    for i in range(length - 1, at - 1, -1):
        nodes[i + longer] = nodes[i]
    nodes[at] = node
    if longer == 2:
        nodes[at + 1] = before
    return length + longer


@helper
def _delete(
    graph: Graph, scratch: MoveScratch, nodes: OffsetArray, length: int, start: int, stop: int
) -> int:
    """Delete the nodes from ``start`` to before ``stop``, by the arc that joins what is left."""
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
    return _cut(nodes, length, start, stop)


@helper
def _delete_loop(nodes: OffsetArray, length: int, position: int, states: SeedArray) -> int:
    """Delete what lies between a visit to a node and another one, drawn uniformly."""
    n = 0
    drawn = position
    for i in range(length):
        if i != position and nodes[i] == nodes[position]:
            n += 1
            if n == 1 or uniform(states, 0) * n < 1.0:
                drawn = i
    if n == 0:
        return CANNOT
    return _cut(nodes, length, min(position, drawn) + 1, max(position, drawn) + 1)


@helper
def _swap(
    graph: Graph, scratch: MoveScratch, nodes: OffsetArray, length: int, low: int, high: int
) -> int:
    """Let the nodes at two inner positions change places."""
    one, other = nodes[low], nodes[high]
    if one == other:
        return CANNOT
    for i in range(4):
        # The hops to and from the first position, then those to and from the second.
        if i == 0:
            tail, head = nodes[low - 1], other
        elif i == 1:
            tail, head = other, one if high == low + 1 else nodes[low + 1]
        elif i == 2:
            tail, head = other if high == low + 1 else nodes[high - 1], one
        else:
            tail, head = one, nodes[high + 1]
        arc = find_arc(graph, tail, head)
        if arc < 0:
            return CANNOT
        if scratch.used[arc] == scratch.mark[0]:
            given_up = False
            for at in (low - 1, low, high - 1, high):
                given_up = given_up or (nodes[at] == tail and nodes[at + 1] == head)
            if not given_up:
                return CANNOT
    nodes[low], nodes[high] = other, one
    return length


@helper
def _reverse(graph: Graph, nodes: OffsetArray, length: int) -> int:
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
    """Try one move of a kind, in place, at positions and with nodes drawn uniformly.

    - ``INSERT``: a node between two consecutive ones, or behind the return to base, which opens
      another loop;
    - ``DELETE``: a node, by the arc between its neighbours; where they are one, the spur goes;
    - ``SUBSTITUTE``: another node for one;
    - ``SWAP``: two nodes change places;
    - ``GRAB``: from a node to a neighbour and straight back;
    - ``DELETE_SEGMENT``: two or more consecutive nodes, by the arc that joins what is left;
    - ``REVERSE``: the whole trail;
    - ``DELETE_LOOP``: what lies between two visits to a node, with one of them;
    - ``DETOUR``: another way, mostly by way of a node drawn among all, from a position to the same
      one, which inserts a loop, or to a later one; short spans are drawn as often as long ones.

    Positions are drawn first, among the inner ones (for ``INSERT`` and ``GRAB`` among those behind
    which a node may come, for ``DELETE_LOOP`` among all), then a node or a visit, among those that
    are possible there.

    ``nodes`` is a buffer of at least n_arcs + 1 nodes that begins with a valid trail. Only this
    trail's arcs are marked before (``mark_trail``), and also after the move.

    Returns the new length; ``CANNOT`` where the move cannot be made, ``NO_PATHS`` where it is
    a detour for which there is no scratch: nothing has changed.
    """
    if kind == DETOUR:
        return take_detour(graph, scratch, scratch.paths, nodes, length, states)
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
            return _cut(nodes, length, low, low + 2)
    else:
        if n_inner < 2:
            return CANNOT
        high = 1 + below(states, n_inner - 1)
        high += high >= low
        low, high = min(low, high), max(low, high)
        if kind == SWAP:
            return _swap(graph, scratch, nodes, length, low, high)
    return _delete(graph, scratch, nodes, length, low, high + 1)
