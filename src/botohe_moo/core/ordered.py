"""A front of plans in order of their objectives, for a search that changes it all the time.

Places are kept by descending E[R], hence by ascending E[S], one plan for each pair of objectives.
They lie in blocks of at most ``BLOCK``, so that finding a place takes the logarithm of the front's
size, and changing it the length of a block: the two upper levels of a B+-tree (Bayer and McCreight,
"Organization and maintenance of large ordered indexes", Acta Informatica 1, 1972).
"""

from typing import NamedTuple

import numpy as np

from botohe_moo._base.types import FloatArray, IntArray, OffsetArray, Record, RecordArray, SeedArray
from botohe_moo.core.compile import helper, inlined
from botohe_moo.core.rng import below
from botohe_moo.core.threads import apart

BLOCK = 64
_NEAR = 48  # plans on either side that ``draw_near`` draws from

_COUNTS = np.dtype([(name, np.int64) for name in ("blocks", "plans", "entered", "free", "spare")])
_PLACE = np.dtype([("slot", np.int64), ("reward", np.float64), ("survivors", np.float64)])
_SLOT = np.dtype(
    [(name, np.float64) for name in ("reward", "survivors")]
    + [(name, np.int64) for name in ("before", "after", "member", "serial", "tried")]
)


class OrderedFront(NamedTuple):
    """Places for plans, in order of their objectives."""

    # How many ``blocks`` and ``plans`` there are, how many plans ever ``entered``, and how many
    # blocks (``free``) and slots (``spare``) are not in use.
    n: Record
    directory: OffsetArray  # the blocks in order
    size: OffsetArray  # plans in each block
    # Of each place of each block (n_blocks, BLOCK), which ``slot`` holds the plan, and its E[R] and
    # E[S] (``reward`` and ``survivors``).
    places: RecordArray
    # Blocks and slots that are not in use, as stacks.
    free_blocks: OffsetArray
    spare_slots: OffsetArray
    # The plan in each slot: numbers of its trails, in lexicographic order (n_slots, n_robots).
    plan: IntArray
    # Of the plan in each slot: E[R] and E[S] (``reward`` and ``survivors``); the slots of its
    # neighbours, −1 at an end of the front (``before`` and ``after``); where it is in ``members``
    # (``member``); how many plans had entered before it (``serial``); and how often it has been a
    # parent (``tried``; n_slots).
    slots: RecordArray
    members: OffsetArray  # slots in use, in an order that follows from what entered and left


def new_front(n_slots: int, n_robots: int) -> OrderedFront:
    """Return room for ``n_slots`` plans of ``n_robots`` trails."""
    n_blocks = n_slots // 8 + 2  # two neighbours always hold more than half a block together
    parts = OrderedFront(
        n=np.zeros(1, _COUNTS).view(np.recarray)[0],
        directory=np.zeros(n_blocks, np.int64),
        size=np.zeros(n_blocks, np.int64),
        places=np.zeros((n_blocks, BLOCK), _PLACE).view(np.recarray),
        free_blocks=np.arange(n_blocks)[::-1].copy(),
        spare_slots=np.arange(n_slots)[::-1].copy(),
        plan=np.zeros((n_slots, n_robots), np.int32),
        slots=np.zeros(n_slots, _SLOT).view(np.recarray),
        members=np.zeros(n_slots, np.int64),
    )
    front: OrderedFront = apart(parts)
    front.n.free, front.n.spare = n_blocks, n_slots
    return front


def read_front(front: OrderedFront) -> tuple[OffsetArray, FloatArray]:
    """Return the slots of all plans in order, and their E[R] and E[S] (n_plans, 2)."""
    blocks = front.directory[: front.n.blocks]
    places = front.places[blocks][np.arange(BLOCK) < front.size[blocks, np.newaxis]]
    return places["slot"].copy(), np.column_stack([places["reward"], places["survivors"]])


def grow_front(front: OrderedFront, n_slots: int) -> OrderedFront:
    """Return the same front with room for ``n_slots`` plans, at least as many as now."""
    grown = new_front(n_slots, front.plan.shape[1])
    for name in ("directory", "size", "places", "plan", "slots", "members"):
        old = getattr(front, name)
        getattr(grown, name)[: len(old)] = old
    n = grown.n
    n.blocks, n.plans, n.entered = front.n.blocks, front.n.plans, front.n.entered
    for name, of in (("free", "free_blocks"), ("spare", "spare_slots")):
        stack, old, n_old = getattr(grown, of), getattr(front, of), getattr(front.n, name)
        n_new = len(stack) - len(old)  # these numbers are at the bottom of the stack
        stack[n_new : n_new + n_old] = old[:n_old]
        setattr(n, name, n_new + n_old)
    return grown


