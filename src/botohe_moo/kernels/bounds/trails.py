"""The trail that is worth the most: depth-first search, bounded by what lies ahead if relaxed.

Of partial trails that use the same arcs only the most valuable is gone on from: they are at the
same node, alive with the same probability, and have seen the same nodes. Sets of arcs are known by
128 random bits each.
"""

from typing import NamedTuple

import numpy as np

from botohe_moo._base.types import FloatArray, OffsetArray, Record, RecordArray, SeedArray
from botohe_moo.kernels.bounds.relaxed import chord
from botohe_moo.kernels.bounds.states import ROUNDING, Net, States
from botohe_moo.kernels.compile import kernel

_STEP = np.dtype(
    [(name, np.int64) for name in ("state", "link", "arc", "pays")]
    + [(name, np.float64) for name in ("alive", "value", "length")]
    + [(name, np.uint64) for name in ("low", "high")]
)
_SEEN = np.dtype(
    [("low", np.uint64), ("high", np.uint64), ("value", np.float64), ("search", np.int64)]
)
_FOUND = np.dtype([("value", np.float64), ("n_arcs", np.int64), ("n_searches", np.int64)])


class Depths(NamedTuple):
    """Scratch of depth-first searches, and what the last has found."""

    # The best ``value`` found, with how many arcs, and how many searches there have been.
    found: Record
    arcs: OffsetArray  # the arcs of the best trail found (n_arcs)
    steps: RecordArray  # of the partial trail (n_arcs + 2)
    used: OffsetArray  # the last search in which an arc is on the partial trail (n_arcs)
    met: OffsetArray  # the same of nodes that have paid (n_nodes)
    keys: SeedArray  # random bits of each arc (n_arcs, 2)
    # The last sets of arcs that were gone on from, each at the place that its bits tell.
    seen: RecordArray


def new_depths(net: Net, random_state: np.random.Generator, n_seen: int) -> Depths:
    """Make the scratch; ``n_seen`` is a power of 2."""
    n_arcs, n_nodes = net.graph.n_arcs, net.graph.n_nodes
    return Depths(
        np.zeros(1, _FOUND).view(np.recarray)[0],
        np.zeros(n_arcs, np.int64),
        np.zeros(n_arcs + 2, _STEP).view(np.recarray),
        np.full(n_arcs, -1, np.int64),
        np.full(n_nodes, -1, np.int64),
        random_state.integers(2**64, size=(n_arcs, 2), dtype=np.uint64),
        np.zeros(n_seen, _SEEN).view(np.recarray),
    )


@kernel
def find_best(
    net: Net,
    states: States,
    prices: FloatArray,
    mu: float,
    values: FloatArray,
    least: float,
    n_most: int,
    depths: Depths,
) -> int:
    """Find a trail that leaves the base and is worth more than ``least``, and no other more.

    Gives how many steps were tried; −1 if ``n_most`` have not been enough.
    """
    graph, found, steps = net.graph, depths.found, depths.steps
    n_levels = values.shape[1] - 1
    found.n_searches += 1
    search = found.n_searches
    found.value, found.n_arcs = least, 0
    last = np.uint64(depths.seen.shape[0] - 1)
    step, depth, n = steps[0], 0, 0
    step.state, step.link, step.arc, step.pays = 0, states.first[0], -1, 0
    step.alive, step.value, step.length = 1.0, 0.0, 0.0
    step.low, step.high = 0, 0
    while depth >= 0:
        here = steps[depth]
        if here.link == states.first[here.state + 1]:
            if depth > 0:
                depths.used[here.arc] = -1
                if here.pays:
                    depths.met[graph.head[here.arc]] = -1
            depth -= 1
            continue
        link = here.link
        here.link += 1
        arc = states.arc[link]
        if depths.used[arc] == search:
            continue
        node, alive = graph.head[arc], here.alive * graph.survival[arc]
        length = here.length + graph.length[arc]
        if alive * graph.home[node] < net.min_survival * (1.0 - ROUNDING):
            continue
        if (length + net.home_length[node]) * (1.0 - ROUNDING) > net.max_length:
            continue
        n += 1
        if n > n_most:
            break
        level = alive / net.reach[node] * n_levels
        value, pays = here.value, 0
        if graph.reward[node] > 0.0 and depths.met[node] != search and node != graph.base:
            value += chord(prices, node, level)
            pays = 1
        if node == graph.base and value + mu * alive > found.value:
            found.value, found.n_arcs = value + mu * alive, depth + 1
            for i in range(depth):
                depths.arcs[i] = steps[i + 1].arc
            depths.arcs[depth] = arc
        if value + chord(values, states.to[link], level) <= found.value:
            continue
        low, high = here.low ^ depths.keys[arc, 0], here.high ^ depths.keys[arc, 1]
        seen = depths.seen[np.int64(low & last)]
        if seen.search == search and seen.low == low and seen.high == high and seen.value >= value:
            continue
        seen.search, seen.low, seen.high, seen.value = search, low, high, value
        depth += 1
        step = steps[depth]
        step.state, step.link, step.arc, step.pays = states.to[link], 0, arc, pays
        step.link = states.first[step.state]
        step.alive, step.value, step.length, step.low, step.high = alive, value, length, low, high
        depths.used[arc] = search
        if pays:
            depths.met[node] = search
    return n if n <= n_most else -1
