"""A move that can be made wherever there is a trail: part of it goes another way.

The other moves want arcs that join what they leave, most of them arcs both ways. Where arcs are
one-way, a detour leaves a trail along safest paths over arcs that the trail has not taken. Its
scratch is made when it is needed: where the other moves can be made, it hardly ever is.
"""

import math

import numpy as np

from botohe_moo._base.types import FloatArray, IntArray, OffsetArray, SeedArray
from botohe_moo.kernels.compile import kernel
from botohe_moo.kernels.graph.old_paths import safest_path
from botohe_moo.kernels.plans.evaluate import find_arc
from botohe_moo.kernels.rng import uniform


@kernel
def _find_path(
    first: OffsetArray,
    tail: IntArray,
    head: IntArray,
    cost: FloatArray,
    used: OffsetArray,
    mark: int,
    source: int,
    target: int,
    path: IntArray,
) -> int:
    """Write the safest path over arcs that are not marked; give its length, −1 without any."""
    n_nodes, n_arcs = first.shape[0] - 1, head.shape[0]
    return safest_path(
        first,
        tail,
        head,
        cost,
        used,
        mark,
        source,
        target,
        0,
        np.full(n_nodes, -1, np.int64),
        np.empty(n_nodes),
        np.empty(n_nodes, np.int32),
        np.empty(n_arcs + 1),
        np.empty(n_arcs + 1, np.int32),
        path,
    )


@kernel
def _replace(
    head: IntArray,
    nodes: IntArray,
    length: int,
    start: int,
    stop: int,
    out: IntArray,
    back: IntArray,
) -> int:
    """Put two paths in the place of a segment; give the new length, −1 if they are the segment."""
    n_out, n = out.shape[0], out.shape[0] + back.shape[0]
    shift = n - (stop - start)
    if shift == 0:
        differs = False
        for i in range(n):
            arc = out[i] if i < n_out else back[i - n_out]
            differs = differs or head[arc] != nodes[start + 1 + i]
        if not differs:
            return -1
    if shift > 0:
        for i in range(length - 1, stop, -1):
            nodes[i + shift] = nodes[i]
    else:
        for i in range(stop + 1, length):
            nodes[i + shift] = nodes[i]
    for i in range(n):
        nodes[start + 1 + i] = head[out[i] if i < n_out else back[i - n_out]]
    return int(length + shift)


@kernel
def take_detour(
    first: OffsetArray,
    head: IntArray,
    survival: FloatArray,
    base: int,
    nodes: IntArray,
    length: int,
    used: OffsetArray,
    mark: int,
    states: SeedArray,
    which: int,
) -> int:
    """Go another way from a position of a trail to the same or a later one, in place.

    First to a node, by the arc where a free one leads there, else by the safest path, then by the
    safest path to where the trail goes on; all over arcs that the rest of the trail does not take.
    The first position is drawn uniformly, the other one so that short spans are drawn as often as
    long ones (evenly in their logarithms), the node among all: with the base, or a node at one of
    the positions, the safest path is taken at once.

    Parameters
    ----------
    first, head, survival, base
        The mission's arcs, grouped by tail node, and its base.
    nodes, length, used, mark, states, which
        As for ``move_trail``.

    Returns
    -------
    int
        The trail's new length; −1 where there is no path, or no other one than the trail takes.
    """
    n_nodes, n_arcs = first.shape[0] - 1, head.shape[0]
    start = int(uniform(states, which) * length)
    room = length - start
    stop = start + min(room, int((room + 1) ** uniform(states, which))) - 1
    ends = np.empty(3, np.int64)  # of one type, so that the search is compiled once
    ends[0], ends[1], ends[2] = nodes[start], int(uniform(states, which) * n_nodes), nodes[stop]
    source, via, target = ends[0], ends[1], ends[2]
    tail, cost = np.empty(n_arcs, np.int32), np.empty(n_arcs)
    for node in range(n_nodes):
        for arc in range(first[node], first[node + 1]):
            tail[arc], cost[arc] = node, -math.log(survival[arc])
    for i in range(start, stop):
        used[find_arc(first, head, nodes[i], nodes[i + 1])] = -1
    out, back = np.empty(n_nodes, np.int32), np.empty(n_nodes, np.int32)
    here = source
    n_out = n_back = 0
    if via != base and via != source and via != target:
        here = via
        out[0] = find_arc(first, head, source, via)
        n_out = 1
        if out[0] < 0 or used[out[0]] == mark:
            n_out = _find_path(first, tail, head, cost, used, mark, source, via, out)
        for i in range(n_out):
            used[out[i]] = mark
    if here != target and n_out >= 0:
        n_back = _find_path(first, tail, head, cost, used, mark, here, target, back)
    for i in range(n_out):
        used[out[i]] = -1
    for i in range(start, stop):
        used[find_arc(first, head, nodes[i], nodes[i + 1])] = mark
    if n_out < 0 or n_back < 0:
        return -1
    return _replace(head, nodes, length, start, stop, out[:n_out], back[:n_back])
