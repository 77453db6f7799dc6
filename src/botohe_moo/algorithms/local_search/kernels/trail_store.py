"""Trails that many plans share: each is stored once, as long as some plan has it.

A child differs from its parent in one trail, and shares the others. So the memory and the time that
it takes depend on the length of that trail, not on the size of the team.
"""

from typing import NamedTuple

import numpy as np

from botohe_moo._base.types import FloatArray, IntArray, OffsetArray, Record, RecordArray
from botohe_moo.core.apart import apart
from botohe_moo.core.compile import helper
from botohe_moo.core.graph import Graph

_COUNTS = np.dtype([(name, np.int64) for name in ("arcs", "visits", "spare")])
_TRAIL = np.dtype(
    [
        ("first_arc", np.int64),
        ("end_arc", np.int64),
        ("n_arcs", np.int64),
        ("first_visit", np.int64),
        ("n_visits", np.int64),
        ("n_users", np.int64),
        ("alive", np.float64),
        ("hash", np.uint64),
    ]
)


class TrailStore(NamedTuple):
    """Trails by number: their arcs, and what they reach."""

    n: Record  # how many ``arcs`` and ``visits`` are in use, and how many trails are ``spare``
    # Of each trail, where its arcs and visits begin, and its arcs end; how many there are; how many
    # plans have it (``n_users``); with what probability a robot survives it (``alive``); and once
    # it was told to other searches, or by them, the ``hash`` of its arcs, else 0.
    trails: RecordArray
    arc: IntArray  # the arcs of all trails, one trail after another
    # Also the nodes that each trail visits, in order of first visits, except the base and nodes
    # without reward; and the probability to reach each.
    node: IntArray
    reach: FloatArray
    spare: OffsetArray  # numbers that are free, as a stack
    # Numbers of trails that were told, at the places of their hashes. They may be out of date or
    # never written, so trails found here are compared; a later one takes the place of an earlier.
    told: IntArray


def new_store(n_trails: int, n_arcs: int, n_visits: int) -> TrailStore:
    """Return a store with room for some trails, and for the arcs and visits of all of them."""
    parts = TrailStore(
        n=np.zeros(1, _COUNTS).view(np.recarray)[0],
        trails=np.zeros(n_trails, _TRAIL).view(np.recarray),
        arc=np.zeros(n_arcs, np.int32),
        node=np.zeros(n_visits, np.int32),
        reach=np.zeros(n_visits),
        spare=np.arange(n_trails)[::-1].copy(),
        told=np.zeros(1 << (4 * n_trails).bit_length(), np.int32),
    )
    store: TrailStore = apart(parts)
    store.n.spare = n_trails
    return store


def copy_trails(store: TrailStore, into: TrailStore) -> None:
    """Copy trails that some plan has into an empty store, without gaps; they keep their numbers."""
    used = np.flatnonzero(store.trails["n_users"])
    trails = into.trails[used] = store.trails[used]
    arcs = ragged(trails["first_arc"], trails["n_arcs"])
    visits = ragged(trails["first_visit"], trails["n_visits"])
    into.arc[: len(arcs)] = store.arc[arcs]
    into.node[: len(visits)], into.reach[: len(visits)] = store.node[visits], store.reach[visits]
    into.trails["end_arc"][used] = np.cumsum(trails["n_arcs"])
    into.trails["first_arc"][used] = into.trails["end_arc"][used] - trails["n_arcs"]
    into.trails["first_visit"][used] = np.cumsum(trails["n_visits"]) - trails["n_visits"]
    into.n.arcs, into.n.visits = len(arcs), len(visits)
    free = np.flatnonzero(into.trails["n_users"] == 0)[::-1]
    into.spare[: len(free)] = free
    into.n.spare = len(free)
    told = trails["hash"] != 0
    into.told[trails["hash"][told] & np.uint64(len(into.told) - 1)] = used[told]


def ragged(first: OffsetArray, lengths: OffsetArray) -> OffsetArray:
    """Return the indices of stretches of an array, one stretch after another."""
    before = np.cumsum(lengths) - lengths
    return np.repeat(first - before, lengths) + np.arange(lengths.sum())


@helper
def place_of(store: TrailStore, trail_hash: np.uint64) -> int:
    """Return the place in ``told`` of trails with some hash."""
    bits = trail_hash & np.uint64(store.told.shape[0] - 1)
    return int(np.int64(bits))  # numba's int() leaves it unsigned, and a sum with it a float


@helper
def fits(graph: Graph, store: TrailStore, n_trails: int) -> bool:
    """Return whether there is room for ``n_trails`` more, however long they are."""
    n, longest, most_visits = store.n, graph.head.shape[0], graph.reward.shape[0]
    return bool(
        n.spare >= n_trails
        and n.arcs + n_trails * longest <= store.arc.shape[0]
        and n.visits + n_trails * most_visits <= store.node.shape[0]
    )


@helper
def release(store: TrailStore, trail: int) -> None:
    """Note that a trail has one user less; where none is left, its number is free."""
    store.trails[trail].n_users -= 1
    if store.trails[trail].n_users == 0:
        store.spare[store.n.spare] = trail
        store.n.spare += 1


@helper
def discard(store: TrailStore, trail: int) -> None:
    """Release a trail; if it was stored last and has no user left, free its room, too."""
    n, last = store.n, store.trails[trail]
    release(store, trail)
    ends = last.end_arc, last.first_visit + last.n_visits
    if last.n_users == 0 and ends == (n.arcs, n.visits):
        n.arcs, n.visits = last.first_arc, last.first_visit
