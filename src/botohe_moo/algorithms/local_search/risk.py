"""Local search for the mean reward of the worst scenarios."""

from __future__ import annotations

from typing import Any

import numpy as np

from botohe_moo.algorithms.base import PlanArchive
from botohe_moo.algorithms.local_search.engine import Costs, Islands
from botohe_moo.base.types import FloatArray
from botohe_moo.core.world import World
from botohe_moo.problem import BOTOHE

_TURN = 1_000  # evaluations with the same weights of scenarios, or as many as there are plans
_MIXED = 12  # plans whose worst scenarios are weighed together


class WorstScenarios(Islands):
    """A search whose plans are as good as can be in their own worst scenarios.

    The mean of the worst scenarios is the least mean over all weights of scenarios that are at most
    1 / risk times their probabilities (Artzner, Delbaen, Eber and Heath, "Coherent measures of
    risk", Mathematical Finance 9(3), 1999). In turns, one search begins with all plans of the
    ``archive``, and its rewards have other weights: a random mean of those at which some plans of
    the archive are the worst. What it finds enters the archive by what it is worth to the
    ``problem``. Other arguments are those of :class:`Islands`.
    """

    def __init__(self, problem: BOTOHE, archive: PlanArchive, **given: Any) -> None:
        super().__init__(problem.mission, problem.world, **given)
        self._problem, self._archive = problem, archive
        self._random_state: np.random.Generator = given["random_state"]

    def run(self, n_evaluations: int) -> int:
        """Search in turns; return how many plans were evaluated, as :meth:`Islands.run` does.

        The plans with which a turn begins do not count again.
        """
        search, n = self.first, 0
        while n < n_evaluations:
            search.costs = Costs(_weighted(self._problem.world, self._weights()))
            search.restart()
            search.insert(self._archive.plans)
            before = search.version
            found = search.run(min(n_evaluations - n, max(_TURN, len(self._archive))))
            if found == 0:
                break
            n += found
            batch, _, numbers = search.plans()
            batch = batch.take(np.flatnonzero(numbers >= before))
            self._archive.insert(batch, -self._problem.evaluate_batch(batch))
        return n

    def _weights(self) -> FloatArray:
        """Return weights of the scenarios (n_scenarios)."""
        rows = np.unique(self._random_state.integers(len(self._archive), size=_MIXED))
        worst = self._problem.worst_weights(self._archive.plans.take(rows))
        weights: FloatArray = worst @ self._random_state.dirichlet(np.ones(len(rows)))
        return weights


def _weighted(world: World, weights: FloatArray) -> World:
    """Return a world whose rewards have these weights of scenarios; survivals keep theirs."""
    graph, team = world.graph, world.team
    worth = team.worth.reshape(graph.n_scenarios, -1) * (weights / graph.probability)[:, None]
    graph = graph._replace(reward=worth.sum(axis=0)[team.origin] * team.share)
    return world._replace(graph=graph, team=team._replace(worth=worth.ravel()))
