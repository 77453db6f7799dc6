"""Ants that build trail plans hop by hop.

Arcs are numbered as in the graph; behind them comes the base's self-loop, which ends a trail.
"""

import math
from typing import NamedTuple

import numpy as np

from botohe_moo._base.types import FloatArray, IntArray, OffsetArray, SeedArray
from botohe_moo.kernels.compile import helper, inlined, kernel
from botohe_moo.kernels.graph.graph import Graph
from botohe_moo.kernels.graph.paths import Paths, leads_home, survives_home
from botohe_moo.kernels.rng import uniform

# Ants whose weights are tabulated together: enough to share the exponentials, few enough that
# the tables of a small mission stay in the fastest caches.
BLOCK = 50

# Up to this many arcs a scan that stops early beats one without branches (measured).
_SHORT_SCAN = 5


class BuildRule(NamedTuple):
    """How plans are built."""

    n_robots: int  # trails per plan
    n_ants: int  # size of the colony: ant i has λ = i / (n_ants − 1), a single ant λ = 1/2
    # Whether all robots are out at once and take one hop each in turn, those left out that have
    # ended their trails; otherwise one trail is complete before the next begins.
    concurrent: bool
    # Every weight is raised by exploration · (mean weight) / (number of candidates).
    exploration: float
    # Survival floor: the least probability with which every robot gets home; 0 sets none.
    min_survival: float


class Weights(NamedTuple):
    """What ants weigh arcs by."""

    # log(τ_R η_R), with η_R that of a head already in this trail, and log(τ_S η_S)
    # (n_maps, n_arcs + 1); one map a robot, or one that all robots share.
    log_reward: FloatArray
    log_survival: FloatArray
    # What a head that no robot reaches yet adds to η_R, relative, and log(1 + gain) (n_arcs + 1).
    gain: FloatArray
    log_fresh: FloatArray


class Plans(NamedTuple):
    """Where plans are written, hop by hop."""

    nodes: IntArray  # nodes of the trails one after another: where each hop begins
    robots: IntArray  # scratch as long: whose hop each is
    lengths: OffsetArray  # nodes of each trail (n_ants · n_robots)
    size: OffsetArray  # how many hops have been written (1)


class Scratch(NamedTuple):
    """Scratch of an ant: weights in tables, and where its robots have been."""

    # Weights of arcs for each ant of a block (n_maps, ``BLOCK``, n_arcs + 1): for a head already in
    # the trail, and for one that no robot reaches yet.
    seen: FloatArray
    fresh: FloatArray
    # For which block the arcs that leave a node have been tabulated (n_maps, n_nodes).
    tabulated: OffsetArray
    # The last trail that used each arc (n_rows, n_arcs + 1) and visited each node
    # (n_rows, n_nodes): a row for each robot that is out at once.
    used: OffsetArray
    visited: OffsetArray
    # Where each robot is, −1 where its trail has ended, and with what probability (n_robots).
    here: OffsetArray
    alive: FloatArray
    unreached: FloatArray  # probability that no robot reaches each node (n_nodes)
    # The nodes where that is below 1, and how many they are (n_nodes), (1).
    touched: OffsetArray
    n_touched: OffsetArray
    cumulated: FloatArray  # weights of the candidates, summed up (n_arcs + 1)
    rejected: OffsetArray  # arcs that were drawn and lead to where no way home is left (n_arcs + 1)
    states: SeedArray  # state of each ant's random numbers (n_ants, 2)


