"""Local search for the mean reward of the worst scenarios."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from botohe_moo.algorithms.base import PlanArchive
from botohe_moo.algorithms.local_search.engine import Islands, LocalSearchSettings
from botohe_moo.base.types import FloatArray, Rng
from botohe_moo.core.world import World
from botohe_moo.operators import RuinRecreate
from botohe_moo.problem import BOTOHE
from botohe_moo.trails import PlanBatch

# Evaluations with the same weights of scenarios, or as many as the archive has plans, if these are
# more; and the share of them that children of single plans get.
_TURN, _SHARE = 1_000, 0.3
_MIXED = 12  # plans whose worst scenarios are weighed together


class WorstScenarios(Islands):
    """A search whose plans are as good as can be in their own worst scenarios.

    The mean of the worst scenarios is the least mean over all weights of scenarios that are at most
    1 / risk times their probabilities (Artzner, Delbaen, Eber and Heath, "Coherent measures of
    risk", Mathematical Finance 9(3), 1999). In turns, one search begins with all plans of the
    ``archive``, and its rewards have other weights: a random mean of the weights at which some
    plans of the archive are worth least. What it finds enters the archive by what it is worth to
    the ``problem``. Plans that are good in all scenarios, but best under no weights, are found
    otherwise: each turn ends with children of plans of the archive, ruined and recreated.
    """

    def __init__(
        self,
        problem: BOTOHE,
        archive: PlanArchive,
        *,
        random_state: Rng,
        settings: LocalSearchSettings,
    ) -> None:
        super().__init__(
            problem.mission,
            problem.world,
            n_threads=1,
            random_state=random_state,
            settings=replace(settings, n_islands=1, max_size=None),
        )
        self._problem, self._archive, self._random_state = problem, archive, random_state
        self._ruin = RuinRecreate()

    def run(self, n_evaluations: int) -> int:
        """Search in turns; return how many plans were evaluated.

        The plans with which a turn begins do not count again.
        """
        search, mission, n = self.first, self._problem.mission, 0
        while n < n_evaluations:
            turn = min(n_evaluations - n, max(_TURN, len(self._archive)))
            n_children = int(_SHARE * turn)
            search.change_rewards(_weighted(self._problem.world, self._weights()))
            search.insert(self._archive.plans)
            before = search.version
            found = search.run(turn - n_children)
            if found == 0:  # no move makes another plan
                break
            batch, _, numbers = search.plans()
            self._add(batch.take(np.flatnonzero(numbers >= before)))
            rows = self._random_state.integers(len(self._archive), size=n_children)
            parents = self._archive.plans.take(rows)
            self._add(self._ruin.mutate_batch(mission, parents, self._random_state))
            n += found + n_children
        return n

    def _add(self, batch: PlanBatch) -> None:
        """Put plans that keep the limits into the archive."""
        if self._problem.n_ieq_constr:
            kept = (self._problem.constrain_batch(batch) <= 0).all(axis=1)
            batch = batch.take(np.flatnonzero(kept))
        self._archive.insert(batch, -self._problem.evaluate_batch(batch))

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
