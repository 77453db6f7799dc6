"""Ants that build trail plans hop by hop, and the two pheromones that plans deposit.

Arcs are numbered as in the graph. Behind them come the self-loops that end trails, one for each
kind of robots.
"""

import math
from typing import NamedTuple

import numpy as np

from botohe_moo.base.types import FloatArray, IntArray, OffsetArray, SeedArray
from botohe_moo.core.compile import at_once, helper, inlined, shared
from botohe_moo.core.paths import Paths, leads_home, way_within
from botohe_moo.core.rng import uniform
from botohe_moo.core.world import (
    AT_NEXT_DEPOT,
    Graph,
    Returns,
    Shortest,
    World,
    aboard_at,
    aboard_of,
    credit_of,
    find_arc,
    layer_of,
    loop_at,
)

# Ants whose weights are tabulated together: enough to share the exponentials, few enough that
# the tables of a small mission stay in the fastest caches.
BLOCK = 50

# The least pheromone. On arcs that no Pareto set uses pheromone falls by the same factor for
# thousands of iterations: this is far below any amount that matters, and far above where floats
# lose their digits.
LEAST = 1e-250

# Bounds on log(τη). Whatever rewards and parameters are, products of two such factors, and sums of
# these products, are neither 0 nor infinite: where all weights are 0 ants could not draw an arc.
LOG_LOW, LOG_HIGH = -650.0, 250.0


class Heuristic(NamedTuple):
    """What ants know of arcs beforehand (n_arcs + n_kinds)."""

    log_reward: float  # log η_R of a node already in the trail
    log_survival: FloatArray  # log η_S
    # Of a node that no robot reaches yet, η_R is 1 + gain times as large; and log(1 + gain).
    gain: FloatArray
    log_fresh: FloatArray


class Pheromone(NamedTuple):
    """Pheromone, and the last deposits; each robot has a map, or all robots share one.

    All arrays have the shape (n_maps, n_arcs + n_kinds, 2): reward comes first, then survival.
    """

    levels: FloatArray  # at least ``LEAST``
    deposits: FloatArray  # sums of what the plans of the iteration's Pareto set deposit
    archive_deposits: FloatArray  # and those of the global Pareto set


class LearnRule(NamedTuple):
    """How pheromone changes after an iteration."""

    evaporation: float  # the share that evaporates, in [0, 1)
    # Whether the deposits of the iteration's and of the global Pareto set are divided by the number
    # of plans in both; otherwise each is divided by the number in its own set.
    pooled: bool


class Depositors(NamedTuple):
    """Plans that deposit pheromone."""

    objectives: FloatArray  # E[R] and E[S] of all plans (n_plans, 2)
    members: OffsetArray  # indices of those that deposit
    # All trails, ragged.
    nodes: IntArray
    offsets: OffsetArray


class Scratch(NamedTuple):
    """Scratch of ants: weights in tables, and where the robots of one ant have been.

    ``n_rows`` is the number of robots if all take their hops in turn, otherwise 1.
    """

    # Weights of arcs for each ant of a block (n_maps, ``BLOCK``, n_arcs + n_kinds): for a head
    # already in the trail, and for one that no robot reaches yet.
    seen: FloatArray
    fresh: FloatArray
    # The last block for which the arcs that leave each node were tabulated (n_maps, n_nodes).
    tabulated: OffsetArray
    # The last trail that used each arc (n_rows, n_arcs + n_kinds), and that visited each node
    # (n_rows, n_nodes).
    used: OffsetArray
    visited: OffsetArray
    # With limits, the way home that each robot knows: the arc by which it leaves each of its nodes
    # (n_rows, n_nodes).
    onward: OffsetArray
    loop: OffsetArray  # the self-loop that ends each robot's trail (n_robots)
    # Where each robot is, −1 where its trail has ended, with what probability, how long its trail
    # is, and its nodes so far: how many (n_robots), and which (n_robots, n_arcs + 1).
    node: OffsetArray
    alive: FloatArray
    length: FloatArray
    n_hops: OffsetArray
    trail: IntArray
    unreached: FloatArray  # probability that no robot collects at each node, by layer (n_nodes)
    cumulated: FloatArray  # weights of the candidates, summed up (n_arcs + n_kinds)
    rejected: OffsetArray  # arcs that were drawn, but leave no way home (n_arcs + n_kinds)
    states: SeedArray  # state of each ant's random numbers (n_ants, 2)


