"""The order of trails, in which plans are evaluated and kept."""

import numpy as np
from numpy.typing import NDArray

from botohe_moo.kernels.compile import helper


@helper
def precedes(
    items: NDArray[np.integer], start: int, stop: int, other_start: int, other_stop: int
) -> bool:
    """Tell whether one stretch of an array comes before another in lexicographic order."""
    length, other_length = stop - start, other_stop - other_start
    for i in range(min(length, other_length)):
        item, other = items[start + i], items[other_start + i]
        if item != other:
            return bool(item < other)
    return bool(length < other_length)
