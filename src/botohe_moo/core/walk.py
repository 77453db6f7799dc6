"""Trails in ragged arrays, and the one walk that lists what a trail visits and collects."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from botohe_moo.base.types import BoolArray, FloatArray, IntArray, OffsetArray, SeedArray
from botohe_moo.core import world as worlds
from botohe_moo.core.compile import array_maker, at_once, helper, inlined
from botohe_moo.core.rng import GOLDEN, hash_step, mixed
from botohe_moo.core.world import Graph, Returns, Team


@helper
def precedes(
    items: NDArray[np.integer], start: int, stop: int, other_start: int, other_stop: int
) -> bool:
    """Return whether one stretch of an array comes before another in lexicographic order."""
    length, other_length = stop - start, other_stop - other_start
    for i in range(min(length, other_length)):
        item, other = items[start + i], items[other_start + i]
        if item != other:
            return bool(item < other)
    return bool(length < other_length)


@inlined
def sort_trails(
    nodes: NDArray[np.integer], starts: OffsetArray, stops: OffsetArray, order: OffsetArray
) -> None:
    """Sort trails, whose numbers are in ``order``, lexicographically; equal ones stay in order."""
    for k in range(1, order.shape[0]):
        trail, place = order[k], k
        while place > 0:
            other = order[place - 1]
            if not precedes(nodes, starts[trail], stops[trail], starts[other], stops[other]):
                break
            order[place] = other
            place -= 1
        order[place] = trail


@at_once(lambda nodes, *_: 1e-6 * len(nodes))
def plan_hashes(nodes: IntArray, offsets: OffsetArray, n_robots: int) -> SeedArray:
    """Hash the multiset of each plan's trails to 64 bits (n_plans); their order does not matter."""
    hashes = np.zeros((offsets.shape[0] - 1) // n_robots, np.uint64)
    for trail in range(offsets.shape[0] - 1):
        bits = GOLDEN
        for i in range(offsets[trail], offsets[trail + 1]):
            bits = hash_step(bits, nodes[i])
        hashes[trail // n_robots] += mixed(bits)
    return hashes


@at_once(lambda objectives, *_: 2e-6 * len(objectives))
def keep_front(objectives: FloatArray, hashes: SeedArray, order: OffsetArray, max_ties: int) -> int:
    """Leave the Pareto set in front of ``order``, each plan once; return how many plans it has.

    ``order`` has the plans by descending objectives, and only non-dominated ones where these are
    more than two. Of plans with equal objectives up to ``max_ties`` stay.
    """
    n = first = 0  # ``first`` is the first plan with the objectives of the last
    best, is_pair = -np.inf, objectives.shape[1] == 2
    for i in range(order.shape[0]):
        row = order[i]  # n ≤ i: what is overwritten is not needed any more
        survivors = objectives[row, 1]
        if survivors != best or not np.array_equal(objectives[row], objectives[order[first]]):
            if is_pair and not (survivors > best and objectives[row, 0] > -np.inf):
                continue
            best, first = survivors, n
        is_known = first < n and (hashes[order[first:n]] == hashes[row]).any()
        if not is_known and n - first < max_ties:
            order[n] = row
            n += 1
    return n


@at_once(lambda _objectives, _hashes, rows, front, *_: 2e-6 * len(rows) * len(front))
def are_new(
    objectives: FloatArray,
    hashes: SeedArray,
    rows: OffsetArray,
    front: FloatArray,
    known: SeedArray,
) -> BoolArray:
    """Return which rows of plans are neither dominated by a front nor, by their hashes, in it."""
    found = np.ones(rows.shape[0], np.bool_)
    for i in range(rows.shape[0]):
        for j in range(front.shape[0]):
            is_ahead = is_behind = False
            for k in range(front.shape[1]):
                is_ahead |= objectives[rows[i], k] > front[j, k]
                is_behind |= objectives[rows[i], k] < front[j, k]
            if not is_ahead and (is_behind or hashes[rows[i]] == known[j]):
                found[i] = False
                break
    return found


CARRIED = -1.0  # instead of a probability, of visits that have not been credited yet


class Visits(NamedTuple):
    """Scratch of walks: what a trail visits that may be worth something."""

    # In one scenario after another, the nodes of the mission in the order of first visits, what
    # robots carry from the start before these, as indices of ``Team.worth``; and the probability
    # that each is credited then (n_scenarios · n_nodes).
    node: OffsetArray
    chance: FloatArray
    seen: OffsetArray  # the last walk that came to each node of the layers (n_nodes)
    n_walks: OffsetArray  # how many walks there have been (1)


@array_maker
def new_visits(n_nodes: int, n_scenarios: int) -> Visits:
    """Return scratch for walks through a graph of ``n_nodes`` nodes."""
    node, chance = np.empty(n_scenarios * n_nodes, np.int64), np.empty(n_scenarios * n_nodes)
    return Visits(node, chance, np.zeros(n_nodes, np.int64), np.zeros(1, np.int64))


@inlined
def walk(
    graph: Graph,
    team: Team,
    returns: Returns | None,
    arcs: IntArray | OffsetArray,
    n_arcs: int,
    robot: int,
    visits: Visits,
) -> tuple[int, float, float]:
    """List what a robot visits on a trail, and with what probability each reward is credited.

    In each scenario, a reward that counts on arrival is credited with share · (probability to get
    there), one on return with share · (probability to get to the next depot), or 0 if there is
    none. Returns how many visits there are in all scenarios, and the survival, over all scenarios,
    and the length of the trail.
    """
    survival = length = 0.0
    n = 0
    for scenario in range(graph.probability.shape[0]):
        survivals, alive, length = graph.survival[scenario], 1.0, 0.0
        n = begin_walk(graph, team, returns, robot, scenario, n, visits)
        for i in range(n_arcs):
            arc = arcs[i]
            alive *= survivals[arc]
            length += graph.length[arc]
            n = visit(graph, team, returns, graph.head[arc], alive, scenario, n, visits)
        end_walk(team, returns, robot, n, visits)
        survival += graph.probability[scenario] * alive
    return n, survival, length


@inlined
def begin_walk(
    graph: Graph,
    team: Team,
    returns: Returns | None,
    robot: int,
    scenario: int,
    n: int,
    visits: Visits,
) -> int:
    """List what a robot carries from the start, and its visit there; return how many these are."""
    visits.n_walks[0] += 1
    source = team.start[robot]
    first, stop = worlds.aboard_of(returns, robot)
    for i in range(first, stop):
        node = worlds.aboard_at(returns, worlds.layer_of(team, source), i)
        visits.seen[node] = visits.n_walks[0]
        visits.node[n] = scenario * graph.reward.shape[0] + team.origin[node]
        visits.chance[n] = CARRIED
        n += 1
    return visit(graph, team, returns, source, 1.0, scenario, n, visits)


@inlined
def visit(
    graph: Graph,
    team: Team,
    returns: Returns | None,
    node: int,
    alive: float,
    scenario: int,
    n: int,
    visits: Visits,
) -> int:
    """Note that a robot gets to a node, with probability ``alive``, after ``n`` visits.

    Returns how many visits there are then.
    """
    if visits.seen[node] != visits.n_walks[0]:
        visits.seen[node] = visits.n_walks[0]
        if graph.reward[node] > 0.0:
            visits.node[n] = scenario * graph.reward.shape[0] + team.origin[node]
            visits.chance[n] = alive * team.share[node]
            if worlds.credit_of(returns, node) == worlds.AT_NEXT_DEPOT:
                visits.chance[n] = CARRIED
            n += 1
    if worlds.credit_of(returns, node) == worlds.AT_THIS_DEPOT:
        _credit_carried(team, returns, visits, node, n, alive)
    return n


@inlined
def end_walk(team: Team, returns: Returns | None, robot: int, n: int, visits: Visits) -> None:
    """Note that what a robot still carries at the end, or where it is lost, is never credited."""
    _credit_carried(team, returns, visits, team.start[robot], n, 0.0)


@helper
def _credit_carried(
    team: Team, returns: Returns | None, visits: Visits, node: int, n: int, alive: float
) -> None:
    """Credit what is carried of ``n`` visits at a depot; of scenarios before, nothing is."""
    if returns is None:
        return
    layer, n_nodes = worlds.layer_of(team, node), team.origin.shape[0]
    for i in range(n):
        if visits.chance[i] == CARRIED:
            visits.chance[i] = alive * team.share[layer + visits.node[i] % n_nodes]
