"""Pareto local search: plans of a front are parents, whose children may enter it.

A child differs from its parent in the trail of one robot.
"""

from botohe_moo.algorithms.local_search.kernels.children import (
    evaluate_child,
    evaluate_trail,
    write_child,
)
from botohe_moo.algorithms.local_search.kernels.moves import ADOPT, N_KINDS, draw_trail, make_child
from botohe_moo.algorithms.local_search.kernels.plans import (
    NOT_STORED,
    acquire_parent,
    add_trail,
    add_within_limits,
    clear_others,
    clear_trail,
    evaluate_others,
    find_plan,
    insert_trails,
    is_stuck,
    lay_out,
    pop_newest,
    release_parent,
)
from botohe_moo.algorithms.local_search.kernels.trail_store import fits, release
from botohe_moo.algorithms.local_search.kernels.workspace import (
    BUSY,
    N_CHILDREN,
    N_CHILDREN_BUSY,
    N_DRAWN,
    N_DRAWN_BUSY,
    Search,
    Workspace,
)
from botohe_moo.core.compile import helper, kernel
from botohe_moo.core.graph import find_arc
from botohe_moo.core.kinds import Kinds, has_kinds
from botohe_moo.core.ordered import contribution, count_turn, draw_place
from botohe_moo.core.rng import below, uniform
from botohe_moo.core.sharing import shared
from botohe_moo.core.trails import Trails

# After this many parents in a row without any child there is nothing left to try.
MAX_FRUITLESS = 10_000

# The probability that the parent is the plan of most reward: ``P_END``, and more where its robots
# are safe, up to ``_P_SAFE_END`` where all survive for sure.
P_END, _P_SAFE_END = 0.1, 0.4
# Once the search is stuck, the probability that another robot of a parent takes a trail of another
# plan, so that two trails change. Without this, a mission of six nodes was not solved.
P_OTHER = 0.5
# With kinds, the probability that it takes a child of its own trail instead, and that a robot
# adopts the trail of another robot of its plan. Without these, where rewards are paid on return,
# one of fifty missions of five nodes was not solved.
P_SHAKE, MOST_SHAKEN, P_FOLLOW = 0.7, 3, 0.5


@helper
def has_room(search: Search) -> bool:
    """Return whether there is room for the children of a parent, or for a plan of new trails."""
    n_robots, n_children = search.work.parent.shape[0], N_CHILDREN + 1
    n_trails = n_children + MOST_SHAKEN if has_kinds(search.graph.kinds) else n_children
    stored = fits(search.graph, search.store, max(n_trails, n_robots))
    return bool(stored and search.front.n.spare >= n_children)


@kernel
def improve(search: Search, given: Trails, n_evaluations: int) -> int:
    """Evaluate the given plans, which are valid, insert them into the front, and search from there.

    Returns how many plans have been evaluated, the given ones among them. These are fewer than
    ``n_evaluations`` where there is no room for more, where plans wait to be refilled, or where no
    move makes another plan.
    """
    search, given = shared(search), shared(given)
    memory = search.work.memory
    n_given = (given.offsets.shape[0] - 1) // search.work.parent.shape[0]
    n = fruitless = 0
    while n < n_evaluations and fruitless < MAX_FRUITLESS and has_room(search):
        if n < n_given:
            _insert_given(search, given, n)
            n += 1
            continue
        if memory.n_waiting >= memory.most_waiting:
            break
        block, place = _draw_parent(search)
        if _waits_for_refill(search, block, place):
            continue
        _select_robot(search, block, place)
        n_children = _make_children(search, n_evaluations - n)
        release_parent(search)
        n += n_children
        fruitless = 0 if n_children > 0 else fruitless + 1
    return n


@helper
def _insert_given(search: Search, given: Trails, plan: int) -> None:
    """Insert a given plan into the front, unless that has one as good."""
    graph, store, work = search.graph, search.store, search.work
    n_robots = work.trails.shape[0]
    for k in range(n_robots):
        start = given.offsets[plan * n_robots + k]
        length = given.offsets[plan * n_robots + k + 1] - start - 1
        for i in range(start, start + length):
            work.child[i - start] = find_arc(graph, given.nodes[i], given.nodes[i + 1])
        work.trails[k] = add_trail(graph, store, work, k, length)
    insert_trails(search, 0.0)
    for k in range(n_robots):
        release(store, work.trails[k])


@helper
def _waits_for_refill(search: Search, block: int, place: int) -> bool:
    """Count a plan's turn as a parent, and draw whether it waits to be refilled instead.

    On its n-th turn this happens with probability 1 / n², but with ``p_refill`` or more, and with
    1 / 2 or more divided by the number of plans in the front.
    """
    front, memory, p_refill = search.front, search.work.memory, search.p_refill
    parent = front.places[front.directory[block], place]
    count_turn(front, parent.slot)
    if p_refill > 0.0:  # plans of a small front, which has few trails to combine, more often
        n_tried = front.tried[parent.slot]
        p_refill = max(p_refill, 0.5 / front.n.plans, 1.0 / (n_tried * n_tried))
    if uniform(search.work.states, 0) >= p_refill:
        return False
    search.work.waiting[memory.n_waiting] = parent.survivors
    memory.n_waiting += 1
    return True


