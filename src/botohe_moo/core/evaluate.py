"""Expected team reward and expected number of survivors of many trail plans."""

from typing import NamedTuple, TypeVar

import numpy as np

from botohe_moo._base.types import FloatArray, IntArray, OffsetArray
from botohe_moo.core.compile import array_maker, helper, inlined, kernel
from botohe_moo.core.graph import Graph, find_arc
from botohe_moo.core.kinds import (
    AT_THIS_DEPOT,
    CARRIED,
    Kinds,
    aboard_at,
    aboard_of,
    chance_at,
    credit_carried,
    end_of,
    is_listed,
    layer_of,
    origin_of,
    reward_at,
    start_of,
)
from botohe_moo.core.sharing import shared
from botohe_moo.core.trails import sort_trails

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


class Team(NamedTuple):
    """Scratch: what the robots of a plan reach together."""

    plan: OffsetArray  # the number of the plan (1)
    seen_by: OffsetArray  # the last plan that reaches each node (n_nodes)
    chance: FloatArray  # the probability that the plan reaches each node (n_nodes)
    # The nodes that it reaches, in the order in which they were added (n_nodes), and how many (1).
    nodes: OffsetArray
    n: OffsetArray


class _Scratch(NamedTuple):
    """Scratch of evaluations."""

    # The last trail that used each arc (n_arcs), and that visited each node (n_nodes).
    used: OffsetArray
    visited: OffsetArray
    team: Team
    # With kinds, which nodes of the mission a trail visits, in the order of first visits, and with
    # what probability each is credited (n_nodes).
    node: OffsetArray
    chance: FloatArray


@array_maker
def new_team(n_nodes: int) -> Team:
    """Return scratch for plans on a graph of ``n_nodes`` nodes."""
    return Team(
        np.zeros(1, np.int64),
        np.zeros(n_nodes, np.int64),
        np.empty(n_nodes),
        np.empty(n_nodes, np.int64),
        np.zeros(1, np.int64),
    )


@helper
def begin_team(team: Team) -> None:
    """Begin the next plan, which reaches nothing yet."""
    team.plan[0] += 1
    team.n[0] = 0


@inlined
def combine(team: Team, node: int | np.int64, alive: float) -> None:
    """Note that one more robot of the plan reaches a node with probability ``alive``."""
    if team.seen_by[node] != team.plan[0]:
        team.seen_by[node], team.chance[node] = team.plan[0], alive
        team.nodes[team.n[0]] = node
        team.n[0] += 1
    else:
        team.chance[node] = either(team.chance[node], alive)


@helper
def team_reward(graph: Graph, team: Team) -> float:
    """Return E[R] of the plan: the rewards of its nodes, in the order in which they were added."""
    total = 0.0
    for i in range(team.n[0]):
        node = team.nodes[i]
        total += reward_at(graph.kinds, graph.reward, node) * team.chance[node]
    return total


@helper
def either(one: Chance, other: Chance) -> Chance:
    """Return the chance that one of two robots or the other reaches a node: 1 − (1 − p)(1 − q).

    As p + (1 − p) q it keeps the digits of small chances, which differences from 1 lose.
    """
    return one + (1.0 - one) * other


@inlined
def _load(kinds: Kinds | None, scratch: _Scratch, trail: int, source: int) -> int:
    """List what a robot carries from the start as visits, and return how many they are."""
    layer, n = layer_of(kinds, source), 0
    first, stop = aboard_of(kinds, trail)
    for i in range(first, stop):
        node = aboard_at(kinds, layer, i)
        scratch.visited[node] = trail
        scratch.node[n], scratch.chance[n] = origin_of(kinds, node), CARRIED
        n += 1
    return n


@inlined
def _reach(
    graph: Graph,
    kinds: Kinds | None,
    scratch: _Scratch,
    trail: int,
    node: int,
    alive: float,
    n: int,
) -> int:
    """Note that a robot gets to a node with probability ``alive``; return how many visits it made.

    ``n`` is how many they were before. Without kinds they are not counted.
    """
    is_first = scratch.visited[node] != trail
    scratch.visited[node] = trail
    if kinds is None:
        if is_first:
            combine(scratch.team, node, alive)
        return 0
    if is_first and is_listed(kinds, graph.reward, node):
        scratch.node[n] = kinds.origin[node]
        scratch.chance[n] = chance_at(kinds, node, alive)
        n += 1
    if kinds.credit[node] == AT_THIS_DEPOT:
        credit_carried(kinds, layer_of(kinds, node), scratch.node, scratch.chance, 0, n, alive)
    return n


