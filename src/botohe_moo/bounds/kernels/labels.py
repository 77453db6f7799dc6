"""Stairs above all trails, by labels of relaxed trails in order of descending survival.

A label is the beginning of a relaxed trail: its state, the probability p to be alive there, and
what it is worth so far, at most all prices together. Prices are convex and 0 at 0, and so they rise
with p. What can follow does not depend on the past, and is worth the more the higher p is. So a
label is extended only if it is worth more than all labels of its state before it, whose p was as
high or higher: Desrochers and Soumis, "A generalized permanent labelling algorithm for the shortest
path problem with time windows", INFOR 26(3), 1988.

An excursion that begins alive with probability p comes back with a share of p, the same for every
p, and is worth a convex function of p. For each level of the gate, the frontier of a piece lists
what excursions are worth at most that come back with a share or more. So between two levels, the
chord of what their frontiers list for the share of an excursion is at least what it is worth.
"""

from typing import NamedTuple

import numpy as np

from botohe_moo.base.types import FloatArray, IntArray, OffsetArray
from botohe_moo.bounds.kernels.relaxed import chord
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
_COARSER = 1.5  # how much more is taken together where a frontier has too many corners
# Steps of stairs, and gates, that are looked at in the time of one outcome.
_STEPS_AN_OUTCOME, _GATES_AN_OUTCOME = 16, 4


class Frontiers(NamedTuple):
    """What excursions into each piece are worth, for each level of its gate."""

    n: OffsetArray  # corners (n_pieces, n_levels + 1)
    # Of each corner the share of the probability that comes back, which falls, and the worth, which
    # rises (n_pieces, n_levels + 1, K).
    share: FloatArray
    worth: FloatArray


class Labels(NamedTuple):
    """Labels of a piece in the order in which they were found, and scratch."""

    alive: FloatArray  # (n_room)
    worth: FloatArray  # (n_room)
    state: IntArray  # (n_room)
    heap: IntArray  # labels to extend, that with the highest ``alive`` first (n_room)
    best: FloatArray  # the most that an extended label of each state is worth (n_states)
    # Labels at the entry of a piece, each worth more than those before: how many (1), which ones
    # (n_room), and by how much more others may be worth that each stands for (n_room).
    n_ends: OffsetArray
    ends: IntArray
    wide: FloatArray
    latest: OffsetArray  # the corner of the stairs that was exceeded the last time (1)
    # In which states excursions into a piece begin and end: how many there are (1), and which
    # (n_states, 2).
    n_gates: OffsetArray
    gates: OffsetArray
    # What a link leads to: shares of ``alive`` that are left, and what is collected ((2, 2 K)).
    outcomes: FloatArray


class LabelSearch(NamedTuple):
    """What labels are found with, and what they have to exceed."""

    net: Net
    states: States
    prices: FloatArray  # of visits (n_nodes, n_levels + 1)
    ahead: Completions  # under the same prices, with nothing beside
    stairs: Stairs  # which are raised above all trails
    corners: Corners
    most: FloatArray  # scratch (n_lines)
    frontiers: Frontiers
    labels: Labels
    tolerance: float  # by how much a label has to be worth more than those before it
    slack: float  # stairs are raised by as much more, to skip equal trails
    cap: float  # what no label is worth more than
    # Ends of excursions whose worth is close are one corner of a frontier. How close: this share of
    # how much worse than the best a trail above the stairs may be.
    fine: float
    n_most: int  # outcomes of links to look at


def new_labels(n_room: int, n_states: int) -> Labels:
    """Return room for ``n_room`` labels."""
    alive, worth, wide = (np.empty(n_room) for _ in range(3))
    state, heap, ends = (np.empty(n_room, np.int32) for _ in range(3))
    n_ends, latest, n_gates = np.zeros((3, 1), np.int64)
    gates, best = np.empty((n_states, 2), np.int64), np.empty(n_states)
    outcomes = np.empty((2, 2 * _MOST_CORNERS))
    return Labels(
        alive, worth, state, heap, best, n_ends, ends, wide, latest, n_gates, gates, outcomes
    )


def new_frontiers(net: Net, n_levels: int) -> Frontiers:
    """Return frontiers without corners; there is room for one where all pieces are dead ends."""
    shape = len(net.pieces.entry), n_levels + 1
    n_corners = _MOST_CORNERS if np.diff(net.pieces.first_option).max() > 1 else 1
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
    heap, alive, at = labels.heap, labels.alive, 0
    first, last = heap[0], heap[n - 1]
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


@inlined
def _level_at(net: Net, node: int, alive: float, n_levels: int) -> float:
    """Return the level of a probability to be alive at a node."""
    return float(min(alive / net.reach[node] * n_levels, n_levels * 1.0))


@inlined
def _worth_of(search: LabelSearch, node: int, alive: float) -> float:
    """Return what a visit is worth."""
    n_levels = search.prices.shape[1] - 1
    return chord(search.prices, node, _level_at(search.net, node, alive, n_levels))