@helper(makes_arrays=True)
def _new_scratch(graph: Graph, rule: BuildRule, n_maps: int, states: SeedArray) -> Scratch:
    n_nodes, n_arcs = graph.reward.shape[0], graph.head.shape[0] + 1
    n_rows = rule.n_robots if rule.concurrent else 1
    scratch = Scratch(
        np.empty((n_maps, BLOCK, n_arcs)),
        np.empty((n_maps, BLOCK, n_arcs)),
        np.empty((n_maps, n_nodes), np.int64),
        np.empty((n_rows, n_arcs), np.int64),
        np.empty((n_rows, n_nodes), np.int64),
        np.empty(rule.n_robots, np.int64),
        np.empty(rule.n_robots),
        np.empty(n_nodes),
        np.empty(n_nodes, np.int64),
        np.empty(1, np.int64),
        np.empty(n_arcs),
        np.empty(n_arcs, np.int64),
        states,
    )
    scratch.tabulated[:], scratch.used[:], scratch.visited[:] = -1, -1, -1
    scratch.unreached[:], scratch.n_touched[:] = 1.0, 0
    return scratch


def new_plans(n_hops: int, n_trails: int) -> Plans:
    """Make room for so many hops."""
    nodes, robots = np.empty(n_hops, np.int32), np.empty(n_hops, np.int32)
    return Plans(nodes, robots, np.empty(n_trails, np.int64), np.zeros(1, np.int64))


class _Ant(NamedTuple):
    """What one trail of an ant is built by: rows of the scratch, and 1 − λ as a power."""

    number: int
    trail: int
    power: float
    used: OffsetArray
    visited: OffsetArray
    seen: FloatArray
    fresh: FloatArray


@inlined
def _tabulate(
    weights: Weights, rule: BuildRule, scratch: Scratch, block: int, which: int, arc: int
) -> None:
    """Fill in the weights of an arc for every ant of a block.

    The ants' λ are evenly spaced, so that an arc's weight is a geometric progression over the
    ants: a few exponentials serve the whole block.
    """
    step = 1.0 / (rule.n_ants - 1) if rule.n_ants > 1 else 0.0
    first = block * BLOCK * step if rule.n_ants > 1 else 0.5
    slope = weights.log_survival[which, arc] - weights.log_reward[which, arc]
    weight = math.exp(weights.log_reward[which, arc] + first * slope)
    ratio = math.exp(step * slope)
    factor = math.exp((1.0 - first) * weights.log_fresh[arc])
    factor_ratio = math.exp(-step * weights.log_fresh[arc])
    seen, fresh = scratch.seen, scratch.fresh
    for i in range(BLOCK):
        seen[which, i, arc] = weight
        fresh[which, i, arc] = weight * factor
        weight *= ratio
        factor *= factor_ratio


@helper
def _tabulate_node(
    graph: Graph,
    weights: Weights,
    rule: BuildRule,
    scratch: Scratch,
    block: int,
    which: int,
    node: int,
) -> None:
    """Fill in the weights of all arcs that leave a node."""
    scratch.tabulated[which, node] = block
    for arc in range(graph.first[node], graph.first[node + 1]):
        _tabulate(weights, rule, scratch, block, which, arc)
    if node == graph.base:
        _tabulate(weights, rule, scratch, block, which, graph.head.shape[0])


@inlined
def _weigh(
    graph: Graph, weights: Weights, scratch: Scratch, ant: _Ant, here: int
) -> tuple[int, float, int]:
    """Sum up the weights of the arcs that a robot may take.

    Gives how many arcs there are to choose from, their weights in sum, and the last of them.
    """
    low, high, loop = graph.first[here], graph.first[here + 1], graph.head.shape[0]
    unreached, cumulated, head = scratch.unreached, scratch.cumulated, graph.head
    n = 0
    arc = low
    total = 0.0
    for a in range(low, high):
        weight = 0.0
        if ant.used[a] != ant.trail:
            n += 1
            arc = a
            weight = ant.seen[a]
            if ant.visited[head[a]] != ant.trail:
                left = unreached[head[a]]
                if left == 1.0:
                    weight = ant.fresh[a]
                else:
                    weight *= math.exp(ant.power * math.log(1.0 + weights.gain[a] * left))
        total += weight
        cumulated[a - low] = total
    if here == graph.base:
        n += 1
        arc = loop
        total += float(ant.seen[loop])
        cumulated[high - low] = total
    return n, total, arc


