"""Drafts of new plans out of pieces of known ones, for crossovers and mutations.

Kernels write which pieces of an array of nodes each trail of a draft is made of:
``pieces[trail, i]`` are the beginning and the end of the i-th one, (0, 0) where there is none.
Each kernel draws from one state of random numbers, in the order of the plans.
"""

import numpy as np

from botohe_moo._base.types import IntArray, OffsetArray, SeedArray
from botohe_moo.core.compile import helper, kernel
from botohe_moo.core.rng import below, uniform
from botohe_moo.core.trails import Trails

N_PIECES = 3

# The kinds of crossovers that a pair of plans may get.
EXCHANGE = 0
SPLICE = 1


def whole_trails(offsets: OffsetArray) -> OffsetArray:
    """Return the pieces of drafts that are the plans as they are."""
    pieces = np.zeros((len(offsets) - 1, N_PIECES, 2), np.int64)
    pieces[:, 0, 0], pieces[:, 0, 1] = offsets[:-1], offsets[1:]
    return pieces


def join_pieces(nodes: IntArray, pieces: OffsetArray) -> tuple[IntArray, OffsetArray]:
    """Write the drafts' nodes one after another; return them, and where each draft begins."""
    starts, stops = pieces.reshape(-1, 2).T
    lengths = stops - starts
    ends = np.cumsum(lengths)
    shift = np.repeat(starts - ends + lengths, lengths)
    offsets = np.zeros(len(pieces) + 1, np.int64)
    offsets[1:] = ends[N_PIECES - 1 :: N_PIECES]
    return nodes[np.arange(len(shift)) + shift], offsets


@helper
def _shuffle(states: SeedArray, items: OffsetArray, stops: OffsetArray) -> None:
    """Shuffle the numbers of robots, those of each kind among themselves."""
    first = 0
    while first < items.shape[0]:
        for i in range(stops[first] - 1, first, -1):
            j = first + below(states, i - first + 1)
            items[i], items[j] = items[j], items[i]
        first = stops[first]


@helper
def _draw_shared_place(
    trails: Trails, one: int, other: int, counts: OffsetArray, states: SeedArray
) -> tuple[int, int]:
    """Draw a place inside each of two trails where both are at the same node.

    All pairs of such places are equally likely; (−1, −1) where there is none. Unknown nodes do not
    count. ``counts`` is scratch (n_nodes), zero before and after.
    """
    nodes, offsets, n_nodes = trails.nodes, trails.offsets, counts.shape[0]
    start, stop = offsets[one] + 1, offsets[one + 1] - 1
    other_start, other_stop = offsets[other] + 1, offsets[other + 1] - 1
    for j in range(other_start, other_stop):
        if 0 <= nodes[j] < n_nodes:
            counts[nodes[j]] += 1
    n = 0
    for i in range(start, stop):
        if 0 <= nodes[i] < n_nodes:
            n += counts[nodes[i]]
    place = other_place = -1
    left = below(states, n) if n > 0 else -1
    for i in range(start, stop if n > 0 else start):
        n_shared = counts[nodes[i]] if 0 <= nodes[i] < n_nodes else 0
        if left < n_shared:
            place = i
            break
        left -= n_shared
    for j in range(other_start, other_stop):
        if 0 <= nodes[j] < n_nodes:
            counts[nodes[j]] = 0
        if place >= 0 and nodes[j] == nodes[place]:
            if left == 0:
                other_place = j
            left -= 1
    return place, other_place


@helper
def _draw_robot_out(offsets: OffsetArray, first: int, stop: int, states: SeedArray) -> int:
    """Draw a trail that leaves the base, of those from ``first`` to ``stop``; any if none does."""
    n = 0
    for trail in range(first, stop):
        n += offsets[trail + 1] - offsets[trail] > 1
    if n == 0:
        return first + below(states, stop - first)
    left = below(states, n)
    for trail in range(first, stop):
        if offsets[trail + 1] - offsets[trail] > 1:
            if left == 0:
                return trail
            left -= 1
    return -1


@helper
def _copy_trail(offsets: OffsetArray, trail: int, pieces: OffsetArray, draft: int) -> None:
    pieces[draft, 0, 0], pieces[draft, 0, 1] = offsets[trail], offsets[trail + 1]


@helper
def _continue_as(
    pieces: OffsetArray, draft: int, start: int, cut: int, onward: int, stop: int
) -> None:
    """Make a draft of the nodes from ``start`` to ``cut`` and from ``onward`` to ``stop``."""
    pieces[draft, 0, 0], pieces[draft, 0, 1] = start, cut
    pieces[draft, 1, 0], pieces[draft, 1, 1] = onward, stop


