"""Upper bounds on what trails are worth, under prices that depend on the probability to be alive.

A visit of node v by a robot that is alive with probability p is worth f_v(p), coming home alive
with probability p is worth mu · p, and what lies ahead of a state is a function of p, too. All of
these are convex, and 0 at 0. They are given on a grid: level l of node v is the probability
reach[v] · l / n_levels. Between two levels a convex function lies below the chord, so that chords
bound what lies ahead.
"""

from typing import NamedTuple

import numpy as np

from botohe_moo._base.types import FloatArray, OffsetArray
from botohe_moo.kernels.bounds.states import Net, States, Worth
from botohe_moo.kernels.compile import inlined, kernel

_MOST_CHOICES = 2_000  # how often the choices of a level are improved
_STRAIGHT = 1e-12  # how far prices may be from a straight line, relative
_SAME = 1e-12  # by how much a link must be better than an earlier one to take its place
_LEAST_LOSS = 1e-9  # on a cycle of links; with less, its worth is lost in rounding


class _Level(NamedTuple):
    """One level: what links are worth, a choice of a link for each state, and its value."""

    # A link is worth ``gain`` + ``part`` × what lies ahead of its end (n_links).
    gain: FloatArray
    part: FloatArray
    stop: FloatArray  # what stopping in each state is worth (n_states)
    cap: FloatArray  # what nothing gets above at each node (n_nodes)
    value: FloatArray  # what lies ahead of each state with these choices, or more (n_states)
    chosen: OffsetArray  # −1 to stop (n_states)
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
    head = net.graph.head
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
    return value + chord(prices, net.graph.head[arc], there) if states.pays[link] else value


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
            value[state], seen[state] = level.stop[state], 2
        elif seen[state] == 1:  # a cycle
            total, left, at = 0.0, 1.0, state
            while True:
                link = chosen[at]
                total += left * level.gain[link]
                left *= level.part[link]
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
                worth = level.gain[link] + level.part[link] * value[states.to[link]]
                value[at] = min(worth, cap[states.node[at]])
                seen[at] = 2
    return True


@inlined
def _choose(states: States, level: _Level, tolerance: float, is_forward: bool) -> bool:
    """Choose better links, and raise values; return whether there were any.

    A raised value at once counts for states that come later in the pass, so passes alternate in
    direction.
    """
    cap, value, chosen = level.cap, level.value, level.chosen
    is_better, n_states = False, value.shape[0]
    for i in range(n_states):
        state = i if is_forward else n_states - 1 - i
        best, most = value[state], cap[states.node[state]]
        if level.stop[state] > best + tolerance:
            best, chosen[state], is_better = level.stop[state], -1, True
        for link in range(states.first[state], states.first[state + 1]):
            worth = min(level.gain[link] + level.part[link] * value[states.to[link]], most)
            if worth > best + tolerance:
                best, chosen[state], is_better = worth, link, True
        value[state] = best
    return is_better


@kernel
def relax(
    net: Net, states: States, worth: Worth, cap: FloatArray, tolerance: float, values: FloatArray
) -> bool:
    """Write what lies ahead of each state at each level, to a tolerance (n_states, n_levels + 1).

    Levels are solved from the lowest up, each by policy iteration: Howard, "Dynamic Programming and
    Markov Processes", MIT Press, 1960. Given the levels below, what lies ahead of a state is linear
    in what lies ahead of the others, so that one choice of a link in each state can be valued at
    once. Choices begin with those of the level below, and are improved until none can be. Nothing
    gets above ``cap`` (n_nodes, n_levels + 1).

    Returns False where choices were improved too often.
    """
    prices, mu = worth.prices, worth.mu
    n_states, n_levels, n_arcs = values.shape[0], values.shape[1] - 1, net.graph.head.shape[0]
    low, part, paid = np.empty(n_arcs, np.int64), np.empty(n_arcs), np.empty(n_arcs)
    n_links = states.arc.shape[0]
    value, most = np.zeros(n_states), np.empty(cap.shape[0])
    made = _Level(
        gain=np.empty(n_links),
        part=np.empty(n_links),
        stop=np.empty(n_states),
        cap=most,
        value=value,
        chosen=np.full(n_states, -1, np.int64),
        path=np.empty(n_states, np.int64),
        seen=np.empty(n_states, np.int64),
    )
    values[:, 0] = 0.0
    n_linear = _count_linear(prices) if np.isinf(cap).all() else 1
    for level in range(n_linear, n_levels + 1):
        _weigh_arcs(net, prices, level, low, part, paid)
        most[:] = cap[:, level]
        for link in range(n_links):
            arc, to = states.arc[link], states.to[link]
            gain = paid[arc] if states.pays[link] else 0.0
            if level == n_linear:  # at this level and below, values are proportional to the level
                made.part[link] = net.ratio[arc]
            elif low[arc] == level - 1:
                gain += values[to, level - 1] * (1.0 - part[arc])
                made.part[link] = part[arc]
            else:
                before, after = values[to, low[arc]], values[to, low[arc] + 1]
                gain += before + (after - before) * part[arc]
                made.part[link] = 0.0
            made.gain[link] = gain
        for state in range(n_states):
            is_base = states.node[state] == net.graph.base
            made.stop[state] = min(mu * level / n_levels, most[net.graph.base]) if is_base else 0.0
        n = 0
        while True:
            if n == _MOST_CHOICES or not _follow_choices(states, made):
                return False
            n += 1
            if not _choose(states, made, tolerance, n % 2 == 0):
                break
        for below in range(1 if level == n_linear else level, level + 1):
            values[:, below] = value * (below / level)
    return True


@kernel
def shortfall(net: Net, states: States, worth: Worth, cap: FloatArray, values: FloatArray) -> float:
    """Return the most by which a value falls short of the best that one step leads to."""
    n_levels, most = values.shape[1] - 1, 0.0
    for state in range(values.shape[0]):
        node = states.node[state]
        for level in range(1, n_levels + 1):
            best = worth.mu * level / n_levels if node == net.graph.base else 0.0
            for link in range(states.first[state], states.first[state + 1]):
                best = max(best, _value_of(net, states, worth.prices, values, link, float(level)))
            most = max(most, min(best, cap[node, level]) - values[state, level])
    return most


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
        is_home = states.node[state] == net.graph.base and n > 0
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
