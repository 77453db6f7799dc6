"""Non-dominated plans: the iteration's Pareto set, and an archive over all iterations.

Objectives are E[R] and E[S], both to be maximised. Sets are kept by descending E[R], hence by
ascending E[S]. Plans with equal objectives but different trails all stay; a plan with the same
multiset of trails as another is dropped.
"""

from typing import NamedTuple

import numpy as np

from botohe_moo.base.types import FloatArray, IntArray, OffsetArray, SeedArray
from botohe_moo.core.compile import helper, inlined
from botohe_moo.core.ready import at_once
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


def new_archive(n_plans: int, n_nodes: int, n_robots: int) -> Archive:
    """Return room for an archive whose trails have some number of nodes in all."""
    return Archive(
        np.empty((n_plans, 2)),
        np.empty(n_plans, np.uint64),
        np.empty(n_plans, np.int64),
        np.empty(n_nodes, np.int32),
        np.zeros(n_plans * n_robots + 1, np.int64),
    )


def first_plans(archive: Archive, n: int, n_robots: int) -> Archive:
    """Return the first ``n`` plans of an archive."""
    offsets = archive.offsets[: n * n_robots + 1]
    nodes = archive.nodes[: offsets[-1]]
    return Archive(archive.objectives[:n], archive.hashes[:n], archive.ids[:n], nodes, offsets)


@helper
def plan_hash(batch: Batch, n_robots: int, plan: int) -> np.uint64:
    """Hash the multiset of a plan's trails to 64 bits; the order of the robots does not matter."""
    total = np.uint64(0)
    for trail in range(plan * n_robots, (plan + 1) * n_robots):
        total += hash_stretch(batch.nodes, batch.offsets[trail], batch.offsets[trail + 1])
    return total


@at_once(lambda archive, batch, *_: 2e-6 * (len(archive.nodes) + len(batch.nodes)))
def insert(
    archive: Archive,
    batch: Batch,
    order: OffsetArray,
    hashes: SeedArray,
    max_ties: int,
    first_id: int,
    merged: Archive,
) -> tuple[int, int, int]:
    """Merge an archive and the Pareto set of a batch, each plan once, into another archive.

    ``order`` has the plans of the batch by descending E[R], then E[S]; it begins with the indices
    of the Pareto set afterwards, and ``hashes`` with their hashes. Of plans with equal objectives
    up to ``max_ties`` stay. A newcomer's id is ``first_id`` plus its index. ``merged`` has room for
    all.

    Returns how many plans there are in the Pareto set and in the archive, and how many are new.
    """
    n_robots = (batch.offsets.shape[0] - 1) // max(1, order.shape[0])
    n_members, n_old = _find_members(batch, n_robots, order, hashes), archive.ids.shape[0]
    best, n, n_new, old, new, first = -np.inf, 0, 0, 0, 0, 0  # first with the last's objectives
    while old + new < n_old + n_members:
        is_new = old == n_old
        if old < n_old and new < n_members:
            is_new = _is_before(batch.objectives, order[new], archive.objectives, old)
        row = order[new] if is_new else old
        own = hashes[new] if is_new else archive.hashes[old]
        new, old = new + is_new, old + (not is_new)
        objectives = batch.objectives if is_new else archive.objectives
        reward, survivors = objectives[row, 0], objectives[row, 1]
        if survivors > best:
            best, first = survivors, n
        is_dominated = survivors < best or (first < n and reward < merged.objectives[first, 0])
        is_known = is_new and _has(merged.hashes, first, n, own)
        if is_dominated or is_known or (is_new and n - first >= max_ties):
            continue
        merged.objectives[n, 0], merged.objectives[n, 1] = reward, survivors
        merged.hashes[n], merged.ids[n] = own, first_id + row if is_new else archive.ids[row]
        if is_new:
            n_new += 1
            _copy(batch.nodes, batch.offsets, row, merged, n, n_robots)
        else:
            _copy(archive.nodes, archive.offsets, row, merged, n, n_robots)
        n += 1
    return n_members, n, n_new


@inlined
def _find_members(batch: Batch, n_robots: int, order: OffsetArray, hashes: SeedArray) -> int:
    """Leave the Pareto set in front of ``order``, and write its hashes; return how many it has."""
    best, n, first = -np.inf, 0, 0
    for i in range(order.shape[0]):
        plan = order[i]  # n ≤ i: what is overwritten is not needed any more
        reward, survivors = batch.objectives[plan, 0], batch.objectives[plan, 1]
        if survivors > best and reward > -np.inf:  # it is not if it is NaN
            best, first = survivors, n
        elif n == first or survivors != best or reward != batch.objectives[order[first], 0]:
            continue
        own = plan_hash(batch, n_robots, plan)
        if not _has(hashes, first, n, own):
            order[n], hashes[n] = plan, own
            n += 1
    return n


@inlined
def _is_before(plans: FloatArray, one: int, others: FloatArray, other: int) -> bool:
    """Return whether a plan has more reward than another, or as much and survives better."""
    difference = plans[one, 0] - others[other, 0]
    return bool(difference > 0.0 or (difference == 0.0 and plans[one, 1] > others[other, 1]))


@inlined
def _has(hashes: SeedArray, first: int, stop: int, own: np.uint64) -> bool:
    """Return whether a hash is among some others."""
    while first < stop and hashes[first] != own:
        first += 1
    return first < stop


@inlined
def _copy(
    nodes: IntArray, offsets: OffsetArray, plan: int, into: Archive, n: int, n_robots: int
) -> None:
    """Write a plan's trails behind ``n`` others."""
    for robot in range(n_robots):
        trail, place = plan * n_robots + robot, n * n_robots + robot
        start, length = offsets[trail], offsets[trail + 1] - offsets[trail]
        for i in range(length):
            into.nodes[into.offsets[place] + i] = nodes[start + i]
        into.offsets[place + 1] = into.offsets[place] + length
