"""Simulated annealing of one trail plan: moves, evaluation and acceptance in one loop."""

import math

from botohe_moo._base.types import FloatArray
from botohe_moo.kernels.anneal.state import AnnealRule, AnnealState, Records
from botohe_moo.kernels.compile import helper, inlined, kernel
from botohe_moo.kernels.graph.arcs import find_arc
from botohe_moo.kernels.graph.graph import Graph
from botohe_moo.kernels.plans.change import change_trail
from botohe_moo.kernels.plans.evaluate import either
from botohe_moo.kernels.plans.moves import CANNOT
from botohe_moo.kernels.plans.order import precedes
from botohe_moo.kernels.rng import uniform


@helper
def _walk(graph: Graph, state: AnnealState, slot: int) -> None:
    """List the nodes of a trail by first visit, with the chance to reach each, and to survive."""
    walked, visited = state.walked, state.team.visited
    start = slot * (graph.head.shape[0] + 1)
    state.team.n_walks[0] += 1
    walk = state.team.n_walks[0]
    alive = 1.0
    here = walked.nodes[start]
    visited[here] = walk
    walked.met[slot, 0], walked.reach[slot, 0] = here, 1.0
    n = 1
    for i in range(start + 1, start + walked.lengths[slot]):
        there = walked.nodes[i]
        alive *= graph.survival[find_arc(graph, here, there)]
        if visited[there] != walk:
            visited[there] = walk
            walked.met[slot, n], walked.reach[slot, n] = there, alive
            n += 1
        here = there
    walked.n_met[slot], walked.alive[slot] = n, alive


@inlined
def _go_to_best(graph: Graph, state: AnnealState) -> None:
    """Make the best plan the one the search is at."""
    width, best = graph.head.shape[0] + 1, state.best
    for k in range(state.here.shape[0]):
        slot = state.here[k]
        state.walked.lengths[slot] = best.lengths[k]
        for i in range(best.lengths[k]):
            state.walked.nodes[slot * width + i] = best.nodes[k, i]
        _walk(graph, state, slot)
    state.objectives[0], state.objectives[1] = best.objectives[0], best.objectives[1]


@inlined
def _try_plan(graph: Graph, rule: AnnealRule, state: AnnealState) -> None:
    """Change one robot's trail, or each robot's, by one move."""
    n_robots, width, walked = state.here.shape[0], graph.head.shape[0] + 1, state.walked
    low, high = 0, n_robots
    if not rule.moves.every_robot and n_robots > 1:
        low = int(uniform(state.random, 0) * n_robots)
        high = low + 1
    for k in range(n_robots):
        state.tried[k] = state.here[k]
    for k in range(low, high):
        slot = state.here[k]
        other = slot ^ 1
        start, length = other * width, walked.lengths[slot]
        for i in range(length):
            walked.nodes[start + i] = walked.nodes[slot * width + i]
        nodes = walked.nodes[start : start + width]
        changed = change_trail(graph, rule.moves, state.moves, nodes, length, state.random)
        if changed != CANNOT:
            walked.lengths[other] = changed
            _walk(graph, state, other)
            state.tried[k] = other


@inlined
def _appraise(graph: Graph, state: AnnealState) -> tuple[float, float]:
    """Give E[R] and E[S] of the plan that is tried: the arithmetic, and the bits, of ``evaluate``.

    Its trails have been walked, which is most of the work.
    """
    walked, team, width = state.walked, state.team, graph.head.shape[0] + 1
    order, touched, reached = team.order, team.touched, team.reached
    for k in range(order.shape[0]):
        slot, place = state.tried[k], k
        start = slot * width
        while place > 0:
            before = order[place - 1]
            other = before * width
            stop, other_stop = start + walked.lengths[slot], other + walked.lengths[before]
            if not precedes(walked.nodes, start, stop, other, other_stop):
                break
            order[place] = before
            place -= 1
        order[place] = slot
    team.n_plans[0] += 1
    n = 0
    survivors = 0.0
    for k in range(order.shape[0]):
        slot = order[k]
        for j in range(walked.n_met[slot]):
            node = walked.met[slot, j]
            if team.touched_by[node] != team.n_plans[0]:
                team.touched_by[node] = team.n_plans[0]
                reached[node] = walked.reach[slot, j]
                touched[n] = node
                n += 1
            else:
                reached[node] = either(reached[node], walked.reach[slot, j])
        survivors += walked.alive[slot]
    expected_reward = 0.0
    for i in range(n):
        expected_reward += graph.reward[touched[i]] * reached[touched[i]]
    return expected_reward, survivors


