"""Non-dominated plans: the iteration's Pareto set, and an archive over all iterations.

Objectives are E[R] and E[S], both to be maximised. Sets are kept by descending E[R], hence by
ascending E[S]. Plans with equal objectives but different trails all stay; a plan with the same
multiset of trails as another is dropped.
"""

import numpy as np

from botohe_moo._base.types import FloatArray, IntArray, OffsetArray, SeedArray
from botohe_moo.kernels.compile import kernel


@kernel
def plan_hash(nodes: IntArray, offsets: OffsetArray, n_robots: int, plan: int) -> np.uint64:
    """Hash the multiset of a plan's trails to 64 bits; the order of the robots does not matter.

    Each trail is mixed node by node and finished as in SplitMix64 (Steele, Lea and Flood, "Fast
    splittable pseudorandom number generators", OOPSLA 2014); the plan's hash is their sum.
    """
    total = np.uint64(0)
    for trail in range(plan * n_robots, (plan + 1) * n_robots):
        mixed = np.uint64(0x9E3779B97F4A7C15)
        for i in range(offsets[trail], offsets[trail + 1]):
            mixed = (mixed ^ np.uint64(nodes[i])) * np.uint64(0xBF58476D1CE4E5B9)
            mixed ^= mixed >> np.uint64(29)
        mixed = (mixed ^ (mixed >> np.uint64(30))) * np.uint64(0xBF58476D1CE4E5B9)
        mixed = (mixed ^ (mixed >> np.uint64(27))) * np.uint64(0x94D049BB133111EB)
        total += mixed ^ (mixed >> np.uint64(31))
    return total


@kernel
def pareto_set(
    objectives: FloatArray, nodes: IntArray, offsets: OffsetArray, n_robots: int
) -> tuple[OffsetArray, SeedArray]:
    """Find the non-dominated plans of a batch, repeated plans once.

    Returns
    -------
    tuple
        Their indices by descending E[R], and their hashes.
    """
    order = np.argsort(-objectives[:, 0])
    members = np.empty(len(order), np.int64)
    hashes = np.empty(len(order), np.uint64)
    n = 0
    best = -np.inf
    at = 0
    while at < len(order):
        reward = objectives[order[at], 0]
        end = at
        group_best = -np.inf
        while end < len(order) and objectives[order[end], 0] == reward:
            group_best = max(group_best, objectives[order[end], 1])
            end += 1
        if group_best > best:
            best = group_best
            group = n
            for i in range(at, end):
                plan = order[i]
                if objectives[plan, 1] != best:
                    continue
                value = plan_hash(nodes, offsets, n_robots, plan)
                known = False
                for j in range(group, n):
                    if hashes[j] == value:
                        known = True
                        break
                if not known:
                    members[n] = plan
                    hashes[n] = value
                    n += 1
        at = max(end, at + 1)
    return members[:n], hashes[:n]


@kernel
def newcomers(
    objectives: FloatArray,
    members: OffsetArray,
    hashes: SeedArray,
    archived: FloatArray,
    archived_hashes: SeedArray,
    max_ties: int,
) -> OffsetArray:
    """Tell which of a batch's Pareto set the archive neither dominates nor holds already.

    Of plans with equal objectives those that would be more than ``max_ties`` are left out.

    Returns
    -------
    numpy.ndarray
        Positions in ``members``, ascending.
    """
    found = np.empty(len(members), np.int64)
    n = 0
    n_archived = len(archived)
    rank = ties = 0
    for i in range(len(members)):
        reward, survivors = objectives[members[i], 0], objectives[members[i], 1]
        if i == 0 or reward != objectives[members[i - 1], 0]:
            ties = 0
        while rank < n_archived and archived[rank, 0] >= reward:
            rank += 1
        if rank > 0:
            if archived[rank - 1, 1] > survivors:
                continue
            if archived[rank - 1, 1] == survivors:
                if archived[rank - 1, 0] > reward:
                    continue
                known = False
                j = rank - 1
                while j >= 0 and archived[j, 0] == reward:
                    known = known or archived_hashes[j] == hashes[i]
                    j -= 1
                if known or ties + rank - 1 - j >= max_ties:
                    continue
        if ties < max_ties:
            found[n] = i
            n += 1
            ties += 1
    return found[:n]


