"""Simulated annealing of one trail plan: moves, evaluation and acceptance in one loop."""

import math
from typing import NamedTuple, TypeVar

import numpy as np

from botohe_moo._base.types import FloatArray, IntArray, OffsetArray, SeedArray
from botohe_moo.core.compile import helper, kernel
from botohe_moo.core.evaluate import Team, begin_team, combine, new_team, team_reward
from botohe_moo.core.graph import Graph, find_arc
from botohe_moo.core.kinds import (
    AT_THIS_DEPOT,
    CARRIED,
    aboard_at,
    aboard_of,
    chance_at,
    credit_carried,
    credit_of,
    has_kinds,
    is_listed,
    layer_of,
    origin_of,
)
from botohe_moo.core.rng import below, uniform
from botohe_moo.core.sharing import shared
from botohe_moo.core.trails import Trails, sort_trails
from botohe_moo.operators.kernels.change import MoveRule, change_trail
from botohe_moo.operators.kernels.moves import CANNOT, MoveScratch, new_move_scratch

Number = TypeVar("Number", float, FloatArray)

_N_SLOTS = 3  # for each robot


class AnnealRule(NamedTuple):
    """How to anneal."""

    moves: MoveRule  # how trails are changed; the first plan keeps its limits, too
    record: bool  # whether to record plans that are evaluated
    total_reward: float  # sum of all rewards, or 1 where there is none
    weight: float  # on reward, in [0, 1]
    cooling: float  # the factor by which the temperature falls after each step
    return_probability: float  # of going back to the best plan after a rejected step


class AnnealState(NamedTuple):
    """The state of a search.

    Trails lie in slots, three for each robot: 3k to 3k + 2 are those of robot k. One has its trail
    in the current plan, one that in the best plan, and each step writes to a free one. What is
    known of trails is kept, so that unchanged ones are not walked again.
    """

    nodes: OffsetArray  # the trails; each slot has room for n_arcs + 1 nodes
    # Where each trail begins and ends (n_slots).
    starts: OffsetArray
    stops: OffsetArray
    # The nodes of the mission that each trail visits, in the order of first visits
    # (n_slots, n_nodes), and how many there are (n_slots).
    met: OffsetArray
    n_met: OffsetArray
    reach: FloatArray  # with what probability each of these is credited (n_slots, n_nodes)
    alive: FloatArray  # probability to survive each trail (n_slots)
    # The slots of the current plan, of the one that is tried, and of the best one that has been
    # evaluated (n_robots).
    current: OffsetArray
    tried: OffsetArray
    best: OffsetArray
    # E[R] and E[S] of the current plan and of the best one (2), and the score of the best one (1).
    # With a score of −inf the next plan that is evaluated becomes the best one.
    objectives: FloatArray
    best_objectives: FloatArray
    best_score: FloatArray
    # Whether the next step begins at the best plan (1), as the first one does.
    to_best: OffsetArray
    temperature: FloatArray  # (1)
    random: SeedArray  # state of the random numbers (1, 2)
    # Scratch: how many trails have been walked (1), and the last walk that came to each node
    # (n_nodes); what the plan reaches; and its slots in the order of their trails (n_robots).
    n_walks: OffsetArray
    visited: OffsetArray
    team: Team
    order: OffsetArray
    moves: MoveScratch


class Records(NamedTuple):
    """Plans that a search has evaluated, except those that the current or best plan dominated."""

    # Their trails; there may be room for more.
    nodes: IntArray
    offsets: OffsetArray
    objectives: FloatArray  # E[R] and E[S] of each (n_most, 2)
    n_plans: OffsetArray  # how many there are (1)


def new_state(graph: Graph, plan: Trails, objectives: FloatArray, random: SeedArray) -> AnnealState:
    """Begin a search with a plan, of which ``objectives`` (2) are E[R] and E[S]."""
    n_robots = len(plan.offsets) - 1
    n_nodes, width, n_slots = graph.n_nodes, graph.n_arcs + 1, _N_SLOTS * n_robots
    first, starts = _N_SLOTS * np.arange(n_robots), width * np.arange(n_slots)
    nodes, stops = np.zeros(n_slots * width, np.int64), starts.copy()
    for slot, begin, end in zip(first, plan.offsets[:-1], plan.offsets[1:], strict=True):
        stops[slot] += end - begin
        nodes[starts[slot] : stops[slot]] = plan.nodes[begin:end]
    return AnnealState(
        nodes=nodes,
        starts=starts,
        stops=stops,
        met=np.zeros((n_slots, n_nodes), np.int64),
        n_met=np.zeros(n_slots, np.int64),
        reach=np.zeros((n_slots, n_nodes)),
        alive=np.zeros(n_slots),
        current=first.copy(),
        tried=first.copy(),
        best=first,
        objectives=np.zeros(2),
        best_objectives=objectives.copy(),
        best_score=np.full(1, -np.inf),
        to_best=np.ones(1, np.int64),
        temperature=np.ones(1),
        random=random,
        n_walks=np.zeros(1, np.int64),
        visited=np.zeros(n_nodes, np.int64),
        team=new_team(n_nodes),
        order=np.zeros(n_robots, np.int64),
        moves=new_move_scratch(graph),
    )


def new_records(n_robots: int, n_plans: int, n_nodes: int) -> Records:
    """Make room for ``n_plans`` plans of ``n_nodes`` nodes together."""
    return Records(
        np.empty(n_nodes, np.int32),
        np.zeros(n_plans * n_robots + 1, np.int64),
        np.empty((n_plans, 2)),
        np.zeros(1, np.int64),
    )


