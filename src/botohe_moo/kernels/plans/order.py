"""Orders: of trails, in which plans are evaluated and kept, and of numbers."""

import numpy as np
from numpy.typing import NDArray

from botohe_moo._base.types import FloatArray, OffsetArray
from botohe_moo.kernels.compile import helper


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


@helper
def sort_descending(keys: FloatArray, order: OffsetArray, spare: OffsetArray, n: int) -> None:
    """Sort the first ``n`` indices in ``order`` by their keys, the largest first.

    Equal ones stay in order; NaN comes anywhere. By merging from the bottom up, with ``spare`` as
    scratch: numpy's own sorting takes seconds to compile.
    """
    width = 1
    while width < n:
        for start in range(0, n, 2 * width):
            middle, stop = min(start + width, n), min(start + 2 * width, n)
            left, right = start, middle
            for i in range(start, stop):
                takes_right = left == middle
                if left < middle and right < stop:
                    takes_right = keys[order[right]] > keys[order[left]]
                if takes_right:
                    spare[i] = order[right]
                    right += 1
                else:
                    spare[i] = order[left]
                    left += 1
        for i in range(n):
            order[i] = spare[i]
        width *= 2
