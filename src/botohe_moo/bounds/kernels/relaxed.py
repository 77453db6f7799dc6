"""Upper bounds on what trails are worth, under prices that depend on the probability to be alive.

A visit of node v by a robot that is alive with probability p is worth f_v(p), coming home alive
with probability p is worth mu · p, and what lies ahead of a state is a function of p, too. All of
these are convex, and 0 at 0. They are given on a grid: level l of node v is the probability
reach[v] · l / n_levels. Between two levels a convex function lies below the chord, so that chords
bound what lies ahead.

An excursion that begins with p collects w and comes back alive with q. What follows is convex in q.
So only the pairs (q, w) on their concave hull count. For slopes σ_1 < … < σ_K, the tables of a
piece hold h_k = max (w + σ_k q). The half planes w ≤ h_k − σ_k q contain the hull, and their
corners are the options of the excursion.
"""

from typing import NamedTuple

import numpy as np

from botohe_moo.base.types import FloatArray, OffsetArray
from botohe_moo.bounds.kernels.states import Net, States
from botohe_moo.core.compile import array_maker, inlined, kernel
from botohe_moo.core.world import Graph

_MOST_CHOICES = 2_000  # how often the choices of a level are improved
_STRAIGHT = 1e-12  # how far prices may be from a straight line, relative
_SAME = 1e-12  # by how much a link must be better than an earlier one to take its place
_LEAST_LOSS = 1e-9  # on a cycle of links; with less, its worth is lost in rounding
_STEEP = (0.0, 1 / 16, 1.0)  # the first slopes of a hull, as shares of the largest


class Worth(NamedTuple):
    """``Prices`` for kernels: for all nodes, and on a finer grid of levels."""

    prices: FloatArray  # (n_nodes, n_levels + 1)
    mu: float


class Tables(NamedTuple):
    """What lies ahead inside the pieces beyond bridges, and so what excursions are worth."""

    # Where each move leads from each level of its tail, as a level there, and what it pays
    # (n_levels + 1, n_arcs + n_options).
    there: FloatArray
    paid: FloatArray
    # Of each piece: how many slopes there are (n_pieces), in ascending order (n_pieces, K), and the
    # first row of the table for each (n_pieces, K): state j of piece i has row[i, k] + j.
    n_slopes: OffsetArray
    slope: FloatArray
    row: OffsetArray
    values: FloatArray  # (n_rows, n_levels + 1)


class _Level(NamedTuple):
    """One level: what links are worth, a choice of a link for each state, and its value."""

    # A link leads to a level below this one, or to this share ``part`` of the way from the level
    # below to this one: it is worth ``gain`` + ``part`` of its move × what lies ahead of its end.
    # Links with a part of state s end before ``end[s]`` (n_links, n_moves, n_states).
    gain: FloatArray
    part: FloatArray
    end: OffsetArray
    # What a state is worth that stops, or takes a later link (n_states).
    known: FloatArray
    cap: FloatArray  # what it is not worth more than (n_states)
    value: FloatArray  # what lies ahead of each state with these choices, or more (n_states)
    chosen: OffsetArray  # a link before ``end``, or −1 for what is known (n_states)
    # Scratch to follow the choices.
    path: OffsetArray  # states in the order in which they are followed (n_states)
    seen: OffsetArray  # 1 on the path, 2 where a state is valued (n_states)
    below: FloatArray  # what lies ahead at each level so far (n_levels + 1, n_states)


class Rule(NamedTuple):
    """How values are computed."""

    tolerance: float  # values are raised only where they rise by more
    cap: float  # what all visits ahead are worth together, at most
    steepest: float  # the largest slope of a hull
    enough: float  # slopes are added until the hull is about this near to the true one


