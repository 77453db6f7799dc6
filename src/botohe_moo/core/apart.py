"""Arrays that have lines of the processor's cache to themselves.

A line that one thread writes is taken from all others. Small arrays of several searches come to lie
in the same lines: two threads then took a fifth longer for the same work.
"""

from typing import Any

import numpy as np

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
