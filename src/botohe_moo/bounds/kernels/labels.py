"""Stairs above all relaxed trails, by labels in order of descending survival.

A label is the beginning of a relaxed trail: its state, the probability s to be alive there, and
what it is worth. Prices rise with s, and what can follow does not depend on the past. So a label is
extended only if it is worth more than all labels of its state that came before, with s as high or
higher: this is label setting for shortest paths with a resource (Desrochers and Soumis, "A
generalized permanent labelling algorithm for the shortest path problem with time windows", INFOR
26(3), 1988).

An excursion that begins at a level of its gate is worth at most ``paid`` and comes back with at
most a ``share`` of the probability to be alive, for one of the corners of a frontier. The worth of
one excursion is convex in that probability: between two levels, the chord of what two frontiers say
of the same share bounds it.
"""

from typing import NamedTuple

import numpy as np

from botohe_moo.base.types import FloatArray, IntArray, OffsetArray
from botohe_moo.bounds.kernels.relaxed import Worth, chord
from botohe_moo.bounds.kernels.states import ROUNDING, Net, States
from botohe_moo.bounds.kernels.trails import (
    Completions,
    Corners,
    Stairs,
    exceeded,
    find_corners,
    lift,
    step_of,
)
from botohe_moo.core.compile import helper, inlined, kernel

_MOST_CORNERS = 256  # of a frontier
_WORSE = 1.0


class Frontiers(NamedTuple):
    """What excursions into each piece are worth, for each level of its gate."""

    n: OffsetArray  # corners (n_pieces, n_levels + 1)
    # By descending share and ascending worth (n_pieces, n_levels + 1, K).
    share: FloatArray
    paid: FloatArray


class Labels(NamedTuple):
    """The labels of a piece, in the order in which they were found, and scratch."""

    alive: FloatArray  # (n_room)
    worth: FloatArray  # (n_room)
    state: IntArray  # (n_room)
    parent: IntArray  # the label before (n_room)
    # The link from there, and for an excursion the share that comes back (n_room).
    link: IntArray
    share: FloatArray
    heap: IntArray  # labels to extend, the one with the highest ``alive`` first (n_room)
    best: FloatArray  # the most that an extended label of each state is worth (n_states)
    # Labels at the piece's entry, each worth more than those before it: their number is first.
    ends: OffsetArray  # (1 + n_room)


class LabelRule(NamedTuple):
    """How labels are extended."""

    tolerance: float  # labels have to be worth more by this
    cap: float  # what no label is worth more than
    slack: float  # stairs are raised by as much more, to skip equal trails
    n_most: int  # labels to try at most
    fine: float


def new_labels(n_room: int, n_states: int) -> Labels:
    """Return room for labels."""
    floats, integers = (lambda: np.empty(n_room)), (lambda: np.empty(n_room, np.int32))
    return Labels(
        alive=floats(),
        worth=floats(),
        state=integers(),
        parent=integers(),
        link=integers(),
        share=floats(),
        heap=integers(),
        best=np.empty(n_states),
        ends=np.empty(n_room + 1, np.int64),
    )


def new_frontiers(net: Net, n_levels: int) -> Frontiers:
    """Return frontiers without corners."""
    shape = len(net.pieces.entry), n_levels + 1
    n_corners = _MOST_CORNERS if len(net.pieces.of_option) > shape[0] - 1 else 1
    return Frontiers(np.zeros(shape, np.int64), *np.zeros((2, *shape, n_corners)))


@inlined
def _push(labels: Labels, n: int, label: int) -> None:
    """Add a label to a heap of ``n``."""
    at = n
    while at > 0:
        above = (at - 1) // 2
        if labels.alive[labels.heap[above]] >= labels.alive[label]:
            break
        labels.heap[at] = labels.heap[above]
        at = above
    labels.heap[at] = label


