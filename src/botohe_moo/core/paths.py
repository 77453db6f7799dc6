"""Cheapest paths: Dijkstra's algorithm over arcs that a trail has not used.

Costs are those of the graph: by −log(survival) the cheapest paths are the safest ones, by lengths
the shortest.

Arc a is used where ``used[a] == trail``: one array serves trail after trail without being cleared.
"""

from typing import NamedTuple

import numpy as np

from botohe_moo.base.types import FloatArray, OffsetArray
from botohe_moo.core.compile import helper, kernel, shared
from botohe_moo.core.world import Graph, Shortest, World, keeps

ANYWHERE = -1  # instead of a node
ALL_FREE = -2  # a trail that has used no arc


class Paths(NamedTuple):
    """Scratch of searches for paths."""

    n_searches: OffsetArray  # how many searches there have been (1)
    # The last search that met each node (n_nodes). ``distance`` and ``entry`` are those of nodes
    # that the current search has met.
    met: OffsetArray
    # Cost of the safest path between each node and the source, and the arc by which that path comes
    # to the node, −1 at the source (n_nodes).
    distance: FloatArray
    entry: OffsetArray
    order: OffsetArray  # the nodes whose safest path is known, by ascending cost (n_nodes)
    # The heap, of at least n_arcs + 1 and n_nodes + 1.
    heap_keys: FloatArray
    heap_nodes: OffsetArray
    path: OffsetArray  # arcs of the path that was asked for, in order (n_nodes)
    # The first arc of a way home from each node but the base, and the last search that followed it
    # (n_nodes). Ways are the safest ones at first, and then those that ``leads_home`` found
    # for any trail: arcs on them may be used by this trail, and they may go round in circles.
    onward: OffsetArray
    followed: OffsetArray


def new_paths(world: World) -> Paths:
    """Return room for searches."""
    n_nodes, n_arcs = world.graph.n_nodes, world.graph.n_arcs
    n_heap = max(n_arcs, n_nodes) + 1
    return Paths(
        n_searches=np.zeros(1, np.int64),
        met=np.zeros(n_nodes, np.int64),
        distance=np.empty(n_nodes),
        entry=np.empty(n_nodes, np.int64),
        order=np.empty(n_nodes, np.int64),
        heap_keys=np.empty(n_heap),
        heap_nodes=np.empty(n_heap, np.int64),
        path=np.empty(n_nodes, np.int64),
        onward=world.ways.homeward.copy(),
        followed=np.zeros(n_nodes, np.int64),
    )


@helper
def _push(paths: Paths, size: int, key: float, node: int) -> int:
    """Put a node on the heap; return the heap's new size."""
    keys, nodes = paths.heap_keys, paths.heap_nodes
    at = size
    while at > 0:
        parent = (at - 1) // 2
        if keys[parent] <= key:
            break
        keys[at], nodes[at] = keys[parent], nodes[parent]
        at = parent
    keys[at], nodes[at] = key, node
    return size + 1


@helper
def _pop(paths: Paths, size: int) -> tuple[float, int]:
    """Take the first node off a heap of some size; return its key and the node."""
    keys, nodes = paths.heap_keys, paths.heap_nodes
    first_key, first_node = keys[0], nodes[0]
    last, at, child = size - 1, 0, 1
    while child < last:
        if child + 1 < last and keys[child + 1] < keys[child]:
            child += 1
        if keys[child] >= keys[last]:
            break
        keys[at], nodes[at] = keys[child], nodes[child]
        at, child = child, 2 * child + 1
    keys[at], nodes[at] = keys[last], nodes[last]
    return first_key, first_node


