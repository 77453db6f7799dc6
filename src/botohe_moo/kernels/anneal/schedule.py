"""Simulated annealing of one trail plan: moves, evaluation and acceptance in one loop."""

import math
from typing import TypeVar

from botohe_moo._base.types import FloatArray, OffsetArray, SeedArray
from botohe_moo.kernels.anneal.state import (
    AnnealRule,
    AnnealState,
    Best,
    Records,
    TeamScratch,
    Walked,
)
from botohe_moo.kernels.compile import helper, kernel
from botohe_moo.kernels.graph.graph import Graph, find_arc
from botohe_moo.kernels.plans.change import MoveRule, change_trail
from botohe_moo.kernels.plans.evaluate import begin_team, combine, team_reward
from botohe_moo.kernels.plans.marks import CANNOT, NO_PATHS, MoveScratch
from botohe_moo.kernels.plans.order import precedes
from botohe_moo.kernels.rng import below, uniform
from botohe_moo.kernels.sharing import shared

Number = TypeVar("Number", float, FloatArray)


@helper
def _walk(graph: Graph, walked: Walked, team: TeamScratch, slot: int) -> None:
    """List the nodes of a trail by first visit, with the chance to reach each, and to survive."""
    nodes, met, reach, visited = walked.nodes, walked.met, walked.reach, team.visited
    start = slot * (graph.head.shape[0] + 1)
    team.n_walks[0] += 1
    walk = team.n_walks[0]
    alive = 1.0
    here = nodes[start]
    visited[here] = walk
    met[slot, 0], reach[slot, 0] = here, 1.0
    n = 1
    for i in range(start + 1, start + walked.lengths[slot]):
        there = nodes[i]
        alive *= graph.survival[find_arc(graph, here, there)]
        if visited[there] != walk:
            visited[there] = walk
            met[slot, n], reach[slot, n] = there, alive
            n += 1
        here = there
    walked.n_met[slot], walked.alive[slot] = n, alive


@helper
def _change(
    graph: Graph,
    rule: MoveRule,
    moves: MoveScratch,
    walked: Walked,
    team: TeamScratch,
    slot: int,
    states: SeedArray,
) -> int:
    """Change a trail by one move; give the slot of the new one, or its own where none was made.

    ``NO_PATHS`` where a detour was drawn for which there is no scratch.
    """
    nodes, width = walked.nodes, graph.head.shape[0] + 1
    length, other = walked.lengths[slot], slot ^ 1
    start, source = other * width, slot * width
    for i in range(length):
        nodes[start + i] = nodes[source + i]
    changed = change_trail(graph, rule, moves, nodes[start : start + width], length, states)
    if changed == CANNOT:
        return slot
    if changed == NO_PATHS:
        return NO_PATHS
    walked.lengths[other] = changed
    _walk(graph, walked, team, other)
    return other


@helper
def _go_to_best(
    graph: Graph, best: Best, here: OffsetArray, walked: Walked, team: TeamScratch
) -> None:
    """Make the best plan the one the search is at."""
    nodes, best_nodes = walked.nodes, best.nodes
    for k in range(here.shape[0]):
        slot, length = here[k], best.lengths[k]
        start = slot * best_nodes.shape[1]
        walked.lengths[slot] = length
        for i in range(length):
            nodes[start + i] = best_nodes[k, i]
        _walk(graph, walked, team, slot)


@helper
def _evaluate(
    reward: FloatArray, slots: OffsetArray, walked: Walked, team: TeamScratch
) -> tuple[float, float]:
    """Return E[R] and E[S] of a plan: the arithmetic, and the bits, of ``evaluate``.

    Its trails have been walked, which is most of the work.
    """
    n_robots, width = slots.shape[0], walked.nodes.shape[0] // walked.lengths.shape[0]
    nodes, lengths = walked.nodes, walked.lengths
    met, n_met, reach = walked.met, walked.n_met, walked.reach
    order = team.order
    for k in range(n_robots):
        slot, place = slots[k], k
        start = slot * width
        while place > 0:
            before = order[place - 1]
            other = before * width
            stop, other_stop = start + lengths[slot], other + lengths[before]
            if not precedes(nodes, start, stop, other, other_stop):
                break
            order[place] = before
            place -= 1
        order[place] = slot
    begin_team(team.team)
    survivors = 0.0
    for k in range(n_robots):
        slot = order[k]
        for j in range(n_met[slot]):
            combine(team.team, met[slot, j], reach[slot, j])
        survivors += walked.alive[slot]
    return team_reward(reward, team.team), survivors


@helper
def score(rule: AnnealRule, n_robots: int, reward: Number, survivors: Number) -> Number:
    """Return the weighted sum of the shares of all rewards and of all robots."""
    share = reward / rule.total_reward
    return rule.weight * share + (1.0 - rule.weight) * (survivors / n_robots)


