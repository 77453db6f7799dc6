"""Valid closed trails out of drafts: arbitrary sequences of integers."""

from typing import NamedTuple

import numpy as np

from botohe_moo._base.types import IntArray, OffsetArray
from botohe_moo.core.compile import helper, kernel
from botohe_moo.core.graph import Graph, find_arc
from botohe_moo.core.kinds import layer_of, origin_of, start_of
from botohe_moo.core.paths import Paths, leads_home, new_paths, safest_path, way_home
from botohe_moo.core.sharing import shared
from botohe_moo.core.trails import Trails, write_trails

# The kinds of repairs.
SAFEST_PATH = 0
TRUNCATE = 1


class RepairScratch(NamedTuple):
    """Scratch of repairs."""

    # The last trail, and the last draft, that used each arc (n_arcs).
    used: OffsetArray
    drafted: OffsetArray
    paths: Paths  # scratch of searches for paths


@helper
def _take_path(graph: Graph, scratch: RepairScratch, n: int, out: Trails, size: int) -> int:
    """Append the first ``n`` arcs of ``paths.path`` to a trail; return the new size."""
    for i in range(n):
        out.nodes[size + i] = graph.head[scratch.paths.path[i]]
    return size + n


@helper
def _take_back(graph: Graph, scratch: RepairScratch, out: Trails, size: int) -> int:
    """Take the last hop off a trail; return the new size."""
    tail, head = out.nodes[size - 2], out.nodes[size - 1]
    scratch.used[find_arc(graph, tail, head)] = -1
    return size - 1


@helper
def _bridge_gaps(
    graph: Graph, scratch: RepairScratch, drafts: Trails, trail: int, out: Trails, size: int
) -> int:
    """Visit the nodes of a draft in order, by safest paths over gaps; return the new size."""
    used, paths, nodes = scratch.used, scratch.paths, out.nodes
    node, kinds = start_of(graph.kinds, graph.base, trail), graph.kinds
    for i in range(drafts.offsets[trail], drafts.offsets[trail + 1]):
        head = drafts.nodes[i]
        if head < 0 or head >= graph.reward.shape[0]:
            continue
        head = layer_of(kinds, node) + origin_of(kinds, head)  # whichever kind it was meant for
        if head == node:
            continue
        arc = find_arc(graph, node, head)
        if arc >= 0 and used[arc] == trail:
            while nodes[size - 1] != head or nodes[size - 2] != node:
                size = _take_back(graph, scratch, out, size)
            node = head
            continue
        n = 1
        paths.path[0] = arc
        if arc < 0:
            n = safest_path(graph, paths, used, trail, node, head)
        for j in range(n):
            used[paths.path[j]] = trail
        if n < 0:
            continue
        start, size = size, _take_path(graph, scratch, n, out, size)
        if not graph.balanced and not leads_home(graph, paths, used, trail, head):
            while size > start:
                size = _take_back(graph, scratch, out, size)
            continue
        node = head
    return size


@helper
def _keep_prefix(
    graph: Graph, scratch: RepairScratch, drafts: Trails, trail: int, out: Trails, size: int
) -> int:
    """Take the longest valid prefix of a draft from which a way leads home; return the new size."""
    used, nodes = scratch.used, out.nodes
    start, stop = drafts.offsets[trail], drafts.offsets[trail + 1]
    node, homely = start_of(graph.kinds, graph.base, trail), size
    if start == stop or drafts.nodes[start] != node:
        return size
    for i in range(start + 1, stop):
        head = drafts.nodes[i]
        known = 0 <= head < graph.reward.shape[0]
        arc = find_arc(graph, node, head) if known else -1
        if arc < 0 or used[arc] == trail:
            break
        used[arc] = trail
        nodes[size] = node = head
        size += 1
        if graph.balanced or leads_home(graph, scratch.paths, used, trail, node):
            homely = size
    while size > homely:
        size = _take_back(graph, scratch, out, size)
    return size


