"""Trails that are worth the most: depth-first search, bounded by what relaxed trails are worth.

Partial trails that use the same arcs, except inside pieces that they have left, are at the same
node and can go on in the same ways. One is extended only if none before it was worth as much, alive
with as high a probability and as short. A set of arcs is recognised by 128 random bits: the
exclusive or of those of its arcs (Zobrist, "A new hashing method with application for game
playing", University of Wisconsin, 1970). Two sets are taken for one with probability 2⁻¹²⁸.
"""

from typing import NamedTuple

import numpy as np

from botohe_moo.base.types import FloatArray, IntArray, OffsetArray, Record, RecordArray, SeedArray
from botohe_moo.bounds.kernels.relaxed import Worth, chord
from botohe_moo.bounds.kernels.states import ROUNDING, Net, States
from botohe_moo.core.compile import array_maker, inlined, kernel
from botohe_moo.core.walk import new_visits, walk
from botohe_moo.core.world import Graph, World

# Survivals that are this much below a step of stairs, relative, count as on it.
_EDGE = 5e-13
_UNIT = 2.0**52  # of costs
_LARGEST = 256.0  # cost of an arc, and half of that of a trail: more is as good as no survival
_WAYS = 4  # partial trails that are remembered at one place
_LINK = 16  # how many numbers are written in the time that trying a move takes

_STEP = np.dtype(
    # ``back`` is the arc back from a dead end of one node, and ``pays`` a node that pays; else −1.
    # ``context`` is the depth at which the present excursion began.
    [(name, np.int64) for name in ("state", "link", "arc", "back", "pays", "context")]
    # ``after`` is the state behind an excursion that begins at this depth. ``cost`` is −log of the
    # survival, as an integer: sums do not depend on their order.
    + [(name, np.int64) for name in ("after", "cost")]
    + [(name, np.float64) for name in ("alive", "value", "length")]
    + [(name, np.uint64) for name in ("low", "high")]
)
_SEEN = np.dtype(
    [(name, np.uint64) for name in ("low", "high")]
    + [(name, np.int64) for name in ("cost", "search")]
    + [(name, np.float64) for name in ("value", "length")]
)
_FOUND = np.dtype([("n_trails", np.int64), ("n_searches", np.int64)])


class Completions(NamedTuple):
    """Bounds on what lies ahead, under several prices of survival and of visits at once.

    Line m: a partial trail whose robot comes home with probability s or more becomes worth at most

        what it is worth so far + ``values[m]`` ahead of it + Σ ``beside[m]`` of nodes not yet
        visited − ``mu[m]`` · s.
    """

    values: FloatArray  # of the base's piece (n_lines, n_states there, n_levels + 1)
    mu: FloatArray  # (n_lines)
    beside: FloatArray  # (n_lines, n_nodes)
    # The tables of all other pieces, which lines with the same prices of visits share: which each
    # line has (n_lines), and what ``Tables`` holds, for each of them.
    tables: OffsetArray
    n_slopes: OffsetArray
    slope: FloatArray
    row: OffsetArray
    inside: FloatArray


class Stairs(NamedTuple):
    """What a trail must be worth to count, by its survival.

    A trail with survival s is on step ⌊s / ``width``⌋, and counts if it is worth more than its
    height.
    """

    heights: FloatArray  # which never rise (n_steps)
    width: float
    least: float  # survival of the trails that are looked for, at least


class TrailRule(NamedTuple):
    """What to look for."""

    # Whether all trails above the stairs are looked for, in every order of their arcs. Otherwise
    # each trail found raises the stairs to its worth and ``slack`` more.
    every: bool
    slack: float
    n_most: int  # moves to try at most


class Corners(NamedTuple):
    """The first step of each height of stairs."""

    n: OffsetArray  # how many there are up to each step (n_steps)
    survival: FloatArray  # rounded down (n_steps)
    height: FloatArray  # (n_steps)
    # For each line the least of height + mu · survival over the corners so far. A trail whose line
    # begins no higher exceeds none of them (n_steps, n_lines).
    needed: FloatArray


@array_maker
def new_corners(n_steps: int, n_lines: int) -> Corners:
    """Return room for the corners of stairs with ``n_steps``."""
    n, needed = np.empty(n_steps, np.int64), np.empty((n_steps, n_lines))
    return Corners(n, np.empty(n_steps), np.empty(n_steps), needed)


