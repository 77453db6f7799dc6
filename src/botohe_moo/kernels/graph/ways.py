"""Ways home that are remembered: where dead ends are possible, a trail asks for one at each hop.

Of each node but the base ``ways[node].onward`` is the arc by which some way home goes on, at first
the safest one. These ways are left over from all trails: arcs of them may be used by now, and they
may go round in circles.

Of one trail, ``known.trail``, a way home over unused arcs is known. From the place
``known.size`` − 1 down to the base at 0 it goes over ``ways[place].node``, by their ``onward``;
``ways[node].place`` is where it goes over a node, if it does, and ``ways[place].survival`` is that
of the way from there. It begins where the trail is, and stays free as long as the trail asks for
every node that it goes to. So what leads to this way leads home: mostly a hop or two. And from
where none led home none will: ``ways[node].dead`` is the search that found so, of this trail if it
came after ``known.since``.
"""

from botohe_moo._base.types import OffsetArray
from botohe_moo.kernels.compile import helper, inlined
from botohe_moo.kernels.graph.graph import Graph
from botohe_moo.kernels.graph.paths import NOBODY, Paths, way_home

_SURELY = 1 + 1e-9


@helper
def leads_home(graph: Graph, paths: Paths, used: OffsetArray, trail: int, node: int) -> bool:
    """Tell whether unused arcs lead from a node to the base, whatever has been asked before."""
    _forget_way(graph, paths, NOBODY)
    return _find_way(graph, paths, used, trail, node)


@helper
def survives_home(
    graph: Graph,
    paths: Paths | None,
    used: OffsetArray,
    trail: int,
    node: int,
    alive: float,
    least: float,
) -> bool:
    """Tell whether a robot that goes to a node, with probability ``alive``, can keep a floor.

    It can if it gets home over unused arcs with probability ``least`` or more; without a floor
    (0), if any lead home. If it can it has to go there, and the arc to that node is used by now.
    A trail that has come to its end has to say so (``end_trail``). Where there is no scratch to
    search on, it always can: the search is not even compiled.
    """
    if paths is None:
        return True
    if paths.known[0].trail != trail:
        _forget_way(graph, paths, trail)
    if least <= 0.0:
        return _find_way(graph, paths, used, trail, node)
    if alive * graph.home[node] < least:
        return False
    paths.n_searches[0] += 1
    # Any way will do that is safe enough by more than rounding, else the safest one decides.
    if alive * _walk(graph, paths, used, trail, node) < least * _SURELY:
        n = way_home(graph, paths, used, trail, node)
        for i in range(n):
            alive *= graph.survival[paths.path[i]]
        if n < 0 or alive < least:
            return False
        _forget_way(graph, paths, trail)
        for i in range(n):
            paths.ways[graph.tail[paths.path[i]]].onward = paths.path[i]
    _know_way(graph, paths, node)
    return True


@helper
def go_without_choice(graph: Graph, paths: Paths | None, trail: int, node: int) -> None:
    """Go to a node by the only arc that is left: a trail need not ask whether it can."""
    if paths is None:
        return
    if paths.known[0].trail == trail and _is_on_way(paths, node):
        paths.known[0].size = paths.ways[node].place + 1
    else:
        _forget_way(graph, paths, trail)


@helper
def end_trail(paths: Paths | None) -> None:
    """Let nothing be known of the next trail, be it of the same number."""
    if paths is not None:
        paths.known[0].trail = NOBODY


@inlined
def _forget_way(graph: Graph, paths: Paths, trail: int) -> None:
    """Let nothing be known of a trail, but that it is home at the base."""
    known = paths.known[0]
    known.trail, known.since, known.size = trail, paths.n_searches[0], 1
    paths.ways[0].node, paths.ways[0].survival = graph.base, 1.0
    paths.ways[graph.base].place = 0


@inlined
def _is_on_way(paths: Paths, node: int) -> bool:
    """Tell whether the way that is known goes over a node."""
    place = paths.ways[node].place
    return bool(place < paths.known[0].size and paths.ways[place].node == node)


@helper
def _walk(graph: Graph, paths: Paths, used: OffsetArray, trail: int, node: int) -> float:
    """Walk along ``onward`` to the way that is known; give the survival of the way home.

    It is −1 where a used arc is in the way, or what a walk of the same search has gone over: that
    has been blocked, or this one goes round in a circle.
    """
    search, survival = paths.n_searches[0], 1.0
    while not _is_on_way(paths, node):
        arc = paths.ways[node].onward
        if used[arc] == trail or paths.ways[node].walk == search:
            return -1.0
        paths.ways[node].walk = search
        survival *= graph.survival[arc]
        node = graph.head[arc]
    return float(survival * paths.ways[paths.ways[node].place].survival)


@helper
def _know_way(graph: Graph, paths: Paths, node: int) -> None:
    """Know the way home from a node along ``onward``, from which a walk has led to the way."""
    ways, here, n = paths.ways, node, 0
    while not _is_on_way(paths, here):
        here = graph.head[ways[here].onward]
        n += 1
    end = ways[here].place
    here = node
    for place in range(end + n, end, -1):
        ways[here].place, ways[place].node = place, here
        here = graph.head[ways[here].onward]
    for place in range(end + 1, end + n + 1):
        survival = graph.survival[ways[ways[place].node].onward]
        ways[place].survival = survival * ways[place - 1].survival
    paths.known[0].size = end + n + 1


@helper
def _find_way(graph: Graph, paths: Paths, used: OffsetArray, trail: int, node: int) -> bool:
    """Find a way home from a node, and know it; tell whether there is any.

    By breadth-first search for a node from which a walk leads to the way that is known: mostly
    there is one near by, if it is not the node itself.
    """
    since, ways = paths.known[0].since, paths.ways
    if ways[node].dead > since:
        return False
    paths.n_searches[0] += 1
    if _walk(graph, paths, used, trail, node) >= 0.0:
        _know_way(graph, paths, node)
        return True
    met, entry, queue, search = paths.met, paths.entry, paths.order, paths.n_searches[0]
    queue[0], met[node], n, i = node, search, 1, 0
    while i < n:
        here = queue[i]
        i += 1
        for arc in range(graph.first[here], graph.first[here + 1]):
            there = graph.head[arc]
            if used[arc] == trail or met[there] == search or ways[there].dead > since:
                continue
            met[there], entry[there] = search, arc
            if _walk(graph, paths, used, trail, there) >= 0.0:
                while there != node:
                    ways[graph.tail[entry[there]]].onward = entry[there]
                    there = graph.tail[entry[there]]
                _know_way(graph, paths, node)
                return True
            queue[n] = there
            n += 1
    for i in range(n):
        ways[queue[i]].dead = search
    return False
