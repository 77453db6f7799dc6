"""Pareto local search: parents from a front, children of one changed trail, back into it."""

from typing import NamedTuple

import numpy as np

from botohe_moo.kernels.compile import helper, inlined, kernel
from botohe_moo.kernels.fronts.ordered import (
    OrderedFront,
    best_reward,
    contribution,
    draw_place,
    find_place,
    slope_at,
)
from botohe_moo.kernels.graph.graph import Graph
from botohe_moo.kernels.local_search.admission import (
    Given,
    add_trail,
    bring_in,
    enter_alone,
    leave,
    put_in_order,
    take_in,
)
from botohe_moo.kernels.local_search.children import adopt, appraise, write_child
from botohe_moo.kernels.local_search.layout import clear_others, clear_trail, lay_out, set_aside
from botohe_moo.kernels.local_search.moves import ADOPT, N_KINDS, change, draw_trail
from botohe_moo.kernels.local_search.refill import choose_robots, refill
from botohe_moo.kernels.local_search.routes import Routes
from botohe_moo.kernels.local_search.trail_store import TrailStore, fits, release
from botohe_moo.kernels.local_search.workspace import TOLERANCE, SearchRule, Workspace
from botohe_moo.kernels.rng import below, uniform

# Parents in a row without any child, after which there is nothing left to try.
MAX_FRUITLESS = 10_000

# Instead of a trail: the child's is not stored.
NOBODY = -1


class Fronts(NamedTuple):
    """The front, and another one for trails of one robot, which is empty between two calls."""

    team: OrderedFront
    alone: OrderedFront


@kernel
def search(
    graph: Graph,
    routes: Routes,
    store: TrailStore,
    fronts: Fronts,
    work: Workspace,
    rule: SearchRule,
    given: Given,
    n_evaluations: int,
) -> int:
    """Take the given plans into the front, then search from there.

    Gives how many plans have been evaluated, the given ones among them: where these are fewer than
    ``n_evaluations`` there is no room for more, or no move makes another plan.
    """
    front, alone = fronts.team, fronts.alone
    n_robots = work.held.shape[0]
    n_given = (given.offsets.shape[0] - 1) // n_robots
    most_new = max(rule.n_children, rule.n_children_busy) + 1
    n = fruitless = 0
    while n < n_evaluations and fruitless < MAX_FRUITLESS:
        if not fits(graph, store, max(most_new, n_robots)) or front.n.spare < most_new:
            break
        if n < n_given:
            take_in(graph, store, front, work, given, n)
            n += 1
            continue
        if alone.n.plans == 0:
            _take_parent(graph, store, fronts, work, rule)
            if work.now.chosen > 0:
                n += refill(graph, routes, store, front, work, rule, n_evaluations - n)
                _let_go(graph, store, alone, work)
                continue
        n_more = _raise_children(graph, routes, store, fronts, work, rule, n_evaluations - n)
        n += n_more
        fruitless = 0 if n_more > 0 else fruitless + 1
        work.now.alone -= max(1, n_more)
        if work.now.alone <= 0 or alone.n.spare < most_new:
            _let_go(graph, store, alone, work)
    if alone.n.plans > 0:
        _let_go(graph, store, alone, work)
    return n


@helper
def _take_parent(
    graph: Graph, store: TrailStore, fronts: Fronts, work: Workspace, rule: SearchRule
) -> None:
    """Hold a parent, and set aside all its robots but one, which may go on alone for a while.

    A robot that stays at base is drawn again once: the others have more to change.
    """
    now, held = work.now, work.held
    now.at, place = _draw_parent(fronts.team, work, rule)
    slot = fronts.team.places[fronts.team.directory[now.at], place].slot
    fronts.team.tried[slot] += 1
    for k in range(held.shape[0]):
        held[k] = fronts.team.plan[slot, k]
        store.trails[held[k]].n_users += 1
    now.robot = below(work.states, held.shape[0])
    if store.trails[held[now.robot]].n_arcs == 0:
        now.robot = below(work.states, held.shape[0])
    now.chosen = 0
    p_refill = rule.p_refill * (1.0 if work.memory.idle <= rule.busy else rule.refill_idle)
    if p_refill > 0.0:  # few plans offer few pieces to each other: refill more of them
        p_refill = max(p_refill, 0.5 / fronts.team.n.plans)
    if uniform(work.states, 0) < p_refill:
        choose_robots(work, rule)
        is_end = now.at == 0 and place == 0
        now.slope = 0.0 if is_end else slope_at(fronts.team, now.at, place)
    set_aside(graph, store, work)
    now.alone = 0
    if now.chosen > 0:
        return
    is_stuck = held.shape[0] > 1 and work.memory.idle > rule.patience
    if is_stuck and uniform(work.states, 0) < rule.p_alone:
        now.alone = rule.n_alone
        lay_out(graph, store, work, held[now.robot])
        last = work.steps[now.length]
        enter_alone(store, fronts.alone, work, held[now.robot], last.gained, last.alive)
        clear_trail(graph, work)


