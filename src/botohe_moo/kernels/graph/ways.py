"""Ways home that are remembered: where dead ends are possible, a trail asks for one at each hop.

For each node but the base ``ways[node].onward`` is the first arc of some way home, at the beginning
the safest one. These ways come from all trails so far: some of their arcs may be used, and they may
go round in circles.

Of one trail, ``known.trail``, a way home over unused arcs is known. Its nodes are
``ways[place].node``, from the place ``known.size`` − 1, where the trail is, down to the base at
place 0; each goes on by its ``onward``. ``ways[place].survival`` is the survival of the rest of the
way, and ``ways[node].place`` the place of a node that is on the way. The way stays free as long as
the trail asks for every node that it visits. So whatever leads to this way leads home, mostly in a
hop or two.

Where no way home was found from a node, there will be none for the same trail:
``ways[node].dead`` is the number of the search that showed this. It holds for the present trail if
it is larger than ``known.since``.
"""

from botohe_moo._base.types import OffsetArray
from botohe_moo.kernels.compile import helper, inlined
from botohe_moo.kernels.graph.graph import Graph
from botohe_moo.kernels.graph.paths import NOBODY, Paths, way_home

_SURELY = 1 + 1e-9


@helper
def leads_home(graph: Graph, paths: Paths, used: OffsetArray, trail: int, node: int) -> bool:
    """Return whether unused arcs lead from a node to the base, whatever has been asked before."""
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
    """Return whether a robot that goes to a node, with probability ``alive``, can keep a floor.

    It can if it gets home over unused arcs with probability ``least`` or more; without a floor
    (0), if any lead home. If it can it has to go there, and the arc to that node counts as used.
    Call ``end_trail`` at the end of a trail. Without scratch (``paths`` None) the result is always
    True, and the search is not compiled.
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
    """Forget the way of a trail that has ended: the next one may have the same number."""
    if paths is not None:
        paths.known[0].trail = NOBODY


@inlined
def _forget_way(graph: Graph, paths: Paths, trail: int) -> None:
    """Forget all ways of a trail, except that it is home at the base."""
    known = paths.known[0]
    known.trail, known.since, known.size = trail, paths.n_searches[0], 1
    paths.ways[0].node, paths.ways[0].survival = graph.base, 1.0
    paths.ways[graph.base].place = 0


@inlined
def _is_on_way(paths: Paths, node: int) -> bool:
    """Return whether the way that is known goes over a node."""
    place = paths.ways[node].place
    return bool(place < paths.known[0].size and paths.ways[place].node == node)


@helper
def _walk(graph: Graph, paths: Paths, used: OffsetArray, trail: int, node: int) -> float:
    """Walk along ``onward`` to the way that is known; return the survival of the way home.

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
