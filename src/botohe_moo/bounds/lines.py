"""Lines that no plan of a number of moving robots lies above, found by column generation."""

from __future__ import annotations

import math
from functools import cached_property

import numpy as np

from botohe_moo.base.types import FloatArray
from botohe_moo.bounds.front_bound import Line, LineProof, lower_envelope, stairs_of
from botohe_moo.bounds.kernels.trails import Stairs
from botohe_moo.bounds.master import SECONDS_A_GAIN, Master, Pool, PricedTeam, Prices
from botohe_moo.bounds.relaxation import LEVELS, Ahead, BoundLines, Relaxation

# As in ``proof``, these constants were chosen by experiment, and every line is valid whatever they
# are.

N_STEPS = 2_000  # of a trail's survival
# Prices of survival that bound what lies ahead in searches that raise stairs, in shares of that of
# the line; and what that is at least, in shares of all reward.
_MU_SHARES = (0.3, 1.0)
LEAST_MU = 0.01
# How near to the programme's value a line has to come, in shares of the bound: by relaxed trails,
# and by search.
_RELAXED_TOLERANCE, _SEARCH_TOLERANCE = 1e-3, 2e-4
_MOST_RELAXED = 60  # prices that are tried by relaxed trails
_MOST_SEARCHED = 40  # prices that are tried by search
# How far prices go from the best known ones to those of the linear programme: at first, and at
# least where searches do not end.
_SMOOTHING, _LEAST_SMOOTHING = 0.5, 0.02
_MOST_STEPS = 200_000  # of a depth-first search, for each unit of effort
_FIRST_STEPS = 10  # the first depth-first search has this many times as many
_SAMPLES = 200  # of survival, where lines are compared
_NEW = 1e-6  # by how much a new trail has to be worth more than the known ones
_EPSILON = float(np.finfo(float).eps)


