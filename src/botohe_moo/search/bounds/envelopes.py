"""Envelopes of points and of lines."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from botohe_moo._base.types import FloatArray, OffsetArray


def lower_hull(x: FloatArray, y: FloatArray) -> OffsetArray:
    """Return the corners of the largest convex function below all points, by ascending x.

    Andrew, "Another efficient algorithm for convex hulls in two dimensions", Information Processing
    Letters 9(5), 1979; scipy's refuses points on one line.
    """
    corners: list[int] = []
    for i in np.lexsort((y, x)).tolist():
        if corners and x[i] == x[corners[-1]]:
            continue
        while len(corners) > 1:
            one, last = corners[-2:]
            if (y[last] - y[one]) * (x[i] - x[one]) < (y[i] - y[one]) * (x[last] - x[one]):
                break
            corners.pop()
        corners.append(i)
    return np.array(corners, np.int64)


def convex_below(values: FloatArray) -> FloatArray:
    """Return the largest convex function on a grid that is nowhere above, at least 0."""
    levels = np.arange(len(values), dtype=float)
    corners = lower_hull(levels, values)
    envelope: FloatArray = np.maximum(np.interp(levels, corners, values[corners]), 0.0)
    return envelope


def lower_envelope(most: ArrayLike, mu: ArrayLike) -> OffsetArray:
    """Return which lines ``most`` − ``mu`` · x are the lowest at some x ≥ 0, by ascending mu."""
    # Products must not overflow.
    y, x = (np.asarray(each) / (np.max(each) or 1.0) for each in (most, mu))
    corners = lower_hull(x, y)
    # Lines before the last with the least ``most`` are nowhere below it.
    lowest: Any = np.flatnonzero(y[corners] == y[corners].min())[-1]
    return corners[lowest:]


def area_under_highest(heights: FloatArray, rises: FloatArray) -> float:
    """Integrate the highest of some lines from 0 to 1; those at −inf do not count.

    Where two of the lines that make it cross, it has a corner, or a line between them is higher.
    """
    finite = np.isfinite(heights)
    heights, rises = heights[finite], rises[finite]
    if len(heights) == 0:
        return 0.0

    def highest(at: float) -> int:
        return int((heights + rises * at).argmax())

    corners, pairs = [0.0, 1.0], [(highest(0.0), highest(1.0))]
    while pairs:
        one, other = pairs.pop()
        if rises[one] >= rises[other]:
            continue
        cross = float((heights[one] - heights[other]) / (rises[other] - rises[one]))
        between = highest(cross)
        if rises[one] < rises[between] < rises[other]:
            pairs += [(one, between), (between, other)]
        else:
            corners.append(min(max(cross, 0.0), 1.0))
    at = np.sort(corners)
    values = [float((heights + rises * each).max()) for each in at.tolist()]
    return float(np.trapezoid(values, at))