@inlined
def _pop(labels: Labels, n: int) -> int:
    """Take the first label from a heap of ``n``."""
    heap, alive = labels.heap, labels.alive
    first, last, at = heap[0], heap[n - 1], 0
    while 2 * at + 1 < n - 1:
        below = 2 * at + 1
        if below + 1 < n - 1 and alive[heap[below + 1]] > alive[heap[below]]:
            below += 1
        if alive[heap[below]] <= alive[last]:
            break
        heap[at] = heap[below]
        at = below
    heap[at] = last
    return int(first)


@helper
def _settle(
    net: Net,
    states: States,
    prices: FloatArray,
    frontiers: Frontiers,
    piece: int,
    alive: float,
    ahead: Completions,
    stairs: Stairs,
    corners: Corners,
    most: FloatArray,
    rule: LabelRule,
    labels: Labels,
) -> int:
    """Find the labels of a piece that is entered with probability ``alive``.

    In the base's piece, labels are left out that come to nothing above the stairs, and labels that
    come home raise these. Returns how many labels were tried, negative where there was no room.
    """
    graph, pieces, home = net.world.graph, net.pieces, net.world.ways.home
    n_levels, n_arcs, first = prices.shape[1] - 1, graph.head.shape[0], states.begin[piece]
    entry, n_stairs, heights = pieces.entry[piece], stairs.heights.shape[0], stairs.heights
    least = max(stairs.least, net.min_survival) * (1.0 - ROUNDING)
    # Beyond a bridge, no trail is alive with more than this share of ``alive``.
    part = net.reach[entry] / alive if piece > 0 else 1.0
    first_step, n_room, latest = step_of(least, stairs.width, n_stairs), labels.alive.shape[0], 0
    for state in range(first, states.begin[piece + 1]):
        labels.best[state] = -1.0
    labels.alive[0], labels.state[0], labels.parent[0], labels.ends[0] = alive, first, -1, 0
    level = min(alive / net.reach[entry] * n_levels, n_levels * 1.0)
    labels.worth[0] = chord(prices, entry, level) if piece > 0 else 0.0
    labels.heap[0] = 0
    n = n_heap = 1
    tried = 0
    while n_heap > 0:
        label = _pop(labels, n_heap)
        n_heap -= 1
        state, here, worth = labels.state[label], labels.alive[label], labels.worth[label]
        if worth <= labels.best[state] + (rule.tolerance if label > 0 else 0.0):
            continue
        labels.best[state] = worth
        node = states.node[state]
        if node == entry and (label > 0 or piece > 0):
            at = step_of(here, stairs.width, n_stairs)
            is_end = labels.ends[0] == 0 or worth > labels.worth[labels.ends[labels.ends[0]]]
            if piece == 0:
                is_end = worth > heights[at]
            if piece == 0 and is_end:
                lift(heights, at, worth + rule.slack)
                find_corners(stairs, ahead.mu, first_step, corners)
                tried += n_stairs // 16  # what this takes
            if is_end:
                labels.ends[0] += 1
                labels.ends[labels.ends[0]] = label
        for link in range(states.first[state], states.first[state + 1]):
            move, to, gain = states.move[link], states.to[link], 0.0
            child, low, part_high, n_low, n_high = -1, 0, 0.0, 0, 0
            left = right = 0.0
            share = 0.0
            if move < n_arcs:
                share = graph.survival[move]
                head = graph.head[move]
                if states.pays[link]:
                    level = min(here * share / net.reach[head] * n_levels, n_levels * 1.0)
                    gain = chord(prices, head, level)
            else:
                child = pieces.of_option[move - n_arcs]
                if move > n_arcs + pieces.first_option[child]:
                    continue
                level = min(here / net.reach[node] * n_levels, n_levels * 1.0)
                low = min(int(level), n_levels - 1)
                part_high = level - low
            is_more = True
            while is_more:
                if child < 0:
                    is_more = False
                else:
                    share = -1.0
                    if n_low < frontiers.n[child, low]:
                        share = frontiers.share[child, low, n_low]
                    if n_high < frontiers.n[child, low + 1]:
                        share = max(share, frontiers.share[child, low + 1, n_high])
                    if share < 0.0:
                        break
                    if n_low < frontiers.n[child, low] and (
                        frontiers.share[child, low, n_low] == share
                    ):
                        left = frontiers.paid[child, low, n_low]
                        n_low += 1
                    if n_high < frontiers.n[child, low + 1] and (
                        frontiers.share[child, low + 1, n_high] == share
                    ):
                        right = frontiers.paid[child, low + 1, n_high]
                        n_high += 1
                    gain = left + (right - left) * part_high
                tried += 1
                there, value = here * share, min(worth + gain, rule.cap)
                if value <= labels.best[to] + rule.tolerance:
                    continue
                end = states.node[to]
                at_home = there * part * home[end]
                if at_home < least:
                    continue
                if piece == 0:
                    level = min(there / net.reach[end] * n_levels, n_levels * 1.0)
                    for line in range(most.shape[0]):
                        most[line] = value + chord(ahead.values[line], to, level)
                    highest = step_of(at_home, stairs.width, n_stairs)
                    corner = exceeded(most, ahead.mu, corners, highest, latest)
                    if corner < 0:
                        continue
                    latest = corner
                if n == n_room or tried > rule.n_most:
                    return -tried
                labels.alive[n], labels.worth[n], labels.state[n] = there, value, to
                labels.parent[n], labels.link[n], labels.share[n] = label, link, share
                _push(labels, n_heap, n)
                n_heap += 1
                n += 1
    return tried