@helper
def _dominates(objectives: FloatArray, reward: float, survivors: float) -> bool:
    """Return whether a plan is at least as good as another in both, and better in one."""
    better, safer = objectives[0] > reward, objectives[1] > survivors
    return bool((better and objectives[1] >= survivors) or (safer and objectives[0] >= reward))


@helper
def _has_room(records: Records, here: OffsetArray, lengths: OffsetArray, n_more: int) -> bool:
    """Return whether a plan of ``n_more`` nodes more than the one at hand can be recorded."""
    n_robots, n = here.shape[0], records.n_plans[0]
    if n == records.objectives.shape[0]:
        return False
    size = records.offsets[n * n_robots] + n_more
    for k in range(n_robots):
        size += lengths[here[k]]
    return bool(size <= records.nodes.shape[0])


@helper
def _record(
    records: Records, slots: OffsetArray, walked: Walked, reward: float, survivors: float
) -> None:
    """Write a plan behind those recorded before."""
    nodes, offsets, source, lengths = records.nodes, records.offsets, walked.nodes, walked.lengths
    n_robots, n, width = slots.shape[0], records.n_plans[0], source.shape[0] // lengths.shape[0]
    size = offsets[n * n_robots]
    for k in range(n_robots):
        start, length = slots[k] * width, lengths[slots[k]]
        for i in range(length):
            nodes[size + i] = source[start + i]
        size += length
        offsets[n * n_robots + k + 1] = size
    records.objectives[n, 0], records.objectives[n, 1] = reward, survivors
    records.n_plans[0] += 1


@helper
def _remember(
    best: Best, slots: OffsetArray, walked: Walked, reward: float, survivors: float
) -> None:
    """Let a plan be the best one."""
    best_nodes, nodes = best.nodes, walked.nodes
    best.objectives[0], best.objectives[1] = reward, survivors
    for k in range(slots.shape[0]):
        slot = slots[k]
        start, length = slot * best_nodes.shape[1], walked.lengths[slot]
        best.lengths[k] = length
        for i in range(length):
            best_nodes[k, i] = nodes[start + i]


@kernel
def anneal(
    graph: Graph, rule: AnnealRule, state: AnnealState, records: Records, n_steps: int
) -> int:
    """Anneal one plan for a number of steps, each of which evaluates one plan.

    The score is ``weight · E[R] / total_reward + (1 − weight) · E[S] / n_robots``. A worse plan is
    accepted with probability exp(difference / temperature); when it is rejected, the search goes
    back to the best plan with ``return_probability``. Kirkpatrick, Gelatt and Vecchi,
    "Optimization by simulated annealing", Science 220, 1983.

    Each plan that is evaluated is recorded, but for those that the plan the search is at or its
    best dominates. Gives how many steps, n, were made: fewer than asked for where there may be no
    room to record another plan; −1 − n where the next step needs scratch for detours.
    """
    graph, rule, state, records = shared(graph), shared(rule), shared(state), shared(records)
    best, walked, team, states = state.best, state.walked, state.team, state.random
    here, tried, at, temperature = state.here, state.tried, state.objectives, state.temperature
    n_robots, width, every_robot = here.shape[0], graph.head.shape[0] + 1, rule.moves.every_robot
    for step in range(n_steps):
        if state.to_best[0]:
            _go_to_best(graph, best, here, walked, team)
            at[0], at[1], state.to_best[0] = best.objectives[0], best.objectives[1], 0
        n_more = width * n_robots if every_robot else width
        if rule.record and not _has_room(records, here, walked.lengths, n_more):
            return step
        low, high = states[0, 0], states[0, 1]
        chosen = 0
        if not every_robot and n_robots > 1:
            chosen = below(states, n_robots)
        for k in range(n_robots):
            tried[k] = here[k]
            if every_robot or k == chosen:
                tried[k] = _change(graph, rule.moves, state.moves, walked, team, here[k], states)
                if tried[k] == NO_PATHS:
                    states[0, 0], states[0, 1] = low, high
                    return -1 - step
        reward, survivors = _evaluate(graph.reward, tried, walked, team)
        if rule.record and not (
            _dominates(at, reward, survivors) or _dominates(best.objectives, reward, survivors)
        ):
            _record(records, tried, walked, reward, survivors)
        new_score = score(rule, n_robots, reward, survivors)
        if new_score > best.score[0]:
            best.score[0] = new_score
            _remember(best, tried, walked, reward, survivors)
        change = new_score - score(rule, n_robots, at[0], at[1])
        if change >= 0.0 or uniform(states, 0) < math.exp(change / temperature[0]):
            for k in range(n_robots):
                here[k] = tried[k]
            at[0], at[1] = reward, survivors
        elif rule.return_probability > 0.0 and uniform(states, 0) < rule.return_probability:
            state.to_best[0] = 1
        temperature[0] *= rule.cooling
    return n_steps
