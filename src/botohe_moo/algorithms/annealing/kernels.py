"""Simulated annealing of one trail plan: moves, evaluation and acceptance in one loop.

A trail is written as the node that it starts from and then its arcs. So item i is what leads to
position i of the trail, and trails of robots that start alike are ordered as their nodes are.
"""

import math
from typing import NamedTuple, TypeVar

import numpy as np

from botohe_moo._base.types import FloatArray, IntArray, OffsetArray, SeedArray
from botohe_moo.core.compile import helper, inlined, kernel, shared
from botohe_moo.core.evaluate import Reached, begin_plan, combine, expected_reward, new_reached
from botohe_moo.core.paths import Paths, new_paths, safest_path
from botohe_moo.core.rng import below, draw_weighted, uniform
from botohe_moo.core.trails import sort_trails
from botohe_moo.core.walk import Visits, walk
from botohe_moo.core.world import Graph, World, find_arc, layer_of

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

_LAST_TRIES = 10  # detours, where none of the moves drawn could be made
CANNOT = -1  # instead of a number of arcs, where a move cannot be made


class AnnealRule(NamedTuple):
    """How to anneal."""

    moves: FloatArray  # cumulated weights of moves
    max_tries: int  # how many moves to draw before a few detours are tried
    every_robot: bool  # whether a step changes every robot's trail, rather than that of one
    records: bool  # whether to record plans that are evaluated
    total_reward: float  # sum of all rewards, or 1 where there is none
    weight: float  # on reward, in [0, 1]
    cooling: float  # the factor by which the temperature falls after each step
    return_probability: float  # of going back to the best plan after a rejected step


class Plan(NamedTuple):
    """A plan, with what a walk of each trail has listed."""

    items: OffsetArray  # the trails, one after another with room for n_arcs + 1 items each
    # Where each trail begins and ends (n_robots).
    starts: OffsetArray
    stops: OffsetArray
    # Of each trail: its visits and their probabilities, as ``Visits`` has them (n_robots, n_nodes),
    # how many they are, and the probability to survive it (n_robots).
    visited: OffsetArray
    chance: FloatArray
    n_visits: OffsetArray
    alive: FloatArray
    objectives: FloatArray  # E[R] and E[S] (2); not kept for the plan that is tried


class Moves(NamedTuple):
    """Scratch of moves."""

    mark: OffsetArray  # the number of the trail that is changed (1)
    used: OffsetArray  # its arcs are those where ``used[arc] == mark[0]`` (n_arcs)
    way: OffsetArray  # the arcs that a move puts in
    paths: Paths  # of detours


class AnnealState(NamedTuple):
    """The state of a search."""

    # The current plan; the one that is tried, the same between steps; and the best one evaluated,
    # whose trails need not have been walked.
    current: Plan
    tried: Plan
    best: Plan
    # The score of the best plan (1). With −inf the next plan that is evaluated becomes the best.
    best_score: FloatArray
    # Whether the next step begins at the best plan (1), as the first one does.
    to_best: OffsetArray
    temperature: FloatArray  # (1)
    random: SeedArray  # state of the random numbers (1, 2)
    # Scratch.
    moves: Moves
    seen: OffsetArray  # the last walk that came to each node (n_nodes)
    n_walks: OffsetArray  # how many walks there have been (1)
    reached: Reached
    order: OffsetArray  # robots in the order of their trails (n_robots)


class Records(NamedTuple):
    """Plans that a search has evaluated, except those that the current or best plan dominated."""

    # Their trails; there may be room for more.
    nodes: IntArray
    offsets: OffsetArray
    objectives: FloatArray  # E[R] and E[S] of each (n_most, 2)
    n_plans: OffsetArray  # how many there are (1)


def new_plan(world: World) -> Plan:
    """Return a plan in which every robot stays where it starts."""
    n_robots, n_nodes, width = world.n_robots, len(world.team.reward), world.graph.n_arcs + 1
    items, starts = np.zeros(n_robots * width, np.int64), width * np.arange(n_robots)
    items[starts] = world.team.start
    return Plan(
        items,
        starts,
        starts + 1,
        np.zeros((n_robots, n_nodes), np.int64),
        np.zeros((n_robots, n_nodes)),
        np.zeros(n_robots, np.int64),
        np.zeros(n_robots),
        np.zeros(2),
    )


