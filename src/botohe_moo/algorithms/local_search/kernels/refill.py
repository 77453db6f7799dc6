"""Refills of plans: some stops of some robots are removed, and the best nodes inserted instead.

Ruin and recreate: Schrimpf, Schneider, Stamm-Wilbrandt and Dueck, "Record breaking optimization
results using the ruin and recreate principle", Journal of Computational Physics 159(2), 2000. A
walk goes on from plans that are a little worse, less and less so: Dueck and Scheuer, "Threshold
accepting", Journal of Computational Physics 90(1), 1990.

It is a kernel of its own, so that runs which end before any refill do not compile it.
"""

from botohe_moo.algorithms.local_search.kernels.plans import (
    acquire_parent,
    clear_others,
    evaluate_others,
    evaluate_trails,
    find_plan,
    insert_trails,
    is_stuck,
    pop_newest,
    release_parent,
)
from botohe_moo.algorithms.local_search.kernels.tours import build_tour, fill_tours, store_tour
from botohe_moo.algorithms.local_search.kernels.trail_store import discard, fits, release
from botohe_moo.algorithms.local_search.kernels.workspace import TOLERANCE, Search
from botohe_moo.core.compile import helper, kernel
from botohe_moo.core.kinds import behind_kind, first_of_kind, n_origins
from botohe_moo.core.ordered import count_turn, slope_at
from botohe_moo.core.rng import below, uniform
from botohe_moo.core.sharing import shared

N_REFILLS = 4  # how many children a refilled plan has
# The probability that a second robot is refilled together with the one drawn, that a third follows
# it, and so on.
P_PAIR = 0.7
# Once the search is stuck, the probability that the children are the steps of a walk instead, how
# many steps it has for each node of the mission, and which share of its value the plan may lose at
# the first step. Without walks, rewards on missions without danger were up to 5 % lower.
P_WALK, N_WALK, THRESHOLD = 0.08, 8, 0.05


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
    """Make the plan with an E[S] the parent, draw robots to refill, and evaluate the others.

    A walk weighs E[R] and E[S] as the front weighs them at the plan; at its end of most reward,
    only E[R] counts.
    """
    front, work, draft = search.front, search.work, search.work.draft
    block, place = find_plan(front, survivors)
    acquire_parent(search, block, place)
    found = front.places[front.directory[block], place]
    count_turn(front, found.slot)
    draft.slope = slope_at(front, block, place) if block > 0 or place > 0 else 0.0
    draft.value = found.reward + draft.slope * found.survivors
    _draw_robots(search)
    evaluate_others(search.graph, search.store, work)


@helper
def _draw_robots(search: Search) -> None:
    """Draw which robots are refilled, of the kind of ``draft.robot``, and with it.

    They are written to ``chosen``.
    """
    work, kinds = search.work, search.graph.kinds
    draft, chosen, states = work.draft, work.chosen, work.states
    first = first_of_kind(kinds, draft.robot)
    n_robots = behind_kind(kinds, work.parent.shape[0], draft.robot) - first
    for k in range(n_robots):
        chosen[k] = first + k
    chosen[draft.robot - first], chosen[0] = first, draft.robot
    draft.n_chosen = 1
    while draft.n_chosen < n_robots and uniform(states, 0) < P_PAIR:
        other = draft.n_chosen + below(states, n_robots - draft.n_chosen)
        chosen[draft.n_chosen], chosen[other] = chosen[other], chosen[draft.n_chosen]
        draft.n_chosen += 1


@helper
def _refill_parent(search: Search, n_most: int) -> int:
    """Make children of the parent, at most ``n_most``, insert them, and return how many.

    In a walk, a child that is not too bad is the next parent.
    """
    store, work = search.store, search.work
    n_nodes = n_origins(search.graph.kinds, search.graph.reward.shape[0])
    is_walk = is_stuck(search) and uniform(work.states, 0) < P_WALK
    n_children = min(n_most, N_WALK * n_nodes if is_walk else N_REFILLS)
    for child in range(n_children):
        if not _has_room(search):
            return child
        if is_walk and child > 0:
            _draw_other_robots(search)
        work.memory.idle += 1
        is_next = False
        if _make_child(search):
            insert_trails(search, TOLERANCE)
            is_next = is_walk and _is_good_enough(search, THRESHOLD * (1.0 - child / n_children))
        for which in range(work.draft.n_chosen - 1, -1, -1):
            robot = work.chosen[which]
            if is_next:
                release(store, work.parent[robot])
                work.parent[robot] = work.refilled[robot]
            else:
                discard(store, work.refilled[robot])
    return n_children


@helper
def _draw_other_robots(search: Search) -> None:
    """Draw anew which robots of the parent are refilled, and evaluate the others."""
    graph, work = search.graph, search.work
    clear_others(graph, work)
    work.draft.robot = below(work.states, work.parent.shape[0])
    _draw_robots(search)
    evaluate_others(graph, search.store, work)


@helper
def _is_good_enough(search: Search, loss: float) -> bool:
    """Return whether the child loses at most this share of its parent's value; note its own."""
    draft = search.work.draft
    reward, survivors = evaluate_trails(search.graph, search.store, search.work)
    value = reward + draft.slope * survivors
    if value < draft.value * (1.0 - loss):
        return False
    draft.value = value
    return True


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