class Lines:
    """All lines for a number of moving robots.

    ``family`` are the lines for all numbers of robots: prices give a line to each of them.
    """

    def __init__(
        self, relaxation: Relaxation, pool: Pool, n_robots: int, base_reward: float
    ) -> None:
        self.relaxation, self.pool = relaxation, pool
        self.n_robots, self.base_reward = n_robots, base_reward
        graph = relaxation.net.graph
        # As if every robot reached each node along the safest way.
        missed = (1.0 - np.minimum(relaxation.net.reach * (1.0 + 1e-12), 1.0)) ** n_robots
        everything = float((graph.reward * (1.0 - missed)).sum())
        # Each line with the prices that gave it, if any did.
        self._found: list[tuple[Line, Prices | None]] = [
            (self._line(everything, 0.0, "everything"), None)
        ]
        # Linear programmes that no thread uses: they are large, and made when they are needed.
        self._masters: list[Master] = []
        self.family: list[Lines] = []

    @property
    def found(self) -> list[Line]:
        """The lines."""
        return [line for line, _ in self._found]

    @cached_property
    def team(self) -> PricedTeam:
        """The robots that move, as prices see them."""
        return PricedTeam(self.relaxation.net, self.n_robots, self.pool.n_levels)

    def _line(self, most: float, mu: float, proof: LineProof) -> Line:
        """Return a line that is raised by what rounding may have taken from sums over nodes."""
        n_terms = self.relaxation.net.graph.n_nodes + 8
        scale = self.relaxation.total + self.base_reward + abs(most) + mu
        spare = n_terms * _EPSILON * scale
        return Line(self.n_robots, self.base_reward + most + spare, mu, proof)

    def prune(self) -> None:
        """Leave out lines that are nowhere the lowest."""
        lowest = lower_envelope(*zip(*((line.most, line.mu) for line in self.found), strict=True))
        self._found = [self._found[i] for i in lowest.tolist()]

    def bound(self, x: float) -> float:
        """Bound E[R] where the moving robots' survivals sum to ``x`` or more."""
        return min(line.most - line.mu * x for line in self.found)

    def lowest(self, x: float, end: float, n_most: int) -> list[Prices]:
        """Return the prices of 1 to ``n_most`` lines that are the lowest from ``x`` to ``end``.

        Each line lowers the bound more than any other would beside those before it.
        """
        lines = [(line, prices) for line, prices in self._found if prices is not None]
        if not lines:
            return [Prices(np.zeros((len(self.team.nodes), self.team.n_levels + 1)), 0.0)]
        at = np.linspace(x, end, _SAMPLES)
        heights = np.array([line.most - line.mu * at for line, _ in lines])
        lowest, chosen = np.full(_SAMPLES, np.inf), list[int]()
        while len(chosen) < n_most:
            best = int(np.minimum(heights, lowest).sum(axis=1).argmin())
            if best in chosen:
                break
            chosen.append(best)
            lowest = np.minimum(lowest, heights[best])
        return [lines[i][1] for i in chosen]

    def tighten(self, x: float, effort: int, until: float) -> bool:
        """Find better lines at ``x``, by relaxed trails and then by a search for trails.

        Returns whether relaxed trails remember more than before, so that another try may pay.
        """
        relaxation, masters = self.relaxation, self._masters
        if not masters:
            masters.append(Master(self.team, relaxation))
        master = masters.pop()
        prices = self._by_relaxed(master, x, until)
        used = [self.pool.relaxed[number] for number in master.active()]
        is_exact = self._by_search(master, x, prices, effort, until)
        masters.append(master)
        if is_exact or relaxation.clock.is_over():
            return False
        if not relaxation.remember([trail for trail in used if trail is not None]):
            return False
        self.pool.drop_forbidden(relaxation.allows)
        return True

    def look_ahead(self, prices: Prices) -> Ahead:
        """Bound all trails under prices, on a grid of ``LEVELS`` or a few more."""
        spread = self.team.spread(prices.visits, LEVELS)
        return self.relaxation.look_ahead(spread, [prices.mu])[0]

    def look_ahead_around(self, visits: FloatArray, mu: float) -> BoundLines:
        """Bound all trails under prices of visits, and several prices of survival up to ``mu``."""
        none = np.zeros(self.relaxation.net.graph.n_nodes)
        spread = self.team.spread(visits, LEVELS)
        ahead = self.relaxation.look_ahead(spread, [share * mu for share in _MU_SHARES])
        return [(each, none) for each in ahead]

    def known_stairs(self, visits: FloatArray, width: float) -> FloatArray:
        """Return the stairs of known trails (n_steps), without anything for their survival."""
        worth = self.pool.values(Prices(visits, 0.0), relaxed=False)
        return np.maximum(stairs_of(worth, self.pool.survival, width, N_STEPS), 0.0)

    def raise_stairs(
        self, visits: FloatArray, ahead: BoundLines, stairs: Stairs, n_most: int
    ) -> tuple[bool, int]:
        """Raise stairs above all trails; return whether that ended, and how many were found."""
        spread = self.team.spread(visits, LEVELS)
        ended, trails = self.relaxation.raise_stairs(spread, ahead, stairs, n_most)
        for arcs in trails:
            self.pool.add(arcs)
        return ended, len(trails)

    @property
    def rounding(self) -> float:
        """The share by which what a team collects is raised.

        Products of its survivals are rounded at each factor, and so is the sum over nodes.
        """
        graph = self.relaxation.net.graph
        return (2 * self.n_robots * (graph.n_arcs + 2) + graph.n_nodes + 8) * _EPSILON

    def _tidied(self, prices: Prices) -> Prices:
        return Prices(self.team.tidy(prices.visits), prices.mu)

    def _by_relaxed(self, master: Master, x: float, until: float) -> Prices:
        """Step from the best prices to those of the programme; return the best."""
        pool, best, value, step = self.pool, None, np.inf, _SMOOTHING
        master.allow_relaxed(pool, allowed=True)
        for _ in range(_MOST_RELAXED):
            least, wanted, theta = master.solve(pool, x, until)
            least += self.base_reward
            bound = min(value, self.bound(x))
            if bound - least < _RELAXED_TOLERANCE * bound or self.relaxation.clock.is_over(until):
                break
            prices = self._tidied(wanted if best is None else best.towards(wanted, step))
            ahead = self.look_ahead(prices)
            reached = self._keep_all(prices, ahead.most, "relaxed", until) - prices.mu * x
            added = [pool.add(*trail) for trail in self.relaxation.best_trails(ahead)]
            if reached < value:
                best, value = prices, reached
            is_new = bool(added) and self._exceeds(*added[0], wanted, theta)
            if not is_new and step == 1.0:
                break
            step = _SMOOTHING if is_new else 1.0
        return self._tidied(wanted) if best is None else best

    def _by_search(self, master: Master, x: float, best: Prices, effort: int, until: float) -> bool:
        """Step from the best prices to those of the programme, as far as they can be searched.

        Returns whether the search at the best prices ended.
        """
        pool, value, step, is_exact = self.pool, np.inf, 0.0, False
        master.allow_relaxed(pool, allowed=False)
        for i in range(_MOST_SEARCHED):
            least, wanted, theta = master.solve(pool, x, until)
            least += self.base_reward
            bound = self.bound(x)
            if bound - least < _SEARCH_TOLERANCE * bound or self.relaxation.clock.is_over(until):
                break
            prices = self._tidied(best.towards(wanted, step))
            ahead = self.look_ahead(prices)
            worth = pool.values(prices, relaxed=False)
            at_least = max(0.0, float(worth.max(initial=0.0))) + 1e-9
            n_most = _MOST_STEPS * effort * (1 if i else _FIRST_STEPS)
            ended, most, arcs = self.relaxation.search(ahead, at_least, n_most)
            number, is_new = pool.add(arcs) if arcs else (-1, False)
            proof: LineProof = "exact" if ended else "relaxed"
            theta_proved = min(most, ahead.most) if ended else ahead.most
            reached = self._keep_all(prices, theta_proved, proof, until) - prices.mu * x
            if i == 0 and not ended:
                break
            if i == 0:
                value, is_exact, step = reached, True, _SMOOTHING
            elif not ended:
                step /= 3
                if step < _LEAST_SMOOTHING:
                    break
            else:
                if reached < value:
                    best, value = prices, reached
                if not self._exceeds(number, is_new, wanted, theta):
                    if step == 1.0:
                        break
                    step = min(1.0, 2 * step)
        return is_exact

    def _exceeds(self, number: int, is_new: bool, prices: Prices, theta: float) -> bool:
        """Return whether a trail of the pool is new, and worth more than the programme knew."""
        return is_new and self.pool.value(number, prices) > theta + _NEW

    def _keep_all(self, prices: Prices, theta: float, proof: LineProof, until: float) -> float:
        """Keep the line of prices, also for other numbers of robots while there is time."""
        for lines in self.family:
            if self.relaxation.clock.is_over(until):
                break
            if lines is not self:
                lines.keep(prices, theta, proof)
        return self.keep(prices, theta, proof)

    def keep(self, prices: Prices, theta: float, proof: LineProof) -> float:
        """Keep the line of prices at which no trail is worth more than ``theta``.

        Returns the E[R] at which the line begins.
        """
        beside = float(self.team.most(prices.visits).sum())
        self.relaxation.clock.count(SECONDS_A_GAIN * self.team.gains.size)
        line = self._line(beside + self.n_robots * theta, prices.mu, proof)
        if math.isfinite(line.most):  # a programme without a solution may give any prices
            self._found.append((line, prices))
        return line.most
