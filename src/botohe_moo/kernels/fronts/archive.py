"""Non-dominated plans: the iteration's Pareto set, and an archive over all iterations.

Objectives are E[R] and E[S], both to be maximised. Sets are kept by descending E[R], hence by
ascending E[S]. Plans with equal objectives but different trails all stay; a plan with the same
multiset of trails as another is dropped.
"""

from typing import NamedTuple

import numpy as np

from botohe_moo._base.types import FloatArray, IntArray, OffsetArray, SeedArray
from botohe_moo.kernels.compile import helper, kernel
from botohe_moo.kernels.rng import mixed


class Batch(NamedTuple):
    """Plans that have been evaluated, ragged: E[R] and E[S] (n, 2), nodes, and offsets."""

    objectives: FloatArray
    nodes: IntArray
    offsets: OffsetArray


class Archive(NamedTuple):
    """Non-dominated plans by descending E[R].

    Attributes
    ----------
    objectives
        E[R] and E[S] (n_plans, 2).
    hashes
        Of each plan's multiset of trails (n_plans).
    ids
        A number that no other plan ever gets (n_plans).
    nodes, offsets
        The trails, ragged.
    """

    objectives: FloatArray
    hashes: SeedArray
    ids: OffsetArray
    nodes: IntArray
    offsets: OffsetArray


def new_archive() -> Archive:
    """Make an archive without plans."""
    ids, offsets = np.empty(0, np.int64), np.zeros(1, np.int64)
    return Archive(np.empty((0, 2)), np.empty(0, np.uint64), ids, np.empty(0, np.int32), offsets)


@helper
def plan_hash(batch: Batch, n_robots: int, plan: int) -> np.uint64:
    """Hash the multiset of a plan's trails to 64 bits; the order of the robots does not matter."""
    total = np.uint64(0)
    for trail in range(plan * n_robots, (plan + 1) * n_robots):
        bits = np.uint64(0x9E3779B97F4A7C15)
        for i in range(batch.offsets[trail], batch.offsets[trail + 1]):
            bits = (bits ^ np.uint64(batch.nodes[i])) * np.uint64(0xBF58476D1CE4E5B9)
            bits ^= bits >> np.uint64(29)
        total += mixed(bits)
    return total


@helper
def _is_repeated(hashes: SeedArray, start: int, stop: int) -> bool:
    """Tell whether the hash at ``stop`` is one of those from ``start`` on before it."""
    for i in range(start, stop):  # noqa: SIM110 - any() would make a generator
        if hashes[i] == hashes[stop]:
            return True
    return False


@helper(makes_arrays=True)
def pareto_set(batch: Batch, n_robots: int) -> tuple[OffsetArray, SeedArray]:
    """Find the non-dominated plans of a batch, repeated plans once.

    Returns
    -------
    tuple
        Their indices by descending E[R], and their hashes.
    """
    objectives = batch.objectives
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
                if objectives[order[i], 1] != best:
                    continue
                members[n], hashes[n] = order[i], plan_hash(batch, n_robots, order[i])
                n += not _is_repeated(hashes, group, n)
        at = max(end, at + 1)
    return members[:n], hashes[:n]


@helper(makes_arrays=True)
def newcomers(
    batch: Batch, members: OffsetArray, hashes: SeedArray, archive: Archive, max_ties: int
) -> OffsetArray:
    """Tell which of a batch's Pareto set the archive neither dominates nor holds already.

    Of plans with equal objectives those that would be more than ``max_ties`` are left out.

    Returns
    -------
    numpy.ndarray
        Positions in ``members``, ascending.
    """
    objectives, archived = batch.objectives, archive.objectives
    found = np.empty(len(members), np.int64)
    n = 0
    rank = ties = 0
    for i in range(len(members)):
        reward, survivors = objectives[members[i], 0], objectives[members[i], 1]
        if i == 0 or reward != objectives[members[i - 1], 0]:
            ties = 0
        while rank < len(archived) and archived[rank, 0] >= reward:
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
                    known = known or archive.hashes[j] == hashes[i]
                    j -= 1
                if known or ties + rank - 1 - j >= max_ties:
                    continue
        if ties < max_ties:
            found[n] = i
            n += 1
            ties += 1
    return found[:n]