class Build(NamedTuple):
    """How ants build plans, and what they need for it."""

    n_ants: int  # size of the colony: ant i has λ = i / (n_ants − 1), a single ant λ = 1/2
    # Every weight is raised by exploration · (mean weight) / (number of candidates).
    exploration: float
    # Whether the robots take one hop each in turn until their trails have ended; otherwise one
    # trail is complete before the next begins.
    concurrent: bool
    heuristic: Heuristic
    levels: FloatArray  # those of the pheromone
    # Scratch of searches for ways home. It is None where there always is one, since the graph is
    # balanced and there are no limits.
    paths: Paths | None
    scratch: Scratch


def new_scratch(world: World, n_maps: int, concurrent: bool, states: SeedArray) -> Scratch:
    """Return scratch for ants; ``states`` are those of their random numbers (n_ants, 2)."""
    n_robots, n_nodes, team = world.n_robots, world.graph.n_nodes, world.team
    n_arcs = world.graph.n_arcs + team.n_kinds
    n_rows = n_robots if concurrent else 1
    return Scratch(
        seen=np.empty((n_maps, BLOCK, n_arcs)),
        fresh=np.empty((n_maps, BLOCK, n_arcs)),
        tabulated=np.empty((n_maps, n_nodes), np.int64),
        used=np.empty((n_rows, n_arcs), np.int64),
        visited=np.empty((n_rows, n_nodes), np.int64),
        onward=np.full((n_rows, n_nodes), -1),
        loop=world.graph.n_arcs + team.end[team.start] // len(team.reward),
        node=np.empty(n_robots, np.int64),
        alive=np.empty(n_robots),
        length=np.empty(n_robots),
        n_hops=np.empty(n_robots, np.int64),
        trail=np.empty((n_robots, world.graph.n_arcs + 1), np.int32),
        unreached=np.empty(n_nodes),
        cumulated=np.empty(n_arcs),
        rejected=np.empty(n_arcs, np.int64),
        states=states,
    )


class Ant(NamedTuple):
    """One trail of an ant while it is built."""

    number: int
    trail: int  # its number among the trails of all ants
    robot: int
    power: float  # 1 − λ
    end: int  # where the trail ends, by the self-loop
    loop: int
    # Rows of the scratch.
    used: OffsetArray
    visited: OffsetArray
    onward: OffsetArray
    seen: FloatArray
    fresh: FloatArray


@helper
def _tabulate(world: World, build: Build, block: int, which: int, node: int) -> None:
    """Fill in the weights of all arcs that leave a node, for every ant of a block.

    The ants' λ are evenly spaced, so that an arc's weight is a geometric progression over the
    ants: a few exponentials serve the whole block.
    """
    graph, team, n_ants = world.graph, world.team, build.n_ants
    heuristic, levels, scratch = build.heuristic, build.levels, build.scratch
    scratch.tabulated[which, node] = block
    seen, fresh = scratch.seen[which], scratch.fresh[which]
    step = 1.0 / (n_ants - 1) if n_ants > 1 else 0.0
    first = block * BLOCK * step if n_ants > 1 else 0.5
    n_here = min(BLOCK, n_ants - block * BLOCK)
    low, high = graph.first[node], graph.first[node + 1]
    for i in range(low, high + 1 if node == team.end[node] else high):
        arc = i if i < high else loop_at(graph, team, node)
        reward = math.log(levels[which, arc, 0]) + heuristic.log_reward
        survival = math.log(levels[which, arc, 1]) + heuristic.log_survival[arc]
        reward = min(max(reward, LOG_LOW), LOG_HIGH)
        slope = min(max(survival, LOG_LOW), LOG_HIGH) - reward
        weight = math.exp(reward + first * slope)
        ratio = math.exp(step * slope)
        factor = math.exp((1.0 - first) * heuristic.log_fresh[arc])
        factor_ratio = math.exp(-step * heuristic.log_fresh[arc])
        for ant in range(n_here):
            seen[ant, arc] = weight
            fresh[ant, arc] = weight * factor
            weight *= ratio
            factor *= factor_ratio


