"""Ants at a node: the weights of the arcs that leave it, and the choice of one of them.

Arcs are numbered as in the graph; behind them comes the base's self-loop, which ends a trail. With
kinds, each has a self-loop where its trails end.
"""

import math
from typing import NamedTuple

import numpy as np

from botohe_moo._base.types import FloatArray, OffsetArray, SeedArray
from botohe_moo.core.compile import helper, inlined
from botohe_moo.core.graph import Graph, Limits
from botohe_moo.core.kinds import end_of, loop_at, n_kinds, origin_of
from botohe_moo.core.paths import Budget

# Ants whose weights are tabulated together: enough to share the exponentials, few enough that
# the tables of a small mission stay in the fastest caches.
BLOCK = 50

# Up to this many arcs a scan that stops early beats one without branches (measured).
_SHORT_SCAN = 5


class BuildRule(NamedTuple):
    """How ants build plans."""

    n_robots: int  # trails per plan
    n_ants: int  # size of the colony: ant i has λ = i / (n_ants − 1), a single ant λ = 1/2
    # Whether the robots take one hop each in turn until their trails have ended; otherwise one
    # trail is complete before the next begins.
    concurrent: bool
    # Every weight is raised by exploration · (mean weight) / (number of candidates).
    exploration: float
    limits: Limits
    # Travel budget, with the survival floor; without a budget its code is not compiled.
    budget: Budget | None


class Weights(NamedTuple):
    """What the weights of arcs are computed from."""

    # log(τ_R η_R), where η_R is that of a head already in this trail, and log(τ_S η_S)
    # (n_maps, n_arcs + n_kinds). Each robot has a map, or all robots share one.
    log_reward: FloatArray
    log_survival: FloatArray
    # Of a head that no robot reaches yet, η_R is 1 + gain times as large. This gain, and
    # log(1 + gain) (n_arcs + n_kinds).
    gain: FloatArray
    log_fresh: FloatArray


class AntScratch(NamedTuple):
    """Scratch of ants: weights in tables, and where the robots of one ant have been."""

    # Weights of arcs for each ant of a block (n_maps, ``BLOCK``, n_arcs + n_kinds): for a head
    # already in the trail, and for one that no robot reaches yet.
    seen: FloatArray
    fresh: FloatArray
    # The last block for which the arcs that leave each node were tabulated (n_maps, n_nodes).
    tabulated: OffsetArray
    # The last trail that used each arc (n_rows, n_arcs + n_kinds), and that visited each node
    # (n_rows, n_nodes); a row for each robot if all take their hops in turn, else one row.
    used: OffsetArray
    visited: OffsetArray
    # With limits, the way home that each robot knows: the arc by which it leaves each of its nodes,
    # −1 at the base (n_rows, n_nodes).
    onward: OffsetArray
    # Where each robot is, −1 where its trail has ended, with what probability, and with a travel
    # budget how long its trail is (n_robots).
    node: OffsetArray
    alive: FloatArray
    length: FloatArray
    unreached: FloatArray  # probability that no robot reaches each node (n_nodes)
    # The nodes where that is below 1 (n_nodes), and how many there are (1).
    touched: OffsetArray
    n_touched: OffsetArray
    cumulated: FloatArray  # weights of the candidates, summed up (n_arcs + n_kinds)
    rejected: OffsetArray  # arcs that were drawn, but leave no way home (n_arcs + n_kinds)
    states: SeedArray  # state of each ant's random numbers (n_ants, 2)


def new_scratch(graph: Graph, rule: BuildRule, n_maps: int, states: SeedArray) -> AntScratch:
    """Return scratch for ants; ``states`` are those of their random numbers (n_ants, 2)."""
    n_nodes, n_arcs = graph.n_nodes, graph.n_arcs + n_kinds(graph.kinds)
    n_rows = rule.n_robots if rule.concurrent else 1
    scratch = AntScratch(
        seen=np.empty((n_maps, BLOCK, n_arcs)),
        fresh=np.empty((n_maps, BLOCK, n_arcs)),
        tabulated=np.empty((n_maps, n_nodes), np.int64),
        used=np.empty((n_rows, n_arcs), np.int64),
        visited=np.empty((n_rows, n_nodes), np.int64),
        onward=np.empty((n_rows, n_nodes), np.int64),
        node=np.empty(rule.n_robots, np.int64),
        alive=np.empty(rule.n_robots),
        length=np.empty(rule.n_robots),
        unreached=np.ones(n_nodes),
        touched=np.empty(n_nodes, np.int64),
        n_touched=np.zeros(1, np.int64),
        cumulated=np.empty(n_arcs),
        rejected=np.empty(n_arcs, np.int64),
        states=states,
    )
    scratch.onward[:] = graph.homeward  # −1 where trails end
    return scratch


