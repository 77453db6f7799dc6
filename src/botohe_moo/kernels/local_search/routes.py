"""Safest paths to every node, found when first asked for.

Up to ``FULL_UP_TO`` nodes a row holds the paths from all nodes. On larger missions it holds those
from the ``NEAR`` nodes that are safest to come from, so that memory grows with the nodes and not
with their square; only the ways to the base are known from everywhere.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from botohe_moo._base.types import FloatArray, IntArray, OffsetArray
from botohe_moo.kernels.compile import part, routine
from botohe_moo.kernels.graph.old_paths import pop, push

FULL_UP_TO = 1_000
NEAR = 200

# Instead of an entry: no path is known.
UNKNOWN = -1


class Routes(NamedTuple):
    """Safest paths, a row for every node where they lead to.

    Attributes
    ----------
    n_known
        Entries in each row; 0 before the row has been asked for (n_nodes).
    source
        Where a path begins, ascending along the known part of a row (n_nodes, n_entries).
    arc
        Its first arc, −1 at the goal itself.
    onward
        The entry, in the same row, of that arc's head.
    cost
        Sum of −log(survival) along it.
    homeward
        Of each node but the base, its arc on the safest way home (n_nodes).
    first_entering, entering
        The arcs that enter node v are ``entering[first_entering[v]:first_entering[v + 1]]``.
    settled, distance, exit, place, order, keys, held
        Scratch of the search.
    """

    n_known: IntArray
    source: NDArray[np.int32]
    arc: NDArray[np.int32]
    onward: NDArray[np.int32]
    cost: FloatArray
    homeward: IntArray
    first_entering: OffsetArray
    entering: OffsetArray
    settled: OffsetArray
    distance: FloatArray
    exit: IntArray
    place: IntArray
    order: IntArray
    keys: FloatArray
    held: IntArray


def new_routes(head: IntArray, homeward: IntArray) -> Routes:
    """Prepare the search for safest paths; nothing is searched yet.

    Parameters
    ----------
    head
        Head of each arc (n_arcs).
    homeward
        Of each node, its arc on the safest way to the base.
    """
    n_nodes, n_arcs = len(homeward), len(head)
    n_entries = n_nodes if n_nodes <= FULL_UP_TO else NEAR
    shape = (n_nodes, n_entries)
    counts = np.bincount(head, minlength=n_nodes)
    return Routes(
        n_known=np.zeros(n_nodes, np.int32),
        source=np.empty(shape, np.int32),
        arc=np.empty(shape, np.int32),
        onward=np.empty(shape, np.int32),
        cost=np.empty(shape),
        homeward=homeward,
        first_entering=np.concatenate([[0], np.cumsum(counts)]),
        entering=np.argsort(head, kind="stable"),
        settled=np.full(n_nodes, -1, np.int64),
        distance=np.empty(n_nodes),
        exit=np.empty(n_nodes, np.int32),
        place=np.empty(n_nodes, np.int32),
        order=np.empty(n_entries, np.int32),
        keys=np.empty(n_arcs + 1),
        held=np.empty(n_arcs + 1, np.int32),
    )


@routine
def search_routes(
    tail: IntArray, head: IntArray, cost: FloatArray, routes: Routes, goal: int
) -> None:
    """Find the safest paths to a node from those that are safest to come from.

    Parameters
    ----------
    tail, head, cost
        The mission's arcs, and −log(survival) of each.
    routes
        The row of ``goal`` is filled in.
    goal
        Where the paths lead.
    """
    n_entries = routes.source.shape[1]
    settled, distance = routes.settled, routes.distance
    done, pending = 2 * goal + 1, 2 * goal  # no other search leaves these marks
    settled[goal], distance[goal], routes.exit[goal] = pending, 0.0, -1
    size = push(routes.keys, routes.held, 0, 0.0, goal)
    n = 0
    while size > 0 and n < n_entries:
        size = pop(routes.keys, routes.held, size)
        here, key = routes.held[size], routes.keys[size]
        if settled[here] == done:
            continue
        settled[here] = done
        routes.order[n] = here
        n += 1
        for i in range(routes.first_entering[here], routes.first_entering[here + 1]):
            arc = routes.entering[i]
            there = tail[arc]
            reached = key + cost[arc]
            if settled[there] == done or (settled[there] == pending and distance[there] <= reached):
                continue
            settled[there], distance[there], routes.exit[there] = pending, reached, arc
            size = push(routes.keys, routes.held, size, reached, there)
    # By index: through the heap, for sorting would need memory that callers have no leave to take.
    size = 0
    for i in range(n):
        size = push(routes.keys, routes.held, size, float(routes.order[i]), routes.order[i])
    for i in range(n):
        size = pop(routes.keys, routes.held, size)
        routes.order[i] = routes.held[size]
        routes.place[routes.order[i]] = i
    for i in range(n):
        node = routes.order[i]
        arc = routes.exit[node]
        routes.source[goal, i] = node
        routes.arc[goal, i] = arc
        routes.onward[goal, i] = routes.place[head[arc]] if arc >= 0 else i
        routes.cost[goal, i] = distance[node]
    routes.n_known[goal] = n


@part
def route_entry(routes: Routes, goal: int, node: int) -> int:
    """Give the entry of the path from ``node`` in a row that has been searched, or ``UNKNOWN``."""
    found = node
    if routes.source.shape[1] < routes.source.shape[0]:
        low, high = 0, routes.n_known[goal]
        while low < high:
            middle = (low + high) // 2
            if routes.source[goal, middle] < node:
                low = middle + 1
            else:
                high = middle
        found = UNKNOWN
        if low < routes.n_known[goal] and routes.source[goal, low] == node:
            found = low
    return found
