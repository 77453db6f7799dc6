"""Ants that build trail plans hop by hop."""

from typing import NamedTuple

import numpy as np

from botohe_moo._base.types import IntArray, OffsetArray
from botohe_moo.core.compile import helper, inlined, kernel
from botohe_moo.core.graph import Graph, limit_at
from botohe_moo.core.kinds import (
    Kinds,
    aboard_at,
    aboard_of,
    layer_of,
    likely_chance,
    origin_of,
    start_of,
)
from botohe_moo.core.paths import Budget, Paths, leads_home, way_within
from botohe_moo.core.rng import uniform
from botohe_moo.core.sharing import shared
from botohe_moo.kernels.colony.weighing import (
    BLOCK,
    Ant,
    AntScratch,
    BuildRule,
    Weights,
    draw_arc,
    tabulate_node,
    weigh,
)


class Plans(NamedTuple):
    """Where plans are written, hop by hop."""

    nodes: IntArray  # nodes of the trails one after another: where each hop begins
    robots: IntArray  # scratch, as long as nodes: whose hop each is
    # Where each trail begins in the nodes, and where the last one ends (n_ants · n_robots + 1).
    offsets: OffsetArray
    size: OffsetArray  # how many hops have been written (1)


def new_plans(n_hops: int, n_trails: int) -> Plans:
    """Return room for a number of hops, in a number of trails."""
    nodes, robots = np.empty(n_hops, np.int32), np.empty(n_hops, np.int32)
    return Plans(nodes, robots, np.zeros(n_trails + 1, np.int64), np.zeros(1, np.int64))


@inlined
def _choose(
    graph: Graph,
    weights: Weights,
    rule: BuildRule,
    scratch: AntScratch,
    paths: Paths | None,
    ant: Ant,
    node: int,
    alive: float,
) -> int:
    """Choose the next arc of a robot, after which a way home is left; return the arc.

    Another arc is drawn where that one leads into a dead end, from which no unused arcs lead home.
    There may be dead ends where some node has more arcs in than out (the graph is not balanced).
    Another one is also drawn where the whole trail could not keep the survival floor, or
    where ``way_within`` finds no way home within the travel budget.
    """
    loop = graph.head.shape[0]
    n_rejected = 0
    while True:
        n, total, arc = weigh(graph, weights, scratch, ant, node)
        if n > 1:
            drawn = uniform(scratch.states, ant.number) * (1.0 + rule.exploration / n)
            arc = draw_arc(graph, rule.exploration, scratch.cumulated, ant, node, n, total, drawn)
        ant.used[arc] = ant.trail
        if arc >= loop or n == 1:
            break
        length = scratch.length[ant.robot]
        if _leads_home(graph, rule, rule.budget, paths, ant, arc, alive, length):
            break
        scratch.rejected[n_rejected] = arc
        n_rejected += 1
    for i in range(n_rejected):
        ant.used[scratch.rejected[i]] = -1
    return arc


@inlined
def _leads_home(
    graph: Graph,
    rule: BuildRule,
    budget: Budget | None,
    paths: Paths | None,
    ant: Ant,
    arc: int,
    alive: float,
    length: float,
) -> bool:
    """Return whether a way home within the limits is known from the head of an arc, and note it.

    ``alive`` and ``length`` are those of the trail up to the arc. No ant gets stuck: with limits,
    it can always follow the way that was noted last. The rest of a safest (or shortest) way is the
    safest (or shortest) one from there. It is not looked for again, as a way that is found instead
    may be as safe but longer. With a travel budget, plans are lost where the only ways home are
    neither the safest nor the shortest ones.
    """
    # ``budget`` is that of the rule: for an argument that is None numba leaves out what needs it.
    if paths is None:
        return True
    if budget is None and rule.limits.min_survival == 0.0:
        return leads_home(graph, paths, ant.used, ant.trail, graph.head[arc])
    if ant.onward[graph.tail[arc]] == arc:
        return True
    node, alive, length = graph.head[arc], alive * graph.survival[arc], length + graph.length[arc]
    least = limit_at(rule.limits.min_survival, rule.limits.floors, node)
    if alive * graph.home[node] < least:
        return False
    n = way_within(graph, budget, paths, ant.used, ant.trail, node, alive, length)
    for i in range(n):
        alive *= graph.survival[paths.path[i]]
    if n < 0 or alive < least:
        return False
    for i in range(n):
        ant.onward[graph.tail[paths.path[i]]] = paths.path[i]
    return True


