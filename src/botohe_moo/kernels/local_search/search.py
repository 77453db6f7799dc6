"""Pareto local search: parents from a front, children of one changed trail, back into it."""

from botohe_moo._types import FloatArray, IntArray, SeedArray
from botohe_moo.kernels.compile import frugal, part, routine
from botohe_moo.kernels.local_search.children import (
    adopt,
    appraise,
    change,
    draw_kind,
    draw_trail,
    write_child,
)
from botohe_moo.kernels.local_search.front import (
    N_BLOCKS,
    N_PLANS,
    Front,
    contribution,
    draw_place,
    find_place,
    has_room,
)
from botohe_moo.kernels.local_search.members import enter, put_in_order, thin
from botohe_moo.kernels.local_search.moves import ADOPT
from botohe_moo.kernels.local_search.parent import (
    MARK,
    WANTED,
    Ground,
    Workspace,
    clear_away,
    lay_out,
    set_aside,
)
from botohe_moo.kernels.local_search.routes import Routes, search_routes
from botohe_moo.kernels.local_search.rule import NOBODY, TOLERANCE, Reserve, SearchRule
from botohe_moo.kernels.local_search.trail_store import (
    TrailStore,
    add_trail,
    evaluate_trails,
    fits,
    release,
)
from botohe_moo.kernels.rng import uniform

# Parents in a row without any child, after which there is nothing left to try.
MAX_FRUITLESS = 10_000


@part
def _draw_parent(
    front: Front,
    reserve: Reserve,
    rule: SearchRule,
    newest: FloatArray,
    held: IntArray,
    states: SeedArray,
) -> int:
    """Write the trails of a parent into ``held``; give its block's number in the directory."""
    if newest[0] >= 0.0 and uniform(states, 0) < rule.p_newest:
        at, place = find_place(front, newest[0])
        if at == front.counts[N_BLOCKS]:
            at -= 1
            place = front.size[front.directory[at]] - 1
    else:
        if rule.p_reserve > 0.0 and uniform(states, 0) < rule.p_reserve:
            drawn = int(uniform(states, 0) * reserve.survivors.shape[0])
            if reserve.plan[drawn, 0] != NOBODY:
                for k in range(held.shape[0]):
                    held[k] = reserve.plan[drawn, k]
                at, place = find_place(front, reserve.survivors[drawn])
                return int(min(at, front.counts[N_BLOCKS] - 1))
        at, place = draw_place(front, states)
        if uniform(states, 0) < rule.p_end:
            at, place = 0, 0
        elif rule.n_drawn > 1:
            most = contribution(front, at, place)
            for _ in range(rule.n_drawn - 1):
                other, other_place = draw_place(front, states)
                area = contribution(front, other, other_place)
                if area > most:
                    most, at, place = area, other, other_place
    slot = front.slot[front.directory[at], place]
    for k in range(held.shape[0]):
        held[k] = front.plan[slot, k]
    return at


@routine
def _keep_in_reserve(
    store: TrailStore, reserve: Reserve, trails: IntArray, survivors: float, states: SeedArray
) -> None:
    """Put a plan in the place of another, drawn."""
    drawn = int(uniform(states, 0) * reserve.survivors.shape[0])
    for k in range(trails.shape[0]):
        store.n_users[trails[k]] += 1
        if reserve.plan[drawn, k] != NOBODY:
            release(store, reserve.plan[drawn, k])
        reserve.plan[drawn, k] = trails[k]
    reserve.survivors[drawn] = survivors


@frugal
def search(
    ground: Ground,
    routes: Routes,
    store: TrailStore,
    front: Front,
    reserve: Reserve,
    work: Workspace,
    rule: SearchRule,
    weights: FloatArray,
    tally: FloatArray,
    newest: FloatArray,
    n_evaluations: int,
    states: SeedArray,
) -> int:
    """Search until so many plans have been evaluated, or there is no room for more.

    Parameters
    ----------
    ground, routes
        The mission, and its safest paths.
    store, front, reserve
        Trails, the front, at least one plan in it, and plans that were nearly good enough.
    work
        Scratch.
    rule
        How to search.
    weights
        How likely each kind of move is, relative, summed up to each (``N_KINDS``).
    tally
        How often each kind of move gave a child, and one that entered; added to (2, N_KINDS).
    newest
        E[S] of the plan that has just entered, −1 where none has (1).
    n_evaluations
        How many.
    states
        Random numbers, one state (1, 2), advanced.

    Returns
    -------
    int
        How many plans have been evaluated; where these are fewer there is no room for more, or no
        move that makes another plan.
    """
    n_robots = work.held.shape[0]
    longest = ground.head.shape[0]
    n = fruitless = 0
    while n < n_evaluations and fruitless < MAX_FRUITLESS:
        before = n
        if not (
            fits(store, rule.n_children + 1, longest, ground.most_visits)
            and has_room(front, rule.n_children + 1)
        ):
            break
        at = _draw_parent(front, reserve, rule, newest, work.held, states)
        newest[0] = -1.0
        for k in range(n_robots):
            store.n_users[work.held[k]] += 1
        robot = int(uniform(states, 0) * n_robots)
        others, survivors_of_others = set_aside(ground, store, work, robot)
        lay_out(ground, store, work, work.held[robot])
        for _ in range(rule.n_children):
            if n == n_evaluations:
                break
            at = min(at, front.counts[N_BLOCKS] - 1)
            kind = draw_kind(weights, states)
            trail = NOBODY
            if kind == ADOPT:
                trail = draw_trail(front, at, rule.p_neighbour, states)
                if trail == work.held[robot]:
                    continue
                reward, survivors, needed = adopt(
                    store, front, work, trail, others, survivors_of_others
                )
            else:
                low, high = states[0, 0], states[0, 1]
                while True:
                    work.now[WANTED] = -1
                    made = change(ground, routes, store, front, work, rule, kind, at, states)
                    if work.now[WANTED] < 0:
                        break
                    # The same child again, from the same random numbers: what has been searched
                    # before does not matter.
                    search_routes(ground.tail, ground.head, ground.cost, routes, work.now[WANTED])
                    states[0, 0], states[0, 1] = low, high
                if not made:
                    continue
                reward, survivors, needed = appraise(
                    ground, front, work, rule, others, survivors_of_others
                )
            n += 1
            tally[0, kind] += 1.0
            if needed * (1.0 - rule.slack) >= reward * (1.0 + TOLERANCE) or reward < 0.0:
                continue
            better = reward * (1.0 - TOLERANCE) > needed
            if not better and (rule.p_reserve == 0.0 or needed <= reward * (1.0 + TOLERANCE)):
                continue
            if trail == NOBODY:
                trail = add_trail(
                    ground.head,
                    ground.survival,
                    ground.reward,
                    ground.base,
                    store,
                    work.child,
                    write_child(work),
                )
            store.n_users[trail] += 1
            put_in_order(store, work, robot, trail)
            if better:
                work.now[MARK] += 1
                reward, survivors = evaluate_trails(
                    ground.reward,
                    ground.base,
                    store,
                    work.trails,
                    work.product,
                    work.reached,
                    work.reached_by,
                    work.now[MARK],
                )
                if enter(store, front, work.trails, reward, survivors):
                    tally[1, kind] += 1.0
                    newest[0] = survivors
                    if 0 < rule.max_size < front.counts[N_PLANS]:
                        thin(store, front, states)
            else:
                _keep_in_reserve(store, reserve, work.trails, survivors, states)
            release(store, trail)
        fruitless = 0 if n > before else fruitless + 1
        clear_away(ground, work)
        for k in range(n_robots):
            release(store, work.held[k])
    return n
