"""Plans that enter a front, leave it, and are read from it."""

from botohe_moo._base.types import FloatArray, IntArray, OffsetArray, SeedArray
from botohe_moo.kernels.compile import frugal, part, routine
from botohe_moo.kernels.local_search.front import (
    N_BLOCKS,
    N_PLANS,
    Front,
    add_place,
    best_reward,
    contribution,
    draw_place,
    find_place,
    remove_place,
)
from botohe_moo.kernels.local_search.parent import MARK, Ground, Workspace
from botohe_moo.kernels.local_search.rule import IDLE, NEWEST, TOLERANCE, SearchRule
from botohe_moo.kernels.local_search.trail_store import (
    TrailStore,
    add_trail,
    evaluate_trails,
    precedes,
    release,
)
from botohe_moo.kernels.plans.evaluate import find_arc

# Plans among which one has to go where the front is full.
_N_THINNED = 16


@routine
def enter(
    store: TrailStore, front: Front, trails: IntArray, reward: float, survivors: float
) -> bool:
    """Put a plan into the front, unless that has one as good; those that it dominates leave.

    Parameters
    ----------
    store, front
        Trails and front.
    trails
        The plan's, in lexicographic order.
    reward, survivors
        Its E[R] and E[S].
    """
    if best_reward(front, survivors) >= reward:
        return False
    no_more = survivors * (1.0 + TOLERANCE)
    while True:
        # Those dominated, but for rounding, are the last that survive no more.
        at, place = find_place(front, no_more)
        if at == front.counts[N_BLOCKS] or front.survivors[front.directory[at], place] > no_more:
            place -= 1
            if place < 0:
                at -= 1
                if at < 0:
                    break
                place = front.size[front.directory[at]] - 1
        if front.reward[front.directory[at], place] > reward:
            break
        slot = remove_place(front, at, place)
        for k in range(trails.shape[0]):
            release(store, front.plan[slot, k])
    slot = add_place(front, reward, survivors)
    for k in range(trails.shape[0]):
        front.plan[slot, k] = trails[k]
        store.n_users[trails[k]] += 1
    return True


@frugal
def thin(store: TrailStore, front: Front, max_size: int, states: SeedArray) -> None:
    """Take out plans until there are no more than ``max_size``; the ends of the front stay.

    Each time the one goes that contributes least of some drawn.

    Parameters
    ----------
    store, front
        Trails and front.
    max_size
        At least 2, or 0 for no limit.
    states
        Random numbers, advanced.
    """
    while 0 < max_size < front.counts[N_PLANS]:
        least, worst, worst_place = 0.0, -1, -1
        for _ in range(_N_THINNED):
            at, place = draw_place(front, states)
            last = front.counts[N_BLOCKS] - 1
            if (at == 0 and place == 0) or (
                at == last and place == front.size[front.directory[last]] - 1
            ):
                continue
            area = contribution(front, at, place)
            if worst < 0 or area < least:
                least, worst, worst_place = area, at, place
        if worst >= 0:
            slot = remove_place(front, worst, worst_place)
            for k in range(front.plan.shape[1]):
                release(store, front.plan[slot, k])


@routine
def empty(store: TrailStore, front: Front) -> None:
    """Take out all plans."""
    while front.counts[N_BLOCKS] > 0:
        last = front.counts[N_BLOCKS] - 1
        slot = remove_place(front, last, front.size[front.directory[last]] - 1)
        for k in range(front.plan.shape[1]):
            release(store, front.plan[slot, k])


@routine
def put_in_order(store: TrailStore, work: Workspace, robot: int, trail: int) -> None:
    """Write the parent's trails with another one for a robot, in lexicographic order."""
    n = 0
    placed = False
    for k in range(work.held.shape[0]):
        if k == robot:
            continue
        if not placed and precedes(store, trail, work.held[k]):
            work.trails[n] = trail
            placed = True
            n += 1
        work.trails[n] = work.held[k]
        n += 1
    if not placed:
        work.trails[n] = trail


@part
def _evaluated(ground: Ground, store: TrailStore, work: Workspace) -> tuple[float, float]:
    """Give E[R] and E[S] of the plan in ``work.trails``."""
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
    return reward, survivors


@frugal
def admit(
    ground: Ground,
    store: TrailStore,
    front: Front,
    work: Workspace,
    nodes: IntArray,
    offsets: OffsetArray,
) -> bool:
    """Put a given plan into the front, unless that has one as good.

    Parameters
    ----------
    ground, store, front, work
        The mission; trails and front, which must have room; scratch.
    nodes, offsets
        A valid plan, ragged.
    """
    n_robots = work.trails.shape[0]
    for k in range(n_robots):
        start, length = offsets[k], offsets[k + 1] - offsets[k] - 1
        for i in range(length):
            work.child[i] = find_arc(
                ground.first, ground.head, nodes[start + i], nodes[start + i + 1]
            )
        trail = add_trail(
            ground.head, ground.survival, ground.reward, ground.base, store, work.child, length
        )
        store.n_users[trail] = 1
        place = k
        while place > 0 and precedes(store, trail, work.trails[place - 1]):
            work.trails[place] = work.trails[place - 1]
            place -= 1
        work.trails[place] = trail
    reward, survivors = _evaluated(ground, store, work)
    entered = enter(store, front, work.trails, reward, survivors)
    for k in range(n_robots):
        release(store, work.trails[k])
    return bool(entered)


@frugal
def write_plans(
    ground: Ground,
    store: TrailStore,
    front: Front,
    slots: IntArray,
    nodes: IntArray,
    offsets: OffsetArray,
) -> None:
    """Write the trails of some plans of the front.

    Parameters
    ----------
    ground, store, front
        The mission, trails and front.
    slots
        Which plans.
    nodes, offsets
        Output, ragged: node indices, and where each trail begins.
    """
    n_robots = front.plan.shape[1]
    size = 0
    for i in range(slots.shape[0]):
        for k in range(n_robots):
            trail = front.plan[slots[i], k]
            start = store.arcs_from[trail]
            nodes[size] = ground.base
            size += 1
            for j in range(start, start + store.n_arcs[trail]):
                nodes[size] = ground.head[store.arc[j]]
                size += 1
            offsets[i * n_robots + k + 1] = size


@routine
def bring_in(
    ground: Ground,
    store: TrailStore,
    front: Front,
    work: Workspace,
    rule: SearchRule,
    remembered: FloatArray,
    states: SeedArray,
) -> int:
    """Put the plan in ``work.trails`` into the front; 1 if it has entered, 0 if not."""
    reward, survivors = _evaluated(ground, store, work)
    if not enter(store, front, work.trails, reward, survivors):
        return 0
    remembered[NEWEST], remembered[IDLE] = survivors, 0.0
    thin(store, front, rule.max_size, states)
    return 1
