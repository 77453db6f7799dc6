"""A front of plans in order of their objectives, for a search that changes it all the time.

Plans are kept by descending E[R], hence by ascending E[S], one for each pair of objectives. Finding
a place takes the logarithm of the front's size. Changing it moves the numbers of all plans behind:
fronts have hundreds or thousands of plans, and of all plans evaluated few enter.
"""

from typing import NamedTuple

import numpy as np

from botohe_moo.base.types import FloatArray, IntArray, OffsetArray, Record, RecordArray, SeedArray
from botohe_moo.core.compile import helper, inlined
from botohe_moo.core.rng import below
from botohe_moo.core.threads import apart

_NEAR = 48  # plans on either side that ``draw_near`` draws from

_COUNTS = np.dtype([(name, np.int64) for name in ("plans", "entered", "spare")])
_SLOT = np.dtype(
    [(name, np.float64) for name in ("reward", "survivors")]
    + [(name, np.int64) for name in ("member", "serial", "tried")]
)


class OrderedFront(NamedTuple):
    """Slots for plans, and the slots of plans by place: in order of their objectives."""

    n: Record  # how many ``plans`` there are, how many ever ``entered``, and ``spare`` slots
    order: OffsetArray  # which slot holds the plan at each place (n_slots)
    # The plan in each slot: numbers of its trails, in lexicographic order (n_slots, n_robots).
    plan: IntArray
    # Of the plan in each slot: E[R] and E[S] (``reward`` and ``survivors``); where it is in
    # ``members`` (``member``); how many plans had entered before it (``serial``); and how often it
    # has been a parent (``tried``; n_slots).
    slots: RecordArray
    # Slots in use, in an order that follows from what entered and left, and behind them the spare
    # ones, the next to be used first (n_slots).
    members: OffsetArray


def new_front(n_slots: int, n_robots: int) -> OrderedFront:
    """Return room for ``n_slots`` plans of ``n_robots`` trails."""
    n = np.array([(0, 0, n_slots)], _COUNTS).view(np.recarray)[0]
    order, plan = np.zeros(n_slots, np.int64), np.zeros((n_slots, n_robots), np.int32)
    slots = np.zeros(n_slots, _SLOT).view(np.recarray)
    return OrderedFront(*apart((n, order, plan, slots, np.arange(n_slots))))


def read_front(front: OrderedFront) -> tuple[OffsetArray, FloatArray]:
    """Return the slots of all plans in order, and their E[R] and E[S] (n_plans, 2)."""
    slots = front.order[: front.n.plans].copy()
    plans = front.slots[slots]
    return slots, np.column_stack([plans["reward"], plans["survivors"]])


def grow_front(front: OrderedFront, n_slots: int) -> OrderedFront:
    """Return the same front with room for ``n_slots`` plans, at least as many as now."""
    grown, n_old = new_front(n_slots, front.plan.shape[1]), len(front.slots)
    for new, old in zip(grown[1:], front[1:], strict=True):
        new[:n_old] = old
    grown.n.plans, grown.n.entered = front.n.plans, front.n.entered
    grown.n.spare = front.n.spare + n_slots - n_old
    return grown


@inlined
def find_place(front: OrderedFront, survivors: float) -> int:
    """Return the place of the plan of largest E[R] among those with at least this E[S].

    Where there is none, this is the number of plans.
    """
    low, high = 0, front.n.plans
    while low < high:
        middle = (low + high) // 2
        if front.slots[front.order[middle]].survivors >= survivors:
            high = middle
        else:
            low = middle + 1
    return int(low)


@inlined
def best_reward(front: OrderedFront, survivors: float) -> float:
    """Return the largest E[R] of the plans with at least this E[S]; −1 without any."""
    place = find_place(front, survivors)
    if place == front.n.plans:
        return -1.0
    return float(front.slots[front.order[place]].reward)