@inlined
def chord(values: FloatArray, row: int, level: float) -> float:
    """Interpolate between two levels."""
    low = min(int(level), values.shape[1] - 2)
    return float(values[row, low] + (values[row, low + 1] - values[row, low]) * (level - low))


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
def _follow_choices(states: States, begin: int, level: _Level, n_states: int) -> None:
    """Compute what all states are worth with the links chosen."""
    cap, value = level.cap, level.value
    chosen, path, seen = level.chosen, level.path, level.seen
    seen[:n_states] = 0
    for first in range(n_states):
        n, state = 0, first
        while seen[state] == 0 and chosen[state] >= 0:
            seen[state] = 1
            path[n] = state
            n += 1
            state = states.to[chosen[state]] - begin
        if seen[state] == 0:
            value[state], seen[state] = level.known[state], 2
        elif seen[state] == 1:  # a cycle
            total, left, at = 0.0, 1.0, state
            while True:
                link = chosen[at]
                total += left * level.gain[link]
                left *= level.part[states.move[link]]
                at = states.to[link] - begin
                if at == state:
                    break
            most = cap[state]
            value[state] = min(total / (1.0 - left), most) if left < 1.0 - _LEAST_LOSS else most
            seen[state] = 2
        for i in range(n - 1, -1, -1):
            at = path[i]
            if seen[at] == 1:
                link = chosen[at]
                part = level.part[states.move[link]]
                worth = level.gain[link] + part * value[states.to[link] - begin]
                value[at] = min(worth, cap[at])
                seen[at] = 2


@inlined
def _choose(
    states: States, begin: int, level: _Level, n_states: int, tolerance: float, is_forward: bool
) -> tuple[bool, float]:
    """Choose better links, and raise values; return whether there were any.

    Also returns the most by which other values fall short of the best link. A raised value at once
    counts for states that come later in the pass, so passes alternate in direction.
    """
    value, is_better, short = level.value, False, 0.0
    for i in range(n_states):
        state = i if is_forward else n_states - 1 - i
        best, chosen = level.known[state], -1
        for link in range(states.first[begin + state], level.end[state]):
            part = level.part[states.move[link]]
            worth = level.gain[link] + part * value[states.to[link] - begin]
            if worth > best:
                best, chosen = worth, link
        best = min(best, level.cap[state])
        if best > value[state] + tolerance:
            value[state], level.chosen[state], is_better = best, chosen, True
        else:
            short = max(short, best - value[state])
    return is_better, short


@inlined
def _weigh_links(
    states: States, piece: int, tables: Tables, level: _Level, at: int, is_lowest: bool
) -> None:
    """Write what links are worth at level ``at``: links of the level, and ``known``.

    At the lowest level, values at the levels below are proportional to them. Choices of links to
    levels that are known are taken back.
    """
    begin, below, part = states.begin[piece], level.below[at - 1], level.part
    there, paid = tables.there[at], tables.paid[at]
    for move in range(part.shape[0]):
        part[move] = there[move] / at if is_lowest else max(there[move] - (at - 1), 0.0)
    for state in range(states.begin[piece + 1] - begin):
        first, best = states.first[begin + state], level.known[state]
        end = first
        for link in range(first, states.first[begin + state + 1]):
            move, to = states.move[link], states.to[link] - begin
            gain = paid[move] if states.pays[link] else 0.0
            if there[move] >= at - 1 or is_lowest:
                if not is_lowest:
                    gain += below[to] * (1.0 - part[move])
                end = link + 1
            else:
                low = int(there[move])
                left, right = level.below[low, to], level.below[low + 1, to]
                gain += left + (right - left) * (there[move] - low)
                best = max(best, gain)
            level.gain[link] = gain
        level.known[state], level.end[state] = min(best, level.cap[state]), end
        if level.chosen[state] >= end:
            level.chosen[state] = -1


