"""Safest paths: Dijkstra's algorithm on −log(survival), over arcs that a trail has not used."""

import math

import numpy as np

from botohe_moo._base.types import FloatArray, IntArray, OffsetArray
from botohe_moo.kernels.compile import kernel


@kernel
def push(keys: FloatArray, held: IntArray, size: int, key: float, node: int) -> int:
    """Put a node on the heap; give the heap's new size."""
    at = size
    while at > 0:
        parent = (at - 1) // 2
        if keys[parent] <= key:
            break
        keys[at], held[at] = keys[parent], held[parent]
        at = parent
    keys[at], held[at] = key, node
    return size + 1


@kernel
def pop(keys: FloatArray, held: IntArray, size: int) -> int:
    """Take the first node off the heap, which moves to the end; give the heap's new size."""
    first_key, first_node = keys[0], held[0]
    size -= 1
    key, node = keys[size], held[size]
    at = 0
    while True:
        child = 2 * at + 1
        if child >= size:
            break
        if child + 1 < size and keys[child + 1] < keys[child]:
            child += 1
        if keys[child] >= key:
            break
        keys[at], held[at] = keys[child], held[child]
        at = child
    if size > 0:
        keys[at], held[at] = key, node
    keys[size], held[size] = first_key, first_node
    return size


@kernel
def safest_path(
    first: OffsetArray,
    tail: IntArray,
    head: IntArray,
    cost: FloatArray,
    used: OffsetArray,
    trail: int,
    source: int,
    target: int,
    search: int,
    met: OffsetArray,
    distance: FloatArray,
    entry: IntArray,
    keys: FloatArray,
    held: IntArray,
    path: IntArray,
) -> int:
    """Find the safest path between two nodes over arcs that a trail has not used.

    Parameters
    ----------
    first, tail, head, cost
        The arcs, grouped by tail node, and −log(survival) of each, at least 0.
    used, trail
        Arc a must not be taken where ``used[a] == trail``.
    source, target
        Where the path begins and ends; with ``target`` −1 the search goes on to every node.
    search
        Number of this search, another one each time the scratch arrays are used.
    met, distance, entry
        Scratch (n_nodes). Where ``met[v] == search``, ``distance[v]`` is the cost of the safest
        path found, and ``entry[v]`` its last arc (−1 at the source).
    keys, held
        Scratch of the heap (n_arcs + 1).
    path
        Output (n_nodes): the arcs of the path in order.

    Returns
    -------
    int
        How many arcs the path has; −1 where there is none.
    """
    met[source], distance[source], entry[source] = search, 0.0, -1
    size = push(keys, held, 0, 0.0, source)
    while size > 0:
        size = pop(keys, held, size)
        here, key = held[size], keys[size]
        if here == target:
            break
        if key > distance[here]:
            continue
        for arc in range(first[here], first[here + 1]):
            there = head[arc]
            reached = key + cost[arc]
            if used[arc] == trail or (met[there] == search and distance[there] <= reached):
                continue
            met[there], distance[there], entry[there] = search, reached, arc
            size = push(keys, held, size, reached, there)
    if target < 0 or met[target] != search:
        return -1
    n = 0
    here = target
    while here != source:
        n += 1
        here = tail[entry[here]]
    here = target
    for i in range(n - 1, -1, -1):
        path[i] = entry[here]
        here = tail[entry[here]]
    return n


@kernel
def way_home(
    first: OffsetArray,
    tail: IntArray,
    head: IntArray,
    cost: FloatArray,
    homeward: IntArray,
    base: int,
    used: OffsetArray,
    trail: int,
    source: int,
    search: int,
    met: OffsetArray,
    distance: FloatArray,
    entry: IntArray,
    keys: FloatArray,
    held: IntArray,
    path: IntArray,
) -> int:
    """Find the safest way to the base over arcs that a trail has not used.

    First along ``homeward``, each node's arc on the safest way home when every arc is free: cheap,
    and nearly always enough. Parameters and result are as for ``safest_path``.
    """
    n = 0
    here = source
    while here != base and used[homeward[here]] != trail:
        path[n] = homeward[here]
        n += 1
        here = head[homeward[here]]
    if here == base:
        return n
    return safest_path(
        first,
        tail,
        head,
        cost,
        used,
        trail,
        source,
        base,
        search,
        met,
        distance,
        entry,
        keys,
        held,
        path,
    )