@inlined
def nearest_place(front: OrderedFront, survivors: float) -> int:
    """Find the plan with an E[S]; where it has left, the next safer one, or else the safest."""
    return int(min(find_place(front, survivors), front.n.plans - 1))


@inlined
def find_dominated(front: OrderedFront, reward: float, survivors: float) -> int:
    """Return the place of the plan of most E[S] with at most this E[R] and this E[S]; −1 if none.

    No plan of at most this E[S] has less E[R] than the last of them.
    """
    order, slots, place = front.order, front.slots, find_place(front, survivors)
    if place == front.n.plans or slots[order[place]].survivors > survivors:
        place -= 1
    return place if place >= 0 and slots[order[place]].reward <= reward else -1


@helper
def insert(front: OrderedFront, reward: float, survivors: float) -> int:
    """Insert a plan, and remove those that it dominates or equals; return its slot.

    No plan of the front may dominate it.
    """
    place = find_dominated(front, reward, survivors)
    while place >= 0:
        remove_place(front, place)
        place = find_dominated(front, reward, survivors)
    return add_place(front, reward, survivors)


@inlined
def draw_slot(front: OrderedFront, states: SeedArray) -> int:
    """Draw a plan uniformly; return its slot."""
    return int(front.members[below(states, front.n.plans)])


@helper
def draw_near(front: OrderedFront, states: SeedArray, place: int) -> int:
    """Draw a plan among the ``_NEAR`` on either side of a place, and there; return its slot.

    Near an end of the front, those beyond it are replaced by those on the other side.
    """
    if front.n.plans <= 2 * _NEAR:
        return draw_slot(front, states)
    offset = below(states, 2 * _NEAR + 1) - _NEAR
    is_beyond = place + offset < 0 or place + offset >= front.n.plans
    return int(front.order[place - offset if is_beyond else place + offset])


@helper
def contribution(front: OrderedFront, place: int) -> float:
    """Return the area of the rectangle between the two neighbours of a plan.

    Plans at the ends get the area that each would have if the plans were evenly spaced.
    """
    last = front.n.plans - 1
    is_end = place == 0 or place == last
    left = front.slots[front.order[0 if is_end else place - 1]]
    right = front.slots[front.order[last if is_end else place + 1]]
    width, height = left.reward - right.reward, right.survivors - left.survivors
    gap = 2.0 / front.n.plans if is_end else 1.0
    return float(gap * width * gap * height)


@helper
def slope_at(front: OrderedFront, place: int) -> float:
    """Return how much E[R] the front loses for each survivor more, between a plan's neighbours.

    At an end of the front the plan is a neighbour of itself.
    """
    left = front.slots[front.order[max(0, place - 1)]]
    right = front.slots[front.order[min(front.n.plans - 1, place + 1)]]
    more = right.survivors - left.survivors
    return float((left.reward - right.reward) / more) if more > 0.0 else 0.0


@helper
def remove_place(front: OrderedFront, place: int) -> int:
    """Remove a plan; return its slot, which is the next to be used."""
    n, slot = front.n, front.order[place]
    n.plans -= 1
    n.spare += 1
    for i in range(place, n.plans):
        front.order[i] = front.order[i + 1]
    member, last = front.slots[slot].member, front.members[n.plans]
    front.members[member], front.slots[last].member = last, member
    front.members[n.plans] = slot
    return int(slot)


@helper
def add_place(front: OrderedFront, reward: float, survivors: float) -> int:
    """Add a plan that no plan of the front dominates or equals; return the slot for its trails.

    The plans that it dominates must have been removed.
    """
    n, place, slot = front.n, find_place(front, survivors), front.members[front.n.plans]
    for i in range(n.plans, place, -1):
        front.order[i] = front.order[i - 1]
    front.order[place] = slot
    new = front.slots[slot]
    new.reward, new.survivors = reward, survivors
    new.member, new.serial, new.tried = n.plans, n.entered, 0
    n.plans += 1
    n.entered += 1
    n.spare -= 1
    return int(slot)
