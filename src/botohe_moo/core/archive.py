"""Non-dominated plans: the iteration's Pareto set, and an archive over all iterations.

Objectives are E[R] and E[S], both to be maximised. Sets are kept by descending E[R], hence by
ascending E[S]. Plans with equal objectives but different trails all stay; a plan with the same
multiset of trails as another is dropped.
"""

from typing import NamedTuple

import numpy as np

from botohe_moo._base.types import BoolArray, FloatArray, IntArray, OffsetArray, SeedArray
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


def survivors_of(archived: FloatArray, newcomers: FloatArray) -> BoolArray:
    """Return which plans of an archive no newcomer dominates; both are by descending E[R]."""
    rank = np.searchsorted(-newcomers[:, 0], -archived[:, 0], side="right")
    # Of the newcomers with as much reward or more the last one survives best.
    rival = np.concatenate([[[np.inf, -np.inf]], newcomers])[rank]
    stays: BoolArray = (rival[:, 1] < archived[:, 1]) | (rival == archived).all(axis=1)
    return stays