@inlined
def _draw(
    graph: Graph,
    exploration: float,
    cumulated: FloatArray,
    ant: _Ant,
    here: int,
    n: int,
    total: float,
    drawn: float,
) -> int:
    """Choose one of the arcs that ``_weigh`` has weighed, of which there are several.

    ``drawn`` is a random number from 0 to 1 + exploration / n: above 1 all are equally likely.
    """
    low, n_arcs = graph.first[here], graph.first[here + 1] - graph.first[here]
    n_listed = n_arcs + 1 if here == graph.base else n_arcs
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
    return int(low + place if place < n_arcs else graph.head.shape[0])


@helper
def _is_safe(
    graph: Graph,
    paths: Paths | None,
    used: OffsetArray,
    trail: int,
    node: int,
    alive: float,
    least: float,
) -> bool:
    """Tell whether unused arcs lead home, with probability ``least`` over all.

    Where there is no scratch to search on, they always do: the search is not even compiled.
    """
    if paths is None:
        return True
    if least > 0.0:
        return survives_home(graph, paths, used, trail, node, alive, least)
    return leads_home(graph, paths, used, trail, node)


@inlined
def _choose(
    graph: Graph,
    weights: Weights,
    rule: BuildRule,
    scratch: Scratch,
    paths: Paths | None,
    ant: _Ant,
    here: int,
    alive: float,
) -> int:
    """Let a robot use one more arc, after which a way home is left; give the arc.

    Where some node has more arcs in than out (the graph is not balanced), an arc from which no
    unused arcs lead home is drawn again: the walk never enters a dead end. Likewise for an arc from
    which the robot could not get home with probability ``min_survival`` over all.
    """
    loop, least = graph.head.shape[0], rule.min_survival
    n_rejected = 0
    while True:
        n, total, arc = _weigh(graph, weights, scratch, ant, here)
        if n > 1:
            drawn = uniform(scratch.states, ant.number) * (1.0 + rule.exploration / n)
            arc = _draw(graph, rule.exploration, scratch.cumulated, ant, here, n, total, drawn)
        ant.used[arc] = ant.trail
        if n == 1 or arc == loop:
            break
        node, arriving = graph.head[arc], alive * graph.survival[arc]
        if _is_safe(graph, paths, ant.used, ant.trail, node, arriving, least):
            break
        scratch.rejected[n_rejected] = arc
        n_rejected += 1
    for i in range(n_rejected):
        ant.used[scratch.rejected[i]] = -1
    return arc


@inlined
def _visit(scratch: Scratch, ant: _Ant, node: int, alive: float) -> None:
    """Note that a robot has got to a node with probability ``alive``."""
    if ant.visited[node] == ant.trail:
        return
    ant.visited[node] = ant.trail
    before = scratch.unreached[node]
    scratch.unreached[node] = before * (1.0 - alive)
    if before == 1.0 and scratch.unreached[node] < 1.0:
        scratch.touched[scratch.n_touched[0]] = node
        scratch.n_touched[0] += 1


@inlined
def _walk(
    graph: Graph,
    weights: Weights,
    rule: BuildRule,
    scratch: Scratch,
    paths: Paths | None,
    plans: Plans,
    trail: int,
) -> bool:
    """Let a robot go on: to the end of its trail, or one hop where all are out at once.

    Gives whether its trail has ended.
    """
    number, robot = trail // rule.n_robots, trail % rule.n_robots
    row, which = robot if rule.concurrent else 0, robot if scratch.seen.shape[0] > 1 else 0
    block = number // BLOCK
    ant = _Ant(
        number,
        trail,
        1.0 - (number * (1.0 / (rule.n_ants - 1)) if rule.n_ants > 1 else 0.5),
        scratch.used[row],
        scratch.visited[row],
        scratch.seen[which, number - block * BLOCK],
        scratch.fresh[which, number - block * BLOCK],
    )
    ant.visited[graph.base] = trail
    here, alive, size = scratch.here[robot], scratch.alive[robot], plans.size[0]
    while True:
        if scratch.tabulated[which, here] != block:
            _tabulate_node(graph, weights, rule, scratch, block, which, here)
        arc = _choose(graph, weights, rule, scratch, paths, ant, here, alive)
        plans.nodes[size], plans.robots[size] = here, robot
        size += 1
        if arc == graph.head.shape[0]:
            here = -1
            break
        alive *= graph.survival[arc]
        here = graph.head[arc]
        _visit(scratch, ant, here, alive)
        if rule.concurrent:
            break
    plans.lengths[trail] += size - plans.size[0]
    scratch.here[robot], scratch.alive[robot], plans.size[0] = here, alive, size
    return bool(here < 0)