class Depths(NamedTuple):
    """Scratch of depth-first searches, and what the last has found."""

    # How many trails the last search has found, and how many searches there have been.
    found: Record
    # The arcs of these trails (n_room, n_arcs), and how many each has (n_room). Where there are too
    # many trails, the last row has the last of them.
    arcs: OffsetArray
    n_arcs: OffsetArray
    steps: RecordArray  # of the partial trail (n_arcs + 2)
    # At each step the sum of ``Completions.beside`` of the nodes not visited (n_arcs + 2, n_lines).
    left: FloatArray
    # Of each excursion, by the depth at which it began: what lies ahead of the state behind it, for
    # each line and level of the gate (n_arcs + 2, n_lines, n_levels + 1).
    ahead: FloatArray
    corners: FloatArray  # scratch (2, K)
    used: OffsetArray  # the last search in which an arc is on the partial trail (n_arcs)
    met: OffsetArray  # the same of nodes that have paid (n_nodes)
    keys: SeedArray  # random bits of each arc (n_arcs, 2)
    cost: OffsetArray  # of each arc (n_arcs)
    # Sets of arcs that were extended, the last one for each place that their bits give.
    seen: RecordArray


def new_depths(
    net: Net, rng: np.random.Generator, n_seen: int, n_room: int, n_lines: int, n_levels: int
) -> Depths:
    """Return the scratch for ``n_seen`` sets of arcs, a power of 2, and ``n_room`` trails."""
    n_arcs, n_nodes = net.graph.n_arcs, net.graph.n_nodes
    cost = np.minimum(-np.log(net.graph.mean_survival), _LARGEST)
    return Depths(
        found=np.zeros(1, _FOUND).view(np.recarray)[0],
        arcs=np.zeros((n_room, n_arcs), np.int32),
        n_arcs=np.zeros(n_room, np.int64),
        steps=np.zeros(n_arcs + 2, _STEP).view(np.recarray),
        left=np.zeros((n_arcs + 2, n_lines)),
        ahead=np.zeros((n_arcs + 2, n_lines, n_levels + 1)),
        corners=np.zeros((2, int(np.diff(net.pieces.first_option).max(initial=1)))),
        used=np.full(n_arcs, -1, np.int64),
        met=np.full(n_nodes, -1, np.int64),
        keys=rng.integers(2**64, size=(n_arcs, 2), dtype=np.uint64),
        cost=np.rint(cost * _UNIT).astype(np.int64),
        seen=np.zeros(n_seen, _SEEN).view(np.recarray),
    )


@inlined
def lift(stairs: FloatArray, at: int, value: float) -> None:
    """Raise a step to a value, and the steps before it."""
    while at >= 0 and stairs[at] < value:
        stairs[at] = value
        at -= 1


@inlined
def step_of(survival: float, width: float, n_steps: int) -> int:
    """Return the step of a survival; the next one if only rounding keeps it below that."""
    return min(int(survival / width * (1.0 + _EDGE) + _EDGE), n_steps - 1)


@inlined
def find_corners(stairs: Stairs, mu: FloatArray, first: int, corners: Corners) -> None:
    """Write the corners from the step ``first`` on."""
    n = 0
    for at in range(stairs.heights.shape[0]):
        height = stairs.heights[at]
        if at == first or (at > first and height < stairs.heights[at - 1]):
            survival = at * stairs.width * (1.0 - ROUNDING) if at > 0 else 0.0
            corners.survival[n], corners.height[n] = survival, height
            for line in range(mu.shape[0]):
                before = corners.needed[n - 1, line] if n > 0 else np.inf
                corners.needed[n, line] = min(before, height + mu[line] * survival)
            n += 1
        corners.n[at] = n


