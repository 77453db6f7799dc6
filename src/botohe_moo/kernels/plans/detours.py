"""A move that can be made wherever there is a trail: part of it goes another way.

The other moves need arcs that join what they leave, most of them arcs both ways. Where arcs are
one-way, a detour leaves a trail along safest paths over arcs that the trail has not taken.
"""

from botohe_moo._base.types import OffsetArray, SeedArray
from botohe_moo.kernels.compile import helper
from botohe_moo.kernels.graph.graph import Graph, find_arc
from botohe_moo.kernels.graph.paths import Paths, safest_path
from botohe_moo.kernels.plans.marks import CANNOT, NO_PATHS, MoveScratch
from botohe_moo.kernels.rng import below, uniform


@helper
def _add_path(
    graph: Graph, scratch: MoveScratch, paths: Paths, n: int, source: int, target: int
) -> int:
    """Add the safest path over arcs that are not marked to a way of ``n`` arcs.

    Returns the new number of arcs, −1 where there is no path.
    """
    n_added = safest_path(graph, paths, scratch.used, scratch.mark[0], source, target)
    for i in range(n_added):
        scratch.way[n + i] = paths.path[i]
    return n + n_added if n_added >= 0 else -1


@helper
def _replace(
    graph: Graph, way: OffsetArray, n: int, nodes: OffsetArray, length: int, start: int, stop: int
) -> int:
    """Put ``n`` arcs in the place of a segment; ``CANNOT`` if they are the same."""
    shift = n - (stop - start)
    if shift == 0:
        i = 0
        while i < n and graph.head[way[i]] == nodes[start + 1 + i]:
            i += 1
        if i == n:
            return CANNOT
    if shift > 0:
        for i in range(length - 1, stop, -1):
            nodes[i + shift] = nodes[i]
    else:
        for i in range(stop + 1, length):
            nodes[i + shift] = nodes[i]
    for i in range(n):
        nodes[start + 1 + i] = graph.head[way[i]]
    return length + shift


@helper
def _go_another_way(
    graph: Graph,
    scratch: MoveScratch,
    paths: Paths,
    nodes: OffsetArray,
    length: int,
    states: SeedArray,
) -> int:
    """Go another way from a position of a trail to the same or a later one, in place.

    First to a node, by the arc where a free one leads there, else by the safest path, then by the
    safest path to where the trail goes on; all over arcs that the rest of the trail does not take.
    The first position is drawn uniformly, the other one so that short spans are drawn as often as
    long ones (evenly in their logarithms), the node among all: with the base, or a node at one of
    the positions, the safest path is taken at once.

    ``CANNOT`` where there is no path, or no other one than the trail takes.
    """
    used, mark, way = scratch.used, scratch.mark[0], scratch.way
    start = below(states, length)
    room = length - start
    stop = start + min(room, int((room + 1) ** uniform(states, 0))) - 1
    via = below(states, graph.reward.shape[0])
    here, target = nodes[start], nodes[stop]
    for i in range(start, stop):
        used[find_arc(graph, nodes[i], nodes[i + 1])] = -1
    n_out = 0
    if via != graph.base and via != here and via != target:
        way[0] = find_arc(graph, here, via)
        n_out = 1
        if way[0] < 0 or used[way[0]] == mark:
            n_out = _add_path(graph, scratch, paths, 0, here, via)
        for i in range(n_out):
            used[way[i]] = mark
        here = via
    n = n_out
    if here != target and n_out >= 0:
        n = _add_path(graph, scratch, paths, n_out, here, target)
    for i in range(n_out):
        used[way[i]] = -1
    for i in range(start, stop):
        used[find_arc(graph, nodes[i], nodes[i + 1])] = mark
    return CANNOT if n < 0 else _replace(graph, way, n, nodes, length, start, stop)


@helper
def take_detour(
    graph: Graph,
    scratch: MoveScratch,
    paths: Paths | None,
    nodes: OffsetArray,
    length: int,
    states: SeedArray,
) -> int:
    """Go another way, in place; parameters and result are those of ``move_trail``.

    ``paths`` are those of ``scratch``: for an argument that is None numba compiles the branch for
    None alone.
    """
    if paths is None:
        return NO_PATHS
    return _go_another_way(graph, scratch, paths, nodes, length, states)