@inlined
def _loss(
    net: Net,
    states: States,
    ahead: Completions,
    gates: OffsetArray,
    n_gates: int,
    piece: int,
    at: int,
    level: float,
    paid: float,
) -> float:
    """Return how much an excursion is worse than the best that its gate can do at level ``at``."""
    above, n_levels = net.pieces.of[net.pieces.gate[piece]], ahead.values.shape[2] - 1
    n = ahead.mu.shape[0] if above == 0 else ahead.n_slopes[0, above]
    least = np.inf
    for k in range(n):
        for i in range(n_gates):
            state, after = gates[i, 0], gates[i, 1]
            if above == 0:
                loss = ahead.values[k, state, at] - paid - chord(ahead.values[k], after, level)
            else:
                row = ahead.row[0, above, k] - states.begin[above]
                loss = ahead.inside[0, row + state, at] - paid
                loss -= chord(ahead.inside[0], row + after, level)
            least = min(least, loss)
    return least


@inlined
def _write_frontier(
    net: Net,
    states: States,
    ahead: Completions,
    gates: OffsetArray,
    n_gates: int,
    labels: Labels,
    piece: int,
    at: int,
    home: float,
    fine: float,
    finest: float,
    share: FloatArray,
    paid: FloatArray,
) -> int:
    """Write the corners of a frontier, and return how many there are.

    Those that are worth about the same become one that is as good as each of them: the less the
    worse they are.
    """
    n, room, gate, n_levels = 0, share.shape[0], net.pieces.gate[piece], ahead.values.shape[2] - 1
    n_ends = labels.ends[0]
    alive = net.reach[gate] * at / n_levels
    for i in range(1, n_ends + 1):
        label = labels.ends[i]
        q = labels.alive[label] * home
        level = min(q / net.reach[gate] * n_levels, n_levels * 1.0)
        loss = _loss(net, states, ahead, gates, n_gates, piece, at, level, labels.worth[label])
        labels.share[label] = max(1.0, (loss / fine) * _WORSE) * fine * finest
    wide = 1.0
    while True:
        n, end = 0, -np.inf
        for i in range(1, n_ends + 1):
            label = labels.ends[i]
            worth = labels.worth[label]
            if worth > end:
                if n == room:
                    n += 1
                    break
                share[n] = labels.alive[label] * home / alive
                end = worth + labels.share[label] * wide
                n += 1
            paid[n - 1] = worth
        if n <= room:
            return n
        wide *= 1.5


