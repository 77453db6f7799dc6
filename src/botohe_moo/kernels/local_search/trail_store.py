"""Trails that many plans share: each is kept once, as long as some plan has it.

A child differs from its parent in one trail; the others are the parent's. So memory and the cost
of a new plan follow the length of the trail that changed, not the size of the team.
"""

from typing import NamedTuple

import numpy as np

from botohe_moo._base.types import FloatArray, IntArray, OffsetArray
from botohe_moo.kernels.compile import everywhere, frugal, part, routine
from botohe_moo.kernels.plans.evaluate import either

# Indices into ``TrailStore.counts``.
N_ARCS = 0  # used of the pool
N_VISITS = 1
N_SPARE_TRAILS = 2
WALK = 3  # number of the last walk that marked ``TrailStore.walked``
N_COUNTS = 4


class TrailStore(NamedTuple):
    """Trails by number: their arcs, and what they reach.

    Attributes
    ----------
    counts
        ``N_ARCS`` to ``WALK``.
    arc
        The arcs of all trails, one trail after another.
    node, reach
        Likewise the nodes with a reward, the base left out, by first visit, and the probability
        to reach each.
    arcs_from, n_arcs, visits_from, n_visits
        Where a trail's arcs and visits are, and how many there are (n_trails).
    alive
        Probability to survive the trail (n_trails).
    n_users
        How many plans have the trail (n_trails).
    spare
        Numbers that are free, as a stack.
    walked
        The last walk that met each node (n_nodes).
    """

    counts: OffsetArray
    arc: IntArray
    node: IntArray
    reach: FloatArray
    arcs_from: OffsetArray
    n_arcs: IntArray
    visits_from: OffsetArray
    n_visits: IntArray
    alive: FloatArray
    n_users: OffsetArray
    spare: IntArray
    walked: OffsetArray


def new_store(n_trails: int, n_arcs: int, n_visits: int, n_nodes: int) -> TrailStore:
    """Make room for trails.

    Parameters
    ----------
    n_trails, n_arcs, n_visits
        How many trails, and how many arcs and visits they have together.
    n_nodes
        Nodes of the mission.
    """
    store = TrailStore(
        counts=np.zeros(N_COUNTS, np.int64),
        arc=np.zeros(n_arcs, np.int32),
        node=np.zeros(n_visits, np.int32),
        reach=np.zeros(n_visits),
        arcs_from=np.zeros(n_trails, np.int64),
        n_arcs=np.zeros(n_trails, np.int32),
        visits_from=np.zeros(n_trails, np.int64),
        n_visits=np.zeros(n_trails, np.int32),
        alive=np.zeros(n_trails),
        n_users=np.zeros(n_trails, np.int64),
        spare=np.empty(n_trails, np.int32),
        walked=np.zeros(n_nodes, np.int64),
    )
    clear_store(store)
    return store


def clear_store(store: TrailStore) -> None:
    """Forget all trails.

    Parameters
    ----------
    store
        Changed in place.
    """
    n_trails = len(store.spare)
    store.counts[N_ARCS] = store.counts[N_VISITS] = 0
    store.counts[N_SPARE_TRAILS] = n_trails
    store.n_users[:] = 0
    store.spare[:] = np.arange(n_trails)[::-1]


@routine
def add_trail(
    head: IntArray,
    survival: FloatArray,
    reward: FloatArray,
    base: int,
    store: TrailStore,
    arcs: IntArray,
    length: int,
) -> int:
    """Store a trail, which nobody uses yet, and give its number.

    Parameters
    ----------
    head, survival, reward, base
        The mission's arcs, rewards and base.
    store
        Must have room for it (``fits``).
    arcs, length
        The arcs of a valid trail, of which there are ``length``.
    """
    counts = store.counts
    counts[WALK] += 1
    counts[N_SPARE_TRAILS] -= 1
    trail = store.spare[counts[N_SPARE_TRAILS]]
    store.arcs_from[trail], store.n_arcs[trail] = counts[N_ARCS], length
    store.visits_from[trail] = counts[N_VISITS]
    store.walked[base] = counts[WALK]
    n = counts[N_VISITS]
    alive = 1.0
    for i in range(length):
        arc = arcs[i]
        store.arc[counts[N_ARCS] + i] = arc
        alive *= survival[arc]
        node = head[arc]
        if reward[node] > 0.0 and store.walked[node] != counts[WALK]:
            store.walked[node] = counts[WALK]
            store.node[n], store.reach[n] = node, alive
            n += 1
    counts[N_ARCS] += length
    store.n_visits[trail] = n - counts[N_VISITS]
    counts[N_VISITS] = n
    store.alive[trail] = alive
    store.n_users[trail] = 0
    return int(trail)


