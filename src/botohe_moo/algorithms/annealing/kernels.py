"""Simulated annealing of one trail plan: moves, evaluation and acceptance in one loop.

A trail is written as the node that it starts from and then its arcs. So item i is what leads to
position i of the trail, and trails of robots that start alike are ordered as their nodes are.
"""

import math
from typing import NamedTuple, TypeVar

import numpy as np

from botohe_moo.base.types import FloatArray, IntArray, OffsetArray, SeedArray
from botohe_moo.core.compile import at_once, helper, inlined, shared
from botohe_moo.core.evaluate import Reached, begin_plan, combine, expected_reward, new_reached
from botohe_moo.core.paths import Paths, new_paths, safest_path
from botohe_moo.core.rng import below, draw_weighted, log_uniform, uniform
from botohe_moo.core.walk import Visits, new_visits, sort_trails, walk
from botohe_moo.core.world import Graph, World, find_arc, keeps, layer_of

Number = TypeVar("Number", float, FloatArray)

# The moves and how often each is drawn, relative to the others: seven of Simon, Richley, Overbey
# and Perez-Lavin, PeerJ Computer Science, 2025, and two that are not published.
MOVES = {
    "insert": 1.0,  # a node between two, or behind the last one, which opens another loop
    "delete": 1.0,  # a node, by the arc between its neighbours; with one of them if they are equal
    "substitute": 1.0,  # another node for one
    "swap": 1.0,  # two nodes change places
    "grab": 1.0,  # from a node to a neighbour and straight back
    "delete-segment": 1.0,  # two or more nodes in a row, by the arc that joins what is left
    "reverse": 0.1,  # the whole trail
    "delete-loop": 0.1,  # what lies between two visits to a node, with one of them
    "detour": 1.0,  # another way between two positions, along safest paths over unused arcs
}
(INSERT, DELETE, SUBSTITUTE, SWAP, GRAB, DELETE_SEGMENT, REVERSE, DELETE_LOOP, DETOUR) = range(
    len(MOVES)
)

# How many moves are drawn, as long as none can be made, and then how many detours.
_MAX_TRIES, _LAST_TRIES = 100, 10
CANNOT = -1  # instead of a number of arcs, where a move cannot be made


class AnnealRule(NamedTuple):
    """How to anneal."""

    moves: FloatArray  # cumulated weights of moves
    every_robot: bool  # whether a step changes every robot's trail, rather than that of one
    records: bool  # whether to record plans that are evaluated
    total_reward: float  # sum of all rewards, or 1 where there is none
    weight: float  # on reward, in [0, 1]
    cooling: float  # the factor by which the temperature falls after each step
    return_probability: float  # of going back to the best plan after a rejected step


class Records(NamedTuple):
    """Plans that have been evaluated, ragged: E[R] and E[S] (n, 2), nodes, and offsets."""

    objectives: FloatArray
    nodes: IntArray
    offsets: OffsetArray


class Plan(NamedTuple):
    """A plan."""

    items: OffsetArray  # the trails, one after another with room for n_arcs + 1 items each
    # Where each trail begins and ends (n_robots).
    starts: OffsetArray
    stops: OffsetArray
    objectives: FloatArray  # E[R] and E[S] (2)


class AnnealState(NamedTuple):
    """The state of a search."""

    # The current plan; the one that is tried, the same between steps; and the best one evaluated.
    current: Plan
    tried: Plan
    best: Plan
    # The score of the best plan (1). With −inf the next plan that is evaluated becomes the best.
    best_score: FloatArray
    temperature: FloatArray  # (1)
    random: SeedArray  # state of the random numbers (1, 2)
    # Scratch of moves: 1 for arcs of the trail that is changed, else 0 (n_arcs); the arcs that a
    # move puts in; and paths of detours.
    used: OffsetArray
    way: OffsetArray
    paths: Paths
    # Of the last walk of each robot in the plan that is tried, and of the one before: the visits (a
    # row of ``node`` and of ``chance``), how many they are, and the probability that it survives
    # (2 · n_robots). And which of them is the last one (n_robots).
    visits: Visits
    n_visits: OffsetArray
    alive: FloatArray
    last: OffsetArray
    # Scratch of evaluations.
    reached: Reached
    order: OffsetArray  # robots in the order of their trails (n_robots)


