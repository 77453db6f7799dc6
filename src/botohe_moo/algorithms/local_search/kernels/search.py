"""Pareto local search: plans of a front are parents, whose children may enter it.

A child differs from its parent in the trail of one robot.
"""

import numpy as np

from botohe_moo.algorithms.local_search.kernels import moves, plans, state
from botohe_moo.algorithms.local_search.kernels.state import Given, Search
from botohe_moo.core import ordered
from botohe_moo.core.compile import at_once, helper, shared, ticks
from botohe_moo.core.rng import below, draw_weighted, uniform
from botohe_moo.core.world import find_arc

# After this many parents in a row without any child there is nothing left to try.
MAX_FRUITLESS = 10_000

# The probability that the parent is the plan of most reward: ``P_END``, and more where its robots
# are safe, up to ``_P_SAFE_END`` where all survive for sure.
P_END, _P_SAFE_END = 0.1, 0.4
# Once the search is stuck, the probability that another robot of a parent takes a trail of another
# plan, so that two trails change. Without this, a mission of six nodes was not solved.
P_OTHER = 0.5


@at_once(lambda search, given, _, n: 2e-5 * (n * (150 + search.world.n_robots) + len(given.nodes)))
def improve(search: Search, given: Given, begin: int, n_evaluations: int) -> int:
    """Insert the given plans, which are valid, from one on into the front, and search from there.

    Returns how many plans have been evaluated, the given ones among them. These are fewer than
    ``n_evaluations`` where there is no room for more, where plans wait for ruin and recreate, or
    where no move makes another plan.
    """
    search, given = shared(search), shared(given)
    memory = search.work.memory
    n_given = given.plan.shape[0] - begin
    n = fruitless = 0
    while n < n_evaluations and fruitless < MAX_FRUITLESS and state.has_room(search):
        if n < n_given:
            _insert_given(search, given, begin + n)
            n += 1
            continue
        if memory.n_waiting >= memory.most_waiting:
            break
        place = _draw_parent(search)
        if _waits(search, place):
            continue
        _select_robot(search, place)
        n_children = _make_children(search, n_evaluations - n)
        plans.release_parent(search)
        n += n_children
        fruitless = 0 if n_children > 0 else fruitless + 1
    for trail in range(given.stored.shape[0]):
        if given.stored[trail] != state.NOT_STORED:
            state.release(search.store, given.stored[trail])
            given.stored[trail] = state.NOT_STORED
    return n


@at_once(lambda search, n: 2e-6 * search.front.n.plans * (search.front.n.plans - n))
def trim(search: Search, n_most: int) -> None:
    """Remove the plan of the front that contributes the least area until ``n_most`` are left.

    Both ends of the front stay.
    """
    search = shared(search)
    front = search.front
    while front.n.plans > n_most:
        least, removed = np.inf, -1
        for place in range(1, front.n.plans - 1):
            area = ordered.contribution(front, place)
            if area < least:
                least, removed = area, place
        plans.remove_plan(search.store, front, removed)


@helper
def _insert_given(search: Search, given: Given, plan: int) -> None:
    """Insert a given plan that keeps the limits into the front, unless that has one as good."""
    reward, survivors = given.objectives[plan, 0], given.objectives[plan, 1]
    least = reward * (1.0 - state.TOLERANCE)
    if ordered.best_reward(search.front, survivors * (1.0 - state.TOLERANCE)) >= least:
        return
    for k in range(search.work.trails.shape[0]):
        trail = np.int64(given.plan[plan, k])
        if given.stored[trail] == state.NOT_STORED:
            given.stored[trail] = _store_given(search, given, int(trail), k)
        if given.stored[trail] == state.NOT_STORED:
            return
        search.work.trails[k] = given.stored[trail]
    if plans.insert_trails(search, state.TOLERANCE):
        slot = search.front.members[search.front.n.plans - 1]  # that of the last to enter
        search.front.slots[slot].tried = given.tried[plan]


@helper
def _store_given(search: Search, given: Given, trail: int, robot: int) -> int:
    """Store a given trail; return its number, ``NOT_STORED`` if it does not keep the limits."""
    start, stop = given.offsets[trail], given.offsets[trail + 1]
    for i in range(start, stop - 1):
        arc = find_arc(search.world.graph, given.nodes[i], given.nodes[i + 1])
        search.work.child[i - start] = arc
    return plans.add_trail(search, robot, stop - start - 1)