def new_moves(world: World) -> Moves:
    """Return scratch for moves."""
    n_nodes, n_arcs = world.graph.n_nodes, world.graph.n_arcs
    return Moves(
        mark=np.zeros(1, np.int64),
        used=np.zeros(n_arcs, np.int64),
        way=np.zeros(2 * n_nodes + n_arcs, np.int64),
        paths=new_paths(world),
    )


def new_state(world: World, random: SeedArray) -> AnnealState:
    """Begin a search, whose best plan still has to be set."""
    return AnnealState(
        current=new_plan(world),
        tried=new_plan(world),
        best=new_plan(world),
        best_score=np.full(1, -np.inf),
        to_best=np.ones(1, np.int64),
        temperature=np.ones(1),
        random=random,
        moves=new_moves(world),
        seen=np.zeros(world.graph.n_nodes, np.int64),
        n_walks=np.zeros(1, np.int64),
        reached=new_reached(len(world.team.reward)),
        order=np.zeros(world.n_robots, np.int64),
    )


def new_records(n_robots: int, n_plans: int, n_nodes: int) -> Records:
    """Make room for ``n_plans`` plans of ``n_nodes`` nodes together."""
    return Records(
        np.empty(n_nodes, np.int32),
        np.zeros(n_plans * n_robots + 1, np.int64),
        np.empty((n_plans, 2)),
        np.zeros(1, np.int64),
    )


@inlined
def _node_at(graph: Graph, trail: OffsetArray, i: int) -> int:
    """Return the node at a position of a trail."""
    return int(graph.head[trail[i]] if i > 0 else trail[0])


@helper
def mark_trail(moves: Moves, trail: OffsetArray, n: int) -> None:
    """Take the next mark, and mark the ``n`` arcs of a trail."""
    moves.mark[0] += 1
    for i in range(1, n + 1):
        moves.used[trail[i]] = moves.mark[0]


@helper
def _draw_between(world: World, moves: Moves, source: int, target: int, states: SeedArray) -> int:
    """Draw a node between two, joined to them by unused arcs, and write these to ``moves.way``.

    It is none where trails end. Returns how many arcs these are: 2, or ``CANNOT``.
    """
    graph, used, mark = world.graph, moves.used, moves.mark[0]
    n = 0
    for arc in range(graph.first[source], graph.first[source + 1]):
        node = graph.head[arc]
        if used[arc] == mark or node == world.team.end[node]:
            continue
        onward = find_arc(graph, node, target)
        if onward < 0 or used[onward] == mark:
            continue
        n += 1
        if n == 1 or uniform(states, 0) * n < 1.0:
            moves.way[0], moves.way[1] = arc, onward
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
def _swap(graph: Graph, moves: Moves, trail: OffsetArray, low: int, high: int) -> int:
    """Write the way between the neighbours of two positions whose nodes are swapped."""
    if _node_at(graph, trail, low) == _node_at(graph, trail, high):
        return CANNOT
    before = _node_at(graph, trail, low - 1)
    for i in range(low, high + 2):
        node = _node_at(graph, trail, low + high - i if i in (low, high) else i)
        kept = low + 1 < i < high
        moves.way[i - low] = trail[i] if kept else find_arc(graph, before, node)
        before = node
    return high + 2 - low


@helper
def _reverse(graph: Graph, moves: Moves, trail: OffsetArray, n: int) -> int:
    """Write the way back along a closed trail."""
    for i in range(n):
        moves.way[i] = graph.reverse[trail[n - i]]
    return n if trail[0] == _node_at(graph, trail, n) else CANNOT


@helper
def _add_path(world: World, moves: Moves, n: int, source: int, target: int) -> int:
    """Append the safest path over arcs that are not marked to a way of ``n`` arcs.

    Returns the new number of arcs, ``CANNOT`` where there is no path.
    """
    paths = moves.paths
    added = safest_path(world.graph, paths, moves.used, moves.mark[0], source, target)
    for i in range(added):
        moves.way[n + i] = paths.path[i]
    return n + added if added >= 0 else CANNOT


