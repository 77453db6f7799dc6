"""A front of plans in order of their objectives, for a search that changes it all the time.

Places are kept by descending E[R], hence by ascending E[S], one plan for each pair of objectives.
They lie in blocks of at most ``BLOCK``, so that finding takes the logarithm, and changing a block's
length, of the front's size: a list of blocks is the upper level of a B+-tree (Bayer and McCreight,
"Organization and maintenance of large ordered indexes", Acta Informatica 1, 1972) that two levels
are enough for.
"""

from typing import NamedTuple

import numpy as np

from botohe_moo._base.types import FloatArray, IntArray, OffsetArray, SeedArray
from botohe_moo.kernels.compile import everywhere, frugal, part, routine
from botohe_moo.kernels.rng import uniform

BLOCK = 64

# Indices into ``Front.counts``.
N_BLOCKS = 0  # in order
N_SPARE_BLOCKS = 1
N_SPARE_SLOTS = 2
N_PLANS = 3
N_ENTERED = 4  # plans that ever entered
N_COUNTS = 5


class Front(NamedTuple):
    """Places for plans, in order of their objectives.

    Attributes
    ----------
    counts
        ``N_BLOCKS`` to ``N_ENTERED``.
    directory
        The blocks in order.
    size
        Plans in each block.
    slot, reward, survivors
        Of each place of each block: which slot holds the plan, and its E[R] and E[S]
        (n_blocks, BLOCK).
    spare_blocks, spare_slots
        Those that are free, as stacks.
    plan
        The trails of the plan in each slot, by number, in lexicographic order (n_slots, n_robots).
    serial
        How many plans had entered before it (n_slots).
    tried
        How often it has been a parent (n_slots).
    """

    counts: OffsetArray
    directory: IntArray
    size: IntArray
    slot: IntArray
    reward: FloatArray
    survivors: FloatArray
    spare_blocks: IntArray
    spare_slots: IntArray
    plan: IntArray
    serial: OffsetArray
    tried: OffsetArray


def new_front(n_slots: int, n_robots: int) -> Front:
    """Make room for ``n_slots`` plans.

    Parameters
    ----------
    n_slots, n_robots
        How many plans, of how many trails.
    """
    n_blocks = n_slots // 8 + 2  # two neighbours always hold more than half a block together
    front = Front(
        counts=np.zeros(N_COUNTS, np.int64),
        directory=np.zeros(n_blocks, np.int32),
        size=np.zeros(n_blocks, np.int32),
        slot=np.zeros((n_blocks, BLOCK), np.int32),
        reward=np.zeros((n_blocks, BLOCK)),
        survivors=np.zeros((n_blocks, BLOCK)),
        spare_blocks=np.empty(n_blocks, np.int32),
        spare_slots=np.empty(n_slots, np.int32),
        plan=np.zeros((n_slots, n_robots), np.int32),
        serial=np.zeros(n_slots, np.int64),
        tried=np.zeros(n_slots, np.int64),
    )
    clear_front(front)
    return front


def clear_front(front: Front) -> None:
    """Take out all plans; the count of those that ever entered begins anew.

    Parameters
    ----------
    front
        Changed in place.
    """
    n_blocks, n_slots = len(front.spare_blocks), len(front.spare_slots)
    front.counts[:] = 0
    front.counts[N_SPARE_BLOCKS], front.counts[N_SPARE_SLOTS] = n_blocks, n_slots
    front.spare_blocks[:] = np.arange(n_blocks)[::-1]
    front.spare_slots[:] = np.arange(n_slots)[::-1]


@part
def find_place(front: Front, survivors: float) -> tuple[int, int]:
    """Find the first plan with at least so many survivors: of those it has the largest reward.

    Gives its block's number in the directory, and its place there; behind the last block where
    there is none.
    """
    low, high = 0, front.counts[N_BLOCKS]
    while low < high:
        middle = (low + high) // 2
        block = front.directory[middle]
        if front.survivors[block, front.size[block] - 1] >= survivors:
            high = middle
        else:
            low = middle + 1
    at = low
    if at == front.counts[N_BLOCKS]:
        return at, 0
    block = front.directory[at]
    low, high = 0, front.size[block] - 1
    while low < high:
        middle = (low + high) // 2
        if front.survivors[block, middle] >= survivors:
            high = middle
        else:
            low = middle + 1
    return at, low


@part
def best_reward(front: Front, survivors: float) -> float:
    """Give the largest E[R] of the plans with at least so many survivors; −1 without any."""
    at, place = find_place(front, survivors)
    if at == front.counts[N_BLOCKS]:
        return -1.0
    return float(front.reward[front.directory[at], place])


@part
def draw_place(front: Front, states: SeedArray) -> tuple[int, int]:
    """Draw a plan uniformly: blocks are drawn again by how full they are."""
    n = front.counts[N_BLOCKS]
    while True:
        at = int(uniform(states, 0) * n)
        size = front.size[front.directory[at]]
        place = int(uniform(states, 0) * (BLOCK if n > 1 else size))
        if place < size:
            return at, place


