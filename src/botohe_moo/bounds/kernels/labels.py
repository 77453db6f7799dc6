"""Stairs above all relaxed trails, by labels in order of descending survival.

A label is the beginning of a relaxed trail: its state, the probability s to be alive there, and
what it is worth so far. What can follow does not depend on the past, and is worth the more the
higher s is. So a label is extended only if it is worth more than all labels of its state before it,
whose s was as high or higher: Desrochers and Soumis, "A generalized permanent labelling algorithm
for the shortest path problem with time windows", INFOR 26(3), 1988.

An excursion that begins alive with probability p comes back with a share of p, and is worth a
convex function of p. For each level of the gate, the frontier of a piece lists what excursions are
worth at most that come back with a share or more. Between two levels, the chord of what two
frontiers say about the same share bounds the worth.
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
from botohe_moo.core.compile import array_maker, helper, inlined, kernel

_MOST_CORNERS = 256  # of a frontier
_COARSER = 1.5  # how much more is taken together where a frontier has too many corners
_STEPS_A_LABEL = 16  # of stairs, that are looked at in the time that a label takes


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
    parent: IntArray  # the label that was extended, −1 for the first one (n_room)
    link: IntArray  # from the parent's state (n_room)
    share: FloatArray  # of the parent's ``alive`` that is left (n_room)
    heap: IntArray  # labels to extend, that with the highest ``alive`` first (n_room)
    best: FloatArray  # the most that an extended label of each state is worth (n_states)
    # How many labels come home, or to the piece's entry, each worth more than those before it; and
    # then these (1 + n_room).
    ends: OffsetArray
    wide: FloatArray  # by how much less than an end another may be worth that it stands for
    # What a link leads to: shares, and what is collected ((2, 2 K)).
    outcomes: FloatArray


class LabelRule(NamedTuple):
    """How labels are extended."""

    tolerance: float  # by how much a label has to be worth more than those before it
    cap: float  # what no label is worth more than
    slack: float  # stairs are raised by as much more, to skip equal trails
    # Excursions stand for others that are worth as much, up to this share of what a trail above the
    # stairs can be worse than the best.
    fine: float
    n_most: int  # outcomes of links to look at


class _Goal(NamedTuple):
    """What labels of the base's piece have to exceed."""

    ahead: Completions
    stairs: Stairs
    corners: Corners
    most: FloatArray  # scratch (n_lines)
    least: float  # survival that trails need, rounded down


def new_labels(n_room: int, n_states: int) -> Labels:
    """Return room for ``n_room`` labels."""
    alive, worth, share, wide = (np.empty(n_room) for _ in range(4))
    state, parent, link, heap = (np.empty(n_room, np.int32) for _ in range(4))
    best, ends = np.empty(n_states), np.empty(n_room + 1, np.int64)
    outcomes = np.empty((2, 2 * _MOST_CORNERS))
    return Labels(alive, worth, state, parent, link, share, heap, best, ends, wide, outcomes)


def new_frontiers(net: Net, n_levels: int) -> Frontiers:
    """Return frontiers without corners; there is room for one where all pieces are single nodes."""
    shape = len(net.pieces.entry), n_levels + 1
    n_corners = _MOST_CORNERS if len(net.pieces.of_option) >= len(net.pieces.entry) else 1
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


@array_maker
def _new_goal(net: Net, ahead: Completions, stairs: Stairs) -> _Goal:
    """Return the goal of stairs as they are."""
    n_stairs, n_lines = stairs.heights.shape[0], ahead.mu.shape[0]
    n, needed = np.empty(n_stairs, np.int64), np.empty((n_stairs, n_lines))
    corners = Corners(n, np.empty(n_stairs), np.empty(n_stairs), needed)
    least = max(stairs.least, net.min_survival) * (1.0 - ROUNDING)
    find_corners(stairs, ahead.mu, step_of(least, stairs.width, n_stairs), corners)
    return _Goal(ahead, stairs, corners, np.empty(n_lines), least)


