"""Prices that the team pays its robots for visits, and what nodes give the team beside them.

A price is a convex function of the probability to be alive, 0 at 0, and linear between the levels
of a grid: level l of node v is the probability reach[v] · l / n_levels.
"""

from __future__ import annotations

import math
from itertools import combinations
from typing import NamedTuple

import numpy as np

from botohe_moo.base.types import FloatArray, OffsetArray
from botohe_moo.bounds.front_bound import convex_below
from botohe_moo.bounds.kernels.states import Net

_EPSILON = float(np.finfo(float).eps)
_TIDIED = 3  # rounds of lowering prices before they are made convex
SECONDS_A_GAIN = 1e-8  # to look for the most that is gained beside prices
_TINY = float(np.finfo(float).tiny)  # the rounding of numbers that are almost 0


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


class PricedTeam:
    """What nodes give a team of ``n_robots`` in each configuration of their levels.

    The probability that a robot of the team reaches a node is linear in that of each robot, and
    prices are convex. So the most is gained beside prices where all robots are at levels.
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
        """Return how many robots are at each level, and how probably none reaches each node.

        Their shapes are (n_configurations, n_levels + 1) and (n_nodes, n_configurations).
        """
        # Robots in a row, with bars between those of one level and those of the next.
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
        terms = 2 * self.n_robots + 5 * self.n_levels + 9  # with some roundings for each power
        spare = terms * _EPSILON * (self.reward + self.n_robots * prices[:, -1])
        most: FloatArray = self.beside(prices).max(axis=1) + spare + _TINY
        return most

    def tidy(self, prices: FloatArray) -> FloatArray:
        """Lower prices where the most that is gained beside them stays, and make them convex.

        The price at a level may fall until some configuration of the other robots gains more. All
        robots pay the same prices, so a price falls by the share of one robot.
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
        """Return values of nodes that pay for all nodes of the mission (n_nodes, ...), else 0."""
        everywhere = np.zeros((self._n_all, *values.shape[1:]))
        everywhere[self.nodes] = values
        return everywhere

    def spread(self, prices: FloatArray, n_levels: int) -> FloatArray:
        """Return prices for all nodes of the mission, on a grid of ``n_levels`` or a few more."""
        n_times = -(-n_levels // self.n_levels)
        return self.to_all(refine(prices, n_times))


def refine(prices: FloatArray, n_times: int) -> FloatArray:
    """Return the same prices on a grid of ``n_times`` as many levels (n_nodes, ·)."""
    n_levels = prices.shape[1] - 1
    levels = np.arange(n_levels * n_times + 1) / n_times
    low = np.minimum(levels.astype(int), n_levels - 1)
    part = levels - low
    fine: FloatArray = prices[:, low] * (1.0 - part) + prices[:, low + 1] * part
    return fine
