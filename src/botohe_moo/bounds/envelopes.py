"""Envelopes of points and of lines."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from botohe_moo.base.types import FloatArray, OffsetArray

EDGE = 1e-12  # survivals this much below a step count as on it, relative


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


def stairs_of(values: FloatArray, survival: FloatArray, width: float, n_steps: int) -> FloatArray:
    """Return the stairs of trails (n_steps), −inf where none survives as well."""
    stairs = np.full(n_steps, -np.inf)
    steps = np.minimum((survival / width * (1 + EDGE)).astype(np.int64), n_steps - 1)
    np.maximum.at(stairs, steps, values)
    return falling(stairs)


def last_steps(stairs: FloatArray) -> OffsetArray:
    """Return the last step of each height."""
    falls = np.append(stairs[1:] < stairs[:-1], True)
    return np.flatnonzero(falls & np.isfinite(stairs))


def falling(stairs: FloatArray) -> FloatArray:
    """Raise each step to the highest of those after it, so that stairs never rise."""
    raised: FloatArray = np.maximum.accumulate(stairs[::-1])[::-1]
    return raised


def least_total(x: FloatArray | float, width: float, n_trails: int) -> OffsetArray:
    """Return the least sum of steps of ``n_trails`` trails whose survivals sum to ``x`` or more."""
    totals: OffsetArray = np.floor(np.divide(x, width) * (1 - EDGE)).astype(np.int64)
    return np.maximum(totals - n_trails + 1, 0)


def add_stairs(stairs: FloatArray, n_trails: int) -> FloatArray:
    """Return the most that ``n_trails`` trails are worth together, by the sum of their steps."""
    most = np.zeros(1)
    for _ in range(n_trails):
        most = add_two(stairs, most)
    return most


def add_two(stairs: FloatArray, others: FloatArray) -> FloatArray:
    """Return the most that a trail and others are worth together, by the sum of their steps."""
    after = np.full(len(others) + len(stairs) - 1, -np.inf)
    for step in last_steps(stairs).tolist():
        reached = after[step : step + len(others)]
        np.maximum(reached, others + stairs[step], out=reached)
    return falling(after)
