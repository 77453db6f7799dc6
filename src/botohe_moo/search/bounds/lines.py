"""Lines that no plan of a number of moving robots lies above, found by column generation."""

from __future__ import annotations

import math
import time
from functools import cached_property
from typing import NamedTuple

import numpy as np

from botohe_moo._base.types import FloatArray
from botohe_moo.search.bounds.envelopes import lower_envelope
from botohe_moo.search.bounds.master import Master
from botohe_moo.search.bounds.pool import Pool
from botohe_moo.search.bounds.prices import Team
from botohe_moo.search.bounds.record import Line, LineProof
from botohe_moo.search.bounds.relaxation import Relaxation

_EPSILON = float(np.finfo(float).eps)
_SAMPLES = 200  # of survival, where lines are compared
_NEW = 1e-6  # by how much a new trail has to exceed what is known


class LineSearch(NamedTuple):
    """How far lines are tightened."""

    smoothing: float = 0.5  # how far prices stay at the best ones known
    tolerance: float = 2e-4  # of the bound
    most_relaxed: int = 60
    most_exact: int = 40
    most_steps: int = 200_000  # of a depth-first search, for each unit of effort
    n_levels: int = 24  # of relaxed trails, at least; twice as many before a search


class Lines:
    """All lines for a number of moving robots."""

    def __init__(
        self,
        relaxation: Relaxation,
        pool: Pool,
        n_robots: int,
        base_reward: float,
        rule: LineSearch,
    ) -> None:
        self._relaxation, self._pool, self.n_robots = relaxation, pool, n_robots
        self.base_reward, self.rule = base_reward, rule
        graph = relaxation.net.graph
        missed = (1.0 - np.minimum(relaxation.net.reach * (1.0 + 1e-12), 1.0)) ** n_robots
        everything = float((graph.reward * (1.0 - missed)).sum())
        # Each line with the prices that gave it (n_nodes that pay, n_levels + 1), if any did.
        self._found: list[tuple[Line, FloatArray | None]] = [
            (self._line(everything, 0.0, "everything"), None)
        ]
        self._made: Master | None = None
        self.others: list[Lines] = []  # for other numbers of robots

    @property
    def found(self) -> list[Line]:
        """The lines."""
        return [line for line, _ in self._found]

    @cached_property
    def team(self) -> Team:
        """What nodes give a team of as many robots."""
        return Team(self._relaxation.net, self.n_robots, self._pool.n_levels)

    @property
    def _master(self) -> Master:
        """The linear programme: large, and made when it is needed."""
        if self._made is None:
            self._made = Master(self.team, self._relaxation.total)
        return self._made

    def drop(self, number: int) -> None:
        """Forget a trail of the pool that has been dropped."""
        if self._made is not None:
            self._made.drop(number)

    def _line(self, most: float, mu: float, proof: LineProof) -> Line:
        n_terms = self._relaxation.net.graph.n_nodes + 8
        scale = self._relaxation.total + self.base_reward + abs(most) + mu
        spare = n_terms * _EPSILON * scale
        return Line(self.n_robots, self.base_reward + most + spare, mu, proof)

    def prune(self) -> None:
        """Leave out lines that are nowhere the lowest."""
        lowest = lower_envelope(*zip(*((line.most, line.mu) for line in self.found), strict=True))
        self._found = [self._found[i] for i in lowest.tolist()]

    def bound(self, x: float) -> float:
        """Bound E[R] where the moving robots' survivals sum to ``x`` or more."""
        return min(line.most - line.mu * x for line in self.found)

    def lowest(self, x: float, end: float, n_most: int) -> list[tuple[FloatArray, float]]:
        """Return prices and mu (the price of survival) of the lowest lines from ``x`` to ``end``.

        There are 1 to ``n_most``; each lowers the bound the most beside those before it.
        """
        lines = [(line, prices) for line, prices in self._found if prices is not None]
        if not lines:
            return [(np.zeros((len(self.team.nodes), self.team.n_levels + 1)), 0.0)]
        at = np.linspace(x, end, _SAMPLES)
        heights = np.array([line.most - line.mu * at for line, _ in lines])
        lowest, chosen = np.full(_SAMPLES, np.inf), list[int]()
        while len(chosen) < n_most:
            best = int(np.minimum(heights, lowest).sum(axis=1).argmin())
            if best in chosen:
                break
            chosen.append(best)
            lowest = np.minimum(lowest, heights[best])
        return [(lines[i][1], lines[i][0].mu) for i in chosen]

    def tighten(self, x: float, effort: int, deadline: float) -> bool:
        """Find better lines at ``x``, first by relaxed trails, then by exact ones.

        True where relaxed trails have been made to remember more, so that it may be worth another
        try.
        """
        prices, mu = self._by_relaxed(x, deadline)
        used = [self._pool.relaxed[number] for number in self._master.active()]
        is_exact = self._by_search(x, prices, mu, effort, deadline)
        if is_exact or time.monotonic() > deadline:
            return False
        if not self._relaxation.remember([walk for walk in used if walk is not None]):
            return False
        self.drop_forgotten()
        return True

    def drop_forgotten(self) -> None:
        """Drop trails that are not relaxed trails any more, since more is remembered."""
        pool = self._pool
        for number, how in enumerate(pool.relaxed):
            if how is None or pool.dropped[number] or self._relaxation.allows(*how):
                continue
            pool.dropped[number] = True
            for lines in (self, *self.others):
                lines.drop(number)

    def _by_relaxed(self, x: float, deadline: float) -> tuple[FloatArray, float]:
        rule, pool = self.rule, self._pool
        self._master.allow_relaxed(pool, allowed=True)
        centre, value, stay = None, np.inf, rule.smoothing
        for _ in range(rule.most_relaxed):
            least, prices, theta, mu = self._master.solve(pool, x, deadline)
            least += self.base_reward
            known = min(value, self.bound(x))
            if known - least < 5 * rule.tolerance * known or time.monotonic() > deadline:
                break
            here, slope = prices, mu
            if centre is not None:
                here = stay * centre[0] + (1 - stay) * prices
                slope = stay * centre[1] + (1 - stay) * mu
            here = self.team.tidy(here)
            ahead = self._relaxation.look_ahead(self.team.spread(here, rule.n_levels), slope)
            reached = self._keep(here, slope, ahead.most, "relaxed", deadline) - slope * x
            found = self._relaxation.best_trails(ahead)
            added = [pool.add(*trail) for trail in found]
            if reached < value:
                centre, value = (here, slope), reached
            is_new = False
            if added and added[0][1]:
                visits = pool.visits[added[0][0]]
                worth = visits.weights @ prices[:, 1:].ravel()[visits.columns]
                is_new = bool(worth + mu * visits.survival > theta + _NEW)
            if not is_new and stay == 0.0:
                break
            stay = rule.smoothing if is_new else 0.0
        if centre is None:
            centre = self.team.tidy(prices), mu
        return centre

    def _by_search(
        self, x: float, prices: FloatArray, mu: float, effort: int, deadline: float
    ) -> bool:
        """Step from the best prices known towards those of the programme, if they can be searched.

        Returns whether the search at the best prices ended.
        """
        rule, pool = self.rule, self._pool
        self._master.allow_relaxed(pool, allowed=False)
        centre, value, step, is_exact = (prices, mu), np.inf, 0.0, False
        for i in range(rule.most_exact):
            least, known, theta, slope = self._master.solve(pool, x, deadline)
            least += self.base_reward
            best = self.bound(x)
            if best - least < rule.tolerance * best or time.monotonic() > deadline:
                break
            here = self.team.tidy((1 - step) * centre[0] + step * known)
            there = (1 - step) * centre[1] + step * slope
            ahead = self._relaxation.look_ahead(self.team.spread(here, 2 * rule.n_levels), there)
            worth = pool.values(here[:, 1:], there)
            worth = worth[~pool.is_relaxed]
            at_least = max(0.0, float(worth.max(initial=0.0))) + 1e-9
            n_most = rule.most_steps * effort * (1 if i else 10)
            ended, most, arcs = self._relaxation.search(ahead, at_least, n_most)
            number, is_new = pool.add(arcs) if arcs else (-1, False)
            if not ended:
                most = ahead.most
            proof: LineProof = "exact" if ended else "relaxed"
            most = min(most, ahead.most)
            reached = self._keep(here, there, most, proof, deadline) - there * x
            if i == 0:
                value, is_exact, step = reached, ended, rule.smoothing
                if not ended:
                    break
                continue
            if not ended:
                step /= 3
                if step < 0.02:
                    break
                continue
            if reached < value:
                centre, value = (here, there), reached
            exceeds = False
            if is_new:
                visits = pool.visits[number]
                worth = visits.weights @ known[:, 1:].ravel()[visits.columns]
                exceeds = bool(worth + slope * visits.survival > theta + _NEW)
            if not exceeds:
                if step > 0.99:
                    break
                step = min(1.0, 2 * step)
        return is_exact

    def _keep(
        self, prices: FloatArray, mu: float, theta: float, proof: LineProof, deadline: float
    ) -> float:
        """Keep the line that prices give, and those that they give other numbers of robots."""
        for lines in self.others:
            if time.monotonic() > deadline:
                break
            lines.keep(prices, mu, theta, proof)
        return self.keep(prices, mu, theta, proof)

    def keep(self, prices: FloatArray, mu: float, theta: float, proof: LineProof) -> float:
        """Keep the line of prices at which trails are worth at most ``theta``; return its most."""
        beside = float(self.team.most(prices).sum())
        line = self._line(beside + self.n_robots * theta, mu, proof)
        if math.isfinite(line.most):  # prices of a programme that went astray may overflow
            self._found.append((line, prices))
        return line.most
