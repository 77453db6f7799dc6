"""Non-dominated plans: the iteration's Pareto set, and an archive over all iterations.

Objectives are E[R] and E[S], both to be maximised. Sets are kept by descending E[R], hence by
ascending E[S]. Plans with equal objectives but different trails all stay; a plan with the same
multiset of trails as another is dropped.
"""

from typing import NamedTuple

import numpy as np

from botohe_moo._base.types import FloatArray, IntArray, OffsetArray, SeedArray
from botohe_moo.core.compile import helper, kernel
from botohe_moo.core.rng import hash_stretch


class Batch(NamedTuple):
    """Plans that have been evaluated, ragged: E[R] and E[S] (n, 2), nodes, and offsets."""

    objectives: FloatArray
    nodes: IntArray
    offsets: OffsetArray


class Archive(NamedTuple):
    """Non-dominated plans by descending E[R]."""

    objectives: FloatArray  # E[R] and E[S] (n_plans, 2)
    hashes: SeedArray  # of each plan's multiset of trails (n_plans)
    ids: OffsetArray  # a number that no other plan ever gets (n_plans)
    # The trails, ragged.
    nodes: IntArray
    offsets: OffsetArray


def new_archive() -> Archive:
    """Return an archive without plans."""
    ids, offsets = np.empty(0, np.int64), np.zeros(1, np.int64)
    return Archive(np.empty((0, 2)), np.empty(0, np.uint64), ids, np.empty(0, np.int32), offsets)


@helper
def sort_descending(keys: FloatArray, order: OffsetArray, spare: OffsetArray, n: int) -> None:
    """Sort the first ``n`` indices in ``order`` by their keys, the largest first.

    Equal ones stay in order; the place of NaN is undefined. ``spare`` is scratch. This is a merge
    sort from the bottom up, since numpy's own sorting takes seconds to compile.
    """
    width = 1
    while width < n:
        for start in range(0, n, 2 * width):
            middle, stop = min(start + width, n), min(start + 2 * width, n)
            left, right = start, middle
            for i in range(start, stop):
                takes_right = left == middle
                if left < middle and right < stop:
                    takes_right = keys[order[right]] > keys[order[left]]
                if takes_right:
                    spare[i] = order[right]
                    right += 1
                else:
                    spare[i] = order[left]
                    left += 1
        for i in range(n):
            order[i] = spare[i]
        width *= 2


@helper
def plan_hash(batch: Batch, n_robots: int, plan: int) -> np.uint64:
    """Hash the multiset of a plan's trails to 64 bits; the order of the robots does not matter."""
    total = np.uint64(0)
    for trail in range(plan * n_robots, (plan + 1) * n_robots):
        total += hash_stretch(batch.nodes, batch.offsets[trail], batch.offsets[trail + 1])
    return total


@helper
def find_pareto_set(
    batch: Batch, n_robots: int, members: OffsetArray, spare: OffsetArray, hashes: SeedArray
) -> int:
    """Find the non-dominated plans of a batch, and each repeated plan once.

    Writes their indices, by descending E[R], to ``members``, and the hash of each one's trails to
    its place in ``hashes``. All arrays are as long as the batch. Returns how many plans there are.
    """
    objectives, n = batch.objectives, 0
    n_plans = objectives.shape[0]
    for i in range(n_plans):
        members[i] = i
    sort_descending(objectives[:, 0], members, spare, n_plans)
    best = -np.inf
    first = stop = 0
    while first < n_plans:
        reward, most = objectives[members[first], 0], -np.inf
        stop = first
        while stop < n_plans and objectives[members[stop], 0] == reward:
            most = max(most, objectives[members[stop], 1])
            stop += 1
        group = n
        for i in range(first, stop if most > best else first):
            plan = members[i]  # n ≤ i: what is overwritten is not needed any more
            if objectives[plan, 1] != most:
                continue
            members[n], hashes[plan] = plan, plan_hash(batch, n_robots, plan)
            same = group
            while hashes[members[same]] != hashes[plan]:
                same += 1
            if same == n:
                n += 1
        best = max(best, most)
        first = max(stop, first + 1)  # a reward that is NaN does not even equal itself
    return n