def new_state(world: World, random: SeedArray) -> AnnealState:
    """Begin a search, whose best plan still has to be set."""
    n_robots, n_nodes, width = world.n_robots, world.graph.n_nodes, world.graph.n_arcs + 1
    starts, items = width * np.arange(n_robots), np.zeros(n_robots * width, np.int64)
    items[starts] = world.team.start
    plans = (Plan(items.copy(), starts, starts + 1, np.zeros(2)) for _ in range(3))
    current, tried, best = plans
    visits = new_visits(n_nodes, world.graph.n_scenarios)
    n_visits = len(visits.node)
    return AnnealState(
        current,
        tried,
        best,
        best_score=np.full(1, -np.inf),
        temperature=np.ones(1),
        random=random,
        used=np.zeros(world.graph.n_arcs, np.int64),
        way=np.zeros(2 * n_nodes + world.graph.n_arcs, np.int64),
        paths=new_paths(world),
        visits=visits._replace(
            node=np.zeros((2 * n_robots, n_visits), np.int64),
            chance=np.zeros((2 * n_robots, n_visits)),
        ),
        n_visits=np.zeros(2 * n_robots, np.int64),
        alive=np.zeros(2 * n_robots),
        last=np.arange(n_robots),
        reached=new_reached(len(world.team.worth)),
        order=np.zeros(n_robots, np.int64),
    )


@inlined
def _node_at(graph: Graph, trail: OffsetArray, i: int) -> int:
    """Return the node at a position of a trail."""
    return int(graph.head[trail[i]] if i > 0 else trail[0])


@inlined
def mark(state: AnnealState, arcs: OffsetArray, start: int, stop: int, used: int) -> None:
    """Mark a stretch of arcs as used (1) or not (0)."""
    for i in range(start, stop):
        state.used[arcs[i]] = used


@helper
def _draw_between(world: World, state: AnnealState, source: int, target: int, but: int) -> int:
    """Draw a node between two, joined to them by unused arcs, and write these to ``state.way``.

    It is not ``but``, nor one where trails end. Returns how many arcs these are: 2, or ``CANNOT``.
    """
    graph, used, n = world.graph, state.used, 0
    for arc in range(graph.first[source], graph.first[source + 1]):
        node = graph.head[arc]
        if used[arc] == 1 or node == but or node == world.team.end[node]:
            continue
        onward = find_arc(graph, node, target)
        if onward < 0 or used[onward] == 1:
            continue
        n += 1
        if n == 1 or uniform(state.random, 0) * n < 1.0:
            state.way[0], state.way[1] = arc, onward
    return 2 if n > 0 else CANNOT


@helper
def _draw_visit(graph: Graph, trail: OffsetArray, n: int, i: int, states: SeedArray) -> int:
    """Draw another position where a trail is at the node that it is at in position i; i if none."""
    node, drawn, n_drawn = _node_at(graph, trail, i), i, 0
    for j in range(n + 1):
        if j != i and _node_at(graph, trail, j) == node:
            n_drawn += 1
            if n_drawn == 1 or uniform(states, 0) * n_drawn < 1.0:
                drawn = j
    return drawn


