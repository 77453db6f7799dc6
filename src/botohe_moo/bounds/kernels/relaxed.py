"""Upper bounds on what trails are worth, under prices that depend on the probability to be alive.

A visit of node v by a robot that is alive with probability p is worth f_v(p), coming home alive
with probability p is worth mu · p, and what lies ahead of a state is a function of p, too. All of
these are convex, and 0 at 0. They are given on a grid: level l of node v is the probability
reach[v] · l / n_levels. Between two levels a convex function lies below the chord, so that chords
bound what lies ahead.
"""

from typing import NamedTuple

import numpy as np

from botohe_moo.base.types import FloatArray, OffsetArray
from botohe_moo.bounds.kernels.states import Net, States, Worth
from botohe_moo.core.compile import inlined, kernel

_MOST_CHOICES = 2_000  # how often the choices of a level are improved
_STRAIGHT = 1e-12  # how far prices may be from a straight line, relative
_SAME = 1e-12  # by how much a link must be better than an earlier one to take its place
_LEAST_LOSS = 1e-9  # on a cycle of links; with less, its worth is lost in rounding


class _Level(NamedTuple):
    """One level: what links are worth, a choice of a link for each state, and its value."""

    # Links whose robots stay above the level below come first of each state: those of state s end
    # at ``end[s]``. They are worth ``gain`` + ``part`` of their arc × what lies ahead of their end
    # (n_states, n_links, n_arcs).
    end: OffsetArray
    gain: FloatArray
    part: FloatArray
    # What a state is worth that stops, or takes a link to a level that is known (n_states).
    known: FloatArray
    cap: FloatArray  # what nothing gets above at each node (n_nodes)
    value: FloatArray  # what lies ahead of each state with these choices, or more (n_states)
    chosen: OffsetArray  # −1 for what is known (n_states)
    # Scratch to follow the choices.
    path: OffsetArray  # states in the order in which they are followed (n_states)
    seen: OffsetArray  # 1 on the path, 2 where a state is valued (n_states)


@inlined
def chord(values: FloatArray, row: int, level: float) -> float:
    """Interpolate between two levels."""
    low = min(int(level), values.shape[1] - 2)
    return float(values[row, low] + (values[row, low + 1] - values[row, low]) * (level - low))


@inlined
def _weigh_arcs(
    net: Net, prices: FloatArray, level: int, low: OffsetArray, part: FloatArray, paid: FloatArray
) -> None:
    """Compute where each arc leads from a level of its tail, and what the visit is worth there.

    A robot gets to the level ``low`` + ``part`` of the arc's head, where 0 ≤ ``part`` ≤ 1. A visit
    is worth ``paid`` there.
    """
    head = net.world.graph.head
    for arc in range(head.shape[0]):
        there = net.ratio[arc] * level
        low[arc] = min(int(there), level - 1)
        part[arc] = there - low[arc]
        paid[arc] = chord(prices, head[arc], there)


@inlined
def _value_of(
    net: Net, states: States, prices: FloatArray, values: FloatArray, link: int, level: float
) -> float:
    """Return what a link is worth to a robot at a level of its tail, with what lies ahead."""
    arc = states.arc[link]
    there = net.ratio[arc] * level
    value = chord(values, states.to[link], there)
    return value + chord(prices, net.world.graph.head[arc], there) if states.pays[link] else value


@inlined
def _count_linear(prices: FloatArray) -> int:
    """Count the levels, from the lowest, up to which all prices are straight lines from 0."""
    n = prices.shape[1] - 1
    for node in range(prices.shape[0]):
        level = 1
        while level < n and abs(prices[node, level + 1] - prices[node, 1] * (level + 1)) <= (
            _STRAIGHT * prices[node, level + 1]
        ):
            level += 1
        n = min(n, level)
    return int(n)


@inlined
def _follow_choices(states: States, level: _Level) -> bool:
    """Compute what all states are worth with the links chosen; False where one is infinite."""
    cap, value = level.cap, level.value
    chosen, path, seen = level.chosen, level.path, level.seen
    seen[:] = 0
    for first in range(value.shape[0]):
        n, state = 0, first
        while seen[state] == 0 and chosen[state] >= 0:
            seen[state] = 1
            path[n] = state
            n += 1
            state = states.to[chosen[state]]
        if seen[state] == 0:
            value[state], seen[state] = level.known[state], 2
        elif seen[state] == 1:  # a cycle
            total, left, at = 0.0, 1.0, state
            while True:
                link = chosen[at]
                total += left * level.gain[link]
                left *= level.part[states.arc[link]]
                at = states.to[link]
                if at == state:
                    break
            most = cap[states.node[state]]
            value[state] = min(total / (1.0 - left), most) if left < 1.0 - _LEAST_LOSS else most
            if value[state] == np.inf:
                return False
            seen[state] = 2
        for i in range(n - 1, -1, -1):
            at = path[i]
            if seen[at] == 1:
                link = chosen[at]
                part = level.part[states.arc[link]]
                worth = level.gain[link] + part * value[states.to[link]]
                value[at] = min(worth, cap[states.node[at]])
                seen[at] = 2
    return True


@inlined
def _choose(
    states: States, level: _Level, tolerance: float, is_forward: bool
) -> tuple[bool, float]:
    """Choose better links, and raise values; return whether there were any.

    Also returns the most by which other values fall short of the best link. A raised value at once
    counts for states that come later in the pass, so passes alternate in direction.
    """
    value, n_states, is_better, short = level.value, level.value.shape[0], False, 0.0
    for i in range(n_states):
        state = i if is_forward else n_states - 1 - i
        best, chosen = level.known[state], -1
        for link in range(states.first[state], level.end[state]):
            worth = level.gain[link] + level.part[states.arc[link]] * value[states.to[link]]
            if worth > best:
                best, chosen = worth, link
        best = min(best, level.cap[states.node[state]])
        if best > value[state] + tolerance:
            value[state], level.chosen[state], is_better = best, chosen, True
        else:
            short = max(short, best - value[state])
    return is_better, short