@helper
def _detour(
    world: World, moves: Moves, trail: OffsetArray, first: int, last: int, states: SeedArray
) -> int:
    """Write a way between two positions that leads over a node drawn among all.

    It takes the arc to that node if it is free, else the safest path, and then the safest path to
    the second position. Over the end, or a node at one of the positions, it is the safest path
    between these. All arcs are ones that the rest of the trail does not take. Returns how many they
    are, ``CANNOT`` where there is no path, or only the one that the trail takes.
    """
    graph, used, mark, way = world.graph, moves.used, moves.mark[0], moves.way
    source, target = _node_at(graph, trail, first), _node_at(graph, trail, last)
    via = layer_of(world.team, source) + below(states, world.team.reward.shape[0])
    for i in range(first + 1, last + 1):
        used[trail[i]] = 0
    out = 0
    if via not in (world.team.end[source], source, target):
        way[0] = find_arc(graph, source, via)
        out = 1
        if way[0] < 0 or used[way[0]] == mark:
            out = _add_path(world, moves, 0, source, via)
        for i in range(out):
            used[way[i]] = mark
        source = via
    n = out
    if source != target and out >= 0:
        n = _add_path(world, moves, out, source, target)
    for i in range(out):
        used[way[i]] = 0
    is_same = n == last - first
    for i in range(first + 1, last + 1):
        used[trail[i]] = mark
        is_same = is_same and way[i - first - 1] == trail[i]
    return CANNOT if is_same else n


@helper
def _draw_change(
    world: World, moves: Moves, trail: OffsetArray, n: int, move: int, states: SeedArray
) -> tuple[int, int, int]:
    """Draw what a move does to a trail of ``n`` arcs.

    Returns two positions, and how many arcs of ``moves.way`` lead from the first to the second one
    instead; ``CANNOT`` where the move cannot be made.

    Positions are drawn uniformly, then a node or a visit among the possible ones. The second
    position of a detour is drawn so that the logarithms of spans are uniform.
    """
    graph = world.graph
    if move == DETOUR:
        first = below(states, n + 1)
        room = n + 1 - first
        last = first + min(room, int((room + 1) ** uniform(states, 0))) - 1
        return first, last, _detour(world, moves, trail, first, last, states)
    if move in (INSERT, GRAB) or (move == SUBSTITUTE and n > 1):
        n_places = n + 1 if move == INSERT else max(1, n) if move == GRAB else n - 1
        first = below(states, n_places)
        last = first + (2 if move == SUBSTITUTE else 1 if move == INSERT and first < n else 0)
        source, target = _node_at(graph, trail, first), _node_at(graph, trail, last)
        return first, last, _draw_between(world, moves, source, target, states)
    if n < 2:
        return 0, 0, CANNOT
    if move == REVERSE:
        return 0, n, _reverse(graph, moves, trail, n)
    if move == DELETE_LOOP:
        one = below(states, n + 1)
        other = _draw_visit(graph, trail, n, one, states)
        return min(one, other), max(one, other), 0 if one != other else CANNOT
    low = high = 1 + below(states, n - 1)
    if move != DELETE:
        if n < 3:
            return 0, 0, CANNOT
        high = 1 + below(states, n - 2)
        high += high >= low
        low, high = min(low, high), max(low, high)
    if move == SWAP:
        return low - 1, high + 1, _swap(graph, moves, trail, low, high)
    before, after = _node_at(graph, trail, low - 1), _node_at(graph, trail, high + 1)
    moves.way[0] = find_arc(graph, before, after)
    return low - 1, high + 1, 0 if move == DELETE and before == after else 1


@helper
def _is_free(moves: Moves, trail: OffsetArray, first: int, last: int, n_way: int) -> bool:
    """Return whether ``moves.way`` has arcs that there are, each once, and the rest does not take.

    The rest of the trail is what is not between the two positions.
    """
    used, mark, way = moves.used, moves.mark[0], moves.way
    for i in range(first + 1, last + 1):
        used[trail[i]] = 0
    n = 0
    while n < n_way and way[n] >= 0 and used[way[n]] != mark:
        used[way[n]] = mark
        n += 1
    for i in range(n):
        used[way[i]] = 0
    for i in range(first + 1, last + 1):
        used[trail[i]] = mark
    return n == n_way