@part
def release(store: TrailStore, trail: int) -> None:
    """Note that one plan less has a trail, which is free when it was the last."""
    store.n_users[trail] -= 1
    if store.n_users[trail] == 0:
        store.spare[store.counts[N_SPARE_TRAILS]] = trail
        store.counts[N_SPARE_TRAILS] += 1


@everywhere
def fits(store: TrailStore, n_trails: int, longest: int, most_visits: int) -> bool:
    """Tell whether so many trails of at most so many arcs and visits can be stored."""
    counts = store.counts
    enough = (
        counts[N_SPARE_TRAILS] >= n_trails
        and counts[N_ARCS] + n_trails * longest <= store.arc.shape[0]
        and counts[N_VISITS] + n_trails * most_visits <= store.node.shape[0]
    )
    return bool(enough)


@frugal
def copy_trails(store: TrailStore, into: TrailStore) -> None:
    """Copy the trails that somebody uses into another store, which has room, under their numbers.

    Parameters
    ----------
    store
        Where they are; may have gaps.
    into
        New, with room for as many trails or more; has no gaps afterwards.
    """
    counts = into.counts
    n_trails, n_more = store.n_users.shape[0], into.n_users.shape[0]
    n = 0
    for trail in range(n_more - 1, -1, -1):
        if trail >= n_trails or store.n_users[trail] == 0:
            into.spare[n] = trail
            n += 1
    counts[N_SPARE_TRAILS] = n
    counts[WALK] = store.counts[WALK]
    for node in range(store.walked.shape[0]):
        into.walked[node] = store.walked[node]
    for trail in range(n_trails):
        if store.n_users[trail] == 0:
            continue
        start, length = store.arcs_from[trail], store.n_arcs[trail]
        into.arcs_from[trail], into.n_arcs[trail] = counts[N_ARCS], length
        for i in range(length):
            into.arc[counts[N_ARCS] + i] = store.arc[start + i]
        counts[N_ARCS] += length
        start, length = store.visits_from[trail], store.n_visits[trail]
        into.visits_from[trail], into.n_visits[trail] = counts[N_VISITS], length
        for i in range(length):
            into.node[counts[N_VISITS] + i] = store.node[start + i]
            into.reach[counts[N_VISITS] + i] = store.reach[start + i]
        counts[N_VISITS] += length
        into.alive[trail], into.n_users[trail] = store.alive[trail], store.n_users[trail]


@routine
def precedes(store: TrailStore, one: int, other: int) -> bool:
    """Tell whether a trail comes before another in lexicographic order.

    Arcs are numbered by tail, then by head: the order by arcs is that by nodes.
    """
    length, other_length = store.n_arcs[one], store.n_arcs[other]
    start, other_start = store.arcs_from[one], store.arcs_from[other]
    for i in range(min(length, other_length)):
        arc, other_arc = store.arc[start + i], store.arc[other_start + i]
        if arc != other_arc:
            return bool(arc < other_arc)
    return bool(length < other_length)


@routine
def evaluate_trails(
    reward: FloatArray,
    base: int,
    store: TrailStore,
    trails: IntArray,
    reached: FloatArray,
    touched: IntArray,
    touched_by: OffsetArray,
    mark: int,
) -> tuple[float, float]:
    """Give E[R] and E[S] of a plan whose trails are in order: the bits of ``evaluate``.

    Parameters
    ----------
    reward, base
        The mission's rewards and base.
    store, trails
        The plan's trails, by number, in lexicographic order.
    reached, touched, touched_by
        Scratch (n_nodes).
    mark
        No entry of ``touched_by`` is ``mark`` yet.
    """
    n = 0
    survivors = 0.0
    for k in range(trails.shape[0]):
        trail = trails[k]
        start = store.visits_from[trail]
        for i in range(start, start + store.n_visits[trail]):
            node = store.node[i]
            if touched_by[node] != mark:
                touched_by[node] = mark
                reached[node] = store.reach[i]
                touched[n] = node
                n += 1
            else:
                reached[node] = either(reached[node], store.reach[i])
        survivors += store.alive[trail]
    expected_reward = reward[base]
    for i in range(n):
        expected_reward += reward[touched[i]] * reached[touched[i]]
    return expected_reward, survivors