@helper
def _draw_positions(
    graph: Graph, trail: OffsetArray, n: int, move: int, states: SeedArray
) -> tuple[int, int]:
    """Draw the positions between which a move changes a trail of ``n`` arcs.

    They are drawn uniformly, but the second one of a detour so that the logarithms of spans are
    uniform. Where there are none, the second one is ``CANNOT``.
    """
    if move == DETOUR:
        first = below(states, n + 1)
        return first, first + log_uniform(states, n + 1 - first) - 1
    if move == INSERT:
        first = below(states, n + 1)
        return first, min(first + 1, n)
    if move == GRAB:
        first = below(states, max(1, n))
        return first, first
    if n < 2:
        return 0, CANNOT
    if move == REVERSE:
        return 0, n
    if move == DELETE_LOOP:
        first = below(states, n + 1)
        last = _draw_visit(graph, trail, n, first, states)
        return min(first, last), max(first, last) if first != last else CANNOT
    first = below(states, n - 1)
    if move in (DELETE, SUBSTITUTE):
        return first, first + 2
    if n < 3:
        return 0, CANNOT
    last = below(states, n - 2)
    last += last >= first
    return min(first, last), max(first, last) + 2


@helper
def _write_way(
    world: World, state: AnnealState, trail: OffsetArray, first: int, last: int, move: int
) -> int:
    """Write the arcs by which a move leads from one position to another to ``state.way``.

    An arc that does not exist is −1. Returns how many they are; ``CANNOT`` where the move cannot be
    made.
    """
    graph, way, n = world.graph, state.way, last - first
    node, target = _node_at(graph, trail, first), _node_at(graph, trail, last)
    if move == DELETE_LOOP or (move == DELETE and node == target):
        return 0
    if move in (INSERT, SUBSTITUTE, GRAB):
        but = _node_at(graph, trail, first + 1) if move == SUBSTITUTE else -1
        return _draw_between(world, state, node, target, but)
    # At first, ``way`` holds nodes.
    if move == REVERSE:
        if node != target:
            return CANNOT
        for i in range(n):
            way[i] = _node_at(graph, trail, n - 1 - i)
    elif move == SWAP:
        for i in range(n):
            way[i] = _node_at(graph, trail, first + 1 + i)
        way[0], way[n - 2] = way[n - 2], way[0]
    else:
        way[0], n = target, 1
    for i in range(n):
        head = way[i]
        way[i] = find_arc(graph, node, head)
        node = head
    return n


@helper
def _write_detour(
    world: World, state: AnnealState, trail: OffsetArray, first: int, last: int
) -> int:
    """Write a way between two positions that leads over a node drawn among all to ``state.way``.

    It takes the arc to that node if it is free, else the safest path, and then the safest path to
    the second position. Over the end, or a node at one of the positions, it is the safest path
    between these. Returns how many arcs these are, ``CANNOT`` where there is no path.
    """
    graph, paths, used, way = world.graph, state.paths, state.used, state.way
    node, target = _node_at(graph, trail, first), _node_at(graph, trail, last)
    via = layer_of(world.team, node) + below(state.random, world.team.reward.shape[0])
    if via in (world.team.end[node], target):
        via = node
    n = 1
    paths.path[0] = find_arc(graph, node, via)
    if paths.path[0] < 0 or used[paths.path[0]] == 1:
        n = safest_path(graph, paths, used, 1, node, via)
    for i in range(n):
        way[i] = paths.path[i]
    mark(state, way, 0, n, 1)
    n_more = safest_path(graph, paths, used, 1, via, target) if n >= 0 else CANNOT
    for i in range(n_more):
        way[n + i] = paths.path[i]
    mark(state, way, 0, n, 0)
    return n + n_more if n_more >= 0 else CANNOT


