"""Trails, or drafts of trails, one after another in an array, and their order."""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from botohe_moo._base.types import IntArray, OffsetArray
from botohe_moo.core.compile import helper, inlined


class Trails(NamedTuple):
    """Trail t is ``nodes[offsets[t]:offsets[t + 1]]``; a plan's trails follow one another."""

    # Indices of nodes, 64-bit as everywhere in kernels. Behind the trails that a kernel has written
    # there may be room for more.
    nodes: OffsetArray
    offsets: OffsetArray  # where each trail begins, and the end of the last one (n_trails + 1)


def read_trails(nodes: IntArray, offsets: OffsetArray) -> Trails:
    """Return trails as kernels take them."""
    return Trails(nodes.astype(np.int64), offsets)


def write_trails(
    n_trails: int, n_nodes: int, write: Callable[[int, Trails], int]
) -> tuple[IntArray, OffsetArray]:
    """Let a kernel write trails whose lengths are not known before.

    ``write`` takes the number of trails that are written already, and where to write. It writes on
    while there is room, and returns the new number. At first there is room for ``n_nodes`` nodes,
    at least 1; it is doubled until all trails are written.
    """
    nodes, offsets = np.empty(n_nodes, np.int64), np.zeros(n_trails + 1, np.int64)
    n_done = write(0, Trails(nodes, offsets))
    while n_done < n_trails:
        nodes = np.concatenate([nodes, np.empty_like(nodes)])
        n_done = write(n_done, Trails(nodes, offsets))
    return nodes[: offsets[-1]].astype(np.int32), offsets


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