@kernel
def merge(
    objectives: FloatArray,
    members: OffsetArray,
    hashes: SeedArray,
    nodes: IntArray,
    offsets: OffsetArray,
    n_robots: int,
    archived: FloatArray,
    archived_hashes: SeedArray,
    archived_ids: OffsetArray,
    archived_nodes: IntArray,
    archived_offsets: OffsetArray,
    next_id: int,
) -> tuple[FloatArray, SeedArray, OffsetArray, IntArray, OffsetArray]:
    """Take ``members``, none of which the archive dominates, into the archive.

    Returns
    -------
    tuple
        The archive's objectives, hashes, ids (newcomers count on from ``next_id`` in the order
        of ``members``), nodes and offsets; new arrays, compact, by descending E[R].
    """
    n_archived, n_new = len(archived), len(members)
    sources = np.empty(n_archived + n_new, np.int64)  # archived i as i, newcomer j as -1 - j
    n = 0
    best = -np.inf
    i = j = 0
    size = 0
    while i < n_archived or j < n_new:
        if j == n_new or (i < n_archived and archived[i, 0] >= objectives[members[j], 0]):
            # Only newcomers can dominate: those of more reward are in already, those of equal
            # reward are the next ones.
            k = j
            beaten = archived[i, 1] <= best
            while k < n_new and objectives[members[k], 0] >= archived[i, 0]:
                beaten = beaten or objectives[members[k], 1] > archived[i, 1]
                k += 1
            if not beaten:
                sources[n] = i
                size += archived_offsets[(i + 1) * n_robots] - archived_offsets[i * n_robots]
                n += 1
            i += 1
        else:
            plan = members[j]
            best = max(best, objectives[plan, 1])
            sources[n] = -1 - j
            size += offsets[(plan + 1) * n_robots] - offsets[plan * n_robots]
            n += 1
            j += 1

    new_objectives = np.empty((n, 2))
    new_hashes = np.empty(n, np.uint64)
    new_ids = np.empty(n, np.int64)
    new_nodes = np.empty(size, np.int32)
    new_offsets = np.zeros(n * n_robots + 1, np.int64)
    at = 0
    for row in range(n):
        source = sources[row]
        if source >= 0:
            plan = source
            new_objectives[row] = archived[plan]
            new_hashes[row] = archived_hashes[plan]
            new_ids[row] = archived_ids[plan]
            from_nodes, cuts = archived_nodes, archived_offsets
        else:
            plan = members[-1 - source]
            new_objectives[row] = objectives[plan]
            new_hashes[row] = hashes[-1 - source]
            new_ids[row] = next_id - 1 - source
            from_nodes, cuts = nodes, offsets
        start = cuts[plan * n_robots]
        for k in range(n_robots):
            new_offsets[row * n_robots + k + 1] = at + cuts[plan * n_robots + k + 1] - start
        for position in range(start, cuts[(plan + 1) * n_robots]):
            new_nodes[at] = from_nodes[position]
            at += 1
    return new_objectives, new_hashes, new_ids, new_nodes, new_offsets


@kernel
def absorb(
    objectives: FloatArray,
    nodes: IntArray,
    offsets: OffsetArray,
    n_robots: int,
    archived: FloatArray,
    archived_hashes: SeedArray,
    archived_ids: OffsetArray,
    archived_nodes: IntArray,
    archived_offsets: OffsetArray,
    next_id: int,
    max_ties: int,
) -> tuple[OffsetArray, OffsetArray, FloatArray, SeedArray, OffsetArray, IntArray, OffsetArray]:
    """Find a batch's Pareto set and take into the archive what belongs there.

    Returns
    -------
    tuple
        The Pareto set's indices, those of the plans that entered the archive, and the archive as
        in ``merge`` (the same arrays when nothing entered).
    """
    members, hashes = pareto_set(objectives, nodes, offsets, n_robots)
    entering = newcomers(objectives, members, hashes, archived, archived_hashes, max_ties)
    if len(entering) > 0:
        (
            archived,
            archived_hashes,
            archived_ids,
            archived_nodes,
            archived_offsets,
        ) = merge(
            objectives,
            members[entering],
            hashes[entering],
            nodes,
            offsets,
            n_robots,
            archived,
            archived_hashes,
            archived_ids,
            archived_nodes,
            archived_offsets,
            next_id,
        )
    return (
        members,
        members[entering],
        archived,
        archived_hashes,
        archived_ids,
        archived_nodes,
        archived_offsets,
    )