@helper
def make_move(
    world: World, moves: Moves, trail: OffsetArray, n: int, move: int, states: SeedArray
) -> int:
    """Try one move of a trail of ``n`` arcs, in place.

    ``trail`` has room for n_arcs + 1 items. The arcs marked (``mark_trail``) are those of the trail
    before the move, also after it. Returns the new number of arcs; ``CANNOT`` where the move cannot
    be made, and nothing has changed.
    """
    first, last, n_way = _draw_change(world, moves, trail, n, move, states)
    if n_way == CANNOT or not _is_free(moves, trail, first, last, n_way):
        return CANNOT
    longer = n_way - (last - first)
    if longer > 0:
        for i in range(n, last, -1):
            trail[i + longer] = trail[i]
    elif longer < 0:
        for i in range(last + 1, n + 1):
            trail[i + longer] = trail[i]
    for i in range(n_way):
        trail[first + 1 + i] = moves.way[i]
    return n + longer


@helper
def _copy(plan: Plan, into: Plan, robot: int) -> None:
    """Copy a robot's trail, and what its walk has listed, into another plan."""
    into.stops[robot] = plan.stops[robot]
    for i in range(plan.starts[robot], plan.stops[robot]):
        into.items[i] = plan.items[i]
    into.alive[robot], into.n_visits[robot] = plan.alive[robot], plan.n_visits[robot]
    for i in range(plan.n_visits[robot]):
        into.visited[robot, i], into.chance[robot, i] = (
            plan.visited[robot, i],
            plan.chance[robot, i],
        )


@helper
def _set_objectives(plan: Plan, reward: float, survivors: float) -> None:
    plan.objectives[0], plan.objectives[1] = reward, survivors


@helper
def _walk(world: World, state: AnnealState, plan: Plan, robot: int) -> bool:
    """Walk a robot's trail, and return whether it keeps the robot's limits."""
    trail = plan.items[plan.starts[robot] + 1 : plan.stops[robot]]
    visits = Visits(plan.visited[robot], plan.chance[robot], state.seen, state.n_walks)
    n, alive, length = walk(world, world.returns, trail, trail.shape[0], robot, visits)
    plan.n_visits[robot], plan.alive[robot] = n, alive
    limits = world.limits
    return bool(alive >= limits.floors[robot] and length <= limits.budgets[robot])


@helper
def change_trail(world: World, rule: AnnealRule, state: AnnealState, robot: int) -> None:
    """Change a robot's trail in the plan that is tried, by a move drawn by the rule's weights.

    Another move is drawn where that one cannot be made or the trail would not keep the limits. In
    the end a few detours are tried, and then it stays as it is.
    """
    plan, moves, states = state.tried, state.moves, state.random
    trail, n = plan.items[plan.starts[robot] :], plan.stops[robot] - plan.starts[robot] - 1
    mark_trail(moves, trail, n)
    for attempt in range(rule.max_tries + _LAST_TRIES):
        move = draw_weighted(rule.moves, states) if attempt < rule.max_tries else DETOUR
        changed = make_move(world, moves, trail, n, move, states)
        if changed != CANNOT:
            plan.stops[robot] = plan.starts[robot] + changed + 1
            if _walk(world, state, plan, robot):
                return
            _copy(state.current, plan, robot)


@helper
def _evaluate(world: World, state: AnnealState) -> tuple[float, float]:
    """Return E[R] and E[S] of the plan that is tried, with the bits of ``evaluate``."""
    order, reached, plan = state.order, state.reached, state.tried
    for k in range(order.shape[0]):
        order[k] = k
    sort_trails(plan.items, plan.starts, plan.stops, order)
    begin_plan(reached)
    survivors = 0.0
    for k in range(order.shape[0]):
        robot = order[k]
        for i in range(plan.n_visits[robot]):
            combine(reached, plan.visited[robot, i], plan.chance[robot, i])
        survivors += plan.alive[robot]
    return expected_reward(world.team.reward, reached), survivors


@helper
def score(rule: AnnealRule, n_robots: int, reward: Number, survivors: Number) -> Number:
    """Return the weighted sum of the shares of all rewards and of all robots."""
    share = reward / rule.total_reward
    return rule.weight * share + (1.0 - rule.weight) * (survivors / n_robots)