@inlined
def _begin_plan(graph: Graph, rule: BuildRule, scratch: Scratch, plans: Plans, ant: int) -> None:
    """Put all robots at the base."""
    for i in range(scratch.n_touched[0]):
        scratch.unreached[scratch.touched[i]] = 1.0
    scratch.n_touched[0] = 0
    for robot in range(rule.n_robots):
        scratch.here[robot], scratch.alive[robot] = graph.base, 1.0
        plans.lengths[ant * rule.n_robots + robot] = 0


@inlined
def _sort_hops(
    plans: Plans, rule: BuildRule, scratch: Scratch, ant: int, start: int, stop: int
) -> None:
    """Put an ant's hops in the order of the robots; behind them there is room for as many."""
    n = stop - start
    for i in range(start, stop):
        plans.nodes[n + i] = plans.nodes[i]
    ends, end = scratch.here, start  # the robots are all home
    for robot in range(rule.n_robots):
        end += plans.lengths[ant * rule.n_robots + robot]
        ends[robot] = end
    for i in range(stop - 1, start - 1, -1):
        ends[plans.robots[i]] -= 1
        plans.nodes[ends[plans.robots[i]]] = plans.nodes[n + i]


@kernel
def construct(
    graph: Graph,
    weights: Weights,
    rule: BuildRule,
    paths: Paths | None,
    states: SeedArray,
    plans: Plans,
    begin: int,
    end: int,
) -> int:
    """Let the ants ``begin`` to ``end`` build one plan each.

    An ant at a node weighs each arc a that this trail has not used yet with
    (τ_R η_R)^(1 − λ) (τ_S η_S)^λ, where η_R is ``1 + gain[a] · (probability that no other robot
    reaches its head, by the trails as they are so far)`` times that of a head already in this
    trail.

    Parameters
    ----------
    graph, weights, rule
        Where, and how arcs are chosen.
    paths
        Scratch of searches for ways home; None where the graph is balanced and there is no floor,
        so that there always is one.
    states
        State of each ant's random numbers (n_ants, 2), advanced: what an ant builds depends on its
        own numbers only.
    plans
        Output.
    begin, end
        Which ants build now.

    Returns
    -------
    int
        The ant whose plan might not have had room; ``end`` if all had.
    """
    n_robots = rule.n_robots
    scratch = _new_scratch(graph, rule, weights.log_reward.shape[0], states)
    plans.size[0] = 0
    room = n_robots * (graph.head.shape[0] + 1) * (2 if rule.concurrent else 1)
    for ant in range(begin, end):
        start = plans.size[0]
        if start + room > plans.nodes.shape[0]:
            return ant
        _begin_plan(graph, rule, scratch, plans, ant)
        robot, n_out = 0, n_robots
        while n_out > 0:
            if scratch.here[robot] >= 0:
                trail = ant * n_robots + robot
                n_out -= _walk(graph, weights, rule, scratch, paths, plans, trail)
            robot = robot + 1 if robot + 1 < n_robots else 0
        if rule.concurrent:
            _sort_hops(plans, rule, scratch, ant, start, plans.size[0])
    return end