@kernel
def raise_by_labels(
    net: Net,
    states: States,
    worth: Worth,
    ahead: Completions,
    stairs: Stairs,
    rule: LabelRule,
    frontiers: Frontiers,
    labels: Labels,
) -> int:
    """Raise stairs above all relaxed trails; the labels of the base's piece are left.

    Returns how many labels were tried, negative where ``n_most`` or the room was not enough.
    """
    pieces, prices = net.pieces, worth.prices
    n_levels, n_lines, n_stairs = prices.shape[1] - 1, ahead.mu.shape[0], stairs.heights.shape[0]
    n_corners, needed, most = np.empty(n_stairs, np.int64), np.empty((n_stairs, n_lines)), np.empty(n_lines)
    corners = Corners(n_corners, np.empty(n_stairs), np.empty(n_stairs), needed)
    least = max(stairs.least, net.min_survival) * (1.0 - ROUNDING)
    find_corners(stairs, ahead.mu, step_of(least, stairs.width, n_stairs), corners)
    tried = 0
    gates = np.empty((states.node.shape[0], 2), np.int64)
    fine = np.inf
    for line in range(n_lines):
        worth_ahead = 0.0
        for at in range(1):
            worth_ahead = ahead.values[line, 0, n_levels]
        fine = min(fine, worth_ahead - corners.needed[corners.n[n_stairs - 1] - 1, line])
    fine = max(fine, 1e-3 * rule.cap)
    finest = rule.fine
    for piece in range(pieces.entry.shape[0] - 1, 0, -1):
        gate, out = pieces.gate[piece], net.world.graph.survival[pieces.arc[piece]]
        home = net.world.graph.survival[pieces.back[piece]]
        above, n_gates = pieces.of[gate], 0
        for state in range(states.begin[above], states.begin[above + 1]):
            for link in range(states.first[state], states.first[state + 1]):
                if states.move[link] == net.ratio.shape[0] + pieces.first_option[piece]:
                    gates[n_gates, 0], gates[n_gates, 1] = state, states.to[link]
                    n_gates += 1
        is_dead_end = pieces.first_option[piece + 1] - pieces.first_option[piece] == 1
        for at in range(1, n_levels + 1):
            alive = net.reach[gate] * at / n_levels
            share, paid = frontiers.share[piece, at], frontiers.paid[piece, at]
            if is_dead_end:
                level = min(alive * out / net.reach[pieces.entry[piece]] * n_levels, n_levels * 1.0)
                frontiers.n[piece, at] = 1
                share[0], paid[0] = out * home, chord(prices, pieces.entry[piece], level)
                continue
            n = _settle(
                net, states, prices, frontiers, piece, alive * out, ahead, stairs, corners, most,
                LabelRule(rule.tolerance, rule.cap, rule.slack, rule.n_most - tried, rule.fine), labels,
            )
            tried += abs(n)
            if n < 0:
                return -tried
            frontiers.n[piece, at] = _write_frontier(
                net, states, ahead, gates, n_gates, labels, piece, at, home, fine, finest, share, paid
            )
    n = _settle(
        net, states, prices, frontiers, 0, 1.0, ahead, stairs, corners, most,
        LabelRule(rule.tolerance, rule.cap, rule.slack, rule.n_most - tried, rule.fine), labels,
    )
    tried += abs(n)
    return tried if n >= 0 else -tried


@kernel
def settle_excursion(
    net: Net,
    states: States,
    worth: Worth,
    ahead: Completions,
    stairs: Stairs,
    rule: LabelRule,
    frontiers: Frontiers,
    labels: Labels,
    piece: int,
    alive: float,
) -> int:
    """Find the labels of a piece that is entered with probability ``alive``."""
    n_stairs, n_lines = stairs.heights.shape[0], ahead.mu.shape[0]
    n_corners, needed = np.empty(n_stairs, np.int64), np.empty((n_stairs, n_lines))
    corners = Corners(n_corners, np.empty(n_stairs), np.empty(n_stairs), needed)
    return _settle(
        net, states, worth.prices, frontiers, piece, alive, ahead, stairs, corners,
        np.empty(n_lines), rule, labels,
    )
