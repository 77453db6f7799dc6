"""How plans are inserted into a front: their trails are stored, evaluated and compared."""

from typing import NamedTuple

import numpy as np

from botohe_moo._base.types import IntArray, OffsetArray
from botohe_moo.kernels.compile import helper
from botohe_moo.kernels.fronts.ordered import (
    OrderedFront,
    add_place,
    best_reward,
    find_place,
    remove_place,
)
from botohe_moo.kernels.graph.graph import Graph, find_arc
from botohe_moo.kernels.local_search.trail_store import TrailStore, comes_before, release
from botohe_moo.kernels.local_search.workspace import TOLERANCE, Workspace
from botohe_moo.kernels.plans.evaluate import begin_team, combine, team_reward


class Given(NamedTuple):
    """Valid plans from elsewhere, ragged: they are evaluated first."""

    nodes: IntArray
    offsets: OffsetArray


@helper
def insert_given(
    graph: Graph, store: TrailStore, front: OrderedFront, work: Workspace, given: Given, plan: int
) -> None:
    """Insert a given plan into the front, unless that has one as good."""
    n_robots, trails = work.trails.shape[0], work.trails
    for k in range(n_robots):
        start = given.offsets[plan * n_robots + k]
        length = given.offsets[plan * n_robots + k + 1] - start - 1
        for i in range(start, start + length):
            work.child[i - start] = find_arc(graph, given.nodes[i], given.nodes[i + 1])
        trails[k] = add_trail(graph, store, work, length)
    sort_trails(store, trails)
    reward, survivors = evaluate_trails(graph, store, work)
    if insert(store, front, trails, reward, survivors):
        work.memory.newest, work.memory.idle = survivors, 0
    for k in range(n_robots):
        release(store, trails[k])


@helper
def add_trail(graph: Graph, store: TrailStore, work: Workspace, length: int) -> int:
    """Store a trail, which one plan has, and return its number; the store has room (``fits``).

    Its arcs are the first ones in ``work.child``.
    """
    n, nodes = store.n, work.nodes
    work.draft.mark += 1
    mark = work.draft.mark
    n.spare -= 1
    trail = store.spare[n.spare]
    added = store.trails[trail]
    added.first_arc, added.n_arcs, added.first_visit = n.arcs, length, n.visits
    nodes[graph.base].seen = mark
    alive = 1.0
    for i in range(length):
        arc = work.child[i]
        store.arc[n.arcs + i] = arc
        alive *= graph.survival[arc]
        node = graph.head[arc]
        if graph.reward[node] > 0.0 and nodes[node].seen != mark:
            nodes[node].seen = mark
            store.node[n.visits], store.reach[n.visits] = node, alive
            n.visits += 1
    n.arcs += length
    added.n_visits = n.visits - added.first_visit
    added.alive, added.n_users = alive, 1
    return int(trail)


@helper
def sort_trails(store: TrailStore, trails: OffsetArray) -> None:
    """Sort a plan's trails in lexicographic order."""
    for k in range(1, trails.shape[0]):
        trail, place = trails[k], k
        while place > 0 and comes_before(store, trail, trails[place - 1]):
            trails[place] = trails[place - 1]
            place -= 1
        trails[place] = trail


@helper
def evaluate_trails(graph: Graph, store: TrailStore, work: Workspace) -> tuple[float, float]:
    """Return E[R] and E[S] of the plan in ``work.trails``: the bits of ``evaluate``."""
    team = work.team
    begin_team(team)
    combine(team, graph.base, 1.0)
    survivors = 0.0
    for k in range(work.trails.shape[0]):
        trail = store.trails[work.trails[k]]
        for i in range(trail.first_visit, trail.first_visit + trail.n_visits):
            combine(team, np.int64(store.node[i]), store.reach[i])
        survivors += trail.alive
    return team_reward(graph.reward, team), survivors


@helper
def insert(
    store: TrailStore, front: OrderedFront, trails: OffsetArray, reward: float, survivors: float
) -> bool:
    """Insert a plan into a front, unless that has one as good; return whether it has entered.

    The plans that it dominates leave the front.
    """
    if best_reward(front, survivors) >= reward:
        return False
    no_more = survivors * (1.0 + TOLERANCE)
    while True:
        # Those dominated, but for rounding, are the last that survive no more.
        at, place = find_place(front, no_more)
        behind = at == front.n.blocks
        if behind or front.places[front.directory[at], place].survivors > no_more:
            place -= 1
            if place < 0:
                at -= 1
                if at < 0:
                    break
                place = front.size[front.directory[at]] - 1
        if front.places[front.directory[at], place].reward > reward:
            break
        slot = remove_place(front, at, place)
        for k in range(front.plan.shape[1]):
            release(store, front.plan[slot, k])
    slot = add_place(front, reward, survivors)
    for k in range(trails.shape[0]):
        front.plan[slot, k] = trails[k]
        store.trails[trails[k]].n_users += 1
    return True
