"""Pareto local search of the plans of another algorithm's iterations."""

import numpy as np

from botohe_moo._base.types import FloatArray, OffsetArray
from botohe_moo.algorithms.local_search.engine import LocalSearch
from botohe_moo.core.world import World
from botohe_moo.mission.model import Mission
from botohe_moo.trails import PlanBatch


class IterationSearch:
    """A local search that improves a share, in (0, 1], of the plans of an algorithm's iterations.

    It spends ``evaluations_each``, at least 1, on each of them. The search's own generator takes
    its seed from ``random_state``.
    """

    def __init__(
        self,
        mission: Mission,
        world: World,
        *,
        share: float,
        evaluations_each: int,
        random_state: np.random.Generator,
    ) -> None:
        self.share = share
        self.evaluations_each = evaluations_each
        self._search = LocalSearch(mission, world, random_state=random_state)

    def improve(
        self, batch: PlanBatch, members: OffsetArray, random_state: np.random.Generator, n_left: int
    ) -> tuple[PlanBatch, FloatArray, int]:
        """Start a Pareto local search from some of the iteration's plans.

        Plans of its Pareto set, ``members``, are drawn first by ``random_state``, then others.
        ``n_left`` is how many evaluations are left.

        Returns the plans of the search's front that it has found itself, their E[R] and E[S]
        (n, 2), and how many plans it has evaluated.
        """
        n_chosen = max(1, round(self.share * len(batch)))
        chosen = random_state.permutation(members)[:n_chosen]
        if len(chosen) < n_chosen:
            others = np.setdiff1d(np.arange(len(batch)), members)
            drawn = random_state.permutation(others)[: n_chosen - len(chosen)]
            chosen = np.concatenate([chosen, drawn])
        search = self._search
        search.restart()
        search.insert(batch.take(np.sort(chosen)))
        n_given = search.version
        n_evaluated = search.run(min(n_left, n_chosen * self.evaluations_each))
        plans, objectives, numbers = search.plans()
        found = numbers >= n_given
        return plans.take(found), objectives[found], n_evaluated
