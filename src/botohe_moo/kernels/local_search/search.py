"""Pareto local search: parents from a front, children of one changed trail, back into it."""

from botohe_moo.kernels.compile import helper, inlined, kernel
from botohe_moo.kernels.fronts.ordered import (
    OrderedFront,
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
    put_in_order,
    take_in,
)
from botohe_moo.kernels.local_search.children import adopt, appraise, write_child
from botohe_moo.kernels.local_search.layout import clear_others, clear_trail, lay_out, set_aside
from botohe_moo.kernels.local_search.moves import ADOPT, N_KINDS, change, draw_trail
from botohe_moo.kernels.local_search.refill import choose_robots, refill
from botohe_moo.kernels.local_search.routes import Routes
from botohe_moo.kernels.local_search.trail_store import TrailStore, fits, release
from botohe_moo.kernels.local_search.workspace import SearchRule, Workspace
from botohe_moo.kernels.rng import below, uniform

# Parents in a row without any child, after which there is nothing left to try.
MAX_FRUITLESS = 10_000

# Instead of a trail: the child's is not stored.
NOBODY = -1


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
    """Take the given plans into the front, then search from there.

    Gives how many plans have been evaluated, the given ones among them: where these are fewer than
    ``n_evaluations`` there is no room for more, or no move makes another plan.
    """
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
        _take_parent(graph, store, front, work, rule)
        if work.now.chosen > 0:
            n_more = refill(graph, routes, store, front, work, rule, n_evaluations - n)
        else:
            n_more = _raise_children(graph, routes, store, front, work, rule, n_evaluations - n)
        _let_go(graph, store, work)
        n += n_more
        fruitless = 0 if n_more > 0 else fruitless + 1
    return n


@helper
def _take_parent(
    graph: Graph, store: TrailStore, front: OrderedFront, work: Workspace, rule: SearchRule
) -> None:
    """Hold a parent, and set aside the robots that are not to be changed.

    A robot that stays at base is drawn again once: the others have more to change.
    """
    now, held, states = work.now, work.held, work.states
    now.at, place = _draw_parent(front, work, rule)
    slot = front.places[front.directory[now.at], place].slot
    front.tried[slot] += 1
    for k in range(held.shape[0]):
        held[k] = front.plan[slot, k]
        store.trails[held[k]].n_users += 1
    now.robot = below(states, held.shape[0])
    if store.trails[held[now.robot]].n_arcs == 0:
        now.robot = below(states, held.shape[0])
    now.chosen = 0
    p_refill = rule.p_refill
    if p_refill > 0.0:  # few plans offer few pieces to each other: refill more of them
        n_tried = front.tried[slot]
        p_refill = max(p_refill, 0.5 / front.n.plans, 1.0 / (n_tried * n_tried))
    if uniform(states, 0) < p_refill:
        choose_robots(work, rule)
        is_end = now.at == 0 and place == 0
        now.slope = 0.0 if is_end else slope_at(front, now.at, place)
    elif work.memory.idle > rule.patience and uniform(states, 0) < rule.p_other:
        _change_another(store, front, work, rule)
    set_aside(graph, store, work)


@inlined
def _change_another(
    store: TrailStore, front: OrderedFront, work: Workspace, rule: SearchRule
) -> None:
    """Let another robot than that at hand, if there is one, take a trail of another plan."""
    n_robots = work.held.shape[0]
    if n_robots == 1:
        return
    other = (work.now.robot + 1 + below(work.states, n_robots - 1)) % n_robots
    trail = draw_trail(front, work, rule)
    store.trails[trail].n_users += 1
    release(store, work.held[other])
    work.held[other] = trail


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
    front: OrderedFront,
    work: Workspace,
    rule: SearchRule,
    n_most: int,
) -> int:
    """Make children of the parent in which the robot at hand goes another way; give how many."""
    now, memory = work.now, work.memory
    parent = work.held[now.robot]
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
            gained, _ = adopt(store, front, work, trail, now.others, now.survivors)
        elif change(graph, routes, store, front, work, rule, kind):
            gained, _ = appraise(graph, front, work, rule, now.others, now.survivors)
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
        put_in_order(store, work, trail)
        work.tally[1, kind] += bring_in(graph, store, front, work)
        release(store, trail)
    clear_trail(graph, work)
    return n


@helper
def _let_go(graph: Graph, store: TrailStore, work: Workspace) -> None:
    """Release the parent."""
    clear_others(graph, work)
    for k in range(work.held.shape[0]):
        release(store, work.held[k])