@helper
def _combine_visits(kinds: Kinds | None, scratch: _Scratch, source: int, n: int) -> None:
    """Add what a robot of some kind collects to what its team does: ``n`` visits."""
    if kinds is None:  # they were added one by one
        return
    visited, chance = scratch.node, scratch.chance
    credit_carried(kinds, layer_of(kinds, source), visited, chance, 0, n, 0.0)  # the rest is lost
    for i in range(n):
        combine(scratch.team, visited[i], chance[i])


@inlined
def _hop(graph: Graph, scratch: _Scratch, trail: int, tail: int, head: int) -> tuple[int, int]:
    """Return the arc of a hop, −1 where there is none, and what is wrong with it."""
    n_nodes = graph.reward.shape[0]
    if head < 0 or head >= n_nodes:
        return -1, UNKNOWN_NODE
    if tail < 0 or tail >= n_nodes:
        return -1, MISSING_ARC
    arc = find_arc(graph, tail, head)
    if arc < 0:
        return -1, MISSING_ARC
    if scratch.used[arc] == trail:
        return arc, ARC_USED_TWICE
    scratch.used[arc] = trail
    return arc, VALID


@inlined
def _walk(
    graph: Graph,
    scratch: _Scratch,
    nodes: IntArray,
    start: int,
    stop: int,
    trail: int,
    source: int,
) -> tuple[float, float, int, int, int]:
    """Walk a trail, from ``source``, up to its first fault, where the robot is lost.

    Returns the probability to survive it, its length, the number of its faults, and kind and
    position of the first fault.
    """
    node = int(nodes[start]) if stop > start else -1
    kind = position = n_faults = n = 0
    if node != source:
        n_faults = 1
        known = 0 <= node < graph.reward.shape[0]
        kind = EMPTY_TRAIL if stop <= start else NOT_FROM_BASE if known else UNKNOWN_NODE
    else:
        n = _load(graph.kinds, scratch, trail, source)
        n = _reach(graph, graph.kinds, scratch, trail, node, 1.0, n)
    alive, length = 1.0, 0.0
    i = start + 1
    while kind == VALID and i < stop:
        head = int(nodes[i])
        arc, kind = _hop(graph, scratch, trail, node, head)
        if kind == VALID:
            alive *= graph.survival[arc]
            length += graph.length[arc]
            n = _reach(graph, graph.kinds, scratch, trail, head, alive, n)
            node = head
            i += 1
        else:
            position = i - start
    _combine_visits(graph.kinds, scratch, source, n)
    for j in range(i, stop):
        head = int(nodes[j])
        n_faults += _hop(graph, scratch, trail, node, head)[1] != VALID
        node = head
    if node != end_of(graph.kinds, graph.base, source):
        n_faults += 1
        if kind == VALID:
            kind, position = NOT_BACK_AT_BASE, stop - start - 1
    return alive if kind == VALID else 0.0, length, n_faults, kind, position


@kernel
def evaluate(
    graph: Graph,
    nodes: IntArray,
    offsets: OffsetArray,
    n_robots: int,
    strict: bool,
    values: Values,
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
    graph, values, n_nodes = shared(graph), shared(values), graph.reward.shape[0]
    used, visited = np.full(graph.head.shape[0], -1), np.full(n_nodes, -1)
    node, chance = np.empty(n_nodes, np.int64), np.empty(n_nodes)
    scratch = _Scratch(used, visited, new_team(n_nodes), node, chance)
    order = np.empty(n_robots, np.int64)
    for plan in range(values.objectives.shape[0]):
        for k in range(n_robots):
            trail = plan * n_robots + k
            order[k] = trail
        sort_trails(nodes, offsets, offsets[1:], order)
        begin_team(scratch.team)
        n_faults = 0
        survivors = 0.0
        for k in range(n_robots):
            trail = order[k]
            start, stop = offsets[trail], offsets[trail + 1]
            source = start_of(graph.kinds, graph.base, trail)
            alive, length, n, kind, at = _walk(graph, scratch, nodes, start, stop, trail, source)
            if strict and kind != VALID:
                return kind, plan, trail - plan * n_robots, at
            n_faults += n
            survivors += alive
            values.alive[plan, trail - plan * n_robots] = alive
            values.lengths[plan, trail - plan * n_robots] = length
        values.objectives[plan, 0] = team_reward(graph, scratch.team)
        values.objectives[plan, 1] = survivors
        values.faults[plan] = n_faults
    return VALID, 0, 0, 0