@helper(makes_arrays=True)
def _merge_order(archived: FloatArray, entering: FloatArray) -> OffsetArray:
    """Give the order of the plans that stay and those that enter, by descending E[R].

    Plan i of the archive as i, newcomer j as −1 − j.
    """
    n_archived, n_new = len(archived), len(entering)
    sources = np.empty(n_archived + n_new, np.int64)
    n = 0
    best = -np.inf
    i = j = 0
    while i < n_archived or j < n_new:
        if j == n_new or (i < n_archived and archived[i, 0] >= entering[j, 0]):
            # Only newcomers can dominate: those of more reward are in already, those of equal
            # reward are the next ones.
            k = j
            beaten = archived[i, 1] <= best
            while k < n_new and entering[k, 0] >= archived[i, 0]:
                beaten = beaten or entering[k, 1] > archived[i, 1]
                k += 1
            if not beaten:
                sources[n] = i
                n += 1
            i += 1
        else:
            best = max(best, entering[j, 1])
            sources[n] = -1 - j
            n += 1
            j += 1
    return sources[:n]


@helper(makes_arrays=True)
def merge(
    batch: Batch,
    members: OffsetArray,
    hashes: SeedArray,
    n_robots: int,
    archive: Archive,
    next_id: int,
) -> Archive:
    """Take ``members``, none of which the archive dominates, into the archive.

    Newcomers are numbered on from ``next_id`` in the order of ``members``.
    """
    sources = _merge_order(archive.objectives, batch.objectives[members])
    n = len(sources)
    size = 0
    for source in sources:
        plan = source if source >= 0 else members[-1 - source]
        cuts = archive.offsets if source >= 0 else batch.offsets
        size += cuts[(plan + 1) * n_robots] - cuts[plan * n_robots]
    objectives, new_hashes = np.empty((n, 2)), np.empty(n, np.uint64)
    ids, nodes = np.empty(n, np.int64), np.empty(size, np.int32)
    offsets = np.zeros(n * n_robots + 1, np.int64)
    at = 0
    for row in range(n):
        source = sources[row]
        if source >= 0:
            plan = source
            objectives[row], new_hashes[row] = archive.objectives[plan], archive.hashes[plan]
            ids[row] = archive.ids[plan]
            from_nodes, cuts = archive.nodes, archive.offsets
        else:
            plan = members[-1 - source]
            objectives[row], new_hashes[row] = batch.objectives[plan], hashes[-1 - source]
            ids[row] = next_id - 1 - source
            from_nodes, cuts = batch.nodes, batch.offsets
        start = cuts[plan * n_robots]
        for k in range(n_robots):
            offsets[row * n_robots + k + 1] = at + cuts[plan * n_robots + k + 1] - start
        for position in range(start, cuts[(plan + 1) * n_robots]):
            nodes[at] = from_nodes[position]
            at += 1
    return Archive(objectives, new_hashes, ids, nodes, offsets)


@kernel
def absorb(
    batch: Batch, n_robots: int, archive: Archive, next_id: int, max_ties: int
) -> tuple[OffsetArray, OffsetArray, Archive]:
    """Find a batch's Pareto set and take into the archive what belongs there.

    Returns
    -------
    tuple
        The Pareto set's indices, those of the plans that entered the archive, and the archive: the
        same one when nothing entered, otherwise in new arrays.
    """
    members, hashes = pareto_set(batch, n_robots)
    entering = newcomers(batch, members, hashes, archive, max_ties)
    if len(entering) > 0:
        archive = merge(batch, members[entering], hashes[entering], n_robots, archive, next_id)
    return members, members[entering], archive
