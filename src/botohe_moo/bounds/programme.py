"""Linear programmes for prices, solved by HiGHS."""

from __future__ import annotations

from collections.abc import Hashable
from typing import Any

import numpy as np

from botohe_moo.base.types import FloatArray
from botohe_moo.bounds.deadline import Deadline
from botohe_moo.bounds.prices import PricedTeam, Visits

CUT = 1e-7  # by how much a row has to be violated to be added
_LEAST_SECONDS = 0.01  # that HiGHS gets
# What HiGHS takes, for each row of the programme, and for each row in an iteration.
_SECONDS_A_ROW, _SECONDS_AN_ITERATION = 1e-6, 1.5e-8
_DEVEX = 1  # how HiGHS weighs rows: other weights take long to compute for rows that were added


class Programme:
    """A linear programme for prices, whose rows are added where its solution violates them.

    Its columns are the prices of each node and level, what each node gives beside these, and
    others, with costs and upper bounds of their own. HiGHS goes on from the last basis.
    """

    def __init__(
        self, team: PricedTeam, cost: FloatArray, upper: FloatArray, deadline: Deadline
    ) -> None:
        import highspy

        class Silent(highspy.Highs):
            """HiGHS, which since 1.16 prints its name as soon as it is made."""

            def enableCallbacks(self) -> None:  # noqa: N802 - its first call
                self.setOptionValue("output_flag", False)
                super().enableCallbacks()  # type: ignore[no-untyped-call]

        self.team, self._deadline, self._inf = team, deadline, highspy.kHighsInf
        n_nodes, n_levels = len(team.nodes), team.n_levels
        self._n_prices = n_nodes * n_levels
        self.first_other = self._n_prices + n_nodes
        most = (team.reward[:, None] * team.alive[:, 1:]).ravel()
        self._upper = np.concatenate([most, np.full(n_nodes, self._inf), upper])
        cost = np.concatenate([np.zeros(self._n_prices), np.ones(n_nodes), cost])
        self._lp: Any = Silent()  # type: ignore[no-untyped-call]
        self._lp.setOptionValue("threads", 1)
        self._lp.setOptionValue("simplex_dual_edge_weight_strategy", _DEVEX)
        self._lp.addVars(len(cost), np.zeros(len(cost)), self._upper)
        self._lp.changeColsCost(len(cost), np.arange(len(cost), dtype=np.int32), cost)
        # Their names: ("gains", node, configuration), ("trail", number, …), or None.
        self.rows: list[Hashable] = []
        self._least: list[float] = []
        for node in range(n_nodes):
            self._shape_prices(node)
        self._solution = np.zeros(len(cost))

    def _shape_prices(self, node: int) -> None:
        """Keep a node's prices convex, and their steepest rise at most the reward it brings.

        Level l has column ``first`` + l − 1; level 0, where the price is 0, has none.
        """
        team, n_levels = self.team, self.team.n_levels
        first = node * n_levels
        for level in range(1, n_levels):
            columns = [first + level, first + level - 1, first + level - 2]
            self.add(None, 0.0, columns[: level + 1], [1.0, -2.0, 1.0][: level + 1])
        steepest = team.reward[node] * team.alive[node, 1]
        last = first + n_levels - 1
        self.add(None, -steepest, [last, last - 1][:n_levels], [-1.0, 1.0][:n_levels])

    def add(self, name: Hashable, least: float, columns: list[int], weights: list[float]) -> None:
        """Add a row: the weighted sum of some columns is at least ``least``."""
        indices = np.array(columns, np.int32)
        self._lp.addRow(least, self._inf, len(columns), indices, np.array(weights))
        self.rows.append(name)
        self._least.append(least)

    def add_configuration(self, node: int, number: int) -> None:
        """Add what a node gives beside prices to a team in one of its configurations."""
        counts = self.team.counts[number, 1:]
        levels = np.flatnonzero(counts)
        columns = [self._n_prices + node, *(node * self.team.n_levels + levels).tolist()]
        least = float(self.team.gains[node, number])
        self.add(("gains", node, number), least, columns, [1.0, *counts[levels].tolist()])

    def add_trail(self, name: Hashable, visits: Visits, others: dict[int, float]) -> None:
        """Add that some columns are worth at least what prices pay for a trail."""
        columns = [*others, *visits.columns.tolist()]
        self.add(name, 0.0, columns, [*others.values(), *(-visits.weights).tolist()])

    def run(self) -> tuple[FloatArray, FloatArray, float]:
        """Return a solution, its prices (n_nodes that pay, n_levels + 1), and its value.

        When the time is over, prices may be far from the best, but any prices are valid.
        """
        left = max(_LEAST_SECONDS, self._deadline.left)
        self._lp.setOptionValue("time_limit", self._lp.getRunTime() + left)
        self._lp.run()
        value = float(self._lp.getObjectiveValue())
        n_iterations = max(0, self._lp.getInfo().simplex_iteration_count)
        seconds = _SECONDS_A_ROW + n_iterations * _SECONDS_AN_ITERATION
        self._deadline.work += len(self.rows) * seconds
        found = np.array(self._lp.getSolution().col_value)
        if found.shape == self._solution.shape and np.isfinite(found).all():
            self._solution = np.clip(found, 0.0, self._upper)
        # Where HiGHS has found none, it is the previous one.
        visits = np.zeros((len(self.team.nodes), self.team.n_levels + 1))
        visits[:, 1:] = self._solution[: self._n_prices].reshape(visits[:, 1:].shape)
        return self._solution, visits, value

    def cut_configurations(self, prices: FloatArray, solution: FloatArray) -> int:
        """Add the worst violated configuration of each node; return how many rows are new."""
        left = self.team.beside(prices)
        worst = left.argmax(axis=1)
        over = left[np.arange(len(left)), worst] - solution[self._n_prices : self.first_other]
        known, n = {*self.rows}, 0
        for node in np.flatnonzero(over > CUT).tolist():
            if ("gains", node, int(worst[node])) not in known:
                self.add_configuration(node, int(worst[node]))
                n += 1
        return n

    def tight(self) -> list[Hashable]:
        """Return the names of the rows that the last solution fulfils with equality."""
        value = np.array(self._lp.getSolution().row_value)
        if len(value) != len(self.rows):  # no solution
            return []
        is_tight = value <= np.array(self._least) + CUT
        return [name for name, kept in zip(self.rows, is_tight, strict=True) if kept and name]

    def used(self) -> list[Hashable]:
        """Return the names of rows that make up the last solution, the most used first."""
        duals = np.array(self._lp.getSolution().row_dual)
        if len(duals) != len(self.rows):  # no solution
            return []
        order = np.argsort(-duals, kind="stable").tolist()
        return [name for i in order if duals[i] > CUT and (name := self.rows[i])]
