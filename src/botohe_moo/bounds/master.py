"""Prices that the team pays its robots for visits, and the linear programme that sets them.

A price is a convex function of the probability to be alive, 0 at 0, and linear between the levels
of a grid: level l of node v is the probability reach[v] · l / n_levels.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from itertools import combinations
from typing import Any, NamedTuple, TypeVar

import numpy as np

from botohe_moo.base.types import FloatArray, OffsetArray
from botohe_moo.bounds.front_bound import convex_below
from botohe_moo.bounds.kernels.states import ROUNDING, Net
from botohe_moo.bounds.kernels.trails import follow_trails
from botohe_moo.bounds.net import RelaxedTrail
from botohe_moo.bounds.relaxation import Relaxation

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


class Visits(NamedTuple):
    """A trail as a row of a linear programme: it is worth ``weights`` · prices + mu · survival."""

    columns: OffsetArray  # of prices (n_nodes × n_levels), level 0 left out
    weights: FloatArray
    survival: float


class Pool:
    """Known trails and relaxed trails, each once; relaxed ones may be dropped."""

    def __init__(self, net: Net, n_levels: int) -> None:
        self._net, self.n_levels = net, n_levels
        self.nodes: OffsetArray = np.flatnonzero(net.graph.reward > 0.0)
        self._row = np.full(net.graph.n_nodes, -1)
        self._row[self.nodes] = np.arange(len(self.nodes))
        self._n_columns = len(self.nodes) * n_levels
        self._known: dict[bytes, int] = {}
        self._matrix: Any = None
        self.visits: list[Visits] = []
        self.relaxed: list[RelaxedTrail | None] = []  # None for trails
        self.dropped: list[bool] = []

    def __len__(self) -> int:
        return len(self.visits)

    def add(self, arcs: list[int], paid: list[bool] | None = None) -> tuple[int, bool]:
        """Add a trail, or a relaxed one with the visits that pay.

        Returns its number, and whether it is new or was dropped before.
        """
        paying, alive = self._follow(arcs, paid)
        relaxed = None
        if paid is not None and not self._is_trail(arcs, paying, alive):
            relaxed = RelaxedTrail(arcs, paid)
        visits = self._visits(paying, alive)
        key = visits.columns.tobytes() + visits.weights.round(10).tobytes()
        key += np.round(alive, 12).tobytes()
        if key in self._known:
            number = self._known[key]
            was_dropped, self.dropped[number] = self.dropped[number], False
            if relaxed is None:
                self.relaxed[number] = None
            return number, was_dropped
        self._known[key] = len(self)
        self.visits.append(visits)
        self.relaxed.append(relaxed)
        self.dropped.append(False)
        self._matrix = None
        return len(self) - 1, True

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
        alive, heads = graph.survival[arcs].cumprod(), graph.head[arcs].tolist()
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

    def _visits(self, paying: list[tuple[int, float]], survival: float) -> Visits:
        """Share out the probability to be alive at each node to the two levels next to it."""
        weights: dict[int, float] = {}
        for node, alive in paying:
            row = self._row[node]
            if row < 0:
                continue
            level = min(alive / self._net.reach[node], 1.0) * self.n_levels
            low = min(int(level), self.n_levels - 1)
            for one, weight in ((low, low + 1 - level), (low + 1, level - low)):
                if one > 0 and weight > 0.0:
                    column = int(row * self.n_levels + one - 1)
                    weights[column] = weights.get(column, 0.0) + weight
        columns = np.array(sorted(weights), np.int64)
        return Visits(columns, np.array([weights[c] for c in columns.tolist()]), survival)

    def value(self, number: int, prices: Prices) -> float:
        """Return what one trail is worth."""
        visits = self.visits[number]
        worth = visits.weights @ prices.visits[:, 1:].ravel()[visits.columns]
        return float(worth + prices.mu * visits.survival)

    def values(self, prices: Prices, *, relaxed: bool) -> FloatArray:
        """Return what trails are worth (n), −inf for those that are dropped.

        Without ``relaxed`` it is −inf for relaxed trails, too.
        """
        from scipy.sparse import csr_array

        if not self.visits:
            return np.empty(0)
        if self._matrix is None:
            first = np.cumsum([0, *(len(visits.columns) for visits in self.visits)])
            columns = np.concatenate([visits.columns for visits in self.visits])
            weights = np.concatenate([visits.weights for visits in self.visits])
            shape = (len(self), self._n_columns)
            self._matrix = csr_array((weights, columns, first), shape=shape)
            self._survival = self.survival
        paid = prices.visits[:, 1:].ravel()
        worth: FloatArray = self._matrix @ paid + prices.mu * self._survival
        worth[np.array(self.dropped)] = -np.inf
        if not relaxed:
            worth[[trail is not None for trail in self.relaxed]] = -np.inf
        return worth

    @property
    def survival(self) -> FloatArray:
        """The probabilities to come home (n)."""
        return np.array([visits.survival for visits in self.visits])

    def drop_forbidden(self, allows: Callable[[RelaxedTrail], bool]) -> None:
        """Drop relaxed trails that are not allowed any more."""
        for number, trail in enumerate(self.relaxed):
            if trail is not None and not self.dropped[number]:
                self.dropped[number] = not allows(trail)


_CUT = 1e-7  # by how much a row has to be violated to be added
_LEAST_SECONDS = 0.01  # that HiGHS gets
# What HiGHS takes, for each row of the programme, and for each row in an iteration.
_SECONDS_A_ROW, _SECONDS_AN_ITERATION = 1e-6, 1.5e-8
_CUTS_AT_ONCE = 8  # trails that are added before the programme is solved again, by experiment
_DEVEX = 1  # how HiGHS weighs rows: other weights take long to compute for rows that were added
# Rows without effect are left out where there are this many times as many rows as columns: solving
# a programme takes a third of the time.
_MOST_ROWS = 2
_MOST_MU = 20.0  # the highest price of survival, in total rewards: it keeps the programme bounded

_Key = TypeVar("_Key")


class Programme:
    """A linear programme for prices, whose rows are added where its solution violates them.

    Its columns are the prices of each node and level, what each node gives beside these, and
    others, with costs and upper bounds of their own. HiGHS goes on from the last basis.
    """

    def __init__(
        self, team: PricedTeam, cost: FloatArray, upper: FloatArray, relaxation: Relaxation
    ) -> None:
        import highspy

        class Silent(highspy.Highs):
            """HiGHS, which since 1.16 prints its name as soon as it is made."""

            def enableCallbacks(self) -> None:  # noqa: N802 - its first call
                self.setOptionValue("output_flag", False)
                super().enableCallbacks()  # type: ignore[no-untyped-call]

        self.team, self._turns, self._clock = team, relaxation.turns, relaxation.clock
        self._inf, self._basic = highspy.kHighsInf, highspy.HighsBasisStatus.kBasic
        n_nodes, n_levels = len(team.nodes), team.n_levels
        self._n_prices = n_nodes * n_levels
        self._first_other = self._n_prices + n_nodes
        most = (team.reward[:, None] * team.alive[:, 1:]).ravel()
        self._upper = np.concatenate([most, np.full(n_nodes, self._inf), upper])
        cost = np.concatenate([np.zeros(self._n_prices), np.ones(n_nodes), cost])
        self._lp: Any = Silent()  # type: ignore[no-untyped-call]
        self._lp.setOptionValue("threads", 1)
        self._lp.setOptionValue("simplex_dual_edge_weight_strategy", _DEVEX)
        self._lp.addVars(len(cost), np.zeros(len(cost)), self._upper)
        self._lp.changeColsCost(len(cost), np.arange(len(cost), dtype=np.int32), cost)
        self._n_rows = 0
        for node in range(n_nodes):
            self._shape_prices(node)
        self._n_shapes = self._n_rows
        self._last = np.zeros(len(cost))
        # The row of each configuration of a node.
        self._configurations: dict[tuple[int, int], int] = {}

    def _shape_prices(self, node: int) -> None:
        """Keep a node's prices convex, and their steepest rise at most the reward it brings.

        Level l has column ``first`` + l − 1; level 0, where the price is 0, has none.
        """
        team, n_levels = self.team, self.team.n_levels
        first = node * n_levels
        for level in range(1, n_levels):
            columns = [first + level, first + level - 1, first + level - 2]
            used = 3 if level > 1 else 2
            self._add(0.0, columns[:used], [1.0, -2.0, 1.0][:used])
        steepest = team.reward[node] * team.alive[node, 1]
        last = first + n_levels - 1
        used = 2 if n_levels > 1 else 1
        self._add(-steepest, [last, last - 1][:used], [-1.0, 1.0][:used])

    def _run(self) -> tuple[FloatArray, FloatArray]:
        """Return a solution, and its prices (n_nodes that pay, n_levels + 1).

        When the time is over, prices may be far from the best, but any prices are valid.
        """
        left = max(_LEAST_SECONDS, self._clock.left)
        self._lp.setOptionValue("time_limit", self._lp.getRunTime() + left)
        with self._turns.aside():
            self._lp.run()
        self._value = self._lp.getObjectiveValue()  # which is 0 once rows are added
        n_iterations = max(0, self._lp.getInfo().simplex_iteration_count)
        self._clock.count(self._n_rows * (_SECONDS_A_ROW + n_iterations * _SECONDS_AN_ITERATION))
        found = np.array(self._lp.getSolution().col_value)
        if found.shape == self._last.shape and np.isfinite(found).all():
            self._last = np.clip(found, 0.0, self._upper)
        solution = self._last  # the previous one, where HiGHS has found none
        visits = np.zeros((len(self.team.nodes), self.team.n_levels + 1))
        visits[:, 1:] = solution[: self._n_prices].reshape(visits[:, 1:].shape)
        return solution, visits

    def _cut_configurations(self, prices: FloatArray, solution: FloatArray) -> int:
        """Add the worst violated configuration of each node; return how many rows are new."""
        left = self.team.beside(prices)
        self._clock.count(SECONDS_A_GAIN * left.size)
        worst = left.argmax(axis=1)
        over = left[np.arange(len(left)), worst] - solution[self._n_prices : self._first_other]
        n = 0
        for node in np.flatnonzero(over > _CUT).tolist():
            cut = (node, int(worst[node]))
            if cut in self._configurations:
                continue
            self._configurations[cut] = self._n_rows
            counts = self.team.counts[cut[1], 1:]
            levels = np.flatnonzero(counts)
            columns = [self._n_prices + node, *(node * self.team.n_levels + levels).tolist()]
            self._add(float(self.team.gains[cut]), columns, [1.0, *counts[levels].tolist()])
            n += 1
        return n

    def _add(self, least: float, columns: list[int], weights: list[float]) -> None:
        """Add a row: the weighted sum of some columns is at least ``least``."""
        indices = np.array(columns, np.int32)
        self._lp.addRow(least, self._inf, len(columns), indices, np.array(weights))
        self._n_rows += 1


def _renumbered(rows: dict[_Key, int], numbers: dict[int, int]) -> dict[_Key, int]:
    """Return the new numbers of rows, as far as they have one."""
    return {key: numbers[row] for key, row in rows.items() if row in numbers}


class Master(Programme):
    """The linear programme for the prices with the least bound.

    It minimises Σ c + n_robots · theta − x · mu, where c is the most that a node gives beside
    prices, theta the most that a known trail is worth, and mu the price of survival.
    """

    def __init__(self, team: PricedTeam, relaxation: Relaxation) -> None:
        cost = np.array([team.n_robots, 0.0])
        upper = np.array([np.inf, _MOST_MU * relaxation.total])
        super().__init__(team, cost, upper, relaxation)
        self._theta, self._mu = self._first_other, self._first_other + 1
        # The row of each trail of the pool, and of those relaxed ones that do not count at present.
        self._rows: dict[int, int] = {}
        self._unused: dict[int, int] = {}
        self._takes_relaxed = True

    def solve(self, pool: Pool, x: float, until: float) -> tuple[float, Prices, float]:
        """Return the least bound over known trails, its prices, and theta."""
        self._lp.changeColCost(self._mu, -x)
        while True:
            solution, visits = self._run()
            prices, theta = Prices(visits, float(solution[self._mu])), float(solution[self._theta])
            n = self._cut_configurations(visits, solution)
            n += self._cut_trails(pool, prices, theta)
            if n == 0 or self._clock.is_over(until):
                return self._value, prices, theta

    def active(self) -> list[int]:
        """Return which trails of the pool make up the last solution, the most used first."""
        duals = np.array(self._lp.getSolution().row_dual)
        if len(duals) != self._n_rows:  # no solution
            return []
        numbers = np.array(list(self._rows), np.int64)
        used = duals[list(self._rows.values())]
        order = np.argsort(-used, kind="stable")
        return [int(i) for i in numbers[order[used[order] > _CUT]]]

    def _cut_trails(self, pool: Pool, prices: Prices, theta: float) -> int:
        """Add the trails that are worth the most above theta; return how many rows are new."""
        worth = pool.values(prices, relaxed=self._takes_relaxed)
        n = 0
        for i in np.argsort(-worth)[:_CUTS_AT_ONCE].tolist():
            if worth[i] > theta + _CUT and i not in self._rows:
                n += 1
                if i in self._unused:  # a relaxed trail that has turned out to be a trail
                    self._restore(i)
                    continue
                self._rows[i], visits = self._n_rows, pool.visits[i]
                columns = [self._theta, self._mu, *visits.columns.tolist()]
                self._add(0.0, columns, [1.0, -visits.survival, *(-visits.weights).tolist()])
        return n

    def allow_relaxed(self, pool: Pool, *, allowed: bool) -> None:
        """Count relaxed trails that the pool has not dropped, too, or trails only."""
        self._takes_relaxed = allowed
        if not allowed:
            self._leave_out_rows()
        for number in [number for number in self._rows if pool.dropped[number]]:
            self._switch_off(self._rows.pop(number))
        self._unused = {i: row for i, row in self._unused.items() if not pool.dropped[i]}
        if allowed:
            for number in list(self._unused):
                self._restore(number)
            return
        for number in [number for number in self._rows if pool.relaxed[number] is not None]:
            self._unused[number] = self._rows.pop(number)
            self._switch_off(self._unused[number])

    def _leave_out_rows(self) -> None:
        """Leave out rows without effect on the last solution, where there are many."""
        if self._n_rows < _MOST_ROWS * len(self._upper):
            return
        basis = self._lp.getBasis()
        if not basis.valid:
            return
        status = list(basis.row_status)  # which is copied whenever it is looked at
        # These rows are basic, so that the others and the columns are still a basis without them.
        is_out = np.array([each == self._basic for each in status])
        is_out[: self._n_shapes] = False
        self._lp.deleteRows(int(is_out.sum()), np.flatnonzero(is_out).astype(np.int32))
        kept = np.flatnonzero(~is_out).tolist()
        basis.row_status = [status[row] for row in kept]
        self._lp.setBasis(basis)
        self._n_rows = len(kept)
        numbers = {row: i for i, row in enumerate(kept)}
        self._configurations = _renumbered(self._configurations, numbers)
        self._rows = _renumbered(self._rows, numbers)
        self._unused = _renumbered(self._unused, numbers)

    def _switch_off(self, row: int) -> None:
        self._lp.changeRowBounds(row, -self._inf, self._inf)

    def _restore(self, number: int) -> None:
        self._rows[number] = self._unused.pop(number)
        self._lp.changeRowBounds(self._rows[number], 0.0, self._inf)
