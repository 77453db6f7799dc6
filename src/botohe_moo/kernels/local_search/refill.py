"""Refills of plans: some stops of some robots are removed, and the best nodes inserted instead.

Ruin and recreate: Schrimpf, Schneider, Stamm-Wilbrandt and Dueck, "Record breaking optimization
results using the ruin and recreate principle", Journal of Computational Physics 159(2), 2000.

It is a kernel of its own, so that runs which end before any refill do not compile it.
"""

from botohe_moo.kernels.compile import helper, kernel
from botohe_moo.kernels.local_search.plans import (
    acquire_parent,
    evaluate_others,
    find_plan,
    insert_trails,
    pop_newest,
    release_parent,
)
from botohe_moo.kernels.local_search.tours import build_tour, fill_tours, store_tour
from botohe_moo.kernels.local_search.trail_store import discard, fits
from botohe_moo.kernels.local_search.workspace import TOLERANCE, Search, Workspace
from botohe_moo.kernels.rng import below, uniform
from botohe_moo.kernels.sharing import shared

N_REFILLS = 4  # how many children a refilled plan has
# The probability that a second robot is refilled together with the one drawn, that a third follows
# it, and so on.
P_PAIR = 0.7


@kernel
def refill(search: Search, n_most: int) -> int:
    """Refill plans that wait for it, and those that enter the front meanwhile.

    Returns how many children they had. These are fewer than ``n_most`` where no plan waits any
    more, or where there may be no room for another child.
    """
    search = shared(search)
    work, memory = search.work, search.work.memory
    n = 0
    while n < n_most and memory.n_waiting > 0 and _has_room(search):
        survivors = pop_newest(work)
        if survivors < 0.0:
            memory.n_waiting -= 1
            survivors = work.waiting[memory.n_waiting]
        _select_robots(search, survivors)
        n += _refill_parent(search, n_most - n)
        release_parent(search)
    return n


@helper
def _has_room(search: Search) -> bool:
    """Return whether there is room for another child."""
    n_robots = search.work.parent.shape[0]
    return search.front.n.spare > 1 and fits(search.graph, search.store, n_robots)


@helper
def _select_robots(search: Search, survivors: float) -> None:
    """Make the plan with an E[S] the parent, draw robots to refill, and evaluate the others."""
    front, work = search.front, search.work
    block, place = find_plan(front, survivors)
    acquire_parent(search, block, place)
    front.tried[front.places[front.directory[block], place].slot] += 1
    _draw_robots(work)
    evaluate_others(search.graph, search.store, work)


@helper
def _draw_robots(work: Workspace) -> None:
    """Draw which robots are refilled, ``draft.robot`` among them, and write them to ``chosen``."""
    draft, chosen, states, n_robots = work.draft, work.chosen, work.states, work.parent.shape[0]
    for k in range(n_robots):
        chosen[k] = k
    chosen[draft.robot], chosen[0] = 0, draft.robot
    draft.n_chosen = 1
    while draft.n_chosen < n_robots and uniform(states, 0) < P_PAIR:
        other = draft.n_chosen + below(states, n_robots - draft.n_chosen)
        chosen[draft.n_chosen], chosen[other] = chosen[other], chosen[draft.n_chosen]
        draft.n_chosen += 1


@helper
def _refill_parent(search: Search, n_most: int) -> int:
    """Make children of the parent, at most ``n_most``, insert them, and return how many."""
    store, work = search.store, search.work
    n_children = min(n_most, N_REFILLS)
    for child in range(n_children):
        if not _has_room(search):
            return child
        work.memory.idle += 1
        if _make_child(search):
            insert_trails(search, TOLERANCE)
        for which in range(work.draft.n_chosen - 1, -1, -1):
            discard(store, work.refilled[work.chosen[which]])
    return n_children


@helper
def _make_child(search: Search) -> bool:
    """Refill the chosen robots together, and return whether that makes another plan.

    Its trails are in ``work.refilled``, by robot, and in ``work.trails``.
    """
    work, draft = search.work, search.work.draft
    draft.mark += 1
    draft.n_legs = 0
    for which in range(draft.n_chosen):
        build_tour(search, which)
    fill_tours(search)
    for k in range(work.parent.shape[0]):
        work.refilled[k] = work.parent[k]
    is_new = False
    for which in range(draft.n_chosen):
        robot = work.chosen[which]
        work.refilled[robot] = store_tour(search, which)
        is_new = is_new or work.refilled[robot] != work.parent[robot]
    for k in range(work.parent.shape[0]):
        work.trails[k] = work.refilled[k]
    return is_new