@inlined
def _weigh(
    world: World, heuristic: Heuristic, scratch: Scratch, ant: Ant, node: int
) -> tuple[int, float, int]:
    """Sum up the weights of the arcs that a robot may take.

    Returns how many arcs there are to choose from, the sum of their weights, and the last of them.
    """
    graph, gain = world.graph, heuristic.gain
    low, high = graph.first[node], graph.first[node + 1]
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
            left = 0.0 if visited else unreached[head[a]]
            weight = ant.fresh[a] if left == 1.0 else ant.seen[a]
            if 0.0 < left < 1.0:
                weight *= math.exp(ant.power * math.log(1.0 + gain[a] * left))
        total += weight
        cumulated[a - low] = total
    if node == ant.end:
        n += 1
        arc = ant.loop
        total += float(ant.seen[arc])
        cumulated[high - low] = total
    return n, total, arc


@inlined
def _draw(
    graph: Graph, exploration: float, scratch: Scratch, ant: Ant, node: int, n: int, total: float
) -> int:
    """Draw one of the ``n`` arcs that ``_weigh`` has weighed; there are at least two.

    A random number from 0 to 1 + exploration / n decides. From 1 on it chooses uniformly: this is
    what exploration adds to every weight.
    """
    cumulated = scratch.cumulated
    drawn = uniform(scratch.states, ant.number) * (1.0 + exploration / n)
    low, n_arcs = graph.first[node], graph.first[node + 1] - graph.first[node]
    n_listed = n_arcs + 1 if node == ant.end else n_arcs
    place = 0
    if drawn < 1.0:
        drawn *= total
        while place < n_listed - 1 and cumulated[place] <= drawn:
            place += 1
    else:
        skip = min(n - 1, int((drawn - 1.0) / exploration * n * n))
        while place < n_arcs and (ant.used[low + place] == ant.trail or skip > 0):
            skip -= ant.used[low + place] != ant.trail
            place += 1
    return low + place if place < n_arcs else ant.loop


@inlined
def _choose(world: World, build: Build, scratch: Scratch, ant: Ant, node: int, alive: float) -> int:
    """Choose the next arc of a robot, after which a way home is left; return the arc.

    Another arc is drawn if no unused arcs lead home from that one. There may be such dead ends
    where some node has more arcs in than out (the graph is not balanced). Another one is also drawn
    if ``way_within`` finds no way home within the robot's limits.

    No ant gets stuck: with limits, it can always follow the way that was noted last. It does not
    look for the rest of that way again, since another way may be as safe but longer. With a travel
    budget, plans are lost if the only ways home are neither the safest nor the shortest ones.
    """
    graph, n_rejected = world.graph, 0
    length = scratch.length[ant.robot]
    while True:
        n, total, arc = _weigh(world, build.heuristic, scratch, ant, node)
        if n > 1:
            arc = _draw(graph, build.exploration, scratch, ant, node, n, total)
        ant.used[arc] = ant.trail
        if arc == ant.loop or n == 1 or (build.paths is not None and arc == ant.onward[node]):
            break
        there = alive * graph.mean_survival[arc]
        reached = graph.head[arc], there, length + graph.length[arc]
        if _leads_home(world, world.ways.shortest, build.paths, ant, *reached):
            break
        scratch.rejected[n_rejected] = arc
        n_rejected += 1
    for i in range(n_rejected):
        ant.used[scratch.rejected[i]] = -1
    return arc


