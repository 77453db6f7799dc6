"""Fewer plans that dominate nearly as much."""

from collections.abc import Collection
from heapq import heapify, heappop, heappush

import numpy as np

from botohe_moo._base.types import FloatArray, OffsetArray


def thinned(objectives: FloatArray, kept: Collection[int], n_plans: int) -> OffsetArray:
    """Choose ``n_plans`` rows of a front that ascends in reward and descends in survivors.

    One after another, the plan goes that dominates the least area alone. Both ends and the rows
    ``kept`` stay, even if these are more than ``n_plans``.
    """
    n = len(objectives)
    left, right = np.arange(n) - 1, np.arange(n) + 1
    stays = np.zeros(n, bool)
    stays[[0, n - 1, *kept]] = True
    there = np.ones(n, bool)

    def area(row: int) -> float:
        reward = objectives[row, 0] - objectives[left[row], 0]
        return float(reward * (objectives[row, 1] - objectives[right[row], 1]))

    queue = [(area(row), row) for row in np.flatnonzero(~stays).tolist()]
    heapify(queue)
    n_left = n
    while n_left > n_plans and queue:
        found, row = heappop(queue)
        if not there[row] or found != area(row):  # another entry tells its area since a plan went
            continue
        there[row] = False
        n_left -= 1
        left[right[row]], right[left[row]] = left[row], right[row]
        for other in (int(left[row]), int(right[row])):
            if not stays[other]:
                heappush(queue, (area(other), other))
    rows: OffsetArray = np.flatnonzero(there)
    return rows