@inlined
def exceeded(most: FloatArray, mu: FloatArray, corners: Corners, last: int, first: int) -> int:
    """Return a corner at a step up to ``last`` that all lines ``most`` − ``mu`` · s exceed, or −1.

    The corner ``first`` is looked at first: that which was exceeded the last time often is again.
    """
    n = corners.n[last]
    if n == 0:
        return -1
    for line in range(most.shape[0]):
        if most[line] <= corners.needed[n - 1, line]:
            return -1
    at = min(first, n - 1)
    for _ in range(n):
        bound = np.inf
        for line in range(most.shape[0]):
            bound = min(bound, most[line] - mu[line] * corners.survival[at])
        if bound > corners.height[at]:
            return int(at)
        at = at + 1 if at + 1 < n else 0
    return -1


@inlined
def _begin(depths: Depths, states: States, ahead: Completions) -> int:
    """Begin a search at the base; return its number."""
    depths.found.n_searches += 1
    depths.found.n_trails = 0
    step = depths.steps[0]
    step.state, step.link, step.arc, step.back, step.pays = 0, states.first[0], -1, -1, -1
    step.context, step.alive, step.value, step.length = 0, 1.0, 0.0, 0.0
    step.low, step.high, step.cost = 0, 0, 0
    for line in range(ahead.mu.shape[0]):
        depths.left[0, line] = ahead.beside[line].sum()
    return int(depths.found.n_searches)


@inlined
def _mark(depths: Depths, arc: int, back: int, pays: int, search: int) -> None:
    """Note the search in which arcs are on the partial trail, and a node has paid; −1 for none."""
    depths.used[arc] = search
    if back >= 0:
        depths.used[back] = search
    if pays >= 0:
        depths.met[pays] = search


@inlined
def _moved(graph: Graph, last: Record, arc: int, back: int) -> tuple[float, float, float]:
    """Return the probability to get over an arc, that behind both, and the length."""
    there = last.alive * graph.mean_survival[arc]
    if back < 0:
        return there, there, last.length + graph.length[arc]
    length = last.length + graph.length[arc] + graph.length[back]
    return there, there * graph.mean_survival[back], length


@inlined
def _used_after(
    depths: Depths, before: int, cost: int, arc: int, back: int
) -> tuple[int, int, int]:
    """Return the bits of the arcs used up to the depth ``before`` and of a move, and the cost.

    After an excursion, it does not matter which arcs it took.
    """
    step = depths.steps[before]
    low, high = step.low ^ depths.keys[arc, 0], step.high ^ depths.keys[arc, 1]
    cost += depths.cost[arc]
    if back >= 0:
        low, high = low ^ depths.keys[back, 0], high ^ depths.keys[back, 1]
        cost += depths.cost[back]
    return low, high, min(cost, int(2 * _LARGEST * _UNIT))


@inlined
def _add_left(
    depths: Depths, ahead: Completions, depth: int, pays: int, value: float, most: FloatArray
) -> None:
    """Add what a partial trail is worth, and what is left beside prices, to what lies ahead."""
    for line in range(most.shape[0]):
        left = depths.left[depth, line]
        if pays >= 0:
            left -= ahead.beside[line, pays]
        depths.left[depth + 1, line] = left
        most[line] += value + left


@inlined
def _record(depths: Depths, depth: int, arc: int, back: int) -> None:
    """Write the arcs of the partial trail and of one more move; in a full table over the last."""
    row = min(depths.found.n_trails, depths.n_arcs.shape[0] - 1)
    depths.found.n_trails += 1
    n = 0
    for i in range(1, depth + 2):
        first = depths.steps[i].arc if i <= depth else arc
        second = depths.steps[i].back if i <= depth else back
        depths.arcs[row, n] = first
        n += 1
        if second >= 0:
            depths.arcs[row, n] = second
            n += 1
    depths.n_arcs[row] = n