@inlined
def find_place(front: OrderedFront, survivors: float) -> tuple[int, int]:
    """Find the plan of largest E[R] among those with at least this E[S].

    Returns its block's number in the directory, and its place there. Where there is none, the first
    is the number of blocks.
    """
    low, high = 0, front.n.blocks
    while low < high:
        middle = (low + high) // 2
        block = front.directory[middle]
        if front.places[block, front.size[block] - 1].survivors >= survivors:
            high = middle
        else:
            low = middle + 1
    at = low
    if at == front.n.blocks:
        return at, 0
    block = front.directory[at]
    low, high = 0, front.size[block] - 1
    while low < high:
        middle = (low + high) // 2
        if front.places[block, middle].survivors >= survivors:
            high = middle
        else:
            low = middle + 1
    return at, low


@inlined
def best_reward(front: OrderedFront, survivors: float) -> float:
    """Return the largest E[R] of the plans with at least this E[S]; −1 without any."""
    at, place = find_place(front, survivors)
    if at == front.n.blocks:
        return -1.0
    return float(front.places[front.directory[at], place].reward)


@inlined
def nearest_place(front: OrderedFront, survivors: float) -> tuple[int, int]:
    """Find the plan with an E[S]; where it has left, the next safer one, or else the safest."""
    at, place = find_place(front, survivors)
    return (at, place) if at < front.n.blocks else place_before(front, at, place)


@inlined
def place_before(front: OrderedFront, at: int, place: int) -> tuple[int, int]:
    """Return the place before another one, which may be behind the last block; −1 for none."""
    place -= 1
    if place < 0:
        at -= 1
        if at >= 0:
            place = front.size[front.directory[at]] - 1
    return at, place


@inlined
def find_dominated(front: OrderedFront, reward: float, survivors: float) -> tuple[int, int]:
    """Find the plan of most E[S] among those with at most this E[R] and this E[S].

    Returns its block's number in the directory, −1 where there is none, and its place there.
    """
    at, place = find_place(front, survivors)
    if at == front.n.blocks or front.places[front.directory[at], place].survivors > survivors:
        at, place = place_before(front, at, place)
    # No plan before it has less E[R].
    if at >= 0 and front.places[front.directory[at], place].reward > reward:
        at = -1
    return at, place


@helper
def insert(front: OrderedFront, reward: float, survivors: float) -> int:
    """Insert a plan, and remove those that it dominates or equals; return its slot.

    No plan of the front may dominate it.
    """
    while True:
        at, place = find_dominated(front, reward, survivors)
        if at < 0:
            return add_place(front, reward, survivors)
        remove_place(front, at, place)


@inlined
def draw_slot(front: OrderedFront, states: SeedArray) -> int:
    """Draw a plan uniformly; return its slot."""
    return int(front.members[below(states, front.n.plans)])


@helper
def draw_near(front: OrderedFront, states: SeedArray, at: int, place: int) -> int:
    """Draw a plan among the ``_NEAR`` on either side of a place, and there; return its slot.

    Near an end of the front, those beyond it are replaced by those on the other side.
    """
    if front.n.plans <= 2 * _NEAR:
        return draw_slot(front, states)
    offset = below(states, 2 * _NEAR + 1) - _NEAR
    slot = _slot_beside(front, at, place + offset)
    return slot if slot >= 0 else _slot_beside(front, at, place - offset)


@inlined
def _slot_beside(front: OrderedFront, at: int, place: int) -> int:
    """Return the slot at a place of a block, or beyond it in other blocks; −1 beyond an end."""
    while place < 0 and at > 0:
        at -= 1
        place += front.size[front.directory[at]]
    while at < front.n.blocks and place >= front.size[front.directory[at]]:
        place -= front.size[front.directory[at]]
        at += 1
    if place < 0 or at == front.n.blocks:
        return -1
    return int(front.places[front.directory[at], place].slot)


@helper
def contribution(front: OrderedFront, slot: int) -> float:
    """Return the area of the rectangle between the two neighbours of a plan.

    Plans at the ends get the area that each would have if the plans were evenly spaced.
    """
    found = front.slots[slot]
    if found.before < 0 or found.after < 0:
        last_block = front.directory[front.n.blocks - 1]
        first = front.places[front.directory[0], 0]
        last = front.places[last_block, front.size[last_block] - 1]
        gap = 2.0 / front.n.plans
        width, height = first.reward - last.reward, last.survivors - first.survivors
        return float(gap * width * gap * height)
    left, right = front.slots[found.before], front.slots[found.after]
    return float((left.reward - right.reward) * (right.survivors - left.survivors))


