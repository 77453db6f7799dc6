"""Pareto local search: parents from a front, children of one changed trail, back into it."""

from botohe_moo.kernels.compile import helper, kernel
from botohe_moo.kernels.fronts.ordered import OrderedFront, contribution, draw_place
from botohe_moo.kernels.graph.graph import Graph
from botohe_moo.kernels.local_search.children import appraise, appraise_trail, write_child
from botohe_moo.kernels.local_search.insertion import (
    Given,
    add_trail,
    evaluate_trails,
    insert,
    insert_given,
    sort_trails,
)
from botohe_moo.kernels.local_search.layout import (
    clear_others,
    clear_trail,
    find_plan,
    hold,
    lay_out,
    let_go,
    set_aside,
    take_newest,
)
from botohe_moo.kernels.local_search.moves import ADOPT, N_KINDS, change, draw_trail
from botohe_moo.kernels.local_search.routes import Routes
from botohe_moo.kernels.local_search.trail_store import TrailStore, fits, release
from botohe_moo.kernels.local_search.workspace import (
    BUSY,
    REFILLED_AT_ONCE,
    SearchRule,
    Workspace,
)
from botohe_moo.kernels.rng import below, uniform
from botohe_moo.kernels.sharing import shared

# Parents in a row without any child, after which there is nothing left to try.
MAX_FRUITLESS = 10_000

# Instead of a trail: the child's is not stored.
NOBODY = -1

# With what probability the parent is the plan of most reward; and where all its robots survive.
P_END, _P_SAFE_END = 0.1, 0.4
# After this many evaluations without a plan that enters the front, with what probability another
# robot of a parent takes a trail of another plan, so that two of its trails change.
PATIENCE, P_OTHER = 2_000, 0.5


@kernel
def search(
    graph: Graph,
    routes: Routes,
    store: TrailStore,
    front: OrderedFront,
    work: Workspace,
    rule: SearchRule,
    given: Given,
    n_evaluations: int,
) -> int:
    """Insert the given plans into the front, then search from there.

    Returns how many plans have been evaluated, the given ones among them. These are fewer than
    ``n_evaluations`` where there is no room for more, where plans wait to be refilled, or where no
    move makes another plan.
    """
    graph, routes, store, front = shared(graph), shared(routes), shared(store), shared(front)
    work, rule, given = shared(work), shared(rule), shared(given)
    n_robots, n_added = work.parent.shape[0], rule.n_children + 1
    n_given = (given.offsets.shape[0] - 1) // n_robots
    n = fruitless = 0
    while n < n_evaluations and fruitless < MAX_FRUITLESS:
        if not fits(graph, store, max(n_added, n_robots)) or front.n.spare < n_added:
            break
        if n < n_given:
            insert_given(graph, store, front, work, given, n)
            n += 1
            continue
        if work.memory.n_waiting == REFILLED_AT_ONCE:
            break
        at, place = _draw_parent(front, work, rule)
        if _lets_wait(front, work, rule, at, place):
            continue
        _take_parent(graph, store, front, work, at, place)
        n_more = _raise_children(graph, routes, store, front, work, rule, n_evaluations - n)
        clear_others(graph, work)
        let_go(store, work)
        n += n_more
        fruitless = 0 if n_more > 0 else fruitless + 1
    return n


@helper
def _lets_wait(front: OrderedFront, work: Workspace, rule: SearchRule, at: int, place: int) -> bool:
    """Count a plan's turn as a parent, and return whether it waits to be refilled instead."""
    memory, found = work.memory, front.places[front.directory[at], place]
    front.tried[found.slot] += 1
    p_refill = rule.p_refill
    if p_refill > 0.0:  # few plans offer few pieces to each other: refill more of them
        n_tried = front.tried[found.slot]
        p_refill = max(p_refill, 0.5 / front.n.plans, 1.0 / (n_tried * n_tried))
    if uniform(work.states, 0) >= p_refill:
        return False
    work.waiting[memory.n_waiting] = found.survivors
    memory.n_waiting += 1
    return True


@helper
def _take_parent(
    graph: Graph, store: TrailStore, front: OrderedFront, work: Workspace, at: int, place: int
) -> None:
    """Hold a parent, and set aside the robots that are not to be changed.

    A robot that stays at base is drawn again once: the others have more to change.
    """
    draft, parent, states = work.draft, work.parent, work.states
    hold(store, front, work, at, place)
    if store.trails[parent[draft.robot]].n_arcs == 0:
        draft.robot = below(states, parent.shape[0])
    if work.memory.idle > PATIENCE and uniform(states, 0) < P_OTHER:
        _change_another(store, front, work)
    set_aside(graph, store, work)


@helper
def _change_another(store: TrailStore, front: OrderedFront, work: Workspace) -> None:
    """Let another robot than that at hand, if there is one, take a trail of another plan."""
    n_robots = work.parent.shape[0]
    if n_robots == 1:
        return
    other = (work.draft.robot + 1 + below(work.states, n_robots - 1)) % n_robots
    trail = draw_trail(front, work)
    store.trails[trail].n_users += 1
    release(store, work.parent[other])
    work.parent[other] = trail


@helper
def _draw_parent(front: OrderedFront, work: Workspace, rule: SearchRule) -> tuple[int, int]:
    """Draw a plan of the front: the newest, that of most reward, or one with much room beside it.

    That room is the area that its neighbours leave it, less with every time it was a parent.
    """
    memory, states, n_robots = work.memory, work.states, work.parent.shape[0]
    newest = take_newest(work)
    if newest >= 0.0:
        return find_plan(front, newest)
    survivors = front.places[front.directory[0], 0].survivors
    if uniform(states, 0) < max(P_END, _P_SAFE_END * survivors / n_robots):
        return 0, 0
    n_drawn = rule.n_drawn
    if n_drawn > 1 and memory.idle <= BUSY:
        n_drawn *= 4
    best, best_place, most = 0, 0, -1.0
    for _ in range(n_drawn):
        at, place = draw_place(front, states)
        tried = front.tried[front.places[front.directory[at], place].slot]
        promise = contribution(front, at, place) / (1.0 + tried)
        if promise > most:
            best, best_place, most = at, place, promise
    return best, best_place


@helper
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
    front: OrderedFront,
    work: Workspace,
    rule: SearchRule,
    n_most: int,
) -> int:
    """Make children of the parent in which the robot at hand goes another way; return how many."""
    draft, memory, parent = work.draft, work.memory, work.parent
    changed = parent[draft.robot]
    lay_out(graph, store, work, changed)
    n_children = rule.n_children
    if memory.idle <= BUSY:
        n_children = (n_children + 2) // 3
    n = 0
    for _ in range(n_children):
        if n == n_most:
            break
        kind, trail = _draw_kind(work), NOBODY
        if kind == ADOPT:
            trail = draw_trail(front, work)
            if trail == changed:
                continue
            gained = appraise_trail(store, front, work, trail)
        elif change(graph, routes, store, front, work, kind):
            gained = appraise(graph, front, work, rule)
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
        for k in range(parent.shape[0]):
            work.trails[k] = trail if k == draft.robot else parent[k]
        sort_trails(store, work.trails)
        reward, survivors = evaluate_trails(graph, store, work)
        if insert(store, front, work.trails, reward, survivors):
            memory.newest, memory.idle = survivors, 0
            work.tally[1, kind] += 1
        release(store, trail)
    clear_trail(graph, work)
    return n