@inlined
def _solve(
    net: Net,
    states: States,
    piece: int,
    slope: float,
    tables: Tables,
    rule: Rule,
    level: _Level,
    n_linear: int,
) -> float:
    """Write what lies ahead of each state of a piece to ``level.below``, for one slope.

    Levels are solved from the lowest up, each by policy iteration: Howard, "Dynamic Programming and
    Markov Processes", MIT Press, 1960. Given the levels below, what lies ahead of a state is linear
    in what lies ahead of the others, so that one choice of a link in each state can be valued at
    once. Where choices would have to be improved too often, values are at the cap. Returns the most
    by which a value falls short of the best that one step leads to, up to rounding.
    """
    begin, n_states = states.begin[piece], states.begin[piece + 1] - states.begin[piece]
    n_levels, entry = level.below.shape[0] - 1, net.pieces.entry[piece]
    most_short = 0.0
    level.below[0, :n_states], level.chosen[:n_states] = 0.0, -1
    for at in range(n_linear, n_levels + 1):
        for state in range(n_states):
            node = states.node[begin + state]
            survived = slope * net.reach[node] * at / n_levels
            level.cap[state] = rule.cap + survived
            level.known[state] = survived if node == entry else 0.0
        _weigh_links(states, piece, tables, level, at, at == n_linear)
        is_better, short, n = True, 0.0, 0
        while is_better and n < _MOST_CHOICES:
            _follow_choices(states, begin, level, n_states)
            n += 1
            is_better, short = _choose(states, begin, level, n_states, rule.tolerance, n % 2 == 0)
        if is_better:
            short = 0.0
            for state in range(n_states):
                level.value[state] = level.cap[state]
        most_short = max(most_short, short)
        for lower in range(1 if at == n_linear else at, at + 1):
            for state in range(n_states):
                level.below[lower, state] = level.value[state] * (lower / at)
    return most_short


@array_maker
def _new_level(states: States, n_moves: int, n_levels: int) -> _Level:
    """Return scratch for the largest piece."""
    n_states = (states.begin[1:] - states.begin[:-1]).max()
    return _Level(
        gain=np.empty(states.to.shape[0]),
        part=np.empty(n_moves),
        end=np.empty(n_states, np.int64),
        known=np.empty(n_states),
        cap=np.empty(n_states),
        value=np.zeros(n_states),
        chosen=np.empty(n_states, np.int64),
        path=np.empty(n_states, np.int64),
        seen=np.empty(n_states, np.int64),
        below=np.zeros((n_levels + 1, n_states)),
    )


