"""Trails that are worth the most: depth-first search, bounded by what relaxed trails are worth.

Partial trails that use the same arcs are at the same node, alive with the same probability, and
have visited the same nodes. Only the most valuable of them is extended. A set of arcs is recognised
by 128 random bits.
"""

from typing import NamedTuple

import numpy as np

from botohe_moo.base.types import FloatArray, IntArray, OffsetArray, Record, RecordArray, SeedArray
from botohe_moo.bounds.kernels.relaxed import chord
from botohe_moo.bounds.kernels.states import ROUNDING, Net, States, Worth
from botohe_moo.core.compile import inlined, kernel
from botohe_moo.core.walk import new_visits, walk
from botohe_moo.core.world import World

# Survivals that are this much below a step of stairs, relative, count as on it.
_EDGE = 1e-13
_LINK = 16  # how many numbers are written in the time that trying a link takes

_STEP = np.dtype(
    [(name, np.int64) for name in ("state", "link", "arc", "pays")]
    + [(name, np.float64) for name in ("alive", "value", "length")]
    + [(name, np.uint64) for name in ("low", "high")]
)
_SEEN = np.dtype(
    [("low", np.uint64), ("high", np.uint64), ("value", np.float64), ("search", np.int64)]
)
_FOUND = np.dtype([("n_trails", np.int64), ("n_searches", np.int64)])


class Completions(NamedTuple):
    """Bounds on what lies ahead, under several prices of survival and of visits at once.

    Line m: what a partial trail becomes worth whose robot comes home with probability s or more is
    at most what it is worth so far + ``values[m]`` + ``beside`` of all nodes not yet visited
    − ``mu[m]`` · s.
    """

    values: FloatArray  # (n_lines, n_states, n_levels + 1)
    mu: FloatArray  # (n_lines)
    beside: FloatArray  # (n_lines, n_nodes)


