"""Prices that the team pays its robots for visits, and known trails as prices see them.

A price is a convex function of the probability to be alive, 0 at 0, and linear between the levels
of a grid: level l of node v is the probability reach[v] · l / n_levels.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from itertools import combinations
from threading import Lock
from typing import Any, NamedTuple

import numpy as np

from botohe_moo.base.types import BoolArray, FloatArray, OffsetArray
from botohe_moo.bounds.front_bound import convex_below
from botohe_moo.bounds.kernels.states import EPSILON, ROUNDING, Net
from botohe_moo.bounds.kernels.trails import follow_trails
from botohe_moo.bounds.net import RelaxedTrail

_TIDIED = 3  # rounds of lowering prices before they are made convex
_TINY = float(np.finfo(float).tiny)  # the rounding of numbers that are almost 0


class Prices(NamedTuple):
    """What a trail is worth: what its visits are paid, and ``mu`` for its survival."""

    visits: FloatArray  # (n_nodes that pay, n_levels + 1)
    mu: float


def most_levels(n_robots: int, n_levels: int, most: int) -> int:
    """Return the largest number of levels, at most ``n_levels``, with few enough configurations."""
    while n_levels > 0 and math.comb(n_levels + n_robots, n_robots) > most:
        n_levels -= 1
    return n_levels


class PricedTeam:
    """What nodes give a team of ``n_robots``, by the levels at which its robots reach them.

    A configuration says how many robots reach a node at each level. The node then gives its
    expected reward less what the robots are paid: this is meant by *beside prices*. With the other
    robots fixed, it is linear in one robot's probability between two levels. So it is the largest
    where all robots are at levels.

    Attributes
    ----------
    nodes, reward
        The nodes that pay, and their rewards (n_nodes).
    alive
        The probability of each level (n_nodes, n_levels + 1).
    counts
        How many robots are at each level (n_configurations, n_levels + 1).
    gains
        The expected rewards, before payment (n_nodes, n_configurations).
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
        spare = terms * EPSILON * (self.reward + self.n_robots * prices[:, -1])
        most: FloatArray = self.beside(prices).max(axis=1) + spare + _TINY
        return most

    def tidy(self, prices: FloatArray) -> FloatArray:
        """Lower prices where the most that is gained beside them stays, and make them convex.

        Trails are worth less then, and the bound is lower. If the others miss the node with
        probability m and are paid f, the price at probability a has to be at least
        reward · (1 − (1 − a) · m) − f − most. All robots are paid the same prices, so each time a
        price falls by one robot's share. Chords between corners of a price gain no more than these.
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


def refine(prices: FloatArray, n_times: int) -> FloatArray:
    """Return the same prices on a grid of ``n_times`` as many levels (n_nodes, ·)."""
    n_levels = prices.shape[1] - 1
    levels = np.arange(n_levels * n_times + 1) / n_times
    low = np.minimum(levels.astype(int), n_levels - 1)
    part = levels - low
    fine: FloatArray = prices[:, low] * (1.0 - part) + prices[:, low + 1] * part
    return fine


class Visits(NamedTuple):
    """A trail as a row of a linear programme: it is worth ``weights`` · prices + mu · survival."""

    columns: OffsetArray  # of prices (n_nodes × n_levels), level 0 left out
    weights: FloatArray
    survival: float

    def worth(self, prices: Prices) -> float:
        """Return what the trail is worth."""
        paid = self.weights @ prices.visits[:, 1:].ravel()[self.columns]
        return float(paid + prices.mu * self.survival)


class Trails(NamedTuple):
    """The trails of a pool at some moment."""

    visits: list[Visits]
    matrix: Any  # of weights (n, n_columns)
    survival: FloatArray  # (n)
    is_relaxed: BoolArray  # (n)
    is_dropped: BoolArray  # (n)

    def worth(self, prices: Prices, *, relaxed: bool) -> FloatArray:
        """Return what trails are worth (n), −inf where they are dropped.

        Without ``relaxed`` it is −inf for relaxed trails, too.
        """
        worth: FloatArray = self.matrix @ prices.visits[:, 1:].ravel() + prices.mu * self.survival
        worth[self.is_dropped if relaxed else self.is_dropped | self.is_relaxed] = -np.inf
        return worth


class Pool:
    """Known trails and relaxed trails, each once; relaxed ones may be dropped."""

    def __init__(self, net: Net, n_levels: int) -> None:
        self._net, self.n_levels = net, n_levels
        self._nodes: OffsetArray = np.flatnonzero(net.graph.reward > 0.0)
        self._known: dict[bytes, int] = {}
        self._visits: list[Visits] = []
        self._relaxed: list[RelaxedTrail | None] = []  # None for trails
        self._is_dropped: list[bool] = []
        self._trails: Trails | None = None
        self._lock = Lock()  # several threads may find trails

    def add(self, arcs: list[int], paid: list[bool] | None = None) -> tuple[Visits, bool]:
        """Add a trail, or a relaxed one with the visits that pay.

        Returns how prices see it, and whether it is new or was dropped before.
        """
        paying, alive = self._follow(arcs, paid)
        relaxed = None
        if paid is not None and not self._is_trail(arcs, paying, alive):
            relaxed = RelaxedTrail(arcs, paid)
        visits = self._seen(paying, alive)
        key = visits.columns.tobytes() + visits.weights.round(10).tobytes()
        key += np.round(alive, 12).tobytes()
        with self._lock:
            number = self._known.setdefault(key, len(self._visits))
            if number == len(self._visits):
                self._visits.append(visits)
                self._relaxed.append(relaxed)
                self._is_dropped.append(True)  # until it is taken in below
            is_new = self._is_dropped[number]
            becomes_true = relaxed is None and self._relaxed[number] is not None
            if is_new or becomes_true:
                self._is_dropped[number], self._trails = False, None
            if becomes_true:
                self._relaxed[number] = None
            return visits, is_new

    def trails(self) -> Trails:
        """Return all trails that are known at present."""
        from scipy.sparse import csr_array

        with self._lock:
            if self._trails is None:
                visits = self._visits[:]
                first = np.cumsum([0, *(len(each.columns) for each in visits)])
                columns = np.concatenate([np.empty(0, int), *(each.columns for each in visits)])
                weights = np.concatenate([np.empty(0), *(each.weights for each in visits)])
                shape = (len(visits), len(self._nodes) * self.n_levels)
                self._trails = Trails(
                    visits,
                    csr_array((weights, columns, first), shape=shape),
                    np.array([each.survival for each in visits]),
                    np.array([trail is not None for trail in self._relaxed], bool),
                    np.array(self._is_dropped, bool),
                )
            return self._trails

    def relaxed(self, number: int) -> RelaxedTrail | None:
        """Return a relaxed trail by its number; None for a trail."""
        return self._relaxed[number]

    def drop_forbidden(self, allows: Callable[[RelaxedTrail], bool]) -> None:
        """Drop relaxed trails that are not allowed any more."""
        for number, trail in enumerate(self._relaxed):
            if trail is not None and not self._is_dropped[number]:
                self._is_dropped[number] = not allows(trail)
        self._trails = None

    def _follow(
        self, arcs: list[int], paid: list[bool] | None
    ) -> tuple[list[tuple[int, float]], float]:
        """Return the nodes that pay, each with the probability to be alive there, and survival.

        Without ``paid``, each node pays at its first visit.
        """
        graph = self._net.graph
        if paid is None:
            taken = np.array([arcs], np.int32)
            survival, [reached] = follow_trails(self._net.world, taken, np.array([len(arcs)]))
            nodes = np.flatnonzero(reached)
            return list(zip(nodes.tolist(), reached[nodes].tolist(), strict=True)), survival[0]
        alive, heads = graph.mean_survival[arcs].cumprod(), graph.head[arcs].tolist()
        paying = zip(heads, alive.tolist(), paid, strict=True)
        return [(node, chance) for node, chance, pays in paying if pays], alive[-1]

    def _is_trail(self, arcs: list[int], paying: list[tuple[int, float]], alive: float) -> bool:
        """Return whether a relaxed trail is a trail.

        It comes home within the limits, no node pays twice, and no arc is taken twice.
        """
        net, graph = self._net, self._net.graph
        nodes = {node for node, _ in paying}
        return bool(
            len(nodes) == len(paying)
            and len({*arcs}) == len(arcs)
            and graph.head[arcs[-1]] == net.base
            and alive >= net.min_survival * (1.0 - ROUNDING)
            and graph.length[arcs].sum() * (1.0 - ROUNDING) <= net.max_length
        )

    def _seen(self, paying: list[tuple[int, float]], survival: float) -> Visits:
        """Share out the probability to be alive at each node to the two levels next to it."""
        nodes, alive = np.array(paying).reshape(-1, 2).T
        nodes = nodes.astype(int)
        level = np.minimum(alive / self._net.reach[nodes], 1.0) * self.n_levels
        low = np.minimum(level.astype(int), self.n_levels - 1)
        weights = np.zeros((len(self._nodes), self.n_levels + 1))
        rows = np.searchsorted(self._nodes, nodes)
        np.add.at(weights, (rows, low), low + 1 - level)
        np.add.at(weights, (rows, low + 1), level - low)
        [columns] = np.nonzero(flat := weights[:, 1:].ravel())
        return Visits(columns, flat[columns], survival)
