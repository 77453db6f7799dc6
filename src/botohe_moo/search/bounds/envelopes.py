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
    """Return the largest convex function on a grid that is nowhere above values, at least 0."""
    levels = np.arange(len(values), dtype=float)
    corners = lower_hull(levels, values)
    envelope: FloatArray = np.maximum(np.interp(levels, corners, values[corners]), 0.0)
    return envelope


def lower_envelope(most: ArrayLike, mu: ArrayLike) -> OffsetArray:
    """Return which lines ``most`` − ``mu`` · x are the lowest at some x ≥ 0, by ascending mu."""
    # So that products do not overflow.
    y, x = (np.asarray(each) / (np.max(each) or 1.0) for each in (most, mu))
    corners = lower_hull(x, y)
    # Of lines with the least ``most``, the last one is the lowest.
    lowest: Any = np.flatnonzero(y[corners] == y[corners].min())[-1]
    return corners[lowest:]
