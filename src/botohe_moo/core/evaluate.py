"""Expected team reward and expected number of survivors of many trail plans."""

from typing import NamedTuple, TypeVar

import numpy as np

from botohe_moo.base.types import FloatArray, IntArray, OffsetArray
from botohe_moo.core.compile import array_maker, at_once, helper, inlined, shared
from botohe_moo.core.walk import Visits, begin_walk, end_walk, new_visits, sort_trails, visit
from botohe_moo.core.world import Graph, Returns, Team, World, find_arc

# What may be wrong with a trail. ``evaluate`` returns the first fault as
# (kind, plan, robot, position), which are all zero where there is none.
VALID = 0
EMPTY_TRAIL = 1
UNKNOWN_NODE = 2
NOT_FROM_BASE = 3
NOT_BACK_AT_BASE = 4
MISSING_ARC = 5
ARC_USED_TWICE = 6

Chance = TypeVar("Chance", float, FloatArray)


class Values(NamedTuple):
    """What plans are worth."""

    objectives: FloatArray  # E[R] in rewards and E[S] in robots (n_plans, 2)
    # How many beginnings and ends of trails are not at base, and how many arcs are missing or used
    # again (n_plans).
    faults: FloatArray
    alive: FloatArray  # the probability that each robot survives (n_plans, n_robots)
    lengths: FloatArray  # how long each trail is, up to its first fault (n_plans, n_robots)


def new_values(n_plans: int, n_robots: int) -> Values:
    """Make room for what plans are worth."""
    teams = (n_plans, n_robots)
    return Values(np.empty((n_plans, 2)), np.empty(n_plans), np.empty(teams), np.empty(teams))


class Reached(NamedTuple):
    """Scratch: what the robots of a plan reach together."""

    plan: OffsetArray  # the number of the plan (1)
    # Of each node in each scenario, as in ``Team.worth``, the last plan that reaches it, and the
    # probability that the plan does.
    seen_by: OffsetArray
    chance: FloatArray
    # What it reaches, in the order in which it was added, and how much that is (1).
    nodes: OffsetArray
    n: OffsetArray


@array_maker
def new_reached(n_entries: int) -> Reached:
    """Return scratch for plans of a mission, where ``Team.worth`` has ``n_entries``."""
    plan, n = np.zeros(1, np.int64), np.zeros(1, np.int64)
    seen_by, nodes = np.zeros(n_entries, np.int64), np.empty(n_entries, np.int64)
    return Reached(plan, seen_by, np.empty(n_entries), nodes, n)


@helper
def begin_plan(reached: Reached) -> None:
    """Begin the next plan, which reaches nothing yet."""
    reached.plan[0] += 1
    reached.n[0] = 0


@inlined
def combine(reached: Reached, node: int | np.int64, alive: float) -> None:
    """Note that one more robot of the plan reaches a node with probability ``alive``."""
    if reached.seen_by[node] != reached.plan[0]:
        reached.seen_by[node], reached.chance[node] = reached.plan[0], alive
        reached.nodes[reached.n[0]] = node
        reached.n[0] += 1
    else:
        reached.chance[node] = either(reached.chance[node], alive)


@helper
def expected_reward(worth: FloatArray, reached: Reached) -> float:
    """Return E[R] of the plan: the rewards of its nodes, in the order in which they were added.

    ``worth`` is that of the team.
    """
    total = 0.0
    for i in range(reached.n[0]):
        node = reached.nodes[i]
        total += worth[node] * reached.chance[node]
    return total


@helper
def either(one: Chance, other: Chance) -> Chance:
    """Return the chance that one of two robots or the other reaches a node: 1 − (1 − p)(1 − q).

    As p + (1 − p) q it keeps the digits of small chances, which differences from 1 lose.
    """
    return one + (1.0 - one) * other


@inlined
def _hop(graph: Graph, used: OffsetArray, trail: int, tail: int, head: int) -> tuple[int, int]:
    """Return the arc of a hop, −1 where there is none, and what is wrong with it."""
    n_nodes = graph.reward.shape[0]
    if head < 0 or head >= n_nodes:
        return -1, UNKNOWN_NODE
    arc = find_arc(graph, tail, head) if 0 <= tail < n_nodes else -1
    if arc < 0:
        return -1, MISSING_ARC
    if used[arc] == trail:
        return arc, ARC_USED_TWICE
    used[arc] = trail
    return arc, VALID


@helper
def _follow_on(
    graph: Graph,
    team: Team,
    returns: Returns | None,
    nodes: IntArray,
    robot: int,
    n: int,
    alive: float,
    visits: Visits,
) -> tuple[int, float]:
    """Walk the nodes of a trail in all scenarios but the first, in which a robot was ``alive``.

    Returns the number of visits and the survival over all. The first scenario is walked while
    faults are looked for: with one loop for all, a plan of a mission without scenarios would take
    half as long again.
    """
    survival = graph.probability[0] * alive
    for scenario in range(1, graph.probability.shape[0]):
        alive = 1.0
        n = begin_walk(graph, team, returns, robot, scenario, n, visits)
        for i in range(1, nodes.shape[0]):
            head = int(nodes[i])
            alive *= graph.survival[scenario, find_arc(graph, int(nodes[i - 1]), head)]
            n = visit(graph, team, returns, head, alive, scenario, n, visits)
        end_walk(team, returns, robot, n, visits)
        survival += graph.probability[scenario] * alive
    return n, survival