@helper
def search_paths(
    graph: Graph,
    paths: Paths,
    used: OffsetArray,
    trail: int,
    source: int,
    target: int,
    n_most: int,
    backwards: bool,
) -> int:
    """Find the safest paths from a node, or, searching ``backwards``, to it; the safest first.

    The search ends when the path to ``target`` is known, or those to ``n_most`` nodes, the source
    among them. With ``ANYWHERE`` there is no target. Writes ``distance``, ``entry`` and ``order``,
    and returns how many nodes are in ``order``.
    """
    met, distance, entry = paths.met, paths.distance, paths.entry
    paths.n_searches[0] += 1
    search = paths.n_searches[0]
    met[source], distance[source], entry[source] = search, 0.0, -1
    size = _push(paths, 0, 0.0, source)
    n = 0
    while size > 0 and n < n_most:
        key, node = _pop(paths, size)
        size -= 1
        if key > distance[node]:
            continue
        paths.order[n] = node
        n += 1
        if node == target:
            break
        starts = graph.first_entering if backwards else graph.first
        for i in range(starts[node], starts[node + 1]):
            arc = graph.entering[i] if backwards else i
            there = graph.tail[arc] if backwards else graph.head[arc]
            reached = key + graph.cost[arc]
            if used[arc] == trail or (met[there] == search and distance[there] <= reached):
                continue
            met[there], distance[there], entry[there] = search, reached, arc
            size = _push(paths, size, reached, there)
    return n


class Near(NamedTuple):
    """For each node the other nodes that are safest to reach, the safest first.

    Rows are searched when they are needed; those that begin with −1 have not been searched yet.
    Where fewer nodes can be reached, the rest of the row is the node itself with survival 0.
    """

    nodes: OffsetArray  # (n_nodes, n_near), n_near < n_nodes
    reach: FloatArray  # survival of the safest path to each of them (n_nodes, n_near)


def new_near(n_nodes: int, n_near: int) -> Near:
    """Return room for the ``n_near`` nodes, or all, that are safest to reach from each node."""
    shape = n_nodes, min(n_near, n_nodes - 1)
    return Near(np.full(shape, -1), np.empty(shape))


def find_near(world: World, n_near: int) -> Near:
    """Find the ``n_near`` nodes, or all, that are safest to reach from each node."""
    near = new_near(world.graph.n_nodes, n_near)
    _search_all_near(world.graph, new_paths(world), np.zeros(world.graph.n_arcs, np.int64), near)
    return near


@kernel
def _search_all_near(graph: Graph, paths: Paths, used: OffsetArray, near: Near) -> None:
    graph, paths, near = shared(graph), shared(paths), shared(near)
    for source in range(near.nodes.shape[0]):
        search_near(graph, paths, used, near, source)


@helper
def search_near(graph: Graph, paths: Paths, used: OffsetArray, near: Near, source: int) -> None:
    """Find the nodes that are safest to reach from a node; ``used`` may hold any trails from −1."""
    n_near = near.nodes.shape[1]
    n = search_paths(graph, paths, used, ALL_FREE, source, ANYWHERE, n_near + 1, False)
    alive = paths.distance  # which is not needed any more
    alive[source] = 1.0
    for i in range(n - 1, n_near):
        near.nodes[source, i], near.reach[source, i] = source, 0.0
    for i in range(n - 1):
        node = paths.order[i + 1]
        arc = paths.entry[node]
        alive[node] = alive[graph.tail[arc]] * graph.mean_survival[arc]
        near.nodes[source, i], near.reach[source, i] = node, alive[node]


@helper
def safest_path(
    graph: Graph, paths: Paths, used: OffsetArray, trail: int, source: int, target: int
) -> int:
    """Write the safest path between two nodes to ``paths.path``.

    Returns how many arcs it has; −1 where there is none.
    """
    n_nodes = paths.met.shape[0]
    n_known = search_paths(graph, paths, used, trail, source, target, n_nodes, False)
    if paths.order[n_known - 1] != target:
        return -1
    n = 0
    node = target
    while node != source:
        n += 1
        node = graph.tail[paths.entry[node]]
    node = target
    for i in range(n - 1, -1, -1):
        paths.path[i] = paths.entry[node]
        node = graph.tail[paths.entry[node]]
    return n


