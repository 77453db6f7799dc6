"""The most that relaxed trails are worth, under prices that depend on the probability to be alive.

A visit of node v by a robot that is alive with probability p is worth f_v(p), coming home alive
with probability p is worth mu · p, and what lies ahead of a state is a function of p, too. All of
these are convex, and 0 at 0. They are given on a grid: level l of node v is the probability
reach[v] · l / n_levels. Between two levels a convex function lies below the chord, so that chords
bound what lies ahead.
"""

import numpy as np

from botohe_moo._base.types import FloatArray, OffsetArray
from botohe_moo.kernels.bounds.states import Net, States
from botohe_moo.kernels.compile import helper, inlined, kernel

# Links are looked at so often each, on average, before it is given up to raise values.
_MOST_LOOKS = 1_000
_MOST_CHOICES = 200  # times that choices are made better
_STRAIGHT = 1e-12  # how far prices may be from a straight line, relative
_LEAST_LOSS = 1e-9  # on a cycle, for it to be worth no more than floats can say


@inlined
def chord(values: FloatArray, row: int, level: float) -> float:
    """Interpolate between two levels."""
    low = min(int(level), values.shape[1] - 2)
    return float(values[row, low] + (values[row, low + 1] - values[row, low]) * (level - low))


@inlined
def _weigh_arcs(
    net: Net, prices: FloatArray, level: int, low: OffsetArray, part: FloatArray, paid: FloatArray
) -> None:
    """Say for all arcs between which levels of its head a robot gets from a level of its tail.

    Between ``low`` and the next, ``part`` of the way; ``paid`` is what a visit is worth there.
    """
    head = net.graph.head
    for arc in range(head.shape[0]):
        there = net.ratio[arc] * level
        low[arc] = min(int(there), level - 1)
        part[arc] = there - low[arc]
        paid[arc] = chord(prices, head[arc], there)


@inlined
def _value_behind(
    states: States, values: FloatArray, link: int, low: int, part: float, paid: float
) -> float:
    to = states.to[link]
    value = values[to, low] + (values[to, low + 1] - values[to, low]) * part
    return float(value + paid if states.pays[link] else value)


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


@helper
def _follow_choices(
    net: Net,
    states: States,
    chosen: OffsetArray,
    paid: FloatArray,
    stop: FloatArray,
    value: FloatArray,
    path: OffsetArray,
    seen: OffsetArray,
) -> bool:
    """Value all states, each with its chosen link, −1 to stop; False where a cycle never ends."""
    seen[:] = 0
    for first in range(value.shape[0]):
        n, state = 0, first
        while seen[state] == 0 and chosen[state] >= 0:
            seen[state] = 1
            path[n] = state
            n += 1
            state = states.to[chosen[state]]
        if seen[state] == 0:
            value[state], seen[state] = stop[state], 2
        elif seen[state] == 1:  # a cycle
            total, alive, at = 0.0, 1.0, state
            while True:
                link = chosen[at]
                if states.pays[link]:
                    total += alive * paid[states.arc[link]]
                alive *= net.ratio[states.arc[link]]
                at = states.to[link]
                if at == state:
                    break
            if alive > 1.0 - _LEAST_LOSS:
                return False
            value[state] = total / (1.0 - alive)
        end = state
        for i in range(n - 1, -1, -1):
            at = path[i]
            link = chosen[at]
            seen[at] = 2
            if at == end:  # of a cycle, valued before
                continue
            worth = value[states.to[link]] * net.ratio[states.arc[link]]
            value[at] = worth + paid[states.arc[link]] if states.pays[link] else worth
    return True


@helper(makes_arrays=True)
def _relax_linear(
    net: Net, states: States, paid: FloatArray, stop: FloatArray, tolerance: float, most: int
) -> tuple[FloatArray, bool]:
    """Give what lies ahead of each state at a level up to which prices are straight lines.

    All values are proportional to the probability to be alive there, so that a choice of a link in
    each state can be valued at once, and is made better until none is: Howard, "Dynamic Programming
    and Markov Processes", MIT Press, 1960. False where a cycle is worth more without end.
    """
    n_states = stop.shape[0]
    value, chosen = np.zeros(n_states), np.full(n_states, -1, np.int64)
    path, seen = np.empty(n_states, np.int64), np.empty(n_states, np.int64)
    for _ in range(most):
        if not _follow_choices(net, states, chosen, paid, stop, value, path, seen):
            return value, False
        is_settled = True
        for state in range(n_states):
            best = value[state]
            for link in range(states.first[state], states.first[state + 1]):
                arc = states.arc[link]
                worth = value[states.to[link]] * net.ratio[arc]
                if states.pays[link]:
                    worth += paid[arc]
                if worth > best + tolerance:
                    best, chosen[state], is_settled = worth, link, False
        if is_settled:
            break
    return value, True