@inlined
def _leads_home(
    world: World,
    shortest: Shortest | None,
    paths: Paths | None,
    ant: Ant,
    node: int,
    alive: float,
    length: float,
) -> bool:
    """Return whether a way home within the limits is known from a node; with limits, note it.

    ``alive`` and ``length`` are those of the trail up to the node.
    """
    if paths is None:
        return True
    if shortest is None and world.limits.floors[ant.robot] == 0.0:
        return leads_home(world, paths, ant.used, ant.trail, node)
    n = way_within(world, shortest, paths, ant.used, ant.trail, node, alive, length)
    for i in range(n):
        ant.onward[world.graph.tail[paths.path[i]]] = paths.path[i]
    return bool(n >= 0)


@inlined
def _visit(
    world: World, returns: Returns | None, scratch: Scratch, ant: Ant, node: int, alive: float
) -> None:
    """Note that a robot gets to a node with probability ``alive``.

    A reward on return is expected to be brought straight home.
    """
    if ant.visited[node] == ant.trail:
        return
    ant.visited[node] = ant.trail
    chance = alive * world.team.share[node]
    if credit_of(returns, node) == AT_NEXT_DEPOT:
        chance *= world.ways.home[node]
    copy = world.team.origin[node]
    while copy < scratch.unreached.shape[0]:  # a range with a step would divide
        scratch.unreached[copy] *= 1.0 - chance
        copy += world.team.reward.shape[0]


@inlined
def _begin_trail(
    world: World, returns: Returns | None, build: Build, scratch: Scratch, ant: Ant, node: int
) -> None:
    """Note where a robot starts, what it carries, and a way from there to its end."""
    _leads_home(world, world.ways.shortest, build.paths, ant, node, 1.0, 0.0)
    home, layer = world.ways.home, layer_of(world.team, node)
    first, stop = aboard_of(returns, ant.robot)
    for i in range(first, stop):
        carried = aboard_at(returns, layer, i)
        # It is brought home from here, not from where it was collected.
        _visit(world, returns, scratch, ant, carried, home[node] / home[carried])
    _visit(world, returns, scratch, ant, node, 1.0)


@inlined
def _walk(
    world: World, build: Build, scratch: Scratch, paths: Paths | None, number: int, robot: int
) -> bool:
    """Extend a robot's trail: to its end, or by one hop where all robots are out at once.

    Returns whether its trail has ended.
    """
    graph = world.graph
    row, which = robot if build.concurrent else 0, robot if build.levels.shape[0] > 1 else 0
    block, end = number // BLOCK, world.team.end[world.team.start[robot]]
    ant = Ant(
        number,
        number * world.team.start.shape[0] + robot,
        robot,
        1.0 - (number * (1.0 / (build.n_ants - 1)) if build.n_ants > 1 else 0.5),
        end,
        scratch.loop[robot],
        scratch.used[row],
        scratch.visited[row],
        scratch.onward[row],
        scratch.seen[which, number - block * BLOCK],
        scratch.fresh[which, number - block * BLOCK],
    )
    node, alive, n_hops = scratch.node[robot], scratch.alive[robot], scratch.n_hops[robot]
    if n_hops == 0:
        _begin_trail(world, world.returns, build, scratch, ant, node)
    while True:
        if scratch.tabulated[which, node] != block:
            _tabulate(world, build, block, which, node)
        arc = _choose(world, build, scratch, ant, node, alive)
        scratch.trail[robot, n_hops] = node
        n_hops += 1
        if arc == ant.loop:
            node = -1
            break
        node = graph.head[arc]
        alive *= graph.mean_survival[arc]
        if paths is not None:
            scratch.length[robot] += graph.length[arc]
        _visit(world, world.returns, scratch, ant, node, alive)
        if build.concurrent:
            break
    scratch.node[robot], scratch.alive[robot], scratch.n_hops[robot] = node, alive, n_hops
    return bool(node < 0)


@inlined
def _build_plan(world: World, build: Build, scratch: Scratch, ant: int) -> None:
    """Build the plan of an ant in the scratch."""
    n_robots = world.team.start.shape[0]
    for node in range(scratch.unreached.shape[0]):
        scratch.unreached[node] = 1.0
    for robot in range(n_robots):
        scratch.node[robot], scratch.n_hops[robot] = world.team.start[robot], 0
        scratch.alive[robot], scratch.length[robot] = 1.0, 0.0
    robot, n_out = 0, n_robots
    while n_out > 0:
        if scratch.node[robot] >= 0:
            n_out -= _walk(world, build, scratch, build.paths, ant, robot)
        robot = robot + 1 if robot + 1 < n_robots else 0