@helper
def slope_at(front: OrderedFront, slot: int) -> float:
    """Return how much E[R] the front loses for each survivor more, between a plan's neighbours.

    At an end of the front the plan is a neighbour of itself.
    """
    before, after = front.slots[slot].before, front.slots[slot].after
    left = front.slots[before if before >= 0 else slot]
    right = front.slots[after if after >= 0 else slot]
    more = right.survivors - left.survivors
    return float((left.reward - right.reward) / more) if more > 0.0 else 0.0


@inlined
def _link(front: OrderedFront, before: int, after: int) -> None:
    """Make two slots neighbours; −1 stands for the outside of the front."""
    if before >= 0:
        front.slots[before].after = after
    if after >= 0:
        front.slots[after].before = before


@inlined
def _move(place: Record, to: Record) -> None:
    """Copy a place by its fields: copying records whole goes byte by byte."""
    to.slot, to.reward, to.survivors = place.slot, place.reward, place.survivors


@helper
def remove_place(front: OrderedFront, at: int, place: int) -> int:
    """Remove a plan; return its slot, which is free again."""
    n, block = front.n, front.directory[at]
    slot = front.places[block, place].slot
    front.size[block] -= 1
    for i in range(place, front.size[block]):
        _move(front.places[block, i + 1], front.places[block, i])
    front.spare_slots[n.spare] = slot
    n.spare += 1
    n.plans -= 1
    left, last = front.slots[slot], front.members[n.plans]
    _link(front, left.before, left.after)
    front.members[left.member], front.slots[last].member = last, left.member
    if front.size[block] == 0:
        _drop_block(front, at)
    else:
        _merge(front, at)
    _merge(front, at - 1)
    return int(slot)


@helper
def _drop_block(front: OrderedFront, at: int) -> None:
    """Free an empty block."""
    n = front.n
    front.free_blocks[n.free] = front.directory[at]
    n.free += 1
    n.blocks -= 1
    for i in range(at, n.blocks):
        front.directory[i] = front.directory[i + 1]


@helper
def _merge(front: OrderedFront, at: int) -> None:
    """Merge a block with the one after it, if there is one, where this leaves half of it free."""
    if at < 0 or at + 1 >= front.n.blocks:
        return
    block, after = front.directory[at], front.directory[at + 1]
    size, more = front.size[block], front.size[after]
    if size + more > BLOCK // 2:
        return
    for i in range(more):
        _move(front.places[after, i], front.places[block, size + i])
    front.size[block] += more
    front.size[after] = 0
    _drop_block(front, at + 1)


@helper
def add_place(front: OrderedFront, reward: float, survivors: float) -> int:
    """Add a plan that no plan of the front dominates or equals; return the slot for its trails.

    The plans that it dominates must have been removed.
    """
    n = front.n
    if n.blocks == 0:
        _open_block(front, 0)
    at, place = find_place(front, survivors)
    if at == n.blocks:
        at -= 1
        place = front.size[front.directory[at]]
    block = front.directory[at]
    n.spare -= 1
    slot = front.spare_slots[n.spare]
    _fill(front, slot, at, place)
    if front.size[block] == BLOCK:
        _open_block(front, at + 1)
        after = front.directory[at + 1]
        half = BLOCK // 2
        for i in range(half):
            _move(front.places[block, half + i], front.places[after, i])
        front.size[block], front.size[after] = half, half
        if place > half:
            block, place = after, place - half
    for i in range(front.size[block], place, -1):
        _move(front.places[block, i - 1], front.places[block, i])
    front.size[block] += 1
    new = front.places[block, place]
    new.slot, new.reward, new.survivors = slot, reward, survivors
    front.slots[slot].reward, front.slots[slot].survivors = reward, survivors
    n.entered += 1
    n.plans += 1
    return int(slot)


@helper
def _fill(front: OrderedFront, slot: int, at: int, place: int) -> None:
    """Put a slot between the plans before and at a place, and among the members."""
    n, block, new = front.n, front.directory[at], front.slots[slot]
    new.before = new.after = -1
    if place < front.size[block]:
        new.after = front.places[block, place].slot
        new.before = front.slots[new.after].before
    elif n.plans > 0:
        new.before = front.places[block, place - 1].slot
        new.after = front.slots[new.before].after
    _link(front, new.before, slot)
    _link(front, slot, new.after)
    new.member, new.serial, new.tried = n.plans, n.entered, 0
    front.members[n.plans] = slot


@helper
def _open_block(front: OrderedFront, at: int) -> None:
    """Put an empty block into the directory."""
    n = front.n
    n.free -= 1
    block = front.free_blocks[n.free]
    front.size[block] = 0
    for i in range(n.blocks, at, -1):
        front.directory[i] = front.directory[i - 1]
    front.directory[at] = block
    n.blocks += 1