@helper
def _select_robot(search: Search, block: int, place: int) -> None:
    """Make a plan the parent, draw the robot that changes, and evaluate the others.

    Where that robot stays at base, another one is drawn, once: it may have more to change.
    """
    store, work = search.store, search.work
    draft, parent = work.draft, work.parent
    acquire_parent(search, block, place)
    if store.trails[parent[draft.robot]].n_arcs == 0:
        draft.robot = below(work.states, parent.shape[0])
    if is_stuck(search) and uniform(work.states, 0) < P_OTHER:
        _change_another(search)
    evaluate_others(search.graph, store, work)


@helper
def _change_another(search: Search) -> None:
    """Replace the trail of another robot, if there is one, by a trail of another plan.

    With kinds, trails of a few robots are mostly replaced by children of them, instead.
    """
    store, work = search.store, search.work
    n_robots = work.parent.shape[0]
    if _change_some(search, search.graph.kinds) or n_robots == 1:
        return
    other = (work.draft.robot + 1 + below(work.states, n_robots - 1)) % n_robots
    trail = draw_trail(search, other)
    store.trails[trail].n_users += 1
    release(store, work.parent[other])
    work.parent[other] = trail


@helper
def _change_some(search: Search, kinds: Kinds | None) -> bool:
    """Replace trails of a few robots by children of them; return whether this was drawn."""
    if kinds is None:  # of an argument: then numba compiles nothing of what follows
        return False
    work = search.work
    if uniform(work.states, 0) >= P_SHAKE:
        return False
    for _ in range(1 + below(work.states, MOST_SHAKEN)):
        robot = below(work.states, work.parent.shape[0])
        trail = _shake(search, robot)
        if trail != NOT_STORED:
            release(search.store, work.parent[robot])
            work.parent[robot] = trail
    return True


@helper
def _shake(search: Search, robot: int) -> int:
    """Store a child of a robot's trail, whatever it is worth; ``NOT_STORED`` if none is made."""
    graph, store, work, draft = search.graph, search.store, search.work, search.work.draft
    changed, draft.robot = draft.robot, robot
    evaluate_others(graph, store, work)
    lay_out(graph, store, work, work.parent[robot])
    trail, kind = NOT_STORED, _draw_kind(work)
    if kind != ADOPT and make_child(search, kind):
        trail = add_within_limits(search, robot, write_child(work))
    clear_trail(graph, work)
    clear_others(graph, work)
    draft.robot = changed
    return trail


@helper
def _draw_adopted(search: Search, kinds: Kinds | None) -> int:
    """Draw a trail that the robot may adopt: of another plan, or with kinds of its own plan."""
    if kinds is not None:
        work, robot = search.work, search.work.draft.robot
        if is_stuck(search) and uniform(work.states, 0) < P_FOLLOW:
            first, stop = kinds.first[robot], kinds.stop[robot]
            return int(work.parent[first + below(work.states, stop - first)])
    return draw_trail(search, search.work.draft.robot)


@helper
def _draw_parent(search: Search) -> tuple[int, int]:
    """Draw a plan of the front: the newest, that of most reward, or one of much area.

    For the last, some plans are drawn. Each scores the area that only it dominates, divided by how
    often it has been a parent; the highest score wins.
    """
    front, work = search.front, search.work
    newest = pop_newest(work)
    if newest >= 0.0:
        return find_plan(front, newest)
    survivors, n_robots = front.places[front.directory[0], 0].survivors, work.parent.shape[0]
    if uniform(work.states, 0) < max(P_END, _P_SAFE_END * survivors / n_robots):
        return 0, 0
    best, best_place, highest = 0, 0, -1.0
    for _ in range(N_DRAWN_BUSY if work.memory.idle <= BUSY else N_DRAWN):
        block, place = draw_place(front, work.states)
        n_tried = front.tried[front.places[front.directory[block], place].slot]
        score = contribution(front, block, place) / (1.0 + n_tried)
        if score > highest:
            best, best_place, highest = block, place, score
    return best, best_place


@helper
def _draw_kind(work: Workspace) -> int:
    """Draw a kind of move by its cumulated weight."""
    weights = work.weights
    drawn = uniform(work.states, 0) * weights[N_KINDS - 1]
    kind = 0
    while weights[kind] <= drawn and kind < N_KINDS - 1:
        kind += 1
    return kind


@helper
def _make_children(search: Search, n_most: int) -> int:
    """Make children of the parent, at most ``n_most``, insert them, and return how many."""
    graph, store, work = search.graph, search.store, search.work
    draft, memory, parent = work.draft, work.memory, work.parent
    changed = parent[draft.robot]
    lay_out(graph, store, work, changed)
    n = 0
    for _ in range(N_CHILDREN_BUSY if memory.idle <= BUSY else N_CHILDREN):
        if n == n_most:
            break
        kind, trail = _draw_kind(work), NOT_STORED
        if kind == ADOPT:
            trail = _draw_adopted(search, graph.kinds)
            if trail == changed:
                continue
            gained = evaluate_trail(search, trail)
        elif make_child(search, kind):
            gained = evaluate_child(search)
        else:
            continue
        n += 1
        memory.idle += 1
        if gained < 0.0:
            continue
        if trail == NOT_STORED:
            trail = add_trail(graph, store, work, draft.robot, write_child(work))
        else:
            store.trails[trail].n_users += 1
        for k in range(parent.shape[0]):
            work.trails[k] = trail if k == draft.robot else parent[k]
        insert_trails(search, 0.0)
        release(store, trail)
    clear_trail(graph, work)
    return n
