"""Threads that share work, and arrays that they do not share: results do not depend on them."""

from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from typing import Any

import numpy as np


@contextmanager
def mapping(n_threads: int) -> Iterator[Callable[..., list[Any]]]:
    """Give a ``map`` whose calls are made by threads; a single thread is the one that is running.

    Kernels release Python's lock, so that they run at the same time. Whichever thread is free makes
    the next call. The threads end with the context, so that none is left to pickle, to fork or to
    close.
    """
    if n_threads == 1:
        yield lambda function, *arguments: list(map(function, *arguments))
    else:
        with ThreadPoolExecutor(n_threads) as pool:
            yield lambda function, *arguments: list(pool.map(function, *arguments))


def in_spans(n: int, n_threads: int, work: Callable[[int, int, int], Any]) -> list[Any]:
    """Let threads work on ``n`` things in spans: ``work(part, begin, end)`` does the one of a part.

    There are as many parts as threads, or as things; at least one.
    """
    n_parts = max(1, min(n_threads, n))
    cuts = [n * i // n_parts for i in range(n_parts + 1)]
    with mapping(n_parts) as map_:
        return map_(work, range(n_parts), cuts[:-1], cuts[1:])


# A line of the processor's cache that one thread writes is taken from all others. Small arrays of
# several searches came to lie in the same lines: two threads took a fifth longer for the same work.
_LINE = 128  # bytes, as on Apple's processors; on x86 two of 64 are fetched together
_SMALL = 65_536  # bytes: of larger arrays only the ends may lie in a line with others


def apart(value: Any) -> Any:
    """Copy small arrays and records, also those of nested tuples, to lines of their own."""
    if isinstance(value, tuple):
        parts = [apart(part) for part in value]
        return value._make(parts) if hasattr(value, "_make") else tuple(parts)
    if isinstance(value, np.record):
        return _moved(np.array([value])).view(np.recarray)[0]
    if isinstance(value, np.ndarray) and value.nbytes <= _SMALL:
        return _moved(value)
    return value


def _moved(array: Any) -> Any:
    room = np.empty(array.nbytes + 2 * _LINE, np.uint8)
    start = -room.ctypes.data % _LINE
    moved = room[start : start + array.nbytes].view(array.dtype).reshape(array.shape)
    moved[...] = array
    return moved.view(type(array))