@helper
def _note_first_way(graph: Graph, budget: Budget | None, onward: OffsetArray, source: int) -> None:
    """Note the way from a start to the end: the safest one, or the shortest if that is too long."""
    way, head, node, length = graph.homeward, graph.head, source, 0.0
    while way[node] >= 0:
        length += graph.length[way[node]]
        node = head[way[node]]
    if budget is not None:
        limits = budget.limits
        if length > limit_at(limits.max_length, limits.budgets, source):
            way = budget.short.homeward
    node = source
    while way[node] >= 0:
        onward[node] = way[node]
        node = head[way[node]]


@inlined
def _visit(graph: Graph, scratch: AntScratch, ant: Ant, node: int, alive: float) -> None:
    """Note that a robot has got to a node with probability ``alive``."""
    if ant.visited[node] == ant.trail:
        return
    ant.visited[node] = ant.trail
    origin = origin_of(graph.kinds, node)
    before = scratch.unreached[origin]
    scratch.unreached[origin] = before * (1.0 - likely_chance(graph.kinds, graph.home, node, alive))
    if before == 1.0 and scratch.unreached[origin] < 1.0:
        scratch.touched[scratch.n_touched[0]] = origin
        scratch.n_touched[0] += 1


@inlined
def _begin_trail(
    graph: Graph, kinds: Kinds | None, rule: BuildRule, scratch: AntScratch, ant: Ant, source: int
) -> None:
    """Note, before its first hop, that a robot is where it starts, and a way from there."""
    if kinds is None:  # all robots are at the base, where trails also end
        ant.visited[source] = ant.trail
    elif ant.visited[source] != ant.trail:
        _note_first_way(graph, rule.budget, ant.onward, source)
        first, stop = aboard_of(kinds, ant.robot)
        for i in range(first, stop):
            node = aboard_at(kinds, layer_of(kinds, source), i)
            # It is brought home from here, not from where it was collected.
            _visit(graph, scratch, ant, node, graph.home[source] / graph.home[node])
        _visit(graph, scratch, ant, source, 1.0)


@inlined
def _walk(
    graph: Graph,
    weights: Weights,
    rule: BuildRule,
    scratch: AntScratch,
    paths: Paths | None,
    plans: Plans,
    trail: int,
) -> bool:
    """Extend a robot's trail: to its end, or by one hop where all robots are out at once.

    Returns whether its trail has ended.
    """
    number, robot = trail // rule.n_robots, trail % rule.n_robots
    row, which = robot if rule.concurrent else 0, robot if scratch.seen.shape[0] > 1 else 0
    block = number // BLOCK
    ant = Ant(
        number,
        trail,
        robot,
        1.0 - (number * (1.0 / (rule.n_ants - 1)) if rule.n_ants > 1 else 0.5),
        scratch.used[row],
        scratch.visited[row],
        scratch.onward[row],
        scratch.seen[which, number - block * BLOCK],
        scratch.fresh[which, number - block * BLOCK],
    )
    node, alive, size = scratch.node[robot], scratch.alive[robot], plans.size[0]
    source = start_of(graph.kinds, graph.base, robot)
    _begin_trail(graph, graph.kinds, rule, scratch, ant, source)
    while True:
        if scratch.tabulated[which, node] != block:
            tabulate_node(graph, weights, rule, scratch, block, which, node)
        arc = _choose(graph, weights, rule, scratch, paths, ant, node, alive)
        plans.nodes[size], plans.robots[size] = node, robot
        size += 1
        if arc >= graph.head.shape[0]:
            node = -1
            break
        alive *= graph.survival[arc]
        if rule.budget is not None:
            scratch.length[robot] += graph.length[arc]
        node = graph.head[arc]
        _visit(graph, scratch, ant, node, alive)
        if rule.concurrent:
            break
    plans.offsets[trail + 1] += size - plans.size[0]
    scratch.node[robot], scratch.alive[robot], plans.size[0] = node, alive, size
    return bool(node < 0)


