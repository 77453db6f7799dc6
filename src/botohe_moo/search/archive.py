"""All non-dominated plans an algorithm has found, held in arrays."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
from pymoo.core.individual import Individual
from pymoo.core.population import Population

from botohe_moo._base.types import FloatArray, IntArray, OffsetArray, SeedArray
from botohe_moo.kernels.fronts import archive as kernels
from botohe_moo.trails import PlanBatch, TrailPlan

__all__ = ["PlanArchive"]


class PlanArchive:
    """Non-dominated plans by descending expected reward.

    Plans with equal objectives but different trails stay; repeated plans are dropped.

    Parameters
    ----------
    n_robots
        Trails per plan.
    max_ties
        Plans with equal objectives that are kept, the first ones found.
    constrain
        Gives the constraints G of a batch (n, n_ieq_constr), for ``population``.
    """

    def __init__(
        self,
        n_robots: int,
        *,
        max_ties: int = 1_000,
        constrain: Callable[[PlanBatch], FloatArray] | None = None,
    ) -> None:
        self.n_robots = n_robots
        self.max_ties = max_ties
        self._constrain = constrain
        self._objectives: FloatArray = np.empty((0, 2))
        self._hashes: SeedArray = np.empty(0, np.uint64)
        self._ids: OffsetArray = np.empty(0, np.int64)
        self._nodes: IntArray = np.empty(0, np.int32)
        self._offsets: OffsetArray = np.zeros(1, np.int64)
        self._next_id = 0
        self._individuals: dict[int, Individual] = {}
        self._population: Population | None = None

    def __len__(self) -> int:
        return len(self._ids)

    @property
    def objectives(self) -> FloatArray:
        """E[R] and E[S] of each plan, to be maximised (n, 2); read-only."""
        view = self._objectives.view()
        view.flags.writeable = False
        return view

    @property
    def plans(self) -> PlanBatch:
        """A copy of the plans, in the order of ``objectives``."""
        return PlanBatch._wrap(self._nodes.copy(), self._offsets.copy(), self.n_robots)

    @property
    def version(self) -> int:
        """Changes whenever the archive does: the number of plans that ever entered."""
        return self._next_id

    def absorb(
        self,
        batch: PlanBatch,
        objectives: FloatArray,
        individuals: Sequence[Individual] | None = None,
    ) -> OffsetArray:
        """Take in what the archive does not dominate.

        Parameters
        ----------
        batch
            Newly evaluated plans.
        objectives
            Their E[R] and E[S] (n, 2).
        individuals
            The same plans as pymoo knows them, where it does; ``population`` gives these.

        Returns
        -------
        numpy.ndarray
            Indices of the batch's own Pareto set.
        """
        (
            members,
            entered,
            self._objectives,
            self._hashes,
            self._ids,
            self._nodes,
            self._offsets,
        ) = kernels.absorb(
            objectives,
            batch.nodes,
            batch.offsets,
            self.n_robots,
            self._objectives,
            self._hashes,
            self._ids,
            self._nodes,
            self._offsets,
            self._next_id,
            self.max_ties,
        )
        if len(entered):
            if individuals is not None:
                known = {self._next_id + i: individuals[j] for i, j in enumerate(entered.tolist())}
                self._individuals.update(known)
            self._next_id += len(entered)
            self._population = None
        return members

    def population(self) -> Population:
        """Give the plans as pymoo knows them.

        Individuals are made when somebody looks, once for every plan that is in the archive then:
        handing pymoo new ones every iteration would cost more than the iteration itself.
        """
        if self._population is None:
            known, keys, plans = self._individuals, self._ids.tolist(), self.plans
            constraints = None if self._constrain is None else self._constrain(plans)
            self._individuals = {
                key: known.get(key)
                or _individual(
                    plans[i], self._objectives[i], None if constraints is None else constraints[i]
                )
                for i, key in enumerate(keys)
            }
            self._population = Population.create(*self._individuals.values())
        return self._population


def _individual(
    plan: TrailPlan, objectives: FloatArray, constraints: FloatArray | None
) -> Individual:
    x = np.empty(1, dtype=object)
    x[0] = plan
    individual = Individual(X=x, F=-objectives)
    if constraints is not None:
        individual.set("G", constraints)
    individual.evaluated.update(("F", "G", "H"))
    return individual
