"""Safest paths to every node, searched when a move first needs them.

On missions of up to ``FULL_UP_TO`` nodes a row holds the paths to a node from all nodes. On larger
ones it holds those from the ``NEAR`` nodes that are safest to come from, so that memory grows with
the number of nodes, not with its square. Only the ways to the base are known from everywhere.
"""

from typing import NamedTuple

import numpy as np

from botohe_moo._base.types import FloatArray, OffsetArray, RecordArray
from botohe_moo.core.compile import helper, kernel, shared
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
    [("cost", np.float64), ("source", np.int32), ("arc", np.int32), ("onward", np.int32)]
)


class Routes(NamedTuple):
    """Safest paths, a row for every node where they lead to."""

    n_known: OffsetArray  # entries in each row; 0 before the row has been searched (n_nodes)
    # Where a path begins (``source``, ascending along the known part of a row), its ``cost``, its
    # first ``arc``, −1 at the goal itself, and the entry, in the same row, of that arc's head
    # (``onward``; n_nodes, n_entries).
    entries: RecordArray
    near: Near  # rows are searched when they are needed
    # Costs of the cheapest paths from each node to all (``leaving``), and to it from all
    # (``coming``; n_nodes, n_nodes), for nodes where they have been searched (``is_known``;
    # n_nodes). Empty on missions of more than ``FULL_UP_TO`` nodes.
    is_known: OffsetArray
    leaving: FloatArray
    coming: FloatArray
    # With travel budgets also the lengths of these paths; what a unit of length costs in the layer
    # of each node (n_nodes); and whether lengths cost anything.
    leaving_length: FloatArray
    coming_length: FloatArray
    per_length: FloatArray
    prices_length: bool
    used: OffsetArray  # 0 for all arcs: every search may take all of them (n_arcs)
    paths: Paths  # scratch of the search


def new_routes(world: World, per_length: FloatArray) -> Routes:
    """Return room for cheapest paths; none of them is searched yet.

    ``per_length`` is what a unit of length adds to the costs of arcs in the layer of each node.
    """
    n_nodes, prices_length = world.graph.n_nodes, world.limits.has_budgets
    n_entries = n_nodes if n_nodes <= FULL_UP_TO else NEAR
    n_costs = n_nodes if n_nodes <= FULL_UP_TO else 0
    return Routes(
        n_known=np.zeros(n_nodes, np.int64),
        entries=np.empty((n_nodes, n_entries), _ENTRY).view(np.recarray),
        near=new_near(n_nodes, _N_NEIGHBOURS),
        is_known=np.zeros(n_nodes, np.int64),
        leaving=np.empty((n_costs, n_costs)),
        coming=np.empty((n_costs, n_costs)),
        leaving_length=np.zeros((n_costs, n_costs) if prices_length else (0, 0)),
        coming_length=np.zeros((n_costs, n_costs) if prices_length else (0, 0)),
        per_length=per_length,
        prices_length=prices_length,
        used=np.zeros(world.graph.n_arcs, np.int64),
        paths=new_paths(world),
    )


@kernel
def search_all(graph: Graph, routes: Routes, with_costs: bool) -> None:
    """Search all paths that have not been searched yet, so that several threads may read them."""
    graph, routes = shared(graph), shared(routes)
    for node in range(graph.reward.shape[0]):
        if routes.near.nodes.shape[1] > 0 and routes.near.nodes[node, 0] < 0:
            search_near(graph, routes.paths, routes.used, routes.near, node)
        if routes.n_known[node] == 0:
            search_routes(graph, routes, node)
        if with_costs:
            search_costs(graph, routes, node)


@helper
def search_costs(graph: Graph, routes: Routes, node: int) -> None:
    """Find the costs of the cheapest paths from a node to all, and to it from all."""
    if routes.is_known[node] > 0:
        return
    routes.is_known[node] = 1
    paths, n_nodes = routes.paths, graph.reward.shape[0]
    for backwards in (False, True):
        costs = routes.coming[node] if backwards else routes.leaving[node]
        for i in range(n_nodes):
            costs[i] = FAR
        n = search_paths(graph, paths, routes.used, 1, node, ANYWHERE, n_nodes, backwards)
        for i in range(n):
            costs[paths.order[i]] = paths.distance[paths.order[i]]
        if not routes.prices_length:
            continue
        lengths = routes.coming_length[node] if backwards else routes.leaving_length[node]
        lengths[node] = 0.0
        for i in range(1, n):
            arc = paths.entry[paths.order[i]]
            before = graph.head[arc] if backwards else graph.tail[arc]
            lengths[paths.order[i]] = lengths[before] + graph.length[arc]


@helper
def search_routes(graph: Graph, routes: Routes, goal: int) -> None:
    """Fill in a row: the safest paths to a node from those that are safest to come from."""
    paths, n_entries = routes.paths, routes.entries.shape[1]
    n = search_paths(graph, paths, routes.used, 1, goal, ANYWHERE, n_entries, True)
    found, place = -paths.n_searches[0], paths.heap_nodes
    for i in range(n):
        paths.met[paths.order[i]] = found  # negative, as no search marks nodes
    n = 0
    for node in range(paths.met.shape[0]):
        if paths.met[node] == found:
            place[node] = n
            n += 1
    for node in range(paths.met.shape[0]):
        if paths.met[node] == found:
            at = node if n_entries == routes.entries.shape[0] else place[node]
            entry, arc = routes.entries[goal, at], paths.entry[node]
            entry.cost, entry.source, entry.arc = paths.distance[node], node, arc
            following = graph.head[arc] if arc >= 0 else node
            entry.onward = following if n_entries == routes.entries.shape[0] else place[following]
    if n_entries == routes.entries.shape[0]:  # from other layers there is none
        for node in range(n_entries):
            if paths.met[node] != found:
                routes.entries[goal, node].cost = np.inf
        n = n_entries
    routes.n_known[goal] = n


@helper
def route_entry(routes: Routes, goal: int, node: int) -> int:
    """Return the entry of the path from ``node`` in a row that was searched, or ``UNKNOWN``."""
    if routes.entries.shape[1] == routes.entries.shape[0]:
        return node
    low, high = 0, routes.n_known[goal]
    while low < high:
        middle = (low + high) // 2
        if routes.entries[goal, middle].source < node:
            low = middle + 1
        else:
            high = middle
    known = low < routes.n_known[goal] and routes.entries[goal, low].source == node
    return low if known else UNKNOWN