@helper
def _find_newcomers(
    batch: Batch,
    members: OffsetArray,
    hashes: SeedArray,
    archive: Archive,
    max_ties: int,
    newcomers: OffsetArray,
) -> int:
    """Find the plans of a batch's Pareto set that the archive neither dominates nor holds already.

    Of plans with equal objectives the archive takes up to ``max_ties``. Writes the indices of the
    plans found, and returns how many there are.
    """
    objectives, archived = batch.objectives, archive.objectives
    n = rank = ties = 0
    for i in range(members.shape[0]):
        reward, survivors = objectives[members[i], 0], objectives[members[i], 1]
        if i == 0 or reward != objectives[members[i - 1], 0]:
            ties = 0
        while rank < archived.shape[0] and archived[rank, 0] >= reward:
            rank += 1
        # Before the rank are the plans with as much reward or more; the last of them survives best.
        equal = rank
        if rank > 0 and archived[rank - 1, 1] >= survivors:
            if archived[rank - 1, 1] > survivors or archived[rank - 1, 0] > reward:
                continue
            while equal > 0 and archived[equal - 1, 0] == reward:
                equal -= 1
                if archive.hashes[equal] == hashes[members[i]]:
                    equal = -1
            if equal < 0:
                continue
        if rank - equal + ties < max_ties:
            newcomers[n] = members[i]
            n += 1
            ties += 1
    return n


@helper
def _merge_order(
    archived: FloatArray, objectives: FloatArray, newcomers: OffsetArray, order: OffsetArray
) -> int:
    """Write the order of the plans that stay and of the newcomers, by descending E[R].

    Plan i of the archive is written as i, newcomer j as −1 − j. Returns how many plans there are.
    """
    n_archived, n_new = archived.shape[0], newcomers.shape[0]
    n = i = j = as_rewarding = 0
    while i < n_archived or j < n_new:
        reward = objectives[newcomers[j], 0] if j < n_new else -np.inf
        if i < n_archived and archived[i, 0] >= reward:
            while as_rewarding < n_new and (
                objectives[newcomers[as_rewarding], 0] >= archived[i, 0]
            ):
                as_rewarding += 1
            # Only a newcomer can dominate it. Of those with as much reward or more the last one
            # survives best.
            stays = True
            if as_rewarding > 0:
                last = newcomers[as_rewarding - 1]
                more = objectives[last, 1] - archived[i, 1]
                stays = more < 0.0 or (more == 0.0 and objectives[last, 0] == archived[i, 0])
            if stays:
                order[n] = i
                n += 1
            i += 1
        else:
            order[n] = -1 - j
            n += 1
            j += 1
    return n


@helper
def _copy_plan(batch: Batch, plan: int, n_robots: int, into: Archive, row: int) -> None:
    """Copy a plan's objectives and trails to a row, behind those of the rows before."""
    offsets = batch.offsets
    for objective in range(2):
        into.objectives[row, objective] = batch.objectives[plan, objective]
    start, at = offsets[plan * n_robots], into.offsets[row * n_robots]
    for k in range(1, n_robots + 1):
        into.offsets[row * n_robots + k] = at + offsets[plan * n_robots + k] - start
    for i in range(offsets[(plan + 1) * n_robots] - start):
        into.nodes[at + i] = batch.nodes[start + i]


@kernel
def insert(
    batch: Batch, n_robots: int, archive: Archive, max_ties: int, next_id: int
) -> tuple[OffsetArray, OffsetArray, Archive]:
    """Insert the plans of a batch that an archive neither dominates nor holds.

    Their numbers begin with ``next_id``. Returns the indices of the batch's Pareto set, and those
    of the plans that are inserted, both by descending E[R], and the archive with them.
    """
    n_plans, n_archived = batch.objectives.shape[0], archive.ids.shape[0]
    members, found = np.empty(n_plans, np.int64), np.empty(n_plans, np.int64)
    hashes = np.empty(n_plans, np.uint64)
    n = find_pareto_set(batch, n_robots, members, found, hashes)
    members = members[:n]
    n_new = _find_newcomers(batch, members, hashes, archive, max_ties, found)
    newcomers = found[:n_new]
    if n_new == 0:
        return members, newcomers, archive
    order = np.empty(n_archived + n_new, np.int64)
    n = _merge_order(archive.objectives, batch.objectives, newcomers, order)
    merged = Archive(
        np.empty((n, 2)),
        np.empty(n, np.uint64),
        np.empty(n, np.int64),
        np.empty(archive.nodes.shape[0] + batch.nodes.shape[0], np.int32),
        np.empty(n * n_robots + 1, np.int64),
    )
    merged.offsets[0] = 0
    archived = Batch(archive.objectives, archive.nodes, archive.offsets)
    for row in range(n):
        plan, new = order[row], -1 - order[row]
        if plan >= 0:
            merged.hashes[row], merged.ids[row] = archive.hashes[plan], archive.ids[plan]
            _copy_plan(archived, plan, n_robots, merged, row)
        else:
            merged.hashes[row], merged.ids[row] = hashes[newcomers[new]], next_id + new
            _copy_plan(batch, newcomers[new], n_robots, merged, row)
    size = merged.offsets[n * n_robots]
    nodes = merged.nodes[:size].copy()
    return (
        members,
        newcomers,
        Archive(merged.objectives, merged.hashes, merged.ids, nodes, merged.offsets),
    )