@inlined
def _level_at(net: Net, node: int, alive: float, n_levels: int) -> float:
    """Return the level of a probability to be alive at a node."""
    return float(min(alive / net.reach[node] * n_levels, n_levels * 1.0))


@inlined
def _find_outcomes(
    net: Net,
    states: States,
    prices: FloatArray,
    frontiers: Frontiers,
    alive: float,
    link: int,
    outcomes: FloatArray,
) -> int:
    """Write what a link leads to; return how many outcomes there are."""
    graph, pieces, n_levels = net.world.graph, net.pieces, prices.shape[1] - 1
    move, n_arcs = states.move[link], graph.head.shape[0]
    if move < n_arcs:
        head, outcomes[0, 0], outcomes[1, 0] = graph.head[move], graph.survival[move], 0.0
        if states.pays[link]:
            level = _level_at(net, head, alive * graph.survival[move], n_levels)
            outcomes[1, 0] = chord(prices, head, level)
        return 1
    child = pieces.of_option[move - n_arcs]
    if move > n_arcs + pieces.first_option[child]:
        return 0  # the first option stands for all excursions
    level = _level_at(net, pieces.gate[child], alive, n_levels)
    low = min(int(level), n_levels - 1)
    shares, worths = frontiers.share[child], frontiers.worth[child]
    n_low, n_high = frontiers.n[child, low], frontiers.n[child, low + 1]
    left = right = 0.0
    i = k = n = 0
    while i < n_low or k < n_high:
        share = max(
            shares[low, i] if i < n_low else -1.0, shares[low + 1, k] if k < n_high else -1.0
        )
        if i < n_low and shares[low, i] == share:
            left = worths[low, i]
            i += 1
        if k < n_high and shares[low + 1, k] == share:
            right = worths[low + 1, k]
            k += 1
        outcomes[0, n], outcomes[1, n] = share, left + (right - left) * (level - low)
        n += 1
    return n


@inlined
def _is_above(net: Net, states: States, goal: _Goal, to: int, alive: float, worth: float) -> bool:
    """Return whether a label of the base's piece may become a trail above the stairs."""
    node, ahead, n_levels = states.node[to], goal.ahead, goal.ahead.values.shape[2] - 1
    level = _level_at(net, node, alive, n_levels)
    for line in range(ahead.mu.shape[0]):
        goal.most[line] = worth + chord(ahead.values[line], to, level)
    at_home = alive * net.world.ways.home[node]
    highest = step_of(at_home, goal.stairs.width, goal.stairs.heights.shape[0])
    return exceeded(goal.most, ahead.mu, goal.corners, highest, 0) >= 0


