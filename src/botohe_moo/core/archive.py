"""Non-dominated plans: the iteration's Pareto set, and an archive over all iterations.

Objectives are E[R] and E[S], both to be maximised. Sets are kept by descending E[R], hence by
ascending E[S]. Plans with equal objectives but different trails all stay; a plan with the same
multiset of trails as another is dropped.
"""

from typing import NamedTuple

import numpy as np

from botohe_moo._base.types import FloatArray, IntArray, OffsetArray, SeedArray
from botohe_moo.core.compile import helper, inlined, kernel
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
def plan_hash(batch: Batch, n_robots: int, plan: int) -> np.uint64:
    """Hash the multiset of a plan's trails to 64 bits; the order of the robots does not matter."""
    total = np.uint64(0)
    for trail in range(plan * n_robots, (plan + 1) * n_robots):
        total += hash_stretch(batch.nodes, batch.offsets[trail], batch.offsets[trail + 1])
    return total


class Found(NamedTuple):
    """What there is in a batch; all arrays are as long as the batch."""

    # Indices of its plans by descending E[R], then E[S]; ``sift`` leaves those of its Pareto set in
    # front.
    members: OffsetArray
    newcomers: OffsetArray  # indices of those that the archive neither dominates nor holds
    hashes: SeedArray  # of the members' trails


def new_found(batch: Batch) -> Found:
    """Return the plans of a batch by descending E[R], then E[S]; equal ones stay in order."""
    n_plans, (rewards, survivors) = len(batch.objectives), batch.objectives.T
    order = np.lexsort((-survivors, -rewards))
    return Found(order, np.empty(n_plans, np.int64), np.empty(n_plans, np.uint64))


@kernel
def sift(
    batch: Batch,
    n_robots: int,
    archived: FloatArray,
    hashes: SeedArray,
    max_ties: int,
    found: Found,
) -> tuple[int, int]:
    """Find the Pareto set of a batch, each plan once, and what of it is new to an archive.

    The archive has the objectives ``archived``, by descending E[R], and the ``hashes``. Of plans
    with equal objectives it takes up to ``max_ties``. Returns how many members and newcomers there
    are.
    """
    objectives, members, newcomers = batch.objectives, found.members, found.newcomers
    best, rank = -np.inf, 0
    n = n_new = first = first_new = 0  # the first ones are those with the objectives of the last
    for i in range(members.shape[0]):
        plan = members[i]  # n ≤ i: what is overwritten is not needed any more
        reward, survivors = objectives[plan, 0], objectives[plan, 1]
        if survivors > best and reward > -np.inf:  # it is not if it is NaN
            best, first, first_new = survivors, n, n_new
        elif n == first or survivors != best or reward != objectives[members[first], 0]:
            continue
        own, same = plan_hash(batch, n_robots, plan), first
        while same < n and found.hashes[members[same]] != own:
            same += 1
        if same < n:
            continue
        members[n], found.hashes[plan] = plan, own
        n += 1
        while rank < archived.shape[0] and archived[rank, 0] >= reward:
            rank += 1
        n_ties = _n_ties(archived, hashes, rank, reward, survivors, own)
        if n_ties >= 0 and n_ties + n_new - first_new < max_ties:
            newcomers[n_new] = plan
            n_new += 1
    return n, n_new


@inlined
def _n_ties(
    archived: FloatArray,
    hashes: SeedArray,
    rank: int,
    reward: float,
    survivors: float,
    own: np.uint64,
) -> int:
    """Return how many plans of an archive have the objectives of a new one, whose hash is ``own``.

    ``rank`` plans have as much reward or more; the last of them survives best. The result is −1
    where one of them dominates the new plan, or is the same.
    """
    n, last = 0, rank - 1
    if last < 0 or archived[last, 1] < survivors:
        return 0
    if archived[last, 1] > survivors or archived[last, 0] > reward:
        return -1
    while n <= last and archived[last - n, 0] == reward:
        if hashes[last - n] == own:
            return -1
        n += 1
    return n


@kernel
def merged(
    archive: Archive, batch: Batch, hashes: SeedArray, newcomers: OffsetArray, first_id: int
) -> Archive:
    """Return an archive with newcomers of a batch, by descending E[R], less what they dominate."""
    objectives, archived, n_old = batch.objectives, archive.objectives, archive.ids.shape[0]
    room, n_robots = n_old + newcomers.shape[0], (batch.offsets.shape[0] - 1) // len(objectives)
    into = Archive(
        np.empty((room, 2)),
        np.empty(room, np.uint64),
        np.empty(room, np.int64),
        np.empty(archive.nodes.shape[0] + batch.nodes.shape[0], np.int32),
        np.zeros(room * n_robots + 1, np.int64),
    )
    n = old = new = 0
    reward, survivors = np.inf, -np.inf  # of the last newcomer, which survives best so far
    while old < n_old or new < newcomers.shape[0]:
        plan = newcomers[min(new, newcomers.shape[0] - 1)]
        if old == n_old or (new < newcomers.shape[0] and objectives[plan, 0] >= archived[old, 0]):
            reward, survivors = objectives[plan, 0], objectives[plan, 1]
            into.hashes[n], into.ids[n] = hashes[plan], first_id + new
            _append(into, n, n_robots, batch, plan)
            n, new = n + 1, new + 1
            continue
        is_same = survivors == archived[old, 1] and reward == archived[old, 0]
        if survivors < archived[old, 1] or is_same:
            into.hashes[n], into.ids[n] = archive.hashes[old], archive.ids[old]
            _append(into, n, n_robots, archive, old)
            n += 1
        old += 1
    offsets = into.offsets[: n * n_robots + 1]
    nodes = into.nodes[: offsets[n * n_robots]]
    return Archive(into.objectives[:n], into.hashes[:n], into.ids[:n], nodes, offsets)


@inlined
def _append(into: Archive, n: int, n_robots: int, plans: Batch | Archive, plan: int) -> None:
    """Write objectives and trails of a plan behind ``n`` others."""
    for k in range(2):
        into.objectives[n, k] = plans.objectives[plan, k]
    for robot in range(n_robots):
        trail, place = plan * n_robots + robot, n * n_robots + robot
        start, stop = plans.offsets[trail], plans.offsets[trail + 1]
        into.offsets[place + 1] = into.offsets[place] + stop - start
        for i in range(stop - start):
            into.nodes[into.offsets[place] + i] = plans.nodes[start + i]