@kernel
def relax(
    net: Net,
    states: States,
    prices: FloatArray,
    mu: float,
    cap: FloatArray,
    tolerance: float,
    values: FloatArray,
) -> bool:
    """Write what lies ahead of each state at each level, from below, to a tolerance (n_states, ·).

    Nothing gets above ``cap`` (n_nodes, ·). False where it has taken too long.
    """
    n_states, n_levels, n_arcs = values.shape[0], values.shape[1] - 1, net.graph.head.shape[0]
    low, part, paid = np.empty(n_arcs, np.int64), np.empty(n_arcs), np.empty(n_arcs)
    queue, is_queued = np.empty(n_states, np.int64), np.zeros(n_states, np.bool_)
    values[:, 0] = 0.0
    n_looks = 0
    most_looks = _MOST_LOOKS * (states.arc.shape[0] + 1_000)
    n_linear = 0
    if np.isinf(cap).all():
        n_linear = _count_linear(prices)
        stop = np.where(states.node == net.graph.base, mu * n_linear / n_levels, 0.0)
        _weigh_arcs(net, prices, n_linear, low, part, paid)
        lowest, is_finite = _relax_linear(net, states, paid, stop, tolerance, _MOST_CHOICES)
        if not is_finite:
            return False
        for level in range(1, n_linear + 1):
            values[:, level] = lowest * (level / n_linear)
    for level in range(n_linear + 1, n_levels + 1):
        _weigh_arcs(net, prices, level, low, part, paid)
        begin = n_queued = 0
        grown = level / (level - 1.0) if level > 1 else 0.0
        for state in range(n_states):  # a convex function that is 0 at 0 grows as much, at least
            value = values[state, level - 1] * grown
            if states.node[state] == net.graph.base:
                value = max(value, mu * level / n_levels)
            values[state, level] = min(value, cap[states.node[state], level])
        for state in range(n_states - 1, -1, -1):
            best = values[state, level]
            for link in range(states.first[state], states.first[state + 1]):
                arc = states.arc[link]
                best = max(
                    best, _value_behind(states, values, link, low[arc], part[arc], paid[arc])
                )
            best = min(best, cap[states.node[state], level])
            if best > values[state, level]:
                values[state, level] = best
                queue[n_queued], is_queued[state] = state, True
                n_queued += 1
        while n_queued > 0:
            state = queue[begin]
            begin = begin + 1 if begin + 1 < n_states else 0
            n_queued -= 1
            is_queued[state] = False
            first, end = states.first_entering[state], states.first_entering[state + 1]
            n_looks += end - first
            if n_looks > most_looks:
                return False
            for i in range(first, end):
                link = states.entering[i]
                arc = states.arc[link]
                if low[arc] != level - 1:
                    continue
                value = _value_behind(states, values, link, low[arc], part[arc], paid[arc])
                source = states.source[link]
                value = min(value, cap[states.node[source], level])
                if value > values[source, level] + tolerance:
                    values[source, level] = value
                    if not is_queued[source]:
                        is_queued[source] = True
                        last = begin + n_queued
                        queue[last - n_states if last >= n_states else last] = source
                        n_queued += 1
    return True


@kernel
def shortfall(
    net: Net, states: States, prices: FloatArray, mu: float, cap: FloatArray, values: FloatArray
) -> float:
    """Give by how much a value falls short, at most, of the best that one step leads to."""
    n_states, n_levels, n_arcs = values.shape[0], values.shape[1] - 1, net.graph.head.shape[0]
    low, part, paid = np.empty(n_arcs, np.int64), np.empty(n_arcs), np.empty(n_arcs)
    most = 0.0
    for level in range(1, n_levels + 1):
        _weigh_arcs(net, prices, level, low, part, paid)
        for state in range(n_states):
            is_base = states.node[state] == net.graph.base
            best = mu * level / n_levels if is_base else 0.0
            for link in range(states.first[state], states.first[state + 1]):
                arc = states.arc[link]
                best = max(
                    best, _value_behind(states, values, link, low[arc], part[arc], paid[arc])
                )
            best = min(best, cap[states.node[state], level])
            most = max(most, best - values[state, level])
    return most


@kernel
def follow(
    net: Net,
    states: States,
    prices: FloatArray,
    mu: float,
    values: FloatArray,
    turn: int,
    links: OffsetArray,
) -> int:
    """Write the links of the best relaxed trail that leaves the base; give how many there are.

    At step ``turn`` it takes the second best link. It ends where ``links`` is full.
    """
    n_levels = values.shape[1] - 1
    state, level, n = 0, float(n_levels), 0
    while n < links.shape[0]:
        is_home = states.node[state] == net.graph.base and n > 0
        best, second = mu * level / n_levels if is_home else -1.0, -1.0
        best_link = second_link = -1
        for link in range(states.first[state], states.first[state + 1]):
            arc = states.arc[link]
            there = net.ratio[arc] * level
            value = chord(values, states.to[link], there)
            if states.pays[link]:
                value += chord(prices, net.graph.head[arc], there)
            if value > best + 1e-12:
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
    return n


@kernel
def best_leaving(net: Net, states: States, prices: FloatArray, values: FloatArray) -> float:
    """Give what the best relaxed trail that leaves the base is worth, at least 0."""
    n_levels = values.shape[1] - 1
    best = 0.0
    for link in range(states.first[0], states.first[1]):
        arc = states.arc[link]
        there = net.ratio[arc] * n_levels
        value = chord(values, states.to[link], there)
        if states.pays[link]:
            value += chord(prices, net.graph.head[arc], there)
        best = max(best, value)
    return best