@inlined
def _begin_plan(graph: Graph, rule: BuildRule, scratch: AntScratch, plans: Plans, ant: int) -> None:
    """Put all robots at their starts; until ``_end_plan`` the plan's offsets count their hops."""
    for i in range(scratch.n_touched[0]):
        scratch.unreached[scratch.touched[i]] = 1.0
    scratch.n_touched[0] = 0
    for robot in range(rule.n_robots):
        scratch.node[robot] = start_of(graph.kinds, graph.base, robot)
        scratch.alive[robot], scratch.length[robot] = 1.0, 0.0
        plans.offsets[ant * rule.n_robots + robot + 1] = 0


@inlined
def _end_plan(plans: Plans, rule: BuildRule, scratch: AntScratch, ant: int, start: int) -> None:
    """Make offsets of the counts of hops, and sort the hops by robot where they took turns.

    The plan's hops begin at ``start``. Behind them there is room for as many.
    """
    first, stop = ant * rule.n_robots, plans.size[0]
    for trail in range(first, first + rule.n_robots):
        plans.offsets[trail + 1] += plans.offsets[trail]
    if not rule.concurrent:
        return
    n, ends = stop - start, scratch.node  # which is not needed any more: all robots are home
    for robot in range(rule.n_robots):
        ends[robot] = plans.offsets[first + robot + 1]
    for i in range(start, stop):
        plans.nodes[n + i] = plans.nodes[i]
    for i in range(stop - 1, start - 1, -1):
        ends[plans.robots[i]] -= 1
        plans.nodes[ends[plans.robots[i]]] = plans.nodes[n + i]


@kernel
def construct(
    graph: Graph,
    weights: Weights,
    rule: BuildRule,
    paths: Paths | None,
    scratch: AntScratch,
    plans: Plans,
    begin: int,
    end: int,
) -> int:
    """Build the plans of the ants ``begin`` to ``end``.

    An ant at a node weighs each arc a that this trail has not used yet with
    (τ_R η_R)^(1 − λ) (τ_S η_S)^λ, where η_R is ``1 + gain[a] · (probability that no other robot
    reaches its head, by the trails as they are so far)`` times that of a head already in this
    trail. What an ant builds depends on its own random numbers only, whose state is advanced.

    ``paths`` is scratch of searches for ways home. It is None where there always is one, since the
    graph is balanced and there are no limits. Plans are written to ``plans``.

    Returns the first ant for whose plan there might be no room, or ``end``.
    """
    graph, weights, rule, plans = shared(graph), shared(weights), shared(rule), shared(plans)
    n_robots = rule.n_robots
    plans.size[0] = plans.offsets[begin * n_robots] = 0
    room = n_robots * (graph.head.shape[0] + 1) * (2 if rule.concurrent else 1)
    for ant in range(begin, end):
        start = plans.size[0]
        if start + room > plans.nodes.shape[0]:
            return ant
        _begin_plan(graph, rule, scratch, plans, ant)
        robot, n_out = 0, n_robots
        while n_out > 0:
            if scratch.node[robot] >= 0:
                trail = ant * n_robots + robot
                n_out -= _walk(graph, weights, rule, scratch, paths, plans, trail)
            robot = robot + 1 if robot + 1 < n_robots else 0
        _end_plan(plans, rule, scratch, ant, start)
    return end