@inlined
def _find_outcomes(search: LabelSearch, alive: float, link: int) -> int:
    """Write what a link leads to; return how many outcomes there are."""
    net, outcomes = search.net, search.labels.outcomes
    graph, pieces, move = net.world.graph, net.pieces, search.states.move[link]
    n_arcs, n_levels = graph.head.shape[0], search.prices.shape[1] - 1
    if move < n_arcs:
        share = graph.mean_survival[move]
        outcomes[0, 0], outcomes[1, 0] = share, 0.0
        if search.states.pays[link]:
            outcomes[1, 0] = _worth_of(search, graph.head[move], alive * share)
        return 1
    child = pieces.of_option[move - n_arcs]
    if move > n_arcs + pieces.first_option[child]:
        return 0  # the first option stands for all excursions
    level = _level_at(net, pieces.gate[child], alive, n_levels)
    low = min(int(level), n_levels - 1)
    shares, worths = search.frontiers.share[child], search.frontiers.worth[child]
    n_left, n_right = search.frontiers.n[child, low], search.frontiers.n[child, low + 1]
    left = right = 0.0
    i = k = n = 0
    while i < n_left or k < n_right:
        is_left = k == n_right or (i < n_left and shares[low, i] >= shares[low + 1, k])
        is_right = i == n_left or (k < n_right and shares[low + 1, k] >= shares[low, i])
        if is_left:
            outcomes[0, n], left = shares[low, i], worths[low, i]
            i += 1
        if is_right:
            outcomes[0, n], right = shares[low + 1, k], worths[low + 1, k]
            k += 1
        outcomes[1, n] = left + (right - left) * (level - low)
        n += 1
    return n


@inlined
def _is_above(search: LabelSearch, to: int, alive: float, worth: float) -> bool:
    """Return whether a label of the base's piece may become a trail above the stairs."""
    net, ahead, stairs = search.net, search.ahead, search.stairs
    node = search.states.node[to]
    level = _level_at(net, node, alive, ahead.values.shape[2] - 1)
    for line in range(ahead.mu.shape[0]):
        search.most[line] = worth + chord(ahead.values[line], to, level)
    highest = step_of(alive * net.world.ways.home[node], stairs.width, stairs.heights.shape[0])
    latest = search.labels.latest
    corner = exceeded(search.most, ahead.mu, search.corners, highest, latest[0])
    if corner >= 0:
        latest[0] = corner
    return corner >= 0


@helper
def _settle(search: LabelSearch, piece: int, alive: float, least: float, tried: int) -> int:
    """Find the labels of a piece that a robot enters alive with some probability.

    The first label is the entry itself. Trails have to survive with ``least``. In the base's piece,
    labels are left out that cannot come home above the stairs, and those that do raise them.
    Returns ``tried``, which is what the search has cost so far, with the outcomes of links looked
    at here; negative where ``n_most`` or the room was not enough.
    """
    net, states, stairs, labels = search.net, search.states, search.stairs, search.labels
    entry, n_steps = net.pieces.entry[piece], stairs.heights.shape[0]
    best, worth = labels.best, labels.worth
    for state in range(states.begin[piece], states.begin[piece + 1]):
        best[state] = -1.0
    labels.alive[0], labels.state[0], labels.heap[0] = alive, states.begin[piece], 0
    worth[0] = _worth_of(search, entry, alive) if piece > 0 else 0.0
    labels.n_ends[0] = 0
    n = n_heap = 1
    while n_heap > 0:
        label = _pop(labels, n_heap)
        n_heap -= 1
        state, here = labels.state[label], labels.alive[label]
        if label > 0 and worth[label] <= best[state] + search.tolerance:
            continue
        best[state] = worth[label]
        if states.node[state] == entry and piece > 0:
            n_ends = labels.n_ends[0]
            if n_ends == 0 or worth[label] > worth[labels.ends[n_ends - 1]]:
                labels.ends[n_ends] = label
                labels.n_ends[0] += 1
        elif states.node[state] == entry:
            at = step_of(here, stairs.width, n_steps)
            if worth[label] > stairs.heights[at]:
                lift(stairs.heights, at, worth[label] + search.slack)
                first = step_of(least, stairs.width, n_steps)
                find_corners(stairs, search.ahead.mu, first, search.corners)
                tried += n_steps // _STEPS_AN_OUTCOME
        # Shares found beyond a bridge also serve robots that enter alive with more, up to reach.
        most_alive = here if piece == 0 else here / alive * net.reach[entry]
        for link in range(states.first[state], states.first[state + 1]):
            to = states.to[link]
            most_home = most_alive * net.world.ways.home[states.node[to]]
            n_outcomes = _find_outcomes(search, here, link)
            tried += n_outcomes
            for i in range(n_outcomes):
                share = labels.outcomes[0, i]
                value = min(worth[label] + labels.outcomes[1, i], search.cap)
                if value <= best[to] + search.tolerance or most_home * share < least:
                    continue
                if piece == 0 and not _is_above(search, to, here * share, value):
                    continue
                if n >= labels.alive.shape[0] or tried > search.n_most:
                    return -tried
                labels.alive[n], worth[n], labels.state[n] = here * share, value, to
                _push(labels, n_heap, n)
                n_heap += 1
                n += 1
    return tried


