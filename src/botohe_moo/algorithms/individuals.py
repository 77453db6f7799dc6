"""Archives whose plans can be read as a population of pymoo's."""

from collections.abc import Callable, Sequence
from typing import Self

import numpy as np
from pymoo.core.individual import Individual
from pymoo.core.population import Population

from botohe_moo.algorithms.archive import PlanArchive
from botohe_moo.base.types import FloatArray, OffsetArray
from botohe_moo.trails import PlanBatch, TrailPlan


class PopulationArchive(PlanArchive):
    """An archive that makes pymoo's individuals when they are read.

    To make them in every iteration would cost more than the iteration itself. ``constrain``
    returns the constraints G of a batch (n, n_ieq_constr).
    """

    def __init__(
        self,
        n_robots: int,
        *,
        max_ties: int = 1_000,
        n_objectives: int = 2,
        constrain: Callable[[PlanBatch], FloatArray] | None = None,
    ) -> None:
        super().__init__(n_robots, max_ties=max_ties, n_objectives=n_objectives)
        self._constrain = constrain
        self._individuals: dict[int, Individual] = {}
        self._population, self._made = Population(), 0  # when ``version`` was that

    def insert(
        self,
        batch: PlanBatch,
        objectives: FloatArray,
        individuals: Sequence[Individual] | None = None,
    ) -> OffsetArray:
        """Insert evaluated plans that the archive does not dominate, as :class:`PlanArchive` does.

        ``individuals`` are the same plans as pymoo's individuals, if there are any; ``population``
        then returns these.
        """
        first, members = self.version, super().insert(batch, objectives)
        if individuals is not None:
            ids = self.arrays.ids
            self._individuals |= {i: individuals[i - first] for i in ids[ids >= first].tolist()}
        return members

    def add(self, infills: Population) -> Self:  # noqa: ARG002
        """Return the archive itself: pymoo calls this after an iteration."""
        return self

    def population(self) -> Population:
        """Return the plans as pymoo's individuals, which are made once for every plan."""
        if self._made != self.version:
            known, plans, objectives = self._individuals, self.plans, self.objectives
            constraints = [None] * len(plans) if not self._constrain else self._constrain(plans)
            self._individuals = {
                key: known.get(key) or _individual(plans[i], objectives[i], constraints[i])
                for i, key in enumerate(self.arrays.ids.tolist())
            }
            self._population = Population.create(*self._individuals.values())
            self._made = self.version
        return self._population


def _individual(
    plan: TrailPlan, objectives: FloatArray, constraints: FloatArray | None
) -> Individual:
    """Return an evaluated individual of pymoo's, which minimises."""
    individual = Individual(X=np.array([plan], dtype=object), F=-objectives)
    if constraints is not None:
        individual.set("G", constraints)
    individual.evaluated.update(("F", "G", "H"))
    return individual
