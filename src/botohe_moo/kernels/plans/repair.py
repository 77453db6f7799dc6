"""Valid closed trails out of arbitrary sequences of nodes."""

import numpy as np

from botohe_moo._base.types import FloatArray, IntArray, OffsetArray
from botohe_moo.kernels.colony.construct import leads_home
from botohe_moo.kernels.compile import kernel
from botohe_moo.kernels.graph.old_paths import safest_path, way_home
from botohe_moo.kernels.plans.evaluate import find_arc


@kernel
def _grown(array: IntArray, size: int) -> IntArray:
    larger = np.empty(max(size, 2 * array.shape[0]), np.int32)
    larger[: array.shape[0]] = array
    return larger


@kernel
def _count_changes(
    first: OffsetArray,
    head: IntArray,
    draft: IntArray,
    start: int,
    stop: int,
    nodes: IntArray,
    begin: int,
    end: int,
    drafted: OffsetArray,
    trail: int,
) -> int:
    """Count the arcs that a repair added and the hops it dropped."""
    n_nodes = first.shape[0] - 1
    for i in range(start, stop - 1):
        if 0 <= draft[i] < n_nodes and 0 <= draft[i + 1] < n_nodes:
            arc = find_arc(first, head, draft[i], draft[i + 1])
            if arc >= 0:
                drafted[arc] = trail
    kept = 0
    for i in range(begin, end - 1):
        kept += drafted[find_arc(first, head, nodes[i], nodes[i + 1])] == trail
    hops = max(0, stop - start - 1)
    changes = hops - kept + (end - begin - 1) - kept
    if changes == 0 and (stop == start or draft[start] != nodes[begin]):
        return 1  # a single node that is not the base, or none
    return changes


@kernel
def repair_safest(
    first: OffsetArray,
    tail: IntArray,
    head: IntArray,
    cost: FloatArray,
    homeward: IntArray,
    base: int,
    balanced: bool,
    draft: IntArray,
    draft_offsets: OffsetArray,
    nodes: IntArray,
    offsets: OffsetArray,
    changes: OffsetArray,
) -> tuple[IntArray, int]:
    """Bridge every gap by the safest path over arcs that the trail has not used yet.

    Nodes are taken in the order of the draft. A hop along an arc that the trail has used already
    cuts off the loop in between. A node is left out that cannot be reached over unused arcs, or
    from which, once the safest path leads there, none would lead home. At the end the trail takes
    the safest way home.

    Parameters
    ----------
    first, tail, head, cost, homeward, base, balanced
        The walk graph (see ``WalkGraph``).
    draft, draft_offsets
        Sequences of any integers, ragged.
    nodes
        Where to write; a larger array takes its place when it is full.
    offsets
        Output: where each trail begins in ``nodes``, and their length at the end.
    changes
        Output (n_trails): arcs added and hops dropped.

    Returns
    -------
    tuple
        The nodes of the trails one after another, and how many there are; the array may be longer.
    """
    n_nodes, n_arcs = first.shape[0] - 1, head.shape[0]
    used = np.full(n_arcs, -1, np.int64)
    drafted = np.full(n_arcs, -1, np.int64)
    met, distance = np.full(n_nodes, -1, np.int64), np.empty(n_nodes)
    entry, path = np.empty(n_nodes, np.int32), np.empty(n_nodes, np.int32)
    keys, held = np.empty(n_arcs + 1), np.empty(n_arcs + 1, np.int32)
    stack = np.empty(n_nodes, np.int32)
    search = size = 0
    for trail in range(len(draft_offsets) - 1):
        if size + n_arcs + 1 > nodes.shape[0]:
            nodes = _grown(nodes, size + n_arcs + 1)
        begin = size
        offsets[trail] = begin
        nodes[size] = base
        size += 1
        here = base
        for i in range(draft_offsets[trail], draft_offsets[trail + 1]):
            there = draft[i]
            if there == here or there < 0 or there >= n_nodes:
                continue
            arc = find_arc(first, head, here, there)
            if arc >= 0 and used[arc] == trail:
                while nodes[size - 1] != there or nodes[size - 2] != here:
                    size -= 1
                    used[find_arc(first, head, nodes[size - 1], nodes[size])] = -1
                here = there
                continue
            n = 1
            path[0] = arc
            if arc < 0:
                search += 1
                n = safest_path(
                    first,
                    tail,
                    head,
                    cost,
                    used,
                    trail,
                    here,
                    there,
                    search,
                    met,
                    distance,
                    entry,
                    keys,
                    held,
                    path,
                )
            for j in range(n):
                used[path[j]] = trail
            if n > 0 and not balanced:
                search += 1
                if not leads_home(
                    first, head, homeward, base, there, used, trail, met, search, stack
                ):
                    for j in range(n):
                        used[path[j]] = -1
                    continue
            for j in range(n):
                nodes[size] = head[path[j]]
                size += 1
                here = there
        search += 1
        n = way_home(
            first,
            tail,
            head,
            cost,
            homeward,
            base,
            used,
            trail,
            here,
            search,
            met,
            distance,
            entry,
            keys,
            held,
            path,
        )
        for j in range(n):
            nodes[size] = head[path[j]]
            size += 1
        changes[trail] = _count_changes(
            first,
            head,
            draft,
            draft_offsets[trail],
            draft_offsets[trail + 1],
            nodes,
            begin,
            size,
            drafted,
            trail,
        )
    offsets[len(draft_offsets) - 1] = size
    return nodes, size