class Ant(NamedTuple):
    """One trail of an ant while it is built."""

    number: int
    trail: int  # its number among the trails of all ants
    robot: int
    power: float  # 1 − λ
    # Rows of the scratch.
    used: OffsetArray
    visited: OffsetArray
    onward: OffsetArray
    seen: FloatArray
    fresh: FloatArray


@helper
def tabulate_node(
    graph: Graph,
    weights: Weights,
    rule: BuildRule,
    scratch: AntScratch,
    block: int,
    which: int,
    node: int,
) -> None:
    """Fill in the weights of all arcs that leave a node, for every ant of a block.

    The ants' λ are evenly spaced, so that an arc's weight is a geometric progression over the
    ants: a few exponentials serve the whole block.
    """
    scratch.tabulated[which, node] = block
    step = 1.0 / (rule.n_ants - 1) if rule.n_ants > 1 else 0.0
    first = block * BLOCK * step if rule.n_ants > 1 else 0.5
    n_ants = min(BLOCK, rule.n_ants - block * BLOCK)
    low, high = graph.first[node], graph.first[node + 1]
    loop = loop_at(graph.kinds, graph.head.shape[0], node)
    for i in range(low, high + 1 if node == end_of(graph.kinds, graph.base, node) else high):
        arc = i if i < high else loop  # behind the base's arcs comes its self-loop
        slope = weights.log_survival[which, arc] - weights.log_reward[which, arc]
        weight = math.exp(weights.log_reward[which, arc] + first * slope)
        ratio = math.exp(step * slope)
        factor = math.exp((1.0 - first) * weights.log_fresh[arc])
        factor_ratio = math.exp(-step * weights.log_fresh[arc])
        for ant in range(n_ants):
            scratch.seen[which, ant, arc] = weight
            scratch.fresh[which, ant, arc] = weight * factor
            weight *= ratio
            factor *= factor_ratio


@inlined
def weigh(
    graph: Graph, weights: Weights, scratch: AntScratch, ant: Ant, node: int
) -> tuple[int, float, int]:
    """Sum up the weights of the arcs that a robot may take.

    Returns how many arcs there are to choose from, the sum of their weights, and the last of them.
    """
    low, high, kinds = graph.first[node], graph.first[node + 1], graph.kinds
    unreached, cumulated, head = scratch.unreached, scratch.cumulated, graph.head
    n = 0
    arc = low
    total = 0.0
    for a in range(low, high):
        weight = 0.0
        if ant.used[a] != ant.trail:
            n += 1
            arc = a
            visited = ant.visited[head[a]] == ant.trail
            left = 0.0 if visited else unreached[origin_of(kinds, head[a])]
            weight = ant.fresh[a] if left == 1.0 else ant.seen[a]
            if 0.0 < left < 1.0:
                weight *= math.exp(ant.power * math.log(1.0 + weights.gain[a] * left))
        total += weight
        cumulated[a - low] = total
    if node == end_of(kinds, graph.base, node):
        n += 1
        arc = loop_at(kinds, head.shape[0], node)
        total += float(ant.seen[arc])
        cumulated[high - low] = total
    return n, total, arc


@inlined
def draw_arc(
    graph: Graph,
    exploration: float,
    cumulated: FloatArray,
    ant: Ant,
    node: int,
    n: int,
    total: float,
    drawn: float,
) -> int:
    """Choose one of the arcs that ``weigh`` has weighed, of which there are several.

    ``drawn`` is a random number from 0 to 1 + exploration / n. From 1 on it chooses uniformly: this
    is what exploration adds to every weight.
    """
    low, n_arcs = graph.first[node], graph.first[node + 1] - graph.first[node]
    n_listed = n_arcs + 1 if node == end_of(graph.kinds, graph.base, node) else n_arcs
    place = 0
    if drawn < 1.0:
        drawn *= total
        if n_listed > _SHORT_SCAN:
            for c in range(n_listed - 1):
                place += cumulated[c] <= drawn
        else:
            while place < n_listed - 1 and cumulated[place] <= drawn:
                place += 1
    else:
        skip = min(n - 1, int((drawn - 1.0) / exploration * n * n))
        while place < n_arcs and (ant.used[low + place] == ant.trail or skip > 0):
            skip -= ant.used[low + place] != ant.trail
            place += 1
    return low + place if place < n_arcs else loop_at(graph.kinds, graph.head.shape[0], node)