@at_once(lambda world, _, begin, end: 7e-6 * (end - begin) * world.n_robots * world.graph.n_arcs)
def construct(world: World, build: Build, begin: int, end: int) -> tuple[IntArray, OffsetArray]:
    """Build the plans of the ants ``begin`` to ``end``; return their nodes and offsets, ragged.

    An ant at a node weighs each arc a that this trail has not used yet with
    (τ_R η_R)^(1 − λ) (τ_S η_S)^λ, where η_R is ``1 + gain[a] · (probability that no other robot
    reaches its head, by the trails as they are so far)`` times that of a head already in this
    trail. What an ant builds depends on its own random numbers only, whose state is advanced.
    """
    # Not shared: its arrays change in the innermost loops, where addresses are best in registers.
    scratch, n_robots = build.scratch, world.team.start.shape[0]
    world, build = shared(world), shared(build)
    n_trails, n = (end - begin) * n_robots, 0
    nodes = np.empty(n_trails * scratch.trail.shape[1], np.int32)  # takes memory where written to
    offsets = np.zeros(n_trails + 1, np.int64)
    for ant in range(begin, end):
        _build_plan(world, build, scratch, ant)
        for robot in range(n_robots):
            for i in range(scratch.n_hops[robot]):
                nodes[n + i] = scratch.trail[robot, i]
            n += scratch.n_hops[robot]
            offsets[(ant - begin) * n_robots + robot + 1] = n
    return nodes[:n], offsets


@helper
def _deposit(graph: Graph, n_nodes: int, plans: Depositors, amounts: FloatArray) -> None:
    """Write what plans deposit in all to ``amounts``, of the shape of ``Pheromone.levels``."""
    n_maps = amounts.shape[0]
    amounts.fill(0.0)
    n_robots = (plans.offsets.shape[0] - 1) // plans.objectives.shape[0]
    for plan in plans.members:
        for robot in range(n_robots):
            trail, which = plan * n_robots + robot, robot if n_maps > 1 else 0
            last = plans.offsets[trail + 1] - 1
            for i in range(plans.offsets[trail], last + 1):
                node = int(plans.nodes[i])
                arc = graph.head.shape[0] + node // n_nodes
                if i < last:
                    arc = find_arc(graph, node, int(plans.nodes[i + 1]))
                amounts[which, arc, 0] += plans.objectives[plan, 0]
                amounts[which, arc, 1] += plans.objectives[plan, 1]


@at_once(lambda *given: 3e-6 * (len(given[3].nodes) + len(given[4].nodes)))
def learn(
    graph: Graph,
    n_nodes: int,
    rule: LearnRule,
    iteration: Depositors,
    archive: Depositors,
    is_new: bool,
    pheromone: Pheromone,
) -> None:
    """Evaporate pheromone, and deposit that of the iteration's and of the global Pareto set.

    What the archive deposits is summed up again only if the archive ``is_new``. ``n_nodes`` is the
    number of nodes in the mission.
    """
    graph, levels = shared(graph), pheromone.levels
    _deposit(graph, n_nodes, iteration, pheromone.deposits)
    if is_new:
        _deposit(graph, n_nodes, archive, pheromone.archive_deposits)
    stays, n, n_archived = 1.0 - rule.evaporation, len(iteration.members), len(archive.members)
    if rule.pooled:
        n = n_archived = n + n_archived
    deposits, archived = pheromone.deposits, pheromone.archive_deposits
    for m in range(levels.shape[0]):
        for arc in range(levels.shape[1]):
            for k in range(2):
                kept = stays * levels[m, arc, k] + deposits[m, arc, k] / max(1, n)
                level = kept + archived[m, arc, k] / max(1, n_archived)
                levels[m, arc, k] = max(level, LEAST)