@inlined
def _weigh_links(
    states: States, level: _Level, low: OffsetArray, paid: FloatArray, values: FloatArray, at: int
) -> None:
    """Write what links are worth at level ``at``: ``end``, ``gain`` and ``known`` of a level.

    Choices of links to levels that are known are taken back. ``values`` are those of the levels
    below (n_levels + 1, n_states).
    """
    part, below = level.part, values[at - 1]
    for state in range(level.end.shape[0]):
        link, end, best = states.first[state], states.first[state + 1], level.known[state]
        while link < end and low[states.arc[link]] == at - 1:
            arc = states.arc[link]
            level.gain[link] = below[states.to[link]] * (1.0 - part[arc])
            if states.pays[link]:
                level.gain[link] += paid[arc]
            link += 1
        level.end[state] = link
        if level.chosen[state] >= link:
            level.chosen[state] = -1
        while link < end:
            arc, to = states.arc[link], states.to[link]
            before, after = values[low[arc], to], values[low[arc] + 1, to]
            gain = before + (after - before) * part[arc]
            if states.pays[link]:
                gain += paid[arc]
            best = max(best, gain)
            link += 1
        level.known[state] = min(best, level.cap[states.node[state]])


@kernel
def relax(
    net: Net, states: States, worth: Worth, cap: FloatArray, tolerance: float, values: FloatArray
) -> tuple[float, int]:
    """Write what lies ahead of each state at each level, to a tolerance (n_states, n_levels + 1).

    Levels are solved from the lowest up, each by policy iteration: Howard, "Dynamic Programming and
    Markov Processes", MIT Press, 1960. Given the levels below, what lies ahead of a state is linear
    in what lies ahead of the others, so that one choice of a link in each state can be valued at
    once. Choices begin with those of the level below, and are improved until none can be. Nothing
    gets above ``cap`` (n_nodes, n_levels + 1). Prices have to be convex, and the links of each
    state to descend by the ratio of their arcs.

    Returns the most by which a value falls short of the best that one step leads to, up to
    rounding, inf where choices were improved too often; and how many links were looked at.
    """
    prices, mu = worth.prices, worth.mu
    n_states, n_levels, n_arcs = values.shape[0], values.shape[1] - 1, net.world.graph.head.shape[0]
    low, paid = np.empty(n_arcs, np.int64), np.empty(n_arcs)
    made = _Level(
        end=np.empty(n_states, np.int64),
        gain=np.empty(states.arc.shape[0]),
        part=np.empty(n_arcs),
        known=np.empty(n_states),
        cap=np.empty(cap.shape[0]),
        value=np.zeros(n_states),
        chosen=np.full(n_states, -1, np.int64),
        path=np.empty(n_states, np.int64),
        seen=np.empty(n_states, np.int64),
    )
    # Levels in rows: values of one level are read together.
    by_level = np.zeros((n_levels + 1, n_states))
    n_linear = _count_linear(prices) if np.isinf(cap).all() else 1
    most_short, n_looks = _STRAIGHT * prices.max(), 0
    for at in range(n_linear, n_levels + 1):
        _weigh_arcs(net, prices, at, low, made.part, paid)
        if at == n_linear:  # at this level and below, values are proportional to the level
            low[:], made.part[:] = at - 1, net.ratio
        made.cap[:] = cap[:, at]
        for state in range(n_states):
            is_base = states.node[state] == net.world.team.start[0]
            made.known[state] = mu * at / n_levels if is_base else 0.0
        _weigh_links(states, made, low, paid, by_level, at)
        n_looks += states.arc.shape[0]
        n_own = n_states + (made.end - states.first[:-1]).sum()
        is_better, short, n = True, 0.0, 0
        while is_better:
            if n == _MOST_CHOICES or not _follow_choices(states, made):
                return np.inf, n_looks
            n += 1
            n_looks += n_own
            is_better, short = _choose(states, made, tolerance, n % 2 == 0)
        most_short = max(most_short, short)
        for below in range(1 if at == n_linear else at, at + 1):
            by_level[below] = made.value * (below / at)
    values[:] = by_level.T
    return float(most_short), n_looks


@kernel
def follow(
    net: Net, states: States, worth: Worth, values: FloatArray, turn: int, links: OffsetArray
) -> tuple[int, float]:
    """Write the links of the best relaxed trail that leaves the base.

    Only at step ``turn`` it takes the second best link. It ends where ``links`` is full. Returns
    how many links there are, and what the best relaxed trail is worth, at least 0.
    """
    n_levels = values.shape[1] - 1
    state, level, n, most = 0, float(n_levels), 0, 0.0
    while n < links.shape[0]:
        is_home = states.node[state] == net.world.team.start[0] and n > 0
        best, second = worth.mu * level / n_levels if is_home else -1.0, -1.0
        best_link = second_link = -1
        for link in range(states.first[state], states.first[state + 1]):
            value = _value_of(net, states, worth.prices, values, link, level)
            if n == 0:
                most = max(most, value)
            if value > best + _SAME:
                second, second_link, best, best_link = best, best_link, value, link
            elif value > second:
                second, second_link = value, link
        if n == turn and second_link >= 0:
            best_link = second_link
        if best_link < 0:
            break
        links[n] = best_link
        n += 1
        level *= net.ratio[states.arc[best_link]]
        state = states.to[best_link]
    return n, most
