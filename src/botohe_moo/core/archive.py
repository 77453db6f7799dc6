"""Non-dominated plans: the iteration's Pareto set, and an archive over all iterations.

Objectives are E[R] and E[S], both to be maximised. Sets are kept by descending E[R], hence by
ascending E[S]. Plans with equal objectives but different trails all stay; a plan with the same
multiset of trails as another is dropped.
"""

from typing import NamedTuple

import numpy as np

from botohe_moo._base.types import BoolArray, FloatArray, IntArray, OffsetArray, SeedArray
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
def plan_hash(batch: Batch, n_robots: int, plan: int) -> np.uint64:
    """Hash the multiset of a plan's trails to 64 bits; the order of the robots does not matter."""
    total = np.uint64(0)
    for trail in range(plan * n_robots, (plan + 1) * n_robots):
        total += hash_stretch(batch.nodes, batch.offsets[trail], batch.offsets[trail + 1])
    return total


class Found(NamedTuple):
    """What there is in a batch; all arrays are as long as the batch."""

    # Indices of its plans by descending E[R]; ``sift`` leaves those of its Pareto set in front.
    members: OffsetArray
    newcomers: OffsetArray  # indices of those that the archive neither dominates nor holds
    hashes: SeedArray  # of the members' trails


def new_found(batch: Batch) -> Found:
    """Return the plans of a batch by descending E[R]; equal ones stay in order."""
    order, n_plans = np.argsort(-batch.objectives[:, 0], kind="stable"), len(batch.objectives)
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
    n = _find_pareto_set(batch, n_robots, found.members, found.hashes)
    return n, _find_newcomers(batch.objectives, n, archived, hashes, max_ties, found)


@helper
def _find_pareto_set(batch: Batch, n_robots: int, members: OffsetArray, hashes: SeedArray) -> int:
    """Leave the non-dominated plans in ``members``, each once; return how many there are."""
    objectives, n = batch.objectives, 0
    n_plans = objectives.shape[0]
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
    objectives: FloatArray,
    n_members: int,
    archived: FloatArray,
    hashes: SeedArray,
    max_ties: int,
    found: Found,
) -> int:
    """Write the members that the archive neither dominates nor holds; return how many there are."""
    members = found.members
    n = rank = ties = 0
    for i in range(n_members):
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
                if hashes[equal] == found.hashes[members[i]]:
                    equal = -1
            if equal < 0:
                continue
        if rank - equal + ties < max_ties:
            found.newcomers[n] = members[i]
            n += 1
            ties += 1
    return n


def survivors_of(archived: FloatArray, newcomers: FloatArray) -> BoolArray:
    """Return which plans of an archive no newcomer dominates; both are by descending E[R]."""
    rank = np.searchsorted(-newcomers[:, 0], -archived[:, 0], side="right")
    # Of the newcomers with as much reward or more the last one survives best.
    rival = np.concatenate([[[np.inf, -np.inf]], newcomers])[rank]
    stays: BoolArray = (rival[:, 1] < archived[:, 1]) | (rival == archived).all(axis=1)
    return stays