@kernel
def cross(
    trails: Trails,
    kinds: OffsetArray,
    orders: OffsetArray,
    firsts: OffsetArray,
    stops: OffsetArray,
    counts: OffsetArray,
    states: SeedArray,
    pieces: OffsetArray,
) -> None:
    """Draft two children of each pair of plans: those of pair m are the plans 2m and 2m + 1.

    ``trails`` are all first parents, then all second ones. With ``EXCHANGE`` each child has whole
    trails: a random part of one parent's, and the rest from the other parent. With ``SPLICE`` one
    trail of each parent goes on as the other's from a node that both visit; where there is none the
    two trails change places. Robots of a kind, from ``firsts`` to ``stops`` of each of them
    (n_robots), get trails of this kind.

    ``orders``, twice the numbers of the robots (2, n_robots), and ``counts``, zeros (n_nodes), are
    scratch. ``states`` (1, 2) are advanced; ``pieces`` are 0 before.
    """
    offsets, n_pairs, n_robots = trails.offsets, kinds.shape[0], orders.shape[1]
    for pair in range(n_pairs):
        mine, others = pair * n_robots, (n_pairs + pair) * n_robots
        child, other_child = 2 * mine, 2 * mine + n_robots
        if kinds[pair] == EXCHANGE:
            _shuffle(states, orders[0], stops)
            _shuffle(states, orders[1], stops)
            cut = 0
            for k in range(n_robots):
                if k == firsts[k]:  # of each kind some, of a single kind some but not all
                    size = stops[k] - k
                    least = 1 if size == n_robots else 0
                    cut = k + least + below(states, size + 1 - 2 * least)
                one, other = mine + orders[0, k], others + orders[1, k]
                if k >= cut:
                    one, other = other, one
                _copy_trail(offsets, one, pieces, child + k)
                _copy_trail(offsets, other, pieces, other_child + k)
            continue
        s = _draw_robot_out(offsets, mine, mine + n_robots, states)
        first, stop = others + firsts[s - mine], others + stops[s - mine]
        t = _draw_robot_out(offsets, first, stop, states)
        p, q = _draw_shared_place(trails, s, t, counts, states)
        if p < 0:
            p, q = offsets[s], offsets[t]
        for k in range(n_robots):
            _copy_trail(offsets, mine + k, pieces, child + k)
            _copy_trail(offsets, others + k, pieces, other_child + k)
        _continue_as(pieces, child + s - mine, offsets[s], p, q, offsets[t + 1])
        _continue_as(pieces, other_child + t - others, offsets[t], q, p, offsets[s + 1])


@kernel
def ruin(
    trails: Trails,
    n_robots: int,
    n_nodes: int,
    states: SeedArray,
    via: IntArray,
    pieces: OffsetArray,
) -> None:
    """Cut a random segment out of one trail of each plan, and visit drawn nodes instead.

    The nodes are written to ``via`` (n_plans, max_via), and every number of them is equally likely.
    To ``pieces``, which are whole trails before, they lie behind the trails' nodes.
    """
    offsets, max_via = trails.offsets, via.shape[1]
    for plan in range(via.shape[0]):
        trail = plan * n_robots + below(states, n_robots)
        start, stop = offsets[trail], offsets[trail + 1]
        one, other = below(states, stop - start), below(states, stop - start)
        low, high = start + min(one, other), start + max(one, other)
        n_via = below(states, max_via + 1)
        if n_via == 0 and high - low < 2 and max_via > 0:
            n_via = 1  # or nothing would change
        for i in range(n_via):
            via[plan, i] = below(states, n_nodes)
        if n_via == 0:  # a node does not follow itself
            high = max(high, low + 1)
        behind = trails.nodes.shape[0] + plan * max_via
        _continue_as(pieces, trail, start, low + 1, behind, behind + n_via)
        pieces[trail, 2, 0], pieces[trail, 2, 1] = high, stop


@kernel
def share(
    trails: Trails,
    n_robots: int,
    prob_copy: float,
    counts: OffsetArray,
    states: SeedArray,
    pieces: OffsetArray,
) -> None:
    """Let one robot of each plan copy another's trail, or two robots swap the ends of their trails.

    They swap from a node that both visit; where there is none, from any place of each trail. There
    are at least two robots. ``pieces`` are whole trails before.
    """
    offsets = trails.offsets
    for plan in range(pieces.shape[0] // n_robots):
        one = _draw_robot_out(offsets, plan * n_robots, (plan + 1) * n_robots, states)
        other = plan * n_robots + below(states, n_robots - 1)
        other += other >= one
        if uniform(states, 0) < prob_copy:
            _copy_trail(offsets, one, pieces, other)
            continue
        p, q = _draw_shared_place(trails, one, other, counts, states)
        if p < 0:
            p = offsets[one] + below(states, offsets[one + 1] - offsets[one])
            q = offsets[other] + below(states, offsets[other + 1] - offsets[other])
        _continue_as(pieces, one, offsets[one], p, q, offsets[other + 1])
        _continue_as(pieces, other, offsets[other], q, p, offsets[one + 1])