@routine
def contribution(front: Front, at: int, place: int) -> float:
    """Give the area between the two plans beside one, on both sides of it.

    At the ends it is what a front of evenly spaced plans has there.
    """
    block = front.directory[at]
    first_block, last_block = front.directory[0], front.directory[front.counts[N_BLOCKS] - 1]
    last = front.size[last_block] - 1
    if place > 0:
        left_reward, left_survivors = (
            front.reward[block, place - 1],
            front.survivors[block, place - 1],
        )
    elif at > 0:
        before = front.directory[at - 1]
        end = front.size[before] - 1
        left_reward, left_survivors = front.reward[before, end], front.survivors[before, end]
    else:
        left_reward = -1.0
        left_survivors = 0.0
    if place < front.size[block] - 1:
        right_reward = front.reward[block, place + 1]
        right_survivors = front.survivors[block, place + 1]
    elif at < front.counts[N_BLOCKS] - 1:
        after = front.directory[at + 1]
        right_reward, right_survivors = front.reward[after, 0], front.survivors[after, 0]
    else:
        right_reward = -1.0
        right_survivors = 0.0
    if left_reward < 0.0 or right_reward < 0.0:
        gap = 2.0 / front.counts[N_PLANS]
        width = front.reward[first_block, 0] - front.reward[last_block, last]
        height = front.survivors[last_block, last] - front.survivors[first_block, 0]
        return float(gap * width * gap * height)
    return float((left_reward - right_reward) * (right_survivors - left_survivors))


@routine
def remove_place(front: Front, at: int, place: int) -> int:
    """Take a plan out; give its slot, which is free now."""
    block = front.directory[at]
    slot = front.slot[block, place]
    front.size[block] -= 1
    for i in range(place, front.size[block]):
        front.slot[block, i] = front.slot[block, i + 1]
        front.reward[block, i] = front.reward[block, i + 1]
        front.survivors[block, i] = front.survivors[block, i + 1]
    front.spare_slots[front.counts[N_SPARE_SLOTS]] = slot
    front.counts[N_SPARE_SLOTS] += 1
    front.counts[N_PLANS] -= 1
    if front.size[block] == 0:
        _drop_block(front, at)
    elif at + 1 < front.counts[N_BLOCKS]:
        _merge(front, at)
    if 0 < at < front.counts[N_BLOCKS]:
        _merge(front, at - 1)
    return int(slot)


@routine
def _drop_block(front: Front, at: int) -> None:
    """Free an empty block."""
    front.spare_blocks[front.counts[N_SPARE_BLOCKS]] = front.directory[at]
    front.counts[N_SPARE_BLOCKS] += 1
    front.counts[N_BLOCKS] -= 1
    for i in range(at, front.counts[N_BLOCKS]):
        front.directory[i] = front.directory[i + 1]


@routine
def _merge(front: Front, at: int) -> None:
    """Make one block of two neighbours where they leave half of it free."""
    block, after = front.directory[at], front.directory[at + 1]
    size, more = front.size[block], front.size[after]
    if size + more > BLOCK // 2:
        return
    for i in range(more):
        front.slot[block, size + i] = front.slot[after, i]
        front.reward[block, size + i] = front.reward[after, i]
        front.survivors[block, size + i] = front.survivors[after, i]
    front.size[block] += more
    front.size[after] = 0
    _drop_block(front, at + 1)


@routine
def add_place(front: Front, reward: float, survivors: float) -> int:
    """Put in a plan that none in the front dominates or equals; give the slot for its trails.

    Those that it dominates must have been removed.
    """
    if front.counts[N_BLOCKS] == 0:
        _open_block(front, 0)
    at, place = find_place(front, survivors)
    if at == front.counts[N_BLOCKS]:
        at -= 1
        place = front.size[front.directory[at]]
    block = front.directory[at]
    if front.size[block] == BLOCK:
        _open_block(front, at + 1)
        after = front.directory[at + 1]
        half = BLOCK // 2
        for i in range(half):
            front.slot[after, i] = front.slot[block, half + i]
            front.reward[after, i] = front.reward[block, half + i]
            front.survivors[after, i] = front.survivors[block, half + i]
        front.size[block], front.size[after] = half, half
        if place > half:
            block, place = after, place - half
    for i in range(front.size[block], place, -1):
        front.slot[block, i] = front.slot[block, i - 1]
        front.reward[block, i] = front.reward[block, i - 1]
        front.survivors[block, i] = front.survivors[block, i - 1]
    front.size[block] += 1
    front.counts[N_SPARE_SLOTS] -= 1
    slot = front.spare_slots[front.counts[N_SPARE_SLOTS]]
    front.slot[block, place] = slot
    front.reward[block, place], front.survivors[block, place] = reward, survivors
    front.serial[slot] = front.counts[N_ENTERED]
    front.tried[slot] = 0
    front.counts[N_ENTERED] += 1
    front.counts[N_PLANS] += 1
    return int(slot)


@routine
def _open_block(front: Front, at: int) -> None:
    front.counts[N_SPARE_BLOCKS] -= 1
    block = front.spare_blocks[front.counts[N_SPARE_BLOCKS]]
    front.size[block] = 0
    for i in range(front.counts[N_BLOCKS], at, -1):
        front.directory[i] = front.directory[i - 1]
    front.directory[at] = block
    front.counts[N_BLOCKS] += 1


@everywhere
def has_room(front: Front, n: int) -> bool:
    """Tell whether so many plans can still enter."""
    # So are the blocks then: two neighbours hold more than half a block together.
    return bool(front.counts[N_SPARE_SLOTS] >= n)


@frugal
def read_front(front: Front, slots: IntArray, objectives: FloatArray) -> None:
    """Write the slots of all plans in order, and their E[R] and E[S].

    Parameters
    ----------
    front
        The front.
    slots, objectives
        Output (n_plans), (n_plans, 2).
    """
    n = 0
    for at in range(front.counts[N_BLOCKS]):
        block = front.directory[at]
        for place in range(front.size[block]):
            slots[n] = front.slot[block, place]
            objectives[n, 0] = front.reward[block, place]
            objectives[n, 1] = front.survivors[block, place]
            n += 1
