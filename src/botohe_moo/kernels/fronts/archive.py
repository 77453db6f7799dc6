"""Non-dominated plans: the iteration's Pareto set, and an archive over all iterations.

Objectives are E[R] and E[S], both to be maximised. Sets are kept by descending E[R], hence by
ascending E[S]. Plans with equal objectives but different trails all stay; a plan with the same
multiset of trails as another is dropped.
"""

from typing import NamedTuple

import numpy as np

from botohe_moo._base.types import FloatArray, IntArray, OffsetArray, SeedArray
from botohe_moo.kernels.compile import helper, kernel
from botohe_moo.kernels.plans.order import sort_descending
from botohe_moo.kernels.rng import mixed


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


class Newcomers(NamedTuple):
    """Plans that enter an archive, by descending E[R], and the hashes of their trails."""

    plans: OffsetArray
    hashes: SeedArray


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

    Gives their indices by descending E[R], and their hashes.
    """
    objectives = batch.objectives
    order, members = np.empty(len(objectives), np.int64), np.empty(len(objectives), np.int64)
    for i in range(len(order)):  # np.arange takes longer to compile
        order[i] = i
    sort_descending(objectives[:, 0], order, members, len(order))
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


@helper
def _has_place(
    archive: Archive, rank: int, reward: float, survivors: float, hashed: np.uint64
) -> int:
    """Tell whether an archive has a place for a plan behind the first ``rank``.

    Gives how many plans it holds with the same objectives; −1 where one dominates the plan, or is
    the same.
    """
    archived = archive.objectives
    if rank == 0 or archived[rank - 1, 1] < survivors:
        return 0
    if archived[rank - 1, 1] > survivors or archived[rank - 1, 0] > reward:
        return -1
    first = rank
    while first > 0 and archived[first - 1, 0] == reward:
        first -= 1
        if archive.hashes[first] == hashed:
            return -1
    return rank - first


@helper(makes_arrays=True)
def find_newcomers(
    batch: Batch, members: OffsetArray, hashes: SeedArray, archive: Archive, max_ties: int
) -> Newcomers:
    """Find those of a batch's Pareto set that the archive neither dominates nor holds already.

    Of plans with equal objectives those that would be more than ``max_ties`` are left out.
    """
    objectives, n_archived = batch.objectives, len(archive.ids)
    plans, found = np.empty(len(members), np.int64), np.empty(len(members), np.uint64)
    n = rank = ties = 0
    for i in range(len(members)):
        reward, survivors = objectives[members[i], 0], objectives[members[i], 1]
        if i == 0 or reward != objectives[members[i - 1], 0]:
            ties = 0
        while rank < n_archived and archive.objectives[rank, 0] >= reward:
            rank += 1
        n_held = _has_place(archive, rank, reward, survivors, hashes[i])
        if n_held >= 0 and n_held + ties < max_ties:
            plans[n], found[n] = members[i], hashes[i]
            n += 1
            ties += 1
    return Newcomers(plans[:n], found[:n])


@helper(makes_arrays=True)
def _merge_order(archived: FloatArray, objectives: FloatArray, plans: OffsetArray) -> OffsetArray:
    """Give the order of the plans that stay and those that enter, by descending E[R].

    Plan i of the archive as i, newcomer j as −1 − j.
    """
    n_archived, n_new = len(archived), len(plans)
    sources = np.empty(n_archived + n_new, np.int64)
    n = 0
    best = -np.inf
    i = j = 0
    while i < n_archived or j < n_new:
        if j == n_new or (i < n_archived and archived[i, 0] >= objectives[plans[j], 0]):
            # Only newcomers can dominate: those of more reward are in already, those of equal
            # reward are the next ones.
            k = j
            beaten = archived[i, 1] <= best
            while k < n_new and objectives[plans[k], 0] >= archived[i, 0]:
                beaten = beaten or objectives[plans[k], 1] > archived[i, 1]
                k += 1
            if not beaten:
                sources[n] = i
                n += 1
            i += 1
        else:
            best = max(best, objectives[plans[j], 1])
            sources[n] = -1 - j
            n += 1
            j += 1
    return sources[:n]


@helper
def _copy_plan(
    objectives: FloatArray,
    nodes: IntArray,
    offsets: OffsetArray,
    plan: int,
    n_robots: int,
    into: Archive,
    row: int,
) -> None:
    """Copy a plan's objectives and trails to a row, behind those of the rows before."""
    into.objectives[row, 0], into.objectives[row, 1] = objectives[plan, 0], objectives[plan, 1]
    start, at = offsets[plan * n_robots], into.offsets[row * n_robots]
    for k in range(1, n_robots + 1):
        into.offsets[row * n_robots + k] = at + offsets[plan * n_robots + k] - start
    for i in range(offsets[(plan + 1) * n_robots] - start):
        into.nodes[at + i] = nodes[start + i]


@kernel
def merge(
    batch: Batch, newcomers: Newcomers, n_robots: int, archive: Archive, next_id: int
) -> Archive:
    """Take newcomers, none of which the archive dominates, into a new archive.

    They are numbered on from ``next_id`` in their order.
    """
    sources = _merge_order(archive.objectives, batch.objectives, newcomers.plans)
    n = len(sources)
    size = 0
    for i in range(n):
        plan = sources[i]
        cuts = archive.offsets
        if plan < 0:
            plan, cuts = newcomers.plans[-1 - plan], batch.offsets
        size += cuts[(plan + 1) * n_robots] - cuts[plan * n_robots]
    merged = Archive(
        np.empty((n, 2)),
        np.empty(n, np.uint64),
        np.empty(n, np.int64),
        np.empty(size, np.int32),
        np.empty(n * n_robots + 1, np.int64),
    )
    merged.offsets[0] = 0
    for row in range(n):
        plan, new = sources[row], -1 - sources[row]
        if plan >= 0:
            merged.hashes[row], merged.ids[row] = archive.hashes[plan], archive.ids[plan]
            known = archive.objectives, archive.nodes, archive.offsets
            _copy_plan(*known, plan, n_robots, merged, row)
        else:
            merged.hashes[row], merged.ids[row] = newcomers.hashes[new], next_id + new
            known = batch.objectives, batch.nodes, batch.offsets
            _copy_plan(*known, newcomers.plans[new], n_robots, merged, row)
    return merged


@kernel
def screen(
    batch: Batch, n_robots: int, archive: Archive, max_ties: int
) -> tuple[OffsetArray, Newcomers]:
    """Find a batch's Pareto set, and what of it belongs into the archive.

    Gives the indices of the set, and the newcomers. Apart from ``merge``, for most iterations of a
    long run find none, and handing an archive back to Python takes longer than screening.
    """
    members, hashes = pareto_set(batch, n_robots)
    return members, find_newcomers(batch, members, hashes, archive, max_ties)