@inlined
def _draw_parent(front: OrderedFront, work: Workspace, rule: SearchRule) -> tuple[int, int]:
    """Draw a plan of the front: the newest, that of most reward, or one with much room beside it.

    That room is the area that its neighbours leave it, less with every time it was a parent.
    """
    memory, states, n_robots = work.memory, work.states, work.held.shape[0]
    newest = memory.newest
    memory.newest = -1.0
    if newest >= 0.0 and uniform(states, 0) < rule.p_newest:
        at, place = find_place(front, newest)
        if at == front.n.blocks:
            at -= 1
            place = front.size[front.directory[at]] - 1
        return at, place
    survivors = front.places[front.directory[0], 0].survivors
    if uniform(states, 0) < max(rule.p_end, rule.p_safe_end * survivors / n_robots):
        return 0, 0
    best, best_place, most = 0, 0, -1.0
    for _ in range(rule.n_drawn_busy if memory.idle <= rule.busy else rule.n_drawn):
        at, place = draw_place(front, states)
        tried = front.tried[front.places[front.directory[at], place].slot]
        promise = contribution(front, at, place) / (1.0 + tried)
        if promise > most:
            best, best_place, most = at, place, promise
    return best, best_place


@inlined
def _draw_kind(work: Workspace) -> int:
    """Draw a kind of move, by weights summed up to each."""
    weights = work.weights
    drawn = uniform(work.states, 0) * weights[N_KINDS - 1]
    kind = 0
    while weights[kind] <= drawn and kind < N_KINDS - 1:
        kind += 1
    return kind


@helper
def _raise_children(
    graph: Graph,
    routes: Routes,
    store: TrailStore,
    fronts: Fronts,
    work: Workspace,
    rule: SearchRule,
    n_most: int,
) -> int:
    """Make children of the parent, or of a trail that it may have; give how many."""
    front, now, memory = fronts.team, work.now, work.memory
    goal, others, survivors = front, now.others, now.survivors
    parent = work.held[now.robot]
    is_alone, needed = fronts.alone.n.plans > 0, -1.0
    if is_alone:
        goal, others, survivors = fronts.alone, 0.0, 0.0
        at, place = draw_place(goal, work.states)
        slot = goal.places[goal.directory[at], place].slot
        parent = int(np.int64(goal.plan[slot, 0]))
    store.trails[parent].n_users += 1
    lay_out(graph, store, work, parent)
    n = 0
    for _ in range(rule.n_children_busy if memory.idle <= rule.busy else rule.n_children):
        if n == n_most:
            break
        kind, trail = _draw_kind(work), NOBODY
        if kind == ADOPT:
            trail = draw_trail(front, work, rule)
            if trail == parent:
                continue
            gained, alive = adopt(store, goal, work, trail, others, survivors)
        elif change(graph, routes, store, front, work, rule, kind):
            gained, alive = appraise(graph, goal, work, rule, others, survivors)
        else:
            continue
        n += 1
        memory.idle += 1
        work.tally[0, kind] += 1
        if gained < 0.0:
            continue
        if trail == NOBODY:
            trail = add_trail(graph, store, work, write_child(work))
        else:
            store.trails[trail].n_users += 1
        if is_alone:
            enter_alone(store, goal, work, trail, gained, alive)
            needed = best_reward(front, (now.survivors + alive) * (1.0 - TOLERANCE))
        if not is_alone or (now.others + gained) * (1.0 - TOLERANCE) > needed:
            put_in_order(store, work, trail)
            work.tally[1, kind] += bring_in(graph, store, front, work)
        release(store, trail)
    clear_trail(graph, work)
    release(store, parent)
    return n


@helper
def _let_go(graph: Graph, store: TrailStore, alone: OrderedFront, work: Workspace) -> None:
    """Release the parent, and the trails that its robot was tried with."""
    while alone.n.blocks > 0:
        last = alone.n.blocks - 1
        leave(store, alone, last, alone.size[alone.directory[last]] - 1)
    clear_others(graph, work)
    for k in range(work.held.shape[0]):
        release(store, work.held[k])