@kernel
def repair_truncate(
    first: OffsetArray,
    tail: IntArray,
    head: IntArray,
    cost: FloatArray,
    homeward: IntArray,
    base: int,
    balanced: bool,
    draft: IntArray,
    draft_offsets: OffsetArray,
    nodes: IntArray,
    offsets: OffsetArray,
    changes: OffsetArray,
) -> tuple[IntArray, int]:
    """Keep the longest valid prefix of each draft and take the safest way home.

    Valid is what begins at base, takes arcs that there are, each once, and leaves a way home over
    arcs it has not taken. Parameters and result are those of ``repair_safest``.
    """
    n_nodes, n_arcs = first.shape[0] - 1, head.shape[0]
    used = np.full(n_arcs, -1, np.int64)
    drafted = np.full(n_arcs, -1, np.int64)
    met, distance = np.full(n_nodes, -1, np.int64), np.empty(n_nodes)
    entry, path = np.empty(n_nodes, np.int32), np.empty(n_nodes, np.int32)
    keys, held = np.empty(n_arcs + 1), np.empty(n_arcs + 1, np.int32)
    stack = np.empty(n_nodes, np.int32)
    search = size = 0
    for trail in range(len(draft_offsets) - 1):
        if size + n_arcs + 1 > nodes.shape[0]:
            nodes = _grown(nodes, size + n_arcs + 1)
        start, stop = draft_offsets[trail], draft_offsets[trail + 1]
        begin = size
        offsets[trail] = begin
        nodes[size] = base
        size += 1
        here = base
        homely = size  # the longest prefix so far from which a way leads home
        for i in range(start + 1, stop if stop > start and draft[start] == base else start):
            there = draft[i]
            known = 0 <= there < n_nodes and there != here  # the base's self-loop is no hop
            arc = find_arc(first, head, here, there) if known else -1
            if arc < 0 or used[arc] == trail:
                break
            used[arc] = trail
            nodes[size] = here = there
            size += 1
            search += 1
            if balanced or leads_home(
                first, head, homeward, base, here, used, trail, met, search, stack
            ):
                homely = size
        while size > homely:
            size -= 1
            used[find_arc(first, head, nodes[size - 1], nodes[size])] = -1
        here = nodes[size - 1]
        search += 1
        n = way_home(
            first,
            tail,
            head,
            cost,
            homeward,
            base,
            used,
            trail,
            here,
            search,
            met,
            distance,
            entry,
            keys,
            held,
            path,
        )
        for j in range(n):
            nodes[size] = head[path[j]]
            size += 1
        changes[trail] = _count_changes(
            first, head, draft, start, stop, nodes, begin, size, drafted, trail
        )
    offsets[len(draft_offsets) - 1] = size
    return nodes, size