@inlined
def _follow(
    graph: Graph,
    team: Team,
    returns: Returns | None,
    used: OffsetArray,
    visits: Visits,
    nodes: IntArray,
    offsets: OffsetArray,
    trail: int,
) -> tuple[float, float, int, int, int, int]:
    """Walk a trail up to its first fault, where the robot is lost, and list what it visits.

    ``used`` is the last trail that used each arc. Returns the probability to survive the trail, its
    length, the number of visits and of faults, and kind and position of the first fault.
    """
    robot = trail % team.start.shape[0]
    source = team.start[robot]
    start, stop = offsets[trail], offsets[trail + 1]
    node = int(nodes[start]) if stop > start else -1
    kind = position = n_faults = n = 0
    if node != source:
        n_faults = 1
        known = 0 <= node < graph.reward.shape[0]
        kind = EMPTY_TRAIL if stop <= start else NOT_FROM_BASE if known else UNKNOWN_NODE
    else:
        n = begin_walk(graph, team, returns, robot, 0, n, visits)
    alive, length = 1.0, 0.0
    for i in range(start + 1, stop if kind == VALID else 0):
        head = int(nodes[i])
        arc, kind = _hop(graph, used, trail, node, head)
        if kind != VALID:
            position = i - start
            break
        alive *= graph.survival[0, arc]
        length += graph.length[arc]
        n = visit(graph, team, returns, head, alive, 0, n, visits)
        node = head
    end_walk(team, returns, robot, n, visits)
    if graph.probability.shape[0] > 1 and (position > 0 or kind == VALID):
        stretch = nodes[start : start + position if position > 0 else stop]
        n, alive = _follow_on(graph, team, returns, stretch, robot, n, alive, visits)
    for i in range(start + max(1, position), stop if kind != VALID else 0):
        head = int(nodes[i])
        n_faults += _hop(graph, used, trail, node, head)[1] != VALID
        node = head
    if node != team.end[source]:
        n_faults += 1
        if kind == VALID:
            kind, position = NOT_BACK_AT_BASE, stop - start - 1
    return alive if kind == VALID else 0.0, length, n, n_faults, kind, position


def evaluate(
    world: World, nodes: IntArray, offsets: OffsetArray, strict: bool, values: Values
) -> tuple[int, int, int, int]:
    """Write what every plan is worth, validating each trail on the way.

    A robot walks its trail up to the first fault, where it is lost. Robots are visited in the
    lexicographic order of their trails, so that two orders of the same trails give the same
    floating-point numbers.

    Trail t is ``nodes[offsets[t]:offsets[t + 1]]``; plan i owns the trails ``i * n_robots`` to
    ``(i + 1) * n_robots``. If ``strict``, it ends at the first plan with a fault, before its row is
    written.

    Returns (kind, plan, robot, position) of the first fault; kind is ``VALID`` where there is none,
    or where it is not ``strict``.
    """
    graph, team, returns = world.graph, world.team, world.returns  # unpacking the rest takes time
    return _evaluate(graph, team, returns, nodes, offsets, strict, values)


@at_once(lambda _graph, _team, _returns, nodes, *_: 2e-5 * len(nodes))
def _evaluate(
    graph: Graph,
    team: Team,
    returns: Returns | None,
    nodes: IntArray,
    offsets: OffsetArray,
    strict: bool,
    values: Values,
) -> tuple[int, int, int, int]:
    graph, team, values = shared(graph), shared(team), shared(values)
    n_robots = team.start.shape[0]
    order, used = np.empty(n_robots, np.int64), np.full(graph.head.shape[0], -1)
    visits = new_visits(graph.reward.shape[0], graph.probability.shape[0])
    reached = new_reached(team.worth.shape[0])
    for plan in range(values.objectives.shape[0]):
        for k in range(n_robots):
            order[k] = plan * n_robots + k
        sort_trails(nodes, offsets, offsets[1:], order)
        begin_plan(reached)
        n_faults = 0
        survivors = 0.0
        for k in range(n_robots):
            trail, robot = order[k], order[k] - plan * n_robots
            alive, length, n, n_wrong, kind, at = _follow(
                graph, team, returns, used, visits, nodes, offsets, trail
            )
            if strict and kind != VALID:
                return kind, plan, robot, at
            for v in range(n):
                combine(reached, visits.node[v], visits.chance[v])
            n_faults += n_wrong
            survivors += alive
            values.alive[plan, robot], values.lengths[plan, robot] = alive, length
        values.objectives[plan, 0] = expected_reward(team.worth, reached)
        values.objectives[plan, 1] = survivors
        values.faults[plan] = n_faults
    return VALID, 0, 0, 0