@inlined
def _find_gates(search: LabelSearch, piece: int) -> None:
    """Write the states in which excursions into a piece begin and end."""
    states, pieces, labels = search.states, search.net.pieces, search.labels
    above, n = pieces.of[pieces.gate[piece]], 0
    move = search.net.ratio.shape[0] + pieces.first_option[piece]
    for state in range(states.begin[above], states.begin[above + 1]):
        for link in range(states.first[state], states.first[state + 1]):
            if states.move[link] == move:
                labels.gates[n, 0], labels.gates[n, 1] = state, states.to[link]
                n += 1
    labels.n_gates[0] = n


@inlined
def _shortfall(search: LabelSearch, above: int, at: int, level: float, worth: float) -> float:
    """Return by how much an excursion is worse than what is best where it begins.

    It begins at level ``at`` of the gate, in the piece ``above``, and comes back at ``level``.
    """
    ahead, gates, least = search.ahead, search.labels.gates, np.inf
    for k in range(ahead.mu.shape[0] if above == 0 else ahead.n_slopes[0, above]):
        table, row = ahead.values[k], 0
        if above > 0:
            table, row = ahead.inside[0], ahead.row[0, above, k] - search.states.begin[above]
        for i in range(search.labels.n_gates[0]):
            after = chord(table, row + gates[i, 1], level)
            least = min(least, table[row + gates[i, 0], at] - worth - after)
    return least


@inlined
def _write_frontier(search: LabelSearch, piece: int, at: int, spread: float) -> int:
    """Write the frontier of a piece at level ``at`` of its gate; return what that has cost.

    A corner stands for several ends of similar worth, with the highest share and the highest worth
    of them. How similar: see ``LabelSearch.fine``. Where these ends are further from the best at
    their gate than ``spread``, that distance counts instead.
    """
    net, labels, frontiers = search.net, search.labels, search.frontiers
    gate, n_levels = net.pieces.gate[piece], search.prices.shape[1] - 1
    above, back = net.pieces.of[gate], net.world.graph.mean_survival[net.pieces.back[piece]]
    shares, worths = frontiers.share[piece, at], frontiers.worth[piece, at]
    alive, n_ends, n_room = net.reach[gate] * at / n_levels, labels.n_ends[0], shares.shape[0]
    for i in range(n_ends):
        label = labels.ends[i]
        level = _level_at(net, gate, labels.alive[label] * back, n_levels)
        worse = _shortfall(search, above, at, level, labels.worth[label])
        labels.wide[i] = search.fine * max(spread, worse)
    n = n_room + 1
    while n > n_room:
        n, end = 0, -np.inf
        for i in range(n_ends):
            label = labels.ends[i]
            if labels.worth[label] > end and n <= n_room:
                n += 1
                end = labels.worth[label] + labels.wide[i]
                if n <= n_room:
                    shares[n - 1] = labels.alive[label] * back / alive
            worths[min(n, n_room) - 1] = labels.worth[label]
            labels.wide[i] = _COARSER * labels.wide[i] + search.tolerance
    frontiers.n[piece, at] = n
    return int(n_ends * labels.n_gates[0] // _GATES_AN_OUTCOME)


@kernel
def raise_by_labels(search: LabelSearch) -> int:
    """Raise stairs above all trails.

    Returns how many outcomes of links were looked at, with other work in such units, negative where
    ``n_most`` or the room was not enough.
    """
    net, ahead, stairs, corners = search.net, search.ahead, search.stairs, search.corners
    graph, pieces, frontiers = net.world.graph, net.pieces, search.frontiers
    n_levels, n_steps = search.prices.shape[1] - 1, stairs.heights.shape[0]
    least = max(stairs.least, net.min_survival) * (1.0 - ROUNDING)
    find_corners(stairs, ahead.mu, step_of(least, stairs.width, n_steps), corners)
    # By how much less than the best trail another may be worth that is above the stairs.
    spread, tried = np.inf, 0
    for line in range(ahead.mu.shape[0]):
        needed = corners.needed[corners.n[n_steps - 1] - 1, line]
        spread = min(spread, ahead.values[line, 0, n_levels] - needed)
    for piece in range(pieces.entry.shape[0] - 1, 0, -1):
        entry, arc, back = pieces.entry[piece], pieces.arc[piece], pieces.back[piece]
        _find_gates(search, piece)
        for at in range(1, n_levels + 1):
            alive = net.reach[pieces.gate[piece]] * at / n_levels * graph.mean_survival[arc]
            if pieces.first_option[piece + 1] - pieces.first_option[piece] > 1:
                tried = _settle(search, piece, alive, least, tried)
                if tried < 0:
                    return tried
                tried += _write_frontier(search, piece, at, max(spread, 0.0))
            else:  # a dead end of one node
                frontiers.n[piece, at] = 1
                frontiers.share[piece, at, 0] = graph.mean_survival[arc] * graph.mean_survival[back]
                frontiers.worth[piece, at, 0] = _worth_of(search, entry, alive)
    return _settle(search, 0, 1.0, least, tried)