@helper
def _dominates(objectives: FloatArray, reward: float, survivors: float) -> bool:
    """Return whether ``objectives`` dominate another plan's E[R] and E[S]."""
    better, safer = objectives[0] > reward, objectives[1] > survivors
    return bool((better and objectives[1] >= survivors) or (safer and objectives[0] >= reward))


@helper
def _record(graph: Graph, records: Records, plan: Plan, reward: float, survivors: float) -> None:
    """Write a plan behind those recorded before."""
    n_robots, n = plan.starts.shape[0], records.n_plans[0]
    size = records.offsets[n * n_robots]
    for robot in range(n_robots):
        start, stop = plan.starts[robot], plan.stops[robot]
        records.nodes[size] = plan.items[start]
        for i in range(1, stop - start):
            records.nodes[size + i] = graph.head[plan.items[start + i]]
        size += stop - start
        records.offsets[n * n_robots + robot + 1] = size
    records.objectives[n, 0], records.objectives[n, 1] = reward, survivors
    records.n_plans[0] += 1


@helper
def _go_to_best(world: World, state: AnnealState) -> None:
    """Begin at the best plan, and walk it again: it may come from elsewhere."""
    state.to_best[0] = 0
    _set_objectives(state.current, state.best.objectives[0], state.best.objectives[1])
    for robot in range(state.order.shape[0]):
        _copy(state.best, state.current, robot)
        _walk(world, state, state.current, robot)
        _copy(state.current, state.tried, robot)


@helper
def _has_room(records: Records, n_robots: int, n_nodes: int) -> bool:
    """Return whether another plan of ``n_nodes`` nodes can be recorded."""
    n = records.n_plans[0]
    is_full = n == records.objectives.shape[0]
    return not is_full and records.offsets[n * n_robots] + n_nodes <= records.nodes.shape[0]


@kernel
def anneal(
    world: World, rule: AnnealRule, state: AnnealState, records: Records, n_steps: int
) -> int:
    """Anneal one plan for a number of steps, each of which evaluates one plan.

    The score is ``weight · E[R] / total_reward + (1 − weight) · E[S] / n_robots``. A worse plan is
    accepted with probability exp(difference / temperature); when it is rejected, the search goes
    back to the best plan with ``return_probability``. Kirkpatrick, Gelatt and Vecchi,
    "Optimization by simulated annealing", Science 220, 1983.

    Plans that are evaluated are recorded, except those that the current plan or the best one
    dominates. Returns how many steps were made: fewer than ``n_steps`` where there may be no room
    to record another plan.
    """
    world, rule, state, records = shared(world), shared(rule), shared(state), shared(records)
    current, tried, best, states = state.current, state.tried, state.best, state.random
    n_robots = state.order.shape[0]
    for step in range(n_steps):
        if state.to_best[0]:
            _go_to_best(world, state)
        if rule.records and not _has_room(records, n_robots, tried.items.shape[0]):
            return step
        first, stop = 0, n_robots
        if not rule.every_robot and n_robots > 1:
            first = below(states, n_robots)
            stop = first + 1
        for robot in range(first, stop):
            change_trail(world, rule, state, robot)
        reward, survivors = _evaluate(world, state)
        if rule.records and not (
            _dominates(current.objectives, reward, survivors)
            or _dominates(best.objectives, reward, survivors)
        ):
            _record(world.graph, records, tried, reward, survivors)
        new_score = score(rule, n_robots, reward, survivors)
        if new_score > state.best_score[0]:
            state.best_score[0] = new_score
            _set_objectives(best, reward, survivors)
            for robot in range(n_robots):
                _copy(tried, best, robot)
        change = new_score - score(rule, n_robots, current.objectives[0], current.objectives[1])
        is_accepted = change >= 0.0 or uniform(states, 0) < math.exp(change / state.temperature[0])
        if is_accepted:
            _set_objectives(current, reward, survivors)
        elif rule.return_probability > 0.0 and uniform(states, 0) < rule.return_probability:
            state.to_best[0] = 1
        for robot in range(first, stop):
            if is_accepted:
                _copy(tried, current, robot)
            else:
                _copy(current, tried, robot)
        state.temperature[0] *= rule.cooling
    return n_steps