class Stairs(NamedTuple):
    """What a trail must be worth to count, by its survival.

    Step b is for survivals of b · ``width`` or more.
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
    n_most: int  # links to try at most


class Corners(NamedTuple):
    """The first step of each height of stairs."""

    n: OffsetArray  # how many there are up to each step (n_steps)
    survival: FloatArray  # rounded down (n_steps)
    height: FloatArray  # (n_steps)
    # What each line is worth without survival, at least, if it exceeds any of the corners so far
    # (n_steps, n_lines).
    needed: FloatArray


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
    used: OffsetArray  # the last search in which an arc is on the partial trail (n_arcs)
    met: OffsetArray  # the same of nodes that have paid (n_nodes)
    keys: SeedArray  # random bits of each arc (n_arcs, 2)
    # Sets of arcs that were extended, the last one for each place that their bits give.
    seen: RecordArray


def new_depths(
    net: Net, random_state: np.random.Generator, n_seen: int, n_room: int, n_lines: int
) -> Depths:
    """Return the scratch for ``n_seen`` sets of arcs, a power of 2, and ``n_room`` trails."""
    n_arcs, n_nodes = net.graph.n_arcs, net.graph.n_nodes
    return Depths(
        found=np.zeros(1, _FOUND).view(np.recarray)[0],
        arcs=np.zeros((n_room, n_arcs), np.int32),
        n_arcs=np.zeros(n_room, np.int64),
        steps=np.zeros(n_arcs + 2, _STEP).view(np.recarray),
        left=np.zeros((n_arcs + 2, n_lines)),
        used=np.full(n_arcs, -1, np.int64),
        met=np.full(n_nodes, -1, np.int64),
        keys=random_state.integers(2**64, size=(n_arcs, 2), dtype=np.uint64),
        seen=np.zeros(n_seen, _SEEN).view(np.recarray),
    )


@inlined
def _raise(stairs: FloatArray, at: int, value: float) -> None:
    """Raise a step to a value, and the steps before it."""
    while at >= 0 and stairs[at] < value:
        stairs[at] = value
        at -= 1


@inlined
def _step_of(survival: float, width: float, n_steps: int) -> int:
    """Return the step that a survival lies on, or the next step where it is on the edge."""
    return min(int(survival / width * (1.0 + _EDGE) + _EDGE), n_steps - 1)


@inlined
def _find_corners(stairs: Stairs, mu: FloatArray, first: int, corners: Corners) -> None:
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
def _exceeded(most: FloatArray, mu: FloatArray, corners: Corners, last: int, first: int) -> int:
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
    step.state, step.link, step.arc, step.pays = 0, states.first[0], -1, 0
    step.alive, step.value, step.length = 1.0, 0.0, 0.0
    step.low, step.high = 0, 0
    for line in range(ahead.mu.shape[0]):
        depths.left[0, line] = ahead.beside[line].sum()
    return int(depths.found.n_searches)


@inlined
def _take_back(depths: Depths, depth: int, head: OffsetArray) -> None:
    """Take the last arc of the partial trail back."""
    last = depths.steps[depth]
    depths.used[last.arc] = -1
    if last.pays:
        depths.met[head[last.arc]] = -1


@inlined
def _record(depths: Depths, depth: int, arc: int) -> None:
    """Write the arcs of the partial trail and one more; in a full table over the last trail."""
    row = min(depths.found.n_trails, depths.n_arcs.shape[0] - 1)
    depths.found.n_trails += 1
    depths.n_arcs[row] = depth + 1
    for i in range(depth):
        depths.arcs[row, i] = depths.steps[i + 1].arc
    depths.arcs[row, depth] = arc


@inlined
def _is_seen(depths: Depths, search: int, low: int, high: int, value: float) -> bool:
    """Return whether these arcs were extended with as much value; if not, remember them."""
    seen = depths.seen[np.int64(low & np.uint64(depths.seen.shape[0] - 1))]
    if seen.search == search and seen.low == low and seen.high == high and seen.value >= value:
        return True
    seen.search, seen.low, seen.high, seen.value = search, low, high, value
    return False


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

    Returns how many links were tried, negative where ``n_most`` or the room was not enough.
    """
    prices, mu, heights, width = worth.prices, worth.mu, stairs.heights, stairs.width
    graph, home, base = net.world.graph, net.world.ways.home, net.world.team.start[0]
    found, steps = depths.found, depths.steps
    n_levels, n_lines, n_stairs = prices.shape[1] - 1, ahead.mu.shape[0], heights.shape[0]
    least = max(stairs.least, net.min_survival) * (1.0 - ROUNDING)
    first, most = _step_of(least, width, n_stairs), np.empty(n_lines)
    n_corners, needed = np.empty(n_stairs, np.int64), np.empty((n_stairs, n_lines))
    corners = Corners(n_corners, np.empty(n_stairs), np.empty(n_stairs), needed)
    _find_corners(stairs, ahead.mu, first, corners)
    search, depth, n, latest = _begin(depths, states, ahead), 0, 0, 0
    while depth >= 0:
        last = steps[depth]
        if last.link == states.first[last.state + 1]:
            if depth > 0:
                _take_back(depths, depth, graph.head)
            depth -= 1
            continue
        link = last.link
        last.link += 1
        arc = states.arc[link]
        if depths.used[arc] == search:
            continue
        node, alive = graph.head[arc], last.alive * graph.survival[arc]
        length = last.length + graph.length[arc]
        at_home = alive * home[node]
        if at_home < least:
            continue
        if (length + net.home_length[node]) * (1.0 - ROUNDING) > net.max_length:
            continue
        n += 1
        if n > rule.n_most:
            break
        level, value, pays = alive / net.reach[node] * n_levels, last.value, 0
        if graph.reward[node] > 0.0 and depths.met[node] != search and node != base:
            value += chord(prices, node, level)
            pays = 1
        if node == base:
            at = _step_of(alive, width, n_stairs)
            if value + mu * alive > heights[at]:
                if not rule.every:
                    _raise(heights, at, value + mu * alive + rule.slack)
                    _find_corners(stairs, ahead.mu, first, corners)
                    n += (n_stairs + depth) // _LINK  # what this takes
                elif found.n_trails == depths.n_arcs.shape[0]:
                    break
                _record(depths, depth, arc)
        for line in range(n_lines):
            left = depths.left[depth, line] - pays * ahead.beside[line, node]
            depths.left[depth + 1, line] = left
            most[line] = value + left + chord(ahead.values[line], states.to[link], level)
        highest = _step_of(at_home, width, n_stairs)
        exceeded = _exceeded(most, ahead.mu, corners, highest, latest)
        if exceeded < 0:
            continue
        latest = exceeded
        low, high = last.low ^ depths.keys[arc, 0], last.high ^ depths.keys[arc, 1]
        if not rule.every and _is_seen(depths, search, low, high, value):
            continue
        depth += 1
        step = steps[depth]
        to = states.to[link]
        step.state, step.link, step.arc, step.pays = to, states.first[to], arc, pays
        step.alive, step.value, step.length, step.low, step.high = alive, value, length, low, high
        depths.used[arc] = search
        if pays:
            depths.met[node] = search
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
    visits = new_visits(n_nodes)
    for i in range(arcs.shape[0]):
        n, survival[i], _ = walk(world, world.returns, arcs[i], n_arcs[i], 0, visits)
        for j in range(n):
            reached[i, visits.node[j]] = visits.chance[j]
    return survival, reached
