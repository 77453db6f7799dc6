"""Duplicate elimination in linear time."""

from pymoo.core.duplicate import DuplicateElimination
from pymoo.core.population import Population

from botohe_moo._base.types import ObjectArray


class PlanDuplicates(DuplicateElimination):
    """Drop plans that have the same multiset of trails as another.

    By hash, in linear time, where pymoo's own elimination compares every pair. The order of the
    robots does not matter.

    Examples
    --------
    >>> import numpy as np
    >>> from pymoo.core.population import Population
    >>> from botohe_moo import TrailPlan
    >>> from botohe_moo.operators import PlanDuplicates
    >>> plans = np.empty((2, 1), object)
    >>> plans[:, 0] = TrailPlan([[0, 1, 0], [0]]), TrailPlan([[0], [0, 1, 0]])  # the same robots
    >>> len(PlanDuplicates().do(Population.new("X", plans)))
    1
    """

    def _do(
        self, pop: Population, other: Population | None, is_duplicate: ObjectArray
    ) -> ObjectArray:
        seen = set() if other is None else {individual.X[0] for individual in other}
        for i, individual in enumerate(pop):
            plan = individual.X[0]
            if plan in seen:
                is_duplicate[i] = True
            elif other is None:
                seen.add(plan)
        return is_duplicate