@inlined
def _is_seen(
    depths: Depths, search: int, low: int, high: int, cost: int, value: float, length: float
) -> bool:
    """Return whether a partial trail that is as good was extended; if not, remember this one."""
    first = int(np.int64(low & np.uint64(depths.seen.shape[0] // _WAYS - 1))) * _WAYS
    place = first + (cost & (_WAYS - 1))
    for at in range(first, first + _WAYS):
        seen = depths.seen[at]
        if seen.search != search:
            place = at
        elif seen.low == low and seen.high == high:
            if seen.value >= value and seen.cost <= cost and seen.length <= length:
                return True
            if seen.value <= value and seen.cost >= cost and seen.length >= length:
                place = at
    seen = depths.seen[place]
    seen.search, seen.low, seen.high, seen.value = search, low, high, value
    seen.cost, seen.length = cost, length
    return False


@inlined
def _bound_ahead(
    net: Net,
    states: States,
    ahead: Completions,
    depths: Depths,
    context: int,
    state: int,
    alive: float,
    most: FloatArray,
) -> None:
    """Write what lies ahead of a state, by each line (n_lines).

    Beyond a bridge that is the most over all corners (q, w) of the hull of what is left of the
    excursion: w, and what lies ahead of the gate with q.
    """
    n_levels, pieces, node = ahead.values.shape[2] - 1, net.pieces, states.node[state]
    level = min(alive / net.reach[node] * n_levels, n_levels * 1.0)
    piece, n, known = pieces.of[node], 0, -1
    if piece == 0:
        for line in range(most.shape[0]):
            most[line] = chord(ahead.values[line], state, level)
        return
    home = net.world.graph.mean_survival[pieces.back[piece]]
    unit = home / net.reach[pieces.gate[piece]] * n_levels
    local, outside, corners = state - states.begin[piece], depths.ahead[context], depths.corners
    for line in range(most.shape[0]):
        which = ahead.tables[line]
        if which != known:
            table, slope, row = ahead.inside[which], ahead.slope[which, piece], ahead.row
            n, known, q = ahead.n_slopes[which, piece], which, 0.0
            height = chord(table, row[which, piece, 0] + local, level)
            for k in range(n):
                worth = height - slope[k] * alive
                if k + 1 < n:
                    after = chord(table, row[which, piece, k + 1] + local, level)
                    q = min(max((after - height) / (slope[k + 1] - slope[k]), q), alive)
                    worth = max(height - slope[k] * q, after - slope[k + 1] * q)
                    height = after
                else:
                    q = alive
                corners[0, k], corners[1, k] = min(q * unit, n_levels * 1.0), worth
        best = 0.0
        for k in range(n):
            best = max(best, corners[1, k] + chord(outside, line, corners[0, k]))
        most[line] = best


@inlined
def _move_of(
    net: Net, states: States, last: Record, entered: Record, link: int
) -> tuple[int, int, int, int]:
    """Return the arc of a link, the arc back from a dead end, the piece entered, and the state.

    A link before the first of its state leads back over the bridge, to what the step that
    ``entered`` the piece says. Only the first option of an excursion is a move: the search makes
    the excursion itself. For others the arc is −1.
    """
    pieces, n_arcs = net.pieces, net.ratio.shape[0]
    if link < states.first[last.state]:
        return pieces.back[pieces.of[states.node[last.state]]], -1, -1, entered.after
    move, to = states.move[link], states.to[link]
    if move < n_arcs:
        return move, -1, -1, to
    child = pieces.of_option[move - n_arcs]
    if move > n_arcs + pieces.first_option[child]:
        return -1, -1, -1, to
    if pieces.first_option[child + 1] - pieces.first_option[child] == 1:
        return pieces.arc[child], pieces.back[child], -1, to
    return pieces.arc[child], -1, child, states.begin[child]


@inlined
def _enter(
    net: Net,
    states: States,
    ahead: Completions,
    depths: Depths,
    depth: int,
    after: int,
    child: int,
    most: FloatArray,
) -> int:
    """Write what lies ahead of the state ``after`` an excursion; return how many numbers."""
    last, gate, n_levels = depths.steps[depth], net.pieces.gate[child], ahead.values.shape[2] - 1
    n = min(int(last.alive / net.reach[gate] * n_levels) + 2, n_levels + 1)
    for at in range(n):
        alive = net.reach[gate] * at / n_levels
        _bound_ahead(net, states, ahead, depths, last.context, after, alive, most)
        for line in range(most.shape[0]):
            depths.ahead[depth + 1, line, at] = most[line]
    return int(n * ahead.mu.shape[0])


@kernel
def find_trails(
    net: Net,
    states: States,
    worth: Worth,
    ahead: Completions,
    stairs: Stairs,
    rule: TrailRule,
    depths: Depths,
) -> int:
    """Find trails above the stairs; unless ``every`` one is wanted, each raises the stairs.

    Returns how many moves were tried, negative where ``n_most`` or the room was not enough.
    """
    prices, mu, heights, width = worth.prices, worth.mu, stairs.heights, stairs.width
    graph, home, pieces = net.world.graph, net.world.ways.home, net.pieces
    found, steps, base = depths.found, depths.steps, net.world.team.start[0]
    n_levels, n_lines, n_stairs = prices.shape[1] - 1, ahead.mu.shape[0], heights.shape[0]
    least = max(stairs.least, net.min_survival) * (1.0 - ROUNDING)
    first, most = step_of(least, width, n_stairs), np.empty(n_lines)
    corners = new_corners(n_stairs, n_lines)
    find_corners(stairs, ahead.mu, first, corners)
    search, depth, n, latest = _begin(depths, states, ahead), 0, 0, 0
    while depth >= 0:
        last = steps[depth]
        if last.link == states.first[last.state + 1]:
            if depth > 0:
                _mark(depths, last.arc, last.back, last.pays, -1)
            depth -= 1
            continue
        last.link, link = last.link + 1, last.link
        arc, back, child, to = _move_of(net, states, last, steps[last.context], link)
        if arc < 0 or depths.used[arc] == search:
            continue
        visit, node = graph.head[arc], states.node[to]
        there, alive, length = _moved(graph, last, arc, back)
        at_home, longest = alive * home[node], (length + net.home_length[node]) * (1.0 - ROUNDING)
        if at_home < least or longest > net.max_length:
            continue
        n += 1
        if n > rule.n_most:
            break
        is_new = graph.reward[visit] > 0.0 and depths.met[visit] != search
        value, pays = last.value, visit if is_new else -1
        value += chord(prices, visit, there / net.reach[visit] * n_levels) if is_new else 0.0
        if node == base:
            at = step_of(alive, width, n_stairs)
            if value + mu * alive > heights[at]:
                if not rule.every:
                    lift(heights, at, value + mu * alive + rule.slack)
                    find_corners(stairs, ahead.mu, first, corners)
                    n += (n_stairs + depth) // _LINK  # what this takes
                elif found.n_trails == depths.n_arcs.shape[0]:
                    break
                _record(depths, depth, arc, back)
        context, before = last.context, depth
        if link < states.first[last.state]:
            context, before = steps[context - 1].context, context
        elif child >= 0:
            n += _enter(net, states, ahead, depths, depth, states.to[link], child, most) // _LINK
            context = depth + 1
        _bound_ahead(net, states, ahead, depths, context, to, alive, most)
        _add_left(depths, ahead, depth, pays, value, most)
        corner = exceeded(most, ahead.mu, corners, step_of(at_home, width, n_stairs), latest)
        if corner < 0:
            continue
        latest = corner
        low, high, cost = _used_after(depths, before, last.cost, arc, back)
        far = length if net.max_length < np.inf else 0.0
        if not rule.every and _is_seen(depths, search, low, high, cost, value, far):
            continue
        depth += 1
        step = steps[depth]
        step.state, step.arc, step.back, step.pays, step.context = to, arc, back, pays, context
        is_entry = node == pieces.entry[pieces.of[node]] and node != base
        step.link = states.first[to] - (1 if is_entry else 0)
        step.after, step.cost = states.to[link] if child >= 0 else -1, cost
        step.alive, step.value, step.length, step.low, step.high = alive, value, length, low, high
        _mark(depths, arc, back, pays, search)
    return n if depth < 0 else -n


@kernel
def follow_trails(
    world: World, arcs: IntArray, n_arcs: OffsetArray
) -> tuple[FloatArray, FloatArray]:
    """Return survivals of trails (n), and probabilities to reach each node that pays (n, n_nodes).

    Trail i takes the first ``n_arcs[i]`` arcs in row i of ``arcs``.
    """
    n_nodes = world.graph.reward.shape[0]
    survival, reached = np.empty(arcs.shape[0]), np.zeros((arcs.shape[0], n_nodes))
    visits = new_visits(n_nodes, 1)
    for i in range(arcs.shape[0]):
        given = arcs[i], n_arcs[i], 0, visits
        n, survival[i], _ = walk(world.graph, world.team, world.returns, *given)
        for j in range(n):
            reached[i, visits.node[j]] = visits.chance[j]
    return survival, reached