@helper
def _settle(
    net: Net,
    states: States,
    prices: FloatArray,
    frontiers: Frontiers,
    piece: int,
    alive: float,
    goal: _Goal,
    rule: LabelRule,
    tried: int,
    labels: Labels,
) -> int:
    """Find the labels of a piece that a robot enters alive with some probability.

    In the base's piece, labels are left out that cannot come home above the stairs, and those that
    do raise them. Returns ``tried`` and how many outcomes of links were looked at, negative where
    ``n_most`` or the room was not enough.
    """
    entry, n_levels, stairs = net.pieces.entry[piece], prices.shape[1] - 1, goal.stairs
    n_room, n_stairs = labels.alive.shape[0], stairs.heights.shape[0]
    best, worth, ends, outcomes = labels.best, labels.worth, labels.ends, labels.outcomes
    for state in range(states.begin[piece], states.begin[piece + 1]):
        best[state] = -1.0
    labels.alive[0], labels.state[0], labels.parent[0] = alive, states.begin[piece], -1
    worth[0] = 0.0
    if piece > 0:
        worth[0] = chord(prices, entry, _level_at(net, entry, alive, n_levels))
    labels.heap[0] = ends[0] = 0
    n = n_heap = 1
    while n_heap > 0:
        label = _pop(labels, n_heap)
        n_heap -= 1
        state, here = labels.state[label], labels.alive[label]
        if label > 0 and worth[label] <= best[state] + rule.tolerance:
            continue
        best[state] = worth[label]
        if states.node[state] == entry and piece > 0:
            if ends[0] == 0 or worth[label] > worth[ends[ends[0]]]:
                ends[0] += 1
                ends[ends[0]] = label
        elif states.node[state] == entry and label > 0:
            at = step_of(here, stairs.width, n_stairs)
            if worth[label] > stairs.heights[at]:
                lift(stairs.heights, at, worth[label] + rule.slack)
                first = step_of(goal.least, stairs.width, n_stairs)
                find_corners(stairs, goal.ahead.mu, first, goal.corners)
                tried += n_stairs // _STEPS_A_LABEL
                ends[0] += 1
                ends[ends[0]] = label
        for link in range(states.first[state], states.first[state + 1]):
            to = states.to[link]
            # Beyond a bridge, no trail is alive with more than reach.
            most_alive = here if piece == 0 else here / alive * net.reach[entry]
            most_home = most_alive * net.world.ways.home[states.node[to]]
            n_outcomes = _find_outcomes(net, states, prices, frontiers, here, link, outcomes)
            tried += n_outcomes
            for i in range(n_outcomes):
                share, value = outcomes[0, i], min(worth[label] + outcomes[1, i], rule.cap)
                if value <= best[to] + rule.tolerance or most_home * share < goal.least:
                    continue
                if piece == 0 and not _is_above(net, states, goal, to, here * share, value):
                    continue
                if n == n_room or tried > rule.n_most:
                    return -tried
                labels.alive[n], worth[n], labels.state[n] = here * share, value, to
                labels.parent[n], labels.link[n], labels.share[n] = label, link, share
                _push(labels, n_heap, n)
                n_heap += 1
                n += 1
    return tried


@inlined
def _find_gates(net: Net, states: States, piece: int, gates: OffsetArray) -> int:
    """Write the states in which excursions into a piece begin and end; return how many pairs."""
    above, n = net.pieces.of[net.pieces.gate[piece]], 0
    move = net.ratio.shape[0] + net.pieces.first_option[piece]
    for state in range(states.begin[above], states.begin[above + 1]):
        for link in range(states.first[state], states.first[state + 1]):
            if states.move[link] == move:
                gates[n, 0], gates[n, 1] = state, states.to[link]
                n += 1
    return n


@inlined
def _loss(
    states: States,
    ahead: Completions,
    above: int,
    gates: OffsetArray,
    n_gates: int,
    at: int,
    level: float,
    worth: float,
) -> float:
    """Return by how much an excursion is worse than what is best where it begins.

    It begins at level ``at`` of the gate, in the piece ``above``, and comes back at ``level``.
    """
    loss = np.inf
    for k in range(ahead.mu.shape[0] if above == 0 else ahead.n_slopes[0, above]):
        table, row = ahead.values[k], 0
        if above > 0:
            table, row = ahead.inside[0], ahead.row[0, above, k] - states.begin[above]
        for i in range(n_gates):
            after = chord(table, row + gates[i, 1], level)
            loss = min(loss, table[row + gates[i, 0], at] - worth - after)
    return loss