@helper
def make_move(world: World, state: AnnealState, trail: OffsetArray, n: int, move: int) -> int:
    """Try one move of a trail of ``n`` arcs, in place.

    ``trail`` has room for n_arcs + 1 items. The arcs marked are those of the trail before the move,
    also after it. Returns the new number of arcs; ``CANNOT`` where the move cannot
    be made, and nothing has changed.
    """
    used, way = state.used, state.way
    first, last = _draw_positions(world.graph, trail, n, move, state.random)
    if last == CANNOT:
        return CANNOT
    mark(state, trail, first + 1, last + 1, 0)
    if move == DETOUR:
        n_way = _write_detour(world, state, trail, first, last)
    else:
        n_way = _write_way(world, state, trail, first, last, move)
    n_free, is_same = 0, n_way == last - first and move != REVERSE
    while n_free < n_way and way[n_free] >= 0 and used[way[n_free]] == 0:
        used[way[n_free]] = 1
        is_same = is_same and way[n_free] == trail[first + 1 + n_free]
        n_free += 1
    mark(state, way, 0, n_free, 0)
    mark(state, trail, first + 1, last + 1, 1)
    if n_free != n_way or is_same:
        return CANNOT
    longer = n_way - (last - first)
    for i in range(n - last):
        moved = n - i if longer > 0 else last + 1 + i
        trail[moved + longer] = trail[moved]
    for i in range(n_way):
        trail[first + 1 + i] = way[i]
    return n + longer


@helper
def _copy(plan: Plan, into: Plan, first: int, stop: int) -> None:
    """Copy objectives, and the trails of some robots, into another plan."""
    into.objectives[0], into.objectives[1] = plan.objectives[0], plan.objectives[1]
    for robot in range(first, stop):
        into.stops[robot] = plan.stops[robot]
        for i in range(plan.starts[robot], plan.stops[robot]):
            into.items[i] = plan.items[i]


@helper
def _walk(world: World, state: AnnealState, robot: int) -> bool:
    """Walk a robot's trail in the plan that is tried; return whether it keeps the limits."""
    plan, lists, last = state.tried, state.visits, state.last[robot]
    trail = plan.items[plan.starts[robot] + 1 : plan.stops[robot]]
    visits = Visits(lists.node[last], lists.chance[last], lists.seen, lists.n_walks)
    graph, team = world.graph, world.team
    n, alive, length = walk(graph, team, world.returns, trail, trail.shape[0], robot, visits)
    state.n_visits[last], state.alive[last] = n, alive
    return keeps(world.limits, robot, alive, length)


@inlined
def _take_other_walk(state: AnnealState, robot: int) -> None:
    """Take the walk before a robot's last one for the last one."""
    n_robots = state.last.shape[0]
    state.last[robot] = (state.last[robot] + n_robots) % (2 * n_robots)


@helper
def _begin_at(world: World, state: AnnealState, plan: Plan) -> None:
    """Make a plan the current one, and the one that is tried."""
    n_robots = state.last.shape[0]
    _copy(plan, state.current, 0, n_robots)
    _copy(plan, state.tried, 0, n_robots)
    for robot in range(n_robots):
        _walk(world, state, robot)


@helper
def change_trail(world: World, rule: AnnealRule, state: AnnealState, robot: int) -> None:
    """Change a robot's trail in the plan that is tried, by a move drawn by the rule's weights.

    Another move is drawn where that one cannot be made or the trail would not keep the limits. In
    the end a few detours are tried, and then it stays as it is.
    """
    plan = state.tried
    trail, n = plan.items[plan.starts[robot] :], plan.stops[robot] - plan.starts[robot] - 1
    mark(state, trail, 1, n + 1, 1)
    _take_other_walk(state, robot)
    for attempt in range(_MAX_TRIES + _LAST_TRIES):
        move = draw_weighted(rule.moves, state.random) if attempt < _MAX_TRIES else DETOUR
        changed = make_move(world, state, trail, n, move)
        if changed != CANNOT:
            plan.stops[robot] = plan.starts[robot] + changed + 1
            if _walk(world, state, robot):
                break
            _copy(state.current, plan, robot, robot + 1)
            changed = CANNOT
    mark(state, state.current.items[plan.starts[robot] :], 1, n + 1, 0)
    if changed == CANNOT:
        _walk(world, state, robot)