@helper
def _walk(graph: Graph, state: AnnealState, slot: int) -> None:
    """List what a trail visits, with the chance that each visit is credited, and to survive."""
    nodes, met, reach, visited = state.nodes, state.met[slot], state.reach[slot], state.visited
    start, kinds = state.starts[slot], graph.kinds
    state.n_walks[0] += 1
    walk = state.n_walks[0]
    node, alive, n, uncredited = nodes[start], 1.0, 0, 0
    layer = layer_of(kinds, node)
    first, stop = aboard_of(kinds, slot // _N_SLOTS)
    for i in range(first, stop):
        carried = aboard_at(kinds, layer, i)
        visited[carried] = walk
        met[n], reach[n] = origin_of(kinds, carried), CARRIED
        n += 1
    for i in range(start, state.stops[slot]):
        tail, node = node, nodes[i]
        if i > start:
            alive *= graph.survival[find_arc(graph, tail, node)]
        if visited[node] != walk:
            visited[node] = walk
            met[n], reach[n] = origin_of(kinds, node), chance_at(kinds, node, alive)
            n += is_listed(kinds, graph.reward, node)
        if has_kinds(kinds) and credit_of(kinds, node) == AT_THIS_DEPOT:
            uncredited = credit_carried(kinds, layer, met, reach, uncredited, n, alive)
    if has_kinds(kinds):  # what is carried at the end is lost
        credit_carried(kinds, layer, met, reach, uncredited, n, 0.0)
    state.n_met[slot], state.alive[slot] = n, alive


@helper
def _change(graph: Graph, rule: MoveRule, state: AnnealState, robot: int) -> int:
    """Change a robot's trail by one move; return the slot of the new trail, or of the old one."""
    nodes, slot, free = state.nodes, state.current[robot], _N_SLOTS * robot
    while free == slot or free == state.best[robot]:
        free += 1
    width, source, start = graph.head.shape[0] + 1, state.starts[slot], state.starts[free]
    length = state.stops[slot] - source
    for i in range(length):
        nodes[start + i] = nodes[source + i]
    trail = nodes[start : start + width]
    changed = change_trail(graph, rule, state.moves, trail, length, state.random)
    if changed == CANNOT:
        return int(slot)
    state.stops[free] = start + changed
    _walk(graph, state, free)
    return free


@helper
def _copy(slots: OffsetArray, into: OffsetArray) -> None:
    for k in range(slots.shape[0]):
        into[k] = slots[k]


@helper
def _evaluate(graph: Graph, state: AnnealState) -> tuple[float, float]:
    """Return E[R] and E[S] of the plan that is tried, with the bits of ``evaluate``.

    Its trails must have been walked.
    """
    order, team, met, reach = state.order, state.team, state.met, state.reach
    _copy(state.tried, order)
    sort_trails(state.nodes, state.starts, state.stops, order)
    begin_team(team)
    survivors = 0.0
    for k in range(order.shape[0]):
        slot = order[k]
        for j in range(state.n_met[slot]):
            combine(team, met[slot, j], reach[slot, j])
        survivors += state.alive[slot]
    return team_reward(graph, team), survivors


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
def _record(records: Records, state: AnnealState, reward: float, survivors: float) -> None:
    """Write the plan that is tried behind those recorded before."""
    n_robots, n = state.tried.shape[0], records.n_plans[0]
    size = records.offsets[n * n_robots]
    for k in range(n_robots):
        slot = state.tried[k]
        for i in range(state.starts[slot], state.stops[slot]):
            records.nodes[size] = state.nodes[i]
            size += 1
        records.offsets[n * n_robots + k + 1] = size
    records.objectives[n, 0], records.objectives[n, 1] = reward, survivors
    records.n_plans[0] += 1


@kernel
def anneal(
    graph: Graph, rule: AnnealRule, state: AnnealState, records: Records, n_steps: int
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
    graph, rule, state, records = shared(graph), shared(rule), shared(state), shared(records)
    current, tried, best, states = state.current, state.tried, state.best, state.random
    objectives, best_objectives = state.objectives, state.best_objectives
    n_robots, every_robot = current.shape[0], rule.moves.every_robot
    longest = n_robots * (graph.head.shape[0] + 1)
    for step in range(n_steps):
        if state.to_best[0]:  # walk it again: it may come from elsewhere
            _copy(best, current)
            for k in range(n_robots):
                _walk(graph, state, current[k])
            objectives[0], objectives[1] = best_objectives[0], best_objectives[1]
            state.to_best[0] = 0
        n_plans = records.n_plans[0]
        if rule.record and (
            n_plans == records.objectives.shape[0]
            or records.offsets[n_plans * n_robots] + longest > records.nodes.shape[0]
        ):
            return step
        chosen = 0
        if not every_robot and n_robots > 1:
            chosen = below(states, n_robots)
        _copy(current, tried)
        for k in range(n_robots):
            if every_robot or k == chosen:
                tried[k] = _change(graph, rule.moves, state, k)
        reward, survivors = _evaluate(graph, state)
        if rule.record and not (
            _dominates(objectives, reward, survivors)
            or _dominates(best_objectives, reward, survivors)
        ):
            _record(records, state, reward, survivors)
        new_score = score(rule, n_robots, reward, survivors)
        if new_score > state.best_score[0]:
            _copy(tried, best)
            state.best_score[0] = new_score
            best_objectives[0], best_objectives[1] = reward, survivors
        change = new_score - score(rule, n_robots, objectives[0], objectives[1])
        if change >= 0.0 or uniform(states, 0) < math.exp(change / state.temperature[0]):
            _copy(tried, current)
            objectives[0], objectives[1] = reward, survivors
        elif rule.return_probability > 0.0 and uniform(states, 0) < rule.return_probability:
            state.to_best[0] = 1
        state.temperature[0] *= rule.cooling
    return n_steps
