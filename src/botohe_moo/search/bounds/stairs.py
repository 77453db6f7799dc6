"""Stairs: of each step of survival, what is worth the most that comes home so likely or likelier.

Step b stands for survivals of b · width or more, and less than (b + 1) · width. Heights never rise.
"""

from __future__ import annotations

import numpy as np

from botohe_moo._base.types import FloatArray, OffsetArray

_EDGE = 1e-12  # survivals this much below a step count as on it, relative


def stairs_of(values: FloatArray, survival: FloatArray, width: float, n_steps: int) -> FloatArray:
    """Give the stairs of trails (n_steps), −inf where none survives so well."""
    stairs = np.full(n_steps, -np.inf)
    np.maximum.at(stairs, step_of(survival, width, n_steps), values)
    return _falling(stairs)


def step_of(survival: FloatArray, width: float, n_steps: int) -> OffsetArray:
    """Tell on which step survivals lie."""
    steps: OffsetArray = np.minimum((survival / width * (1 + _EDGE)).astype(np.int64), n_steps - 1)
    return steps


def last_steps(stairs: FloatArray) -> OffsetArray:
    """Tell the last step of each height."""
    falls = np.append(stairs[1:] < stairs[:-1], True)
    return np.flatnonzero(falls & np.isfinite(stairs))


def _falling(stairs: FloatArray) -> FloatArray:
    falling: FloatArray = np.maximum.accumulate(stairs[::-1])[::-1]
    return falling


def least_total(x: FloatArray, width: float, n_trails: int) -> OffsetArray:
    """Give the least sum of steps of so many trails whose survivals sum to ``x`` or more."""
    totals: OffsetArray = (x / width * (1 - _EDGE)).astype(np.int64) - n_trails + 1
    return np.maximum(totals, 0)


def add_stairs(stairs: FloatArray, n_trails: int) -> FloatArray:
    """Give the most that so many trails are worth together, by the sum of their steps."""
    most = stairs
    for _ in range(n_trails - 1):
        after = np.full(len(most) + len(stairs) - 1, -np.inf)
        for step in last_steps(stairs).tolist():
            there = after[step : step + len(most)]
            np.maximum(there, most + stairs[step], out=there)
        most = _falling(after)
    return most