@helper
def score(rule: AnnealRule, n_robots: int, reward: float, survivors: float) -> float:
    """Give the weighted sum of the shares of all rewards and of all robots."""
    share = reward / rule.total_reward
    return rule.weight * share + (1.0 - rule.weight) * (survivors / n_robots)


@helper
def _dominates(objectives: FloatArray, reward: float, survivors: float) -> bool:
    """Tell whether a plan is at least as good as another in both, and better in one."""
    better, safer = objectives[0] > reward, objectives[1] > survivors
    return bool((better and objectives[1] >= survivors) or (safer and objectives[0] >= reward))


@inlined
def _has_room(graph: Graph, rule: AnnealRule, state: AnnealState, records: Records) -> bool:
    """Tell whether the plan of the next step, whatever it is, can be recorded."""
    n_robots, n = state.here.shape[0], records.n_plans[0]
    if n == records.objectives.shape[0]:
        return False
    size = records.offsets[n * n_robots]
    for k in range(n_robots):
        size += state.walked.lengths[state.here[k]]
    n_changed = n_robots if rule.moves.every_robot else 1
    return bool(size + n_changed * (graph.head.shape[0] + 1) <= records.nodes.shape[0])


@inlined
def _record(
    graph: Graph, state: AnnealState, records: Records, reward: float, survivors: float
) -> None:
    """Write the plan that is tried behind those recorded before."""
    n_robots, n, width = state.here.shape[0], records.n_plans[0], graph.head.shape[0] + 1
    size = records.offsets[n * n_robots]
    for k in range(n_robots):
        slot = state.tried[k]
        for i in range(state.walked.lengths[slot]):
            records.nodes[size + i] = state.walked.nodes[slot * width + i]
        size += state.walked.lengths[slot]
        records.offsets[n * n_robots + k + 1] = size
    records.objectives[n, 0], records.objectives[n, 1] = reward, survivors
    records.n_plans[0] += 1


@inlined
def _remember(graph: Graph, state: AnnealState, reward: float, survivors: float) -> None:
    """Let the plan that is tried be the best one."""
    best, width = state.best, graph.head.shape[0] + 1
    best.objectives[0], best.objectives[1] = reward, survivors
    for k in range(state.here.shape[0]):
        slot = state.tried[k]
        best.lengths[k] = state.walked.lengths[slot]
        for i in range(best.lengths[k]):
            best.nodes[k, i] = state.walked.nodes[slot * width + i]


@kernel
def anneal(
    graph: Graph, rule: AnnealRule, state: AnnealState, records: Records, n_steps: int
) -> int:
    """Anneal one plan for a number of steps, each of which evaluates one plan.

    The score is ``weight · E[R] / total_reward + (1 − weight) · E[S] / n_robots``. A worse plan is
    accepted with probability exp(difference / temperature); when it is rejected, the search goes
    back to the best plan with ``return_probability``. Kirkpatrick, Gelatt and Vecchi,
    "Optimization by simulated annealing", Science 220, 1983.

    Parameters
    ----------
    graph, rule
        Where and how to search.
    state
        Where the search is; advanced.
    records
        Where to write each plan that is evaluated, but for those that the plan the search is at or
        its best dominates. Those that are there stay.
    n_steps
        How many steps to make at most.

    Returns
    -------
    int
        How many steps were made: fewer where there may be no room to record another plan.
    """
    n_robots, here, best = state.here.shape[0], state.objectives, state.best
    if state.to_best[0]:
        _go_to_best(graph, state)
        state.to_best[0] = 0
    for step in range(n_steps):
        if rule.record and not _has_room(graph, rule, state, records):
            return step
        _try_plan(graph, rule, state)
        reward, survivors = _appraise(graph, state)
        if rule.record and not (
            _dominates(here, reward, survivors) or _dominates(best.objectives, reward, survivors)
        ):
            _record(graph, state, records, reward, survivors)
        new_score = score(rule, n_robots, reward, survivors)
        if new_score > best.score[0]:
            best.score[0] = new_score
            _remember(graph, state, reward, survivors)
        change = new_score - score(rule, n_robots, here[0], here[1])
        if change >= 0.0 or uniform(state.random, 0) < math.exp(change / state.temperature[0]):
            for k in range(n_robots):
                state.here[k] = state.tried[k]
            here[0], here[1] = reward, survivors
        elif rule.return_probability > 0.0 and uniform(state.random, 0) < rule.return_probability:
            _go_to_best(graph, state)
        state.temperature[0] *= rule.cooling
    return n_steps
