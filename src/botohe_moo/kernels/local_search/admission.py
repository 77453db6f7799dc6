"""How plans enter a front: their trails are stored, and they are evaluated and compared."""

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
from botohe_moo.kernels.graph.arcs import find_arc
from botohe_moo.kernels.graph.graph import Graph
from botohe_moo.kernels.local_search.trail_store import TrailStore, comes_before, release
from botohe_moo.kernels.local_search.workspace import TOLERANCE, Workspace
from botohe_moo.kernels.plans.evaluate import either


class Given(NamedTuple):
    """Valid plans from elsewhere, ragged: they are evaluated first."""

    nodes: IntArray
    offsets: OffsetArray


@helper
def take_in(
    graph: Graph, store: TrailStore, front: OrderedFront, work: Workspace, given: Given, plan: int
) -> None:
    """Put a given plan into the front, unless that has one as good."""
    n_robots, trails = work.held.shape[0], work.trails
    for k in range(n_robots):
        start = given.offsets[plan * n_robots + k]
        length = given.offsets[plan * n_robots + k + 1] - start - 1
        for i in range(start, start + length):
            work.child[i - start] = find_arc(graph, given.nodes[i], given.nodes[i + 1])
        trail = add_trail(graph, store, work, length)
        place = k
        while place > 0 and comes_before(store, trail, trails[place - 1]):
            trails[place] = trails[place - 1]
            place -= 1
        trails[place] = trail
    bring_in(graph, store, front, work)
    for k in range(n_robots):
        release(store, trails[k])


@helper
def add_trail(graph: Graph, store: TrailStore, work: Workspace, length: int) -> int:
    """Store a trail, which one plan has, and give its number; the store has room (``fits``).

    Its arcs are the first ones in ``work.child``.
    """
    n, nodes = store.n, work.nodes
    work.now.mark += 1
    mark = work.now.mark
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
def put_in_order(store: TrailStore, work: Workspace, trail: int) -> None:
    """Write the parent's trails to ``work.trails``, with another one for the robot at hand."""
    n = 0
    placed = False
    for k in range(work.held.shape[0]):
        if k == work.now.robot:
            continue
        if not placed and comes_before(store, trail, work.held[k]):
            work.trails[n] = trail
            placed = True
            n += 1
        work.trails[n] = work.held[k]
        n += 1
    if not placed:
        work.trails[n] = trail


@helper
def bring_in(graph: Graph, store: TrailStore, front: OrderedFront, work: Workspace) -> bool:
    """Put the plan in ``work.trails`` into the front, unless that has one as good."""
    reward, survivors = evaluate_trails(graph, store, work)
    return enter_team(store, front, work, reward, survivors)


@helper
def enter_team(
    store: TrailStore, front: OrderedFront, work: Workspace, reward: float, survivors: float
) -> bool:
    """Put the plan in ``work.trails`` into the front, and remember if it enters."""
    if not enter(store, front, work.trails, reward, survivors):
        return False
    work.memory.newest, work.memory.idle = survivors, 0
    return True


@helper
def evaluate_trails(graph: Graph, store: TrailStore, work: Workspace) -> tuple[float, float]:
    """Give E[R] and E[S] of the plan in ``work.trails``: the bits of ``evaluate``."""
    nodes, reached = work.nodes, work.reached
    work.now.mark += 1
    mark = work.now.mark
    n = 0
    survivors = 0.0
    for k in range(work.trails.shape[0]):
        trail = store.trails[work.trails[k]]
        for i in range(trail.first_visit, trail.first_visit + trail.n_visits):
            node = np.int64(store.node[i])
            here = nodes[node]
            if here.seen != mark:
                here.seen, here.chance = mark, store.reach[i]
                reached[n] = node
                n += 1
            else:
                here.chance = either(here.chance, store.reach[i])
        survivors += trail.alive
    expected_reward = graph.reward[graph.base]
    for i in range(n):
        expected_reward += graph.reward[reached[i]] * nodes[reached[i]].chance
    return expected_reward, survivors


@helper
def enter(
    store: TrailStore, front: OrderedFront, trails: OffsetArray, reward: float, survivors: float
) -> bool:
    """Put a plan into a front, unless that has one as good; those that it dominates leave."""
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
        leave(store, front, at, place)
    slot = add_place(front, reward, survivors)
    for k in range(trails.shape[0]):
        front.plan[slot, k] = trails[k]
        store.trails[trails[k]].n_users += 1
    return True


@helper
def leave(store: TrailStore, front: OrderedFront, at: int, place: int) -> None:
    """Take a plan out of a front."""
    slot = remove_place(front, at, place)
    for k in range(front.plan.shape[1]):
        release(store, front.plan[slot, k])
