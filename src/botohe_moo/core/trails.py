"""The order of trails that lie one after another in an array."""

import numpy as np
from numpy.typing import NDArray

from botohe_moo.base.types import OffsetArray
from botohe_moo.core.compile import helper, inlined


@helper
def precedes(
    items: NDArray[np.integer], start: int, stop: int, other_start: int, other_stop: int
) -> bool:
    """Return whether one stretch of an array comes before another in lexicographic order."""
    length, other_length = stop - start, other_stop - other_start
    for i in range(min(length, other_length)):
        item, other = items[start + i], items[other_start + i]
        if item != other:
            return bool(item < other)
    return bool(length < other_length)


@inlined
def sort_trails(
    nodes: NDArray[np.integer], starts: OffsetArray, stops: OffsetArray, order: OffsetArray
) -> None:
    """Sort trails, whose numbers are in ``order``, lexicographically; equal ones stay in order."""
    for k in range(1, order.shape[0]):
        trail, place = order[k], k
        while place > 0:
            other = order[place - 1]
            if not precedes(nodes, starts[trail], stops[trail], starts[other], stops[other]):
                break
            order[place] = other
            place -= 1
        order[place] = trail