@helper
def _count_changes(
    graph: Graph, drafted: OffsetArray, drafts: Trails, trail: int, out: Trails
) -> int:
    """Count the arcs that a repair added and the hops that it dropped."""
    draft, nodes, n_nodes, kinds = drafts.nodes, out.nodes, graph.reward.shape[0], graph.kinds
    start, stop = drafts.offsets[trail], drafts.offsets[trail + 1]
    begin, end = out.offsets[trail], out.offsets[trail + 1]
    for i in range(start, stop - 1):
        tail, head = draft[i], draft[i + 1]
        if 0 <= tail < n_nodes and 0 <= head < n_nodes:
            layer = layer_of(kinds, nodes[begin])
            arc = find_arc(graph, layer + origin_of(kinds, tail), layer + origin_of(kinds, head))
            if arc >= 0:
                drafted[arc] = trail
    kept = 0
    for i in range(begin, end - 1):
        arc = find_arc(graph, nodes[i], nodes[i + 1])
        kept += drafted[arc] == trail
    changes = int(max(0, stop - start - 1) - kept + (end - begin - 1) - kept)
    if changes == 0 and (stop == start or draft[start] != nodes[begin]):
        return 1  # the draft is empty, or a single node that is not the base
    return changes


@kernel
def _repair(
    graph: Graph,
    kind: int,
    scratch: RepairScratch,
    drafts: Trails,
    n_done: int,
    out: Trails,
    changes: OffsetArray,
) -> int:
    """Make valid trails out of drafts, as long as there is room to write them.

    ``n_done`` drafts have been repaired before, into ``out``. Returns how many are repaired in the
    end: fewer than all where there may be no room for the next trail of up to n_arcs + 1 nodes.
    """
    graph, scratch, drafts, out = shared(graph), shared(scratch), shared(drafts), shared(out)
    for trail in range(n_done, changes.shape[0]):
        size = out.offsets[trail]
        if size + graph.head.shape[0] + 1 > out.nodes.shape[0]:
            return trail
        out.nodes[size] = start_of(graph.kinds, graph.base, trail)
        if kind == SAFEST_PATH:
            size = _bridge_gaps(graph, scratch, drafts, trail, out, size + 1)
        else:
            size = _keep_prefix(graph, scratch, drafts, trail, out, size + 1)
        last = out.nodes[size - 1]
        n = way_home(graph, scratch.paths, scratch.used, trail, last)
        out.offsets[trail + 1] = _take_path(graph, scratch, n, out, size)
        changes[trail] = _count_changes(graph, scratch.drafted, drafts, trail, out)
    return int(changes.shape[0])


def repair(graph: Graph, kind: int, drafts: Trails) -> tuple[IntArray, OffsetArray, OffsetArray]:
    """Make valid trails out of drafts; return nodes, offsets, and the changes of each.

    With ``SAFEST_PATH`` every gap is bridged by the safest path over arcs that the trail has not
    used yet. Nodes are taken in the order of the draft. Where a hop takes an arc that the trail has
    used already, the loop in between is cut off. Nodes are left out that cannot be reached over
    unused arcs, or from which no unused arcs would lead home after the safest path to them.

    With ``TRUNCATE`` the longest valid prefix of each draft is kept. It begins at base, takes no
    missing arc and no arc twice, and leaves a way home over unused arcs.

    With kinds, nodes of a draft count as those of the kind of the robot whose trail it is. Both end
    with the safest way home. Changes are arcs added and hops dropped.
    """
    used, n_trails = np.full(graph.n_arcs, -1, np.int64), len(drafts.offsets) - 1
    scratch = RepairScratch(used, used.copy(), new_paths(graph))
    changes = np.empty(n_trails, np.int64)
    nodes, offsets = write_trails(
        n_trails,
        2 * len(drafts.nodes) + graph.n_arcs + 1,
        lambda n_done, out: _repair(graph, kind, scratch, drafts, n_done, out, changes),
    )
    return nodes, offsets, changes
