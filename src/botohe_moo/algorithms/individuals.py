"""Archives whose plans can be read as a population of pymoo's."""

from collections.abc import Callable, Sequence
from typing import Self

import moocore
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
        constrain: Callable[[PlanBatch], FloatArray] | None = None,
    ) -> None:
        super().__init__(n_robots, max_ties=max_ties)
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


class ManyObjectiveArchive:
    """An archive like :class:`PopulationArchive`, for more than two objectives."""

    def __init__(self, n_robots: int, *, max_ties: int = 1_000) -> None:
        self.n_robots = n_robots
        self.max_ties = max_ties
        self._members = Population()

    def __len__(self) -> int:
        return len(self._members)

    @property
    def objectives(self) -> FloatArray:
        """The objectives of each plan, to be maximised (n, n_objectives)."""
        return np.asarray(-self._members.get("F"), np.float64)

    @property
    def plans(self) -> PlanBatch:
        """The plans, in the order of ``objectives``."""
        return PlanBatch.from_plans([each.X[0] for each in self._members], self.n_robots)

    def insert(
        self, batch: PlanBatch, objectives: FloatArray, individuals: Sequence[Individual]
    ) -> None:
        """Insert evaluated plans that the archive does not dominate, each plan once."""
        del batch, objectives  # pymoo's individuals have both
        first = {each.X[0]: each for each in [*self._members, *individuals][::-1]}
        candidates = Population.create(*[*first.values()][::-1])
        F = candidates.get("F")
        kept = moocore.is_nondominated(F, keep_weakly=True)
        candidates, F = candidates[kept], F[kept]
        # Of plans with equal objectives, the first ``max_ties`` stay.
        _, groups = np.unique(F, axis=0, return_inverse=True)
        by_group = np.argsort(groups, kind="stable")
        starts = np.searchsorted(groups[by_group], groups[by_group])
        rank = np.empty(len(F), np.int64)
        rank[by_group] = np.arange(len(F)) - starts
        self._members = candidates[rank < self.max_ties]

    def add(self, infills: Population) -> Self:  # noqa: ARG002
        """Return the archive itself, as :meth:`PopulationArchive.add` does."""
        return self

    def population(self) -> Population:
        """Return the plans as pymoo's individuals."""
        return self._members


def _individual(
    plan: TrailPlan, objectives: FloatArray, constraints: FloatArray | None
) -> Individual:
    """Return an evaluated individual of pymoo's, which minimises."""
    individual = Individual(X=np.array([plan], dtype=object), F=-objectives)
    if constraints is not None:
        individual.set("G", constraints)
    individual.evaluated.update(("F", "G", "H"))
    return individual