@helper
def _waits(search: Search, place: int) -> bool:
    """Count a plan's turn as a parent, and draw whether it waits for ruin and recreate instead.

    On its n-th turn this happens with probability 1 / n², but with ``p_recreate`` or more, and with
    1 / 2 or more divided by the number of plans in the front.
    """
    front, memory, p_recreate = search.front, search.work.memory, search.p_recreate
    parent = front.slots[front.order[place]]
    parent.tried += 1
    if p_recreate > 0.0:  # plans of a small front, which has few trails to combine, more often
        n_tried = parent.tried
        p_recreate = max(p_recreate, 0.5 / front.n.plans, 1.0 / (n_tried * n_tried))
    if uniform(search.work.states, 0) >= p_recreate:
        return False
    search.work.waiting[memory.n_waiting] = parent.survivors
    memory.n_waiting += 1
    return True


@helper
def _select_robot(search: Search, place: int) -> None:
    """Make a plan the parent, draw the robot that changes, and evaluate the others.

    Where that robot stays at base, another one is drawn, once: it may have more to change.
    """
    store, work = search.store, search.work
    draft, parent = work.draft, work.parent
    plans.acquire_parent(search, place)
    if store.trails[parent[draft.robot]].n_arcs == 0:
        draft.robot = below(work.states, parent.shape[0])
    if parent.shape[0] > 1 and plans.is_stuck(work) and uniform(work.states, 0) < P_OTHER:
        _change_another(search)
    plans.draw_table(search)
    plans.evaluate_others(search.world, store, work)


@helper
def _change_another(search: Search) -> None:
    """Replace the trail of another robot by a trail of another plan."""
    store, work = search.store, search.work
    n_robots = work.parent.shape[0]
    other = (work.draft.robot + 1 + below(work.states, n_robots - 1)) % n_robots
    trail = moves.draw_trail(search, other)
    store.trails[trail].n_users += 1
    state.release(store, work.parent[other])
    work.parent[other] = trail


@helper
def _draw_parent(search: Search) -> int:
    """Draw a plan of the front: the newest, that of most reward, or one of much area.

    For the last, some plans are drawn. Each scores the area that only it dominates, divided by how
    often it has been a parent; the highest score wins.
    """
    front, work = search.front, search.work
    newest = plans.pop_newest(work)
    if newest >= 0.0:
        return ordered.nearest_place(front, newest)
    survivors, n_robots = front.slots[front.order[0]].survivors, work.parent.shape[0]
    if uniform(work.states, 0) < max(P_END, _P_SAFE_END * survivors / n_robots):
        return 0
    best, highest = 0, -1.0
    for _ in range(state.N_DRAWN_BUSY if work.memory.idle <= state.BUSY else state.N_DRAWN):
        drawn = front.slots[ordered.draw_slot(front, work.states)]
        place = ordered.find_place(front, drawn.survivors)
        score = ordered.contribution(front, place) / (1.0 + drawn.tried)
        if score > highest:
            best, highest = place, score
    return best


@helper
def _make_children(search: Search, n_most: int) -> int:
    """Make children of the parent, at most ``n_most``, insert them, and return how many."""
    world, store, work = search.world, search.store, search.work
    changed, memory = work.parent[work.draft.robot], work.memory
    plans.lay_out(world, world.returns, store, work, changed)
    n = 0
    is_timed = memory.n_parents % state.TIMED_EVERY == 0
    memory.n_parents += 1
    before = ticks() if is_timed else 0
    for _ in range(state.N_CHILDREN_BUSY if memory.idle <= state.BUSY else state.N_CHILDREN):
        if n == n_most:
            break
        move = draw_weighted(work.weights, work.states)
        tally = work.tallies[move]
        if moves.make_child(search, move) and work.draft.adopted != changed:
            n += 1
            memory.idle += 1
            tally.tried += 1
            tally.entered += _insert_child(search)
        if is_timed:
            now = ticks()
            tally.ticks += state.TIMED_EVERY * (now - before)
            before = now
    plans.clear_trail(work, world.graph.reward.shape[0])
    return n


@helper
def _insert_child(search: Search) -> bool:
    """Insert the parent with the child into the front, if it may enter; return whether it has."""
    store, work = search.store, search.work
    draft, trail = work.draft, work.draft.adopted
    if trail != state.NOT_STORED:
        gained = moves.evaluate_trail(search, trail)
    else:
        gained = moves.evaluate_child(search, search.world.returns)
    if gained < 0.0:
        return False
    if trail != state.NOT_STORED:
        store.trails[trail].n_users += 1
    else:
        trail = plans.add_trail(search, draft.robot, moves.write_child(work))
        if trail == state.NOT_STORED:  # by rounding
            return False
    for k in range(work.parent.shape[0]):
        work.trails[k] = trail if k == draft.robot else work.parent[k]
    entered = plans.insert_trails(search, 0.0)
    state.release(store, trail)
    return entered