@inlined
def _next_slope(
    slope: FloatArray, heights: FloatArray, n: int, most: FloatArray
) -> tuple[int, float, float]:
    """Return where a slope is missing the most: before which one, how much, and what slope.

    ``heights`` are convex in the slope (n, n_levels + 1), and rise by ``most`` at most
    (n_levels + 1). Between two slopes they are below the chord, and above the lines that go on from
    the chords on either side.
    """
    n_levels, where, widest, best = heights.shape[1] - 1, -1, 0.0, 0.0
    for k in range(n - 1):
        low, high = slope[k], slope[k + 1]
        for at in range(1 + n_levels // 3, n_levels + 1):
            a, b = heights[k, at], heights[k + 1, at]
            rise = 0.0
            if k > 0:
                rise = (a - heights[k - 1, at]) / (low - slope[k - 1])
            fall = most[at]
            if k + 2 < n:
                fall = min(fall, (heights[k + 2, at] - b) / (slope[k + 2] - high))
            if fall <= rise:
                continue
            # a + rise · (x − low) = b − fall · (high − x)
            x = (b - a + rise * low - fall * high) / (rise - fall)
            if x <= low or x >= high:
                continue
            gap = a + (b - a) * (x - low) / (high - low) - (a + rise * (x - low))
            if gap > widest:
                where, widest, best = k + 1, gap, x
    margin = 0.05 * (slope[where] - slope[where - 1])
    return where, widest, min(max(best, slope[where - 1] + margin), slope[where] - margin)


@inlined
def _write_options(net: Net, piece: int, tables: Tables, heights: FloatArray, n: int) -> None:
    """Write the corners of the hull of a piece's excursions.

    A corner lies on both its lines, or on the higher one where rounding has moved it: so nothing of
    the hull is lost.
    """
    gate, slope = net.pieces.gate[piece], tables.slope[piece]
    first = net.world.graph.head.shape[0] + net.pieces.first_option[piece]
    n_options = net.pieces.first_option[piece + 1] - net.pieces.first_option[piece]
    n_levels = heights.shape[1] - 1
    unit = net.reach[gate] / n_levels
    out = net.world.graph.mean_survival[net.pieces.arc[piece]]
    home = net.world.graph.mean_survival[net.pieces.back[piece]]
    for at in range(n_levels + 1):
        most, last = unit * at * out, 0.0
        for k in range(n_options):
            if k >= n:
                tables.there[at, first + k] = tables.paid[at, first + k] = 0.0
                continue
            q, paid = most, heights[k, at] - slope[k] * most
            if k + 1 < n:
                q = (heights[k + 1, at] - heights[k, at]) / (slope[k + 1] - slope[k])
                q = min(max(q, last), most)
                paid = max(heights[k, at] - slope[k] * q, heights[k + 1, at] - slope[k + 1] * q)
            tables.there[at, first + k] = min(q * home / unit, at * 1.0)
            tables.paid[at, first + k] = paid
            last = q


@kernel
def look_ahead(
    net: Net,
    states: States,
    prices: FloatArray,
    mus: FloatArray,
    rule: Rule,
    tables: Tables,
    values: FloatArray,
) -> float:
    """Write what excursions are worth, and what lies ahead of each state of the base's piece.

    Pieces come from the outermost inwards, and the base's at the end, for each price of survival:
    ``values`` has (n_mus, n_states there, n_levels + 1). Slopes are added where the lines may lie
    furthest above the hull, as in sandwich algorithms: Rote, "The convergence rate of the sandwich
    algorithm for approximating convex functions", Computing 48, 1992. Prices have to be convex.
    Returns the most by which a value falls short of the best that one step leads to, up to
    rounding.
    """
    graph, pieces = net.world.graph, net.pieces
    n_levels, n_arcs = prices.shape[1] - 1, graph.head.shape[0]
    for at in range(n_levels + 1):
        for arc in range(n_arcs):
            there = net.ratio[arc] * at
            tables.there[at, arc] = there
            tables.paid[at, arc] = chord(prices, graph.head[arc], there)
    n_linear = _count_linear(prices)
    level, n_most = _new_level(states, tables.there.shape[1], n_levels), tables.slope.shape[1]
    heights, most = np.empty((n_most, n_levels + 1)), np.empty(n_levels + 1)
    most_short = _STRAIGHT * prices.max()
    for piece in range(pieces.entry.shape[0] - 1, 0, -1):
        n_states = states.begin[piece + 1] - states.begin[piece]
        entry, first = pieces.entry[piece], n_arcs + pieces.first_option[piece]
        out, home = graph.mean_survival[pieces.arc[piece]], graph.mean_survival[pieces.back[piece]]
        if pieces.first_option[piece + 1] - pieces.first_option[piece] == 1:  # a dead end
            for at in range(n_levels + 1):
                tables.there[at, first] = at * out * home
                tables.paid[at, first] = prices[entry, at]
            continue
        for at in range(n_levels + 1):
            most[at] = net.reach[pieces.gate[piece]] * at / n_levels * out
        slope, row, n = tables.slope[piece], tables.row[piece], 0
        where, new = 0, _STEEP[0] * rule.steepest
        while True:
            # The table for the new slope, and its place among the others.
            free = row[n]
            for k in range(n, where, -1):
                slope[k], row[k], heights[k] = slope[k - 1], row[k - 1], heights[k - 1]
            slope[where], row[where] = new, free
            n += 1
            short = _solve(net, states, piece, new, tables, rule, level, n_linear)
            most_short = max(most_short, short)
            for state in range(n_states):
                tables.values[free + state] = level.below[:, state]
            for at in range(n_levels + 1):
                heights[where, at] = prices[entry, at] + level.below[at, 0]
            if n == n_most:
                break
            if n < 3:
                where, new = n, _STEEP[n] * rule.steepest
                continue
            where, gap, new = _next_slope(slope, heights, n, most)
            if where < 0 or gap < rule.enough:
                break
        tables.n_slopes[piece] = n
        _write_options(net, piece, tables, heights, n)
    for i in range(mus.shape[0]):
        short = _solve(net, states, 0, mus[i], tables, rule, level, n_linear)
        most_short = max(most_short, short)
        for state in range(values.shape[1]):
            values[i, state] = level.below[:, state]
    return float(most_short)


@inlined
def _take(
    graph: Graph, arcs: OffsetArray, paid: OffsetArray, n: int, arc: int, pays: bool, alive: float
) -> tuple[int, float]:
    """Write the next arc of a trail; return how many there are, and how likely it is survived."""
    arcs[n], paid[n] = arc, int(pays)
    return n + 1, float(alive * graph.mean_survival[arc])


@kernel
def follow(
    net: Net,
    states: States,
    worth: Worth,
    tables: Tables,
    values: FloatArray,
    turn: int,
    arcs: OffsetArray,
    paid: OffsetArray,
) -> tuple[int, float]:
    """Write the arcs of the best relaxed trail that leaves the base, and whether visits pay.

    Only at step ``turn`` it takes the second best link. It ends where ``arcs`` is full. Returns how
    many arcs there are, and what the best relaxed trail is worth, at least 0.
    """
    graph, pieces, prices = net.world.graph, net.pieces, worth.prices
    n_levels, n_arcs, n_room = values.shape[1] - 1, graph.head.shape[0], arcs.shape[0]
    # Of each excursion on the way: the state behind it, and the slope of the piece it began in.
    after, slopes = np.empty(n_room + 1, np.int64), np.empty(n_room + 1, np.int64)
    state, piece, k, alive, depth, n, step, most = 0, 0, 0, 1.0, 0, 0, 0, 0.0
    while n < n_room - 1:
        table = values if piece == 0 else tables.values
        offset = 0 if piece == 0 else tables.row[piece, k] - states.begin[piece]
        slope = worth.mu if piece == 0 else tables.slope[piece, k]
        node = states.node[state]
        level = min(alive / net.reach[node] * n_levels, n_levels * 1.0)
        high = min(int(level) + 1, n_levels)
        is_out = node == pieces.entry[piece] and (piece > 0 or n > 0)
        best, second = slope * alive if is_out else -1.0, -1.0
        best_link = second_link = -1
        for link in range(states.first[state], states.first[state + 1]):
            move = states.move[link]
            part = level / high
            there = tables.there[high, move] * part
            value = chord(table, offset + states.to[link], there)
            if states.pays[link]:
                is_arc, gain = move < n_arcs, tables.paid[high, move] * part
                value += chord(prices, graph.head[move], there) if is_arc else gain
            if n == 0:
                most = max(most, value)
            if value > best + _SAME:
                second, second_link, best, best_link = best, best_link, value, link
            elif value > second:
                second, second_link = value, link
        best_link = second_link if step == turn and second_link >= 0 else best_link
        step += 1
        if best_link < 0:
            if piece == 0:
                break
            n, alive = _take(graph, arcs, paid, n, pieces.back[piece], False, alive)
            depth -= 1
            state, k = after[depth], slopes[depth]
            piece = pieces.of[states.node[state]]
            continue
        move, to = states.move[best_link], states.to[best_link]
        if move < n_arcs:
            n, alive = _take(graph, arcs, paid, n, move, states.pays[best_link], alive)
            state = to
            continue
        child = pieces.of_option[move - n_arcs]
        pays = graph.reward[pieces.entry[child]] > 0.0
        n, alive = _take(graph, arcs, paid, n, pieces.arc[child], pays, alive)
        if pieces.first_option[child + 1] - pieces.first_option[child] == 1:
            n, alive = _take(graph, arcs, paid, n, pieces.back[child], False, alive)
            state = to
            continue
        # In the piece, survival is worth the slope of what follows.
        there = tables.there[high, move] * level / high
        low = min(int(there), n_levels - 1)
        rise = table[offset + to, low + 1] - table[offset + to, low]
        wanted = rise * n_levels / net.reach[node] * graph.mean_survival[pieces.back[child]]
        after[depth], slopes[depth] = to, k
        depth += 1
        k = int(np.abs(tables.slope[child, : tables.n_slopes[child]] - wanted).argmin())
        state, piece = states.begin[child], child
    return n, most