@helper
def _evaluate(world: World, state: AnnealState) -> None:
    """Write E[R] and E[S] of the plan that is tried, with the bits of ``evaluate``."""
    order, reached, visits, plan = state.order, state.reached, state.visits, state.tried
    for k in range(order.shape[0]):
        order[k] = k
    sort_trails(plan.items, plan.starts, plan.stops, order)
    begin_plan(reached)
    survivors = 0.0
    for k in range(order.shape[0]):
        last = state.last[order[k]]
        for i in range(state.n_visits[last]):
            combine(reached, visits.node[last, i], visits.chance[last, i])
        survivors += state.alive[last]
    plan.objectives[0], plan.objectives[1] = expected_reward(world.team.worth, reached), survivors


@inlined
def score(rule: AnnealRule, n_robots: int, reward: Number, survivors: Number) -> Number:
    """Return the weighted sum of the shares of all rewards and of all robots."""
    share = reward / rule.total_reward
    return rule.weight * share + (1.0 - rule.weight) * (survivors / n_robots)


@helper
def _dominates(plan: Plan, other: Plan) -> bool:
    """Return whether a plan dominates another one."""
    more = plan.objectives[0] - other.objectives[0]
    safer = plan.objectives[1] - other.objectives[1]
    return bool(more >= 0.0 and safer >= 0.0 and max(more, safer) > 0.0)


@helper
def _record(graph: Graph, records: Records, n: int, plan: Plan) -> None:
    """Write a plan behind ``n`` others."""
    n_robots = plan.starts.shape[0]
    size = records.offsets[n * n_robots]
    for robot in range(n_robots):
        start, stop = plan.starts[robot], plan.stops[robot]
        records.nodes[size] = plan.items[start]
        for i in range(1, stop - start):
            records.nodes[size + i] = graph.head[plan.items[start + i]]
        size += stop - start
        records.offsets[n * n_robots + robot + 1] = size
    records.objectives[n, 0], records.objectives[n, 1] = plan.objectives[0], plan.objectives[1]


@at_once(lambda world, _rule, _state, _records, n: 1e-4 * n * (10 + world.n_robots))
def anneal(
    world: World, rule: AnnealRule, state: AnnealState, records: Records, n_steps: int
) -> int:
    """Anneal one plan for a number of steps, each of which evaluates one plan.

    The score is ``weight · E[R] / total_reward + (1 − weight) · E[S] / n_robots``. A worse plan is
    accepted with probability exp(difference / temperature); when it is rejected, the search goes
    back to the best plan with ``return_probability``. Kirkpatrick, Gelatt and Vecchi,
    "Optimization by simulated annealing", Science 220, 1983.

    Plans that are evaluated are recorded, except those that the current plan or the best one
    dominates. ``records`` has room for them. Returns how many they are.
    """
    world, rule, state, records = shared(world), shared(rule), shared(state), shared(records)
    current, tried, best, states = state.current, state.tried, state.best, state.random
    n_robots, n_recorded = state.order.shape[0], 0
    _begin_at(world, state, current)
    for _ in range(n_steps):
        first, stop = 0, n_robots
        if not rule.every_robot and n_robots > 1:
            first = below(states, n_robots)
            stop = first + 1
        for robot in range(first, stop):
            change_trail(world, rule, state, robot)
        _evaluate(world, state)
        if rule.records and not (_dominates(current, tried) or _dominates(best, tried)):
            _record(world.graph, records, n_recorded, tried)
            n_recorded += 1
        new_score = score(rule, n_robots, tried.objectives[0], tried.objectives[1])
        change = new_score - score(rule, n_robots, current.objectives[0], current.objectives[1])
        if new_score > state.best_score[0]:
            state.best_score[0] = new_score
            _copy(tried, best, 0, n_robots)
        if change >= 0.0 or uniform(states, 0) < math.exp(change / state.temperature[0]):
            _copy(tried, current, first, stop)
        elif rule.return_probability > 0.0 and uniform(states, 0) < rule.return_probability:
            _begin_at(world, state, best)
        else:
            _copy(current, tried, first, stop)
            for robot in range(first, stop):
                _take_other_walk(state, robot)
        state.temperature[0] *= rule.cooling
    return n_recorded
