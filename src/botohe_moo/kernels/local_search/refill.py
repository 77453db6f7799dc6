"""Refilling plans: stops of some robots are dropped, and the best nodes put in instead.

Ruin and recreate: Schrimpf, Schneider, Stamm-Wilbrandt and Dueck, "Record breaking optimization
results using the ruin and recreate principle", Journal of Computational Physics 159(2), 2000.

It is a kernel of its own: runs that end before plans wait to be refilled do not compile it.
"""

from botohe_moo.kernels.compile import helper, kernel
from botohe_moo.kernels.fronts.ordered import OrderedFront, best_reward
from botohe_moo.kernels.graph.graph import Graph
from botohe_moo.kernels.local_search.insertion import evaluate_trails, insert, sort_trails
from botohe_moo.kernels.local_search.layout import (
    clear_others,
    find_plan,
    hold,
    let_go,
    set_aside,
    take_newest,
)
from botohe_moo.kernels.local_search.routes import Routes
from botohe_moo.kernels.local_search.tours import fill_tours, open_tour, store_tour
from botohe_moo.kernels.local_search.trail_store import TrailStore, fits, take_back
from botohe_moo.kernels.local_search.workspace import TOLERANCE, SearchRule, Workspace
from botohe_moo.kernels.rng import below, uniform
from botohe_moo.kernels.sharing import shared

# How many children a refilled plan has.
N_REFILLS = 4
# With what probability another robot's trail is refilled with that of the robot at hand, and yet
# another, and so on.
P_PAIR = 0.7


@kernel
def refill(
    graph: Graph,
    routes: Routes,
    store: TrailStore,
    front: OrderedFront,
    work: Workspace,
    rule: SearchRule,
    n_most: int,
) -> int:
    """Refill the plans that wait for it, and those that enter meanwhile; return how many children.

    Fewer than ``n_most`` where no plan waits any more, or where there may be no room for a child.
    """
    graph, routes, store, front = shared(graph), shared(routes), shared(store), shared(front)
    work, rule = shared(work), shared(rule)
    memory = work.memory
    n = 0
    while n < n_most and memory.n_waiting > 0 and _has_room(graph, store, front, work):
        survivors = take_newest(work)
        if survivors < 0.0:
            memory.n_waiting -= 1
            survivors = work.waiting[memory.n_waiting]
        _take_plan(graph, store, front, work, survivors)
        n += _refill_plan(graph, routes, store, front, work, rule, n_most - n)
        clear_others(graph, work)
        let_go(store, work)
    return n


@helper
def _has_room(graph: Graph, store: TrailStore, front: OrderedFront, work: Workspace) -> bool:
    return front.n.spare > 1 and fits(graph, store, work.parent.shape[0])


@helper
def _take_plan(
    graph: Graph, store: TrailStore, front: OrderedFront, work: Workspace, survivors: float
) -> None:
    """Hold a plan, and set aside the robots that are not refilled."""
    at, place = find_plan(front, survivors)
    hold(store, front, work, at, place)
    front.tried[front.places[front.directory[at], place].slot] += 1
    _choose_robots(work)
    set_aside(graph, store, work)


@helper
def _choose_robots(work: Workspace) -> None:
    """Draw which robots are refilled together: the one at hand, or others with it."""
    draft, chosen, states, n_robots = work.draft, work.chosen, work.states, work.parent.shape[0]
    for k in range(n_robots):
        chosen[k] = k
    chosen[draft.robot], chosen[0] = 0, draft.robot
    draft.chosen = 1
    while draft.chosen < n_robots and uniform(states, 0) < P_PAIR:
        other = draft.chosen + below(states, n_robots - draft.chosen)
        chosen[draft.chosen], chosen[other] = chosen[other], chosen[draft.chosen]
        draft.chosen += 1


@helper
def _refill_plan(
    graph: Graph,
    routes: Routes,
    store: TrailStore,
    front: OrderedFront,
    work: Workspace,
    rule: SearchRule,
    n_most: int,
) -> int:
    """Make children of the parent, and return how many."""
    draft, memory = work.draft, work.memory
    n_children = min(n_most, N_REFILLS)
    for child in range(n_children):
        if not _has_room(graph, store, front, work):
            return child
        memory.idle += 1
        if _make_child(graph, routes, store, work, rule):
            reward, survivors = evaluate_trails(graph, store, work)
            needed = best_reward(front, survivors * (1.0 - TOLERANCE))
            is_better = reward * (1.0 - TOLERANCE) > needed
            if is_better and insert(store, front, work.trails, reward, survivors):
                memory.newest, memory.idle = survivors, 0
        for which in range(draft.chosen - 1, -1, -1):
            take_back(store, work.refilled[work.chosen[which]])
    return n_children


@helper
def _make_child(
    graph: Graph, routes: Routes, store: TrailStore, work: Workspace, rule: SearchRule
) -> bool:
    """Refill the chosen robots together, and return whether that makes another plan.

    Its trails are in ``work.refilled``, by robot, and in ``work.trails``, in order.
    """
    draft = work.draft
    draft.mark += 1
    mark, draft.legs = draft.mark, 0
    for which in range(draft.chosen):
        open_tour(graph, routes, store, work, rule, which, mark)
    fill_tours(graph, routes, work, mark)
    for k in range(work.parent.shape[0]):
        work.refilled[k] = work.parent[k]
    is_new = False
    for which in range(draft.chosen):
        robot = work.chosen[which]
        work.refilled[robot] = store_tour(graph, routes, store, work, rule, which)
        is_new = is_new or work.refilled[robot] != work.parent[robot]
    for k in range(work.parent.shape[0]):
        work.trails[k] = work.refilled[k]
    sort_trails(store, work.trails)
    return is_new