@inlined
def _write_frontier(
    net: Net,
    states: States,
    ahead: Completions,
    frontiers: Frontiers,
    piece: int,
    at: int,
    gates: OffsetArray,
    n_gates: int,
    spread: float,
    fine: float,
    labels: Labels,
) -> None:
    """Write the frontier of a piece at level ``at`` of its gate.

    A corner stands for several ends: it has the highest share and the highest worth of them. The
    worse excursions are, and the worse than ``spread``, the more of them are one.
    """
    gate, n_levels = net.pieces.gate[piece], ahead.values.shape[2] - 1
    above, home = net.pieces.of[gate], net.world.graph.survival[net.pieces.back[piece]]
    shares, worths = frontiers.share[piece, at], frontiers.worth[piece, at]
    alive, n_ends, n_room = net.reach[gate] * at / n_levels, labels.ends[0], shares.shape[0]
    for i in range(n_ends):
        label = labels.ends[i + 1]
        level = _level_at(net, gate, labels.alive[label] * home, n_levels)
        loss = _loss(states, ahead, above, gates, n_gates, at, level, labels.worth[label])
        labels.wide[i] = fine * max(spread, loss)
    n = n_room + 1
    while n > n_room:
        n, end = 0, -np.inf
        for i in range(n_ends):
            label = labels.ends[i + 1]
            if labels.worth[label] > end and n <= n_room:
                n += 1
                end = labels.worth[label] + labels.wide[i]
                if n <= n_room:
                    shares[n - 1] = labels.alive[label] * home / alive
            worths[min(n, n_room) - 1] = labels.worth[label]
            labels.wide[i] *= _COARSER
    frontiers.n[piece, at] = n


@kernel
def raise_by_labels(
    net: Net,
    states: States,
    prices: FloatArray,
    ahead: Completions,
    stairs: Stairs,
    rule: LabelRule,
    frontiers: Frontiers,
    labels: Labels,
) -> int:
    """Raise stairs above all relaxed trails; the labels of the base's piece are left.

    Returns how many outcomes of links were looked at, negative where ``n_most`` or the room was not
    enough.
    """
    graph, pieces, n_levels = net.world.graph, net.pieces, prices.shape[1] - 1
    goal, gates = _new_goal(net, ahead, stairs), np.empty((states.node.shape[0], 2), np.int64)
    # By how much less than the best trail another may be worth that is above the stairs.
    spread = np.inf
    for line in range(ahead.mu.shape[0]):
        n = goal.corners.n[stairs.heights.shape[0] - 1]
        spread = min(spread, ahead.values[line, 0, n_levels] - goal.corners.needed[n - 1, line])
    spread, tried = max(spread, rule.tolerance), 0
    for piece in range(pieces.entry.shape[0] - 1, 0, -1):
        gate, arc = pieces.gate[piece], pieces.arc[piece]
        n_gates = _find_gates(net, states, piece, gates)
        for at in range(1, n_levels + 1):
            alive = net.reach[gate] * at / n_levels * graph.survival[arc]
            if pieces.first_option[piece + 1] - pieces.first_option[piece] == 1:  # a dead end
                entry, frontiers.n[piece, at] = pieces.entry[piece], 1
                share = graph.survival[arc] * graph.survival[pieces.back[piece]]
                frontiers.share[piece, at, 0] = share
                level = _level_at(net, entry, alive, n_levels)
                frontiers.worth[piece, at, 0] = chord(prices, entry, level)
                continue
            tried = _settle(net, states, prices, frontiers, piece, alive, goal, rule, tried, labels)
            if tried < 0:
                return tried
            given = net, states, ahead, frontiers, piece, at, gates, n_gates, spread
            _write_frontier(*given, rule.fine, labels)
    return _settle(net, states, prices, frontiers, 0, 1.0, goal, rule, tried, labels)


@kernel
def settle_excursion(
    net: Net,
    states: States,
    prices: FloatArray,
    ahead: Completions,
    stairs: Stairs,
    rule: LabelRule,
    frontiers: Frontiers,
    labels: Labels,
    piece: int,
    alive: float,
) -> int:
    """Find the labels of a piece, as :func:`raise_by_labels` does for the one of the base."""
    goal = _new_goal(net, ahead, stairs)
    return _settle(net, states, prices, frontiers, piece, alive, goal, rule, 0, labels)
