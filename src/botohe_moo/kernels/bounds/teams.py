"""The best teams of given trails: depth-first over combinations, bounded by prices."""

from typing import NamedTuple

import numpy as np

from botohe_moo._base.types import FloatArray, OffsetArray
from botohe_moo.kernels.bounds.states import ROUNDING, Net
from botohe_moo.kernels.compile import kernel


class Trails(NamedTuple):
    """Trails by descending value."""

    values: FloatArray  # (n_trails)
    survival: FloatArray  # with what probability they come home (n_trails)
    misses: FloatArray  # and miss each node (n_trails, n_nodes)


@kernel
def write_misses(
    net: Net,
    arcs: OffsetArray,
    n_arcs: OffsetArray,
    row: OffsetArray,
    misses: FloatArray,
    survival: FloatArray,
) -> None:
    """Write with what probability trails miss nodes (n_trails, n_rows), and come home (n_trails).

    ``row`` says which row stands for a node, −1 for none.
    """
    for trail in range(n_arcs.shape[0]):
        alive = 1.0
        misses[trail] = 1.0
        for i in range(n_arcs[trail]):
            arc = arcs[trail, i]
            alive *= net.graph.survival[arc]
            place = row[net.graph.head[arc]]
            if place >= 0:  # a robot is never likelier alive than before
                misses[trail, place] = min(misses[trail, place], 1.0 - alive)
        survival[trail] = alive


@kernel
def find_teams(
    trails: Trails,
    reward: FloatArray,
    beside: float,
    n_robots: int,
    x: float,
    height: float,
    n_most: int,
) -> tuple[bool, float]:
    """Give the most that a team of these trails collects, or ``height``, where that is more.

    Of teams whose survivals sum to ``x`` or more, none of which collects more than their values
    and ``beside``. The first is False where that takes more than ``n_most`` teams and parts of
    teams.
    """
    values, survival, misses = trails.values, trails.survival, trails.misses
    n_trails, most = survival.shape[0], survival.max()
    least = x / (1.0 + ROUNDING)
    chosen, sums = np.zeros(n_robots, np.int64), np.zeros((n_robots, 2))
    missed = np.ones((n_robots, reward.shape[0]))
    k, n = 0, 0
    while k >= 0:
        i, left = chosen[k], n_robots - k
        if (
            i == n_trails
            or sums[k, 1] + left * most < least
            or sums[k, 0] + left * values[i] + beside < height
        ):
            k -= 1
            if k >= 0:
                chosen[k] += 1
            continue
        n += 1
        if n > n_most:
            return False, height
        value, alive = sums[k, 0] + values[i], sums[k, 1] + survival[i]
        if left > 1:
            missed[k + 1] = missed[k] * misses[i]
            k += 1
            chosen[k], sums[k, 0], sums[k, 1] = i, value, alive
            continue
        chosen[k] += 1
        if alive < least or value + beside < height:
            continue
        collected = 0.0
        for node in range(reward.shape[0]):
            collected += reward[node] * (1.0 - missed[k, node] * misses[i, node])
        height = max(height, collected)
    return True, height
