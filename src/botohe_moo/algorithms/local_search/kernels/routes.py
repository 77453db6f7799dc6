"""Cheapest paths to every node, searched before the search begins.

On missions of up to ``FULL_UP_TO`` nodes a row holds the paths to a node from all nodes. On larger
ones it holds those from the ``NEAR`` nodes that are cheapest to come from, so that memory grows
with the number of nodes, not with its square. Only the ways to the base are known from everywhere.
"""

from typing import NamedTuple

import numpy as np

from botohe_moo.base.types import FloatArray, OffsetArray, RecordArray
from botohe_moo.core.compile import at_once, helper, shared
from botohe_moo.core.paths import (
    ANYWHERE,
    Near,
    Paths,
    new_near,
    new_paths,
    search_near,
    search_paths,
)
from botohe_moo.core.world import Graph, World

FULL_UP_TO = 1_000
NEAR = 200

FAR = 1e300  # what a path costs where there is none: finite, so that 0 times it is 0
UNKNOWN = -1  # instead of an entry, where no path is known

_N_NEIGHBOURS = 12
_ENTRY = np.dtype(
    [("cost", np.float64), ("length", np.float64)]
    + [(name, np.int32) for name in ("source", "arc", "onward")]
)


class Routes(NamedTuple):
    """Cheapest paths, a row for every node where they lead to."""

    n_known: OffsetArray  # entries in each row (n_nodes)
    # Where a path begins (``source``, ascending along the known part of a row), its ``cost`` and
    # its ``length``, its first ``arc``, −1 at the goal itself, and the entry, in the same row, of
    # that arc's head (``onward``; n_nodes, n_entries).
    entries: RecordArray
    near: OffsetArray  # of each node, the others that are cheapest to reach (n_nodes, n_near)
    # Costs of the cheapest paths from each node to all (``leaving``), and to it from all
    # (``coming``), and the lengths of these paths (n_nodes, n_nodes). Without travel budgets there
    # are no lengths, and on missions of more than ``FULL_UP_TO`` nodes neither.
    leaving: FloatArray
    coming: FloatArray
    leaving_length: FloatArray
    coming_length: FloatArray
    # What a unit of length costs in the layer of each node (n_nodes), and whether lengths cost
    # anything.
    per_length: FloatArray
    prices_length: bool


def find_routes(world: World, per_length: FloatArray) -> Routes:
    """Search all cheapest paths.

    ``per_length`` is what a unit of length adds to the costs of arcs in the layer of each node.
    """
    n_nodes, is_full = world.graph.n_nodes, world.graph.n_nodes <= FULL_UP_TO
    n_known = np.zeros(n_nodes, np.int64)
    entries = np.empty((n_nodes, n_nodes if is_full else NEAR), _ENTRY).view(np.recarray)
    entries.cost, entries.length = FAR, 0.0
    near = new_near(n_nodes, _N_NEIGHBOURS)
    used = np.zeros(world.graph.n_arcs, np.int64)  # every path may take all arcs
    _search_all(world.graph, new_paths(world), used, near, n_known, entries)
    costs = entries["cost"].copy() if is_full else np.empty((0, 0))
    prices_length = world.limits.has_budgets
    lengths = entries["length"].copy() if is_full and prices_length else np.empty((0, 0))
    return Routes(
        n_known=n_known,
        entries=entries,
        near=near.nodes,
        leaving=costs.T.copy(),
        coming=costs,
        leaving_length=lengths.T.copy(),
        coming_length=lengths,
        per_length=per_length,
        prices_length=prices_length,
    )


@at_once(lambda graph, *_: 1e-5 * graph.n_nodes * graph.n_arcs)
def _search_all(
    graph: Graph,
    paths: Paths,
    used: OffsetArray,
    near: Near,
    n_known: OffsetArray,
    entries: RecordArray,
) -> None:
    graph, paths, near = shared(graph), shared(paths), shared(near)
    for node in range(graph.reward.shape[0]):
        search_near(graph, paths, used, near, node)
        n = search_paths(graph, paths, used, 1, node, ANYWHERE, entries.shape[1], True)
        n_known[node] = _fill_row(graph, paths, n, entries[node])


@helper
def _fill_row(graph: Graph, paths: Paths, n: int, row: RecordArray) -> int:
    """Fill in the row of a goal from the last search, which found ``n`` paths; return its size."""
    place, n_nodes = paths.heap_nodes, paths.met.shape[0]
    is_full = row.shape[0] == n_nodes
    found = -paths.n_searches[0]
    for i in range(n):
        paths.met[paths.order[i]] = found  # negative, as no search marks nodes
    n_known = 0
    for node in range(n_nodes):
        if is_full or paths.met[node] == found:
            place[node] = n_known
            n_known += 1
    for i in range(n):  # the nearest first, so that the rest of a path is known
        node = paths.order[i]
        entry, arc = row[place[node]], paths.entry[node]
        entry.cost, entry.source, entry.arc = paths.distance[node], node, arc
        entry.onward, entry.length = place[node], 0.0
        if arc >= 0:
            entry.onward = place[graph.head[arc]]
            entry.length = graph.length[arc] + row[entry.onward].length
    return n_known


@helper
def route_entry(routes: Routes, goal: int, node: int) -> int:
    """Return the entry of the path from ``node`` in the row of a goal, or ``UNKNOWN``."""
    if routes.entries.shape[1] == routes.entries.shape[0]:
        return node if routes.entries[goal, node].cost < FAR else UNKNOWN
    low, high = 0, routes.n_known[goal]
    while low < high:
        middle = (low + high) // 2
        if routes.entries[goal, middle].source < node:
            low = middle + 1
        else:
            high = middle
    known = low < routes.n_known[goal] and routes.entries[goal, low].source == node
    return low if known else UNKNOWN