@helper
def way_home(world: World, paths: Paths, used: OffsetArray, trail: int, source: int) -> int:
    """Write the safest way to the end to ``paths.path``; return how many arcs it has, −1 for none.

    The usual way is tried first: it takes little time, and is nearly always free.
    """
    n = way_along(world.graph, world.ways.homeward, paths, used, trail, source)
    end = world.team.end[source]
    return n if n >= 0 else safest_path(world.graph, paths, used, trail, source, end)


@helper
def way_along(
    graph: Graph, homeward: OffsetArray, paths: Paths, used: OffsetArray, trail: int, source: int
) -> int:
    """Write a way of ``Ways`` to ``paths.path``; return how many arcs it has, −1 if one is used."""
    n, node = 0, source
    while homeward[node] >= 0:
        arc = homeward[node]
        if used[arc] == trail:
            return -1
        paths.path[n] = arc
        n += 1
        node = graph.head[arc]
    return n


@helper
def way_within(
    world: World,
    shortest: Shortest | None,
    paths: Paths,
    used: OffsetArray,
    trail: int,
    node: int,
    alive: float,
    length: float,
) -> int:
    """Write a way home that keeps the robot's limits to ``paths.path``, as ``way_home`` does.

    The trail is that of robot ``trail % n_robots``; ``alive`` and ``length`` are its survival and
    its length up to the node. The way is the safest one if that is short enough, otherwise the
    shortest one if that is safe enough. Where neither is, the result is −1: a way that compromises
    between both is not looked for. ``shortest`` is that of the world's ways, None without travel
    budgets.
    """
    robot = trail % world.team.start.shape[0]
    # Even if every arc were free:
    if alive * world.ways.home[node] < world.limits.floors[robot]:
        return -1
    if shortest is not None and length + shortest.length[node] > world.limits.budgets[robot]:
        return -1
    n = way_home(world, paths, used, trail, node)
    if n < 0 or _keeps(world, paths, n, robot, alive, length):
        return n
    if shortest is None:
        return -1
    n = way_along(world.graph, shortest.homeward, paths, used, trail, node)
    if n < 0:
        n = safest_path(shortest.graph, paths, used, trail, node, world.team.end[node])
    return n if _keeps(world, paths, n, robot, alive, length) else -1


@helper
def _keeps(world: World, paths: Paths, n: int, robot: int, alive: float, length: float) -> bool:
    """Return whether a robot's trail that goes on by ``paths.path`` keeps its limits."""
    for i in range(n):
        alive *= world.graph.mean_survival[paths.path[i]]
        length += world.graph.length[paths.path[i]]
    return keeps(world.limits, robot, alive, length)


@helper
def leads_home(world: World, paths: Paths, used: OffsetArray, trail: int, node: int) -> bool:
    """Return whether unused arcs lead from a node to the end, and note them in ``onward``.

    This is a breadth-first search for a node from which the way home noted before is free. Mostly
    it is the node itself, or one nearby.
    """
    paths.n_searches[0] += 1
    graph, met, entry, queue = world.graph, paths.met, paths.entry, paths.order
    search, end = paths.n_searches[0], world.team.end[node]
    queue[0], met[node], n, i = node, search, 1, 0
    while i < n:
        tail = queue[i]
        i += 1
        if _is_free(graph, paths, used, trail, tail, end):
            while tail != node:
                arc = entry[tail]
                tail = graph.tail[arc]
                paths.onward[tail] = arc
            return True
        for arc in range(graph.first[tail], graph.first[tail + 1]):
            head = graph.head[arc]
            if used[arc] != trail and met[head] != search:
                met[head], entry[head], queue[n] = search, arc, head
                n += 1
    return False


@helper
def _is_free(
    graph: Graph, paths: Paths, used: OffsetArray, trail: int, node: int, end: int
) -> bool:
    """Return whether the way home that is noted for a node is free.

    It is not if it comes to a node from which this search has followed a way before: that way
    is blocked, or this one goes round in a circle.
    """
    search = paths.n_searches[0]
    while node != end:
        arc = paths.onward[node]
        if used[arc] == trail or paths.followed[node] == search:
            return False
        paths.followed[node] = search
        node = graph.head[arc]
    return True
