"""Which plan is the next parent: the newest, one of the front, or one of the reserve."""

from botohe_moo._base.types import FloatArray, IntArray, SeedArray
from botohe_moo.kernels.compile import part, routine
from botohe_moo.kernels.local_search.front import (
    N_BLOCKS,
    Front,
    contribution,
    draw_place,
    find_place,
)
from botohe_moo.kernels.local_search.rule import IDLE, NEWEST, NOBODY, Reserve, SearchRule
from botohe_moo.kernels.local_search.trail_store import TrailStore, release
from botohe_moo.kernels.rng import uniform

# How much rather parents come from the reserve, and how much faster hops for best responses are
# earned, when nothing has entered the front for long.
WHEN_IDLE = 3.0


@part
def _promise(front: Front, at: int, place: int) -> float:
    """Give the area that a plan's neighbours leave it, less with every time it was a parent."""
    tried = front.tried[front.slot[front.directory[at], place]]
    return float(contribution(front, at, place) / (1.0 + tried))


@part
def draw_parent(
    front: Front,
    reserve: Reserve,
    rule: SearchRule,
    remembered: FloatArray,
    held: IntArray,
    states: SeedArray,
) -> int:
    """Write the trails of a parent into ``held``; give its block's number in the directory.

    Parameters
    ----------
    front, reserve, rule, remembered, states
        As for ``search``.
    held
        Output (n_robots).
    """
    if remembered[NEWEST] >= 0.0 and uniform(states, 0) < rule.p_newest:
        at, place = find_place(front, remembered[NEWEST])
        if at == front.counts[N_BLOCKS]:
            at -= 1
            place = front.size[front.directory[at]] - 1
    else:
        p_reserve = rule.p_reserve * (WHEN_IDLE if remembered[IDLE] > rule.patience else 1.0)
        if p_reserve > 0.0 and uniform(states, 0) < p_reserve:
            drawn = int(uniform(states, 0) * reserve.survivors.shape[0])
            if reserve.plan[drawn, 0] != NOBODY:
                for k in range(held.shape[0]):
                    held[k] = reserve.plan[drawn, k]
                at, place = find_place(front, reserve.survivors[drawn])
                return int(min(at, front.counts[N_BLOCKS] - 1))
        at, place = draw_place(front, states)
        n_drawn = rule.n_drawn_busy if remembered[IDLE] <= rule.busy else rule.n_drawn
        if uniform(states, 0) < rule.p_end:
            at, place = 0, 0
        elif n_drawn > 1:
            most = _promise(front, at, place)
            for _ in range(n_drawn - 1):
                other, other_place = draw_place(front, states)
                promise = _promise(front, other, other_place)
                if promise > most:
                    most, at, place = promise, other, other_place
    slot = front.slot[front.directory[at], place]
    front.tried[slot] += 1
    for k in range(held.shape[0]):
        held[k] = front.plan[slot, k]
    return at


@part
def take_safest(front: Front, held: IntArray) -> int:
    """Write the trails of the plan of most survivors into ``held``, as ``draw_parent`` does.

    Parameters
    ----------
    front, held
        As there.
    """
    at = front.counts[N_BLOCKS] - 1
    block = front.directory[at]
    slot = front.slot[block, front.size[block] - 1]
    for k in range(held.shape[0]):
        held[k] = front.plan[slot, k]
    return int(at)


@routine
def keep_in_reserve(
    store: TrailStore, reserve: Reserve, trails: IntArray, survivors: float, states: SeedArray
) -> None:
    """Put a plan in the place of another, drawn.

    Parameters
    ----------
    store, reserve, states
        As for ``search``.
    trails, survivors
        The plan, and its E[S].
    """
    drawn = int(uniform(states, 0) * reserve.survivors.shape[0])
    for k in range(trails.shape[0]):
        store.n_users[trails[k]] += 1
        if reserve.plan[drawn, k] != NOBODY:
            release(store, reserve.plan[drawn, k])
        reserve.plan[drawn, k] = trails[k]
    reserve.survivors[drawn] = survivors
