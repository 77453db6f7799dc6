"""Prices of visits: what the whole team gains at a node, beside what its robots are paid for it.

Prices are convex functions of the probability to be alive, 0 at 0, linear between the levels of a
grid: level l of node v is the probability reach[v] · l / n_levels.
"""

from __future__ import annotations

import math
from itertools import combinations
from typing import NamedTuple

import numpy as np

from botohe_moo._base.types import FloatArray, OffsetArray
from botohe_moo.kernels.bounds.states import Net
from botohe_moo.search.bounds.envelopes import convex_below

_EPSILON = float(np.finfo(float).eps)
_TIDIED = 3  # times that prices are lowered before the convex envelope is taken
_TINY = float(np.finfo(float).tiny)  # rounding where a relative error no longer holds


class Prices(NamedTuple):
    """What a trail is worth: what its visits are paid, and ``mu`` for its survival."""

    visits: FloatArray  # (n_nodes that pay, n_levels + 1)
    mu: float

    def towards(self, other: Prices, share: float) -> Prices:
        """Return prices that lie a share of the way from these to others."""
        visits = (1 - share) * self.visits + share * other.visits
        return Prices(visits, (1 - share) * self.mu + share * other.mu)


def most_levels(n_robots: int, n_levels: int, most: int) -> int:
    """Return the largest number of levels, at most ``n_levels``, with few enough configurations."""
    while n_levels > 0 and math.comb(n_levels + n_robots, n_robots) > most:
        n_levels -= 1
    return n_levels


class Team:
    """What nodes give a team of ``n_robots``, whatever their levels (configurations).

    The probability that one of them reaches a node is linear in that of each robot, and prices are
    convex: the most that is gained beside prices is gained where all are at a level of the grid.
    """

    def __init__(self, net: Net, n_robots: int, n_levels: int) -> None:
        graph = net.graph
        self.n_robots, self.n_levels, self._n_all = n_robots, n_levels, graph.n_nodes
        self.nodes: OffsetArray = np.flatnonzero(graph.reward > 0.0)
        self.reward: FloatArray = graph.reward[self.nodes]
        self.alive = np.outer(net.reach[self.nodes], np.arange(n_levels + 1) / n_levels)
        self.counts, missed = self._configurations(n_robots)
        self._others, self._others_miss = self._configurations(n_robots - 1)
        self.gains = self.reward[:, None] * (1.0 - missed)  # (n_nodes, n_configurations)

    def _configurations(self, n_robots: int) -> tuple[FloatArray, FloatArray]:
        """How many robots are at each level, and with what probability none gets to each node."""
        # Robots in a row, and bars between those of one level and those of the next.
        bars = list(combinations(range(n_robots + self.n_levels), self.n_levels))
        ends = np.pad(np.array(bars), ((0, 0), (1, 1)), constant_values=-1)
        ends[:, -1] = n_robots + self.n_levels
        counts = (np.diff(ends) - 1).astype(float)
        missed = np.ones((len(self.nodes), len(counts)))
        for alive, count in zip(self.alive.T, counts.T, strict=True):
            missed *= np.power.outer(1.0 - alive, count)
        return counts, missed

    def beside(self, prices: FloatArray) -> FloatArray:
        """Return what each configuration gains beside prices (n_nodes, n_configurations)."""
        left: FloatArray = self.gains - prices @ self.counts.T
        return left

    def most(self, prices: FloatArray) -> FloatArray:
        """Return the most that is gained beside prices at each node, rounded up (n_nodes)."""
        terms = 2 * self.n_robots + 5 * self.n_levels + 9  # of each power some units
        spare = terms * _EPSILON * (self.reward + self.n_robots * prices[:, -1])
        most: FloatArray = self.beside(prices).max(axis=1) + spare + _TINY
        return most

    def tidy(self, prices: FloatArray) -> FloatArray:
        """Lower prices as far as the most that is gained beside them stays, and make them convex.

        The price at one level may fall until some levels of the other robots would gain more. All
        robots' prices fall together, so each falls by its share.
        """
        most = self.beside(prices).max(axis=1)
        slope = self.reward[:, None] * self._others_miss
        prices = prices.copy()
        for _ in range(_TIDIED):
            at_none = (self.reward - most)[:, None] - prices @ self._others.T
            least = np.stack(
                [(at_none - (1.0 - alive)[:, None] * slope).max(axis=1) for alive in self.alive.T],
                axis=1,
            )
            prices += (np.clip(least, 0.0, prices) - prices) / self.n_robots
            prices[:, 0] = 0.0
        return np.array([convex_below(row) for row in prices]).reshape(prices.shape)

    def to_all(self, values: FloatArray) -> FloatArray:
        """Write values of nodes that pay to all nodes of the mission, 0 elsewhere."""
        everywhere = np.zeros(self._n_all)
        everywhere[self.nodes] = values
        return everywhere

    def spread(self, prices: FloatArray, n_levels: int) -> FloatArray:
        """Write prices to all nodes of the mission, on a grid of ``n_levels`` or a few more."""
        n_times = -(-n_levels // self.n_levels)
        fine = np.zeros((self._n_all, self.n_levels * n_times + 1))
        fine[self.nodes] = refine(prices, n_times)
        return fine


def refine(prices: FloatArray, n_times: int) -> FloatArray:
    """Return the same prices on a grid of ``n_times`` as many levels (n_nodes, ·)."""
    n_levels = prices.shape[1] - 1
    levels = np.arange(n_levels * n_times + 1) / n_times
    low = np.minimum(levels.astype(int), n_levels - 1)
    part = levels - low
    fine: FloatArray = prices[:, low] * (1.0 - part) + prices[:, low + 1] * part
    return fine