@kernel
def safest_homes(
    first: OffsetArray,
    tail: IntArray,
    head: IntArray,
    survival: FloatArray,
    base: int,
    homeward: IntArray,
    home: FloatArray,
) -> None:
    """Write each node's arc on its safest way to the base, and that way's survival.

    Parameters
    ----------
    first, tail, head, survival
        The arcs, grouped by tail node.
    base
        Where the ways end.
    homeward, home
        Output (n_nodes): an arc, −1 at the base, and the product of the survivals, 1 at the base.
    """
    n_nodes, n_arcs = first.shape[0] - 1, head.shape[0]
    entering = np.argsort(head, kind="mergesort")
    first_entering = np.zeros(n_nodes + 1, np.int64)
    for arc in range(n_arcs):
        first_entering[head[arc] + 1] += 1
    first_entering = np.cumsum(first_entering)
    backward_tail = head[entering]
    backward_head = tail[entering]
    cost = np.empty(n_arcs)
    for i in range(n_arcs):
        cost[i] = -math.log(survival[entering[i]])
    distance = np.empty(n_nodes)
    entry = np.full(n_nodes, -1, np.int32)
    safest_path(
        first_entering,
        backward_tail,
        backward_head,
        cost,
        np.full(n_arcs, -1, np.int64),
        0,
        base,
        -1,
        0,
        np.full(n_nodes, -1, np.int64),
        distance,
        entry,
        np.empty(n_arcs + 1),
        np.empty(n_arcs + 1, np.int32),
        np.empty(n_nodes, np.int32),
    )
    for node in range(n_nodes):
        homeward[node] = entering[entry[node]] if node != base else -1
    for node in range(n_nodes):
        home[node] = 1.0
        here = node
        while here != base:
            home[node] *= survival[homeward[here]]
            here = head[homeward[here]]


@kernel
def nearest(
    first: OffsetArray,
    head: IntArray,
    cost: FloatArray,
    survival: FloatArray,
    near: IntArray,
    reach: FloatArray,
) -> None:
    """Find the nodes that are safest to reach from each node.

    Parameters
    ----------
    first, head, cost, survival
        The walk graph (see ``WalkGraph``).
    near
        Output (n_nodes, n_near), n_near < n_nodes: for each node others, the safest to reach first.
    reach
        Output (n_nodes, n_near): survival of the safest path to each of them.
    """
    n_nodes, n_arcs, n_near = first.shape[0] - 1, head.shape[0], near.shape[1]
    met, settled = np.full(n_nodes, -1, np.int64), np.full(n_nodes, -1, np.int64)
    distance, alive = np.empty(n_nodes), np.empty(n_nodes)
    keys, held = np.empty(n_arcs + 1), np.empty(n_arcs + 1, np.int32)
    for source in range(n_nodes):
        met[source], distance[source], alive[source] = source, 0.0, 1.0
        size = push(keys, held, 0, 0.0, source)
        n = -1  # the source itself comes first
        while size > 0 and n < n_near:
            size = pop(keys, held, size)
            here, key = held[size], keys[size]
            if settled[here] == source:
                continue
            settled[here] = source
            if n >= 0:
                near[source, n], reach[source, n] = here, alive[here]
            n += 1
            for arc in range(first[here], first[here + 1]):
                there = head[arc]
                reached = key + cost[arc]
                if met[there] == source and distance[there] <= reached:
                    continue
                met[there], distance[there] = source, reached
                alive[there] = alive[here] * survival[arc]
                size = push(keys, held, size, reached, there)
