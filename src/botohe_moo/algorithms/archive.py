"""All non-dominated plans an algorithm has found, held in arrays."""

from __future__ import annotations

import numpy as np
from pymoo.core.individual import Individual
from pymoo.core.population import Population

from botohe_moo._types import FloatArray, IntArray, OffsetArray, SeedArray
from botohe_moo.kernels import archive as kernels
from botohe_moo.trails import PlanBatch

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
    """

    def __init__(self, n_robots: int, *, max_ties: int = 1_000) -> None:
        self.n_robots = n_robots
        self.max_ties = max_ties
        self._objectives: FloatArray = np.empty((0, 2))
        self._hashes: SeedArray = np.empty(0, np.uint64)
        self._ids: OffsetArray = np.empty(0, np.int64)
        self._nodes: IntArray = np.empty(0, np.int32)
        self._arcs: IntArray = np.empty(0, np.int32)
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
    def arcs(self) -> IntArray:
        """The arc that leaves each of ``plans.nodes``, trails ending with the self-loop."""
        return self._arcs

    @property
    def offsets(self) -> OffsetArray:
        """Where each trail begins in ``arcs`` (n · n_robots + 1)."""
        return self._offsets

    @property
    def version(self) -> int:
        """Changes whenever the archive does: the number of plans that ever entered."""
        return self._next_id

    def absorb(self, batch: PlanBatch, arcs: IntArray, objectives: FloatArray) -> OffsetArray:
        """Take in what the archive does not dominate.

        Parameters
        ----------
        batch
            Newly evaluated plans.
        arcs
            The arc that leaves each of ``batch.nodes``, trails ending with the base's self-loop.
        objectives
            Their E[R] and E[S] (n, 2).

        Returns
        -------
        numpy.ndarray
            Indices of the batch's own Pareto set.
        """
        (
            members,
            n_entered,
            self._objectives,
            self._hashes,
            self._ids,
            self._nodes,
            self._arcs,
            self._offsets,
        ) = kernels.absorb(
            objectives,
            batch.nodes,
            arcs,
            batch.offsets,
            self.n_robots,
            self._objectives,
            self._hashes,
            self._ids,
            self._nodes,
            self._arcs,
            self._offsets,
            self._next_id,
            self.max_ties,
        )
        if n_entered:
            self._next_id += n_entered
            self._population = None
        return members

    def population(self) -> Population:
        """Give the plans as pymoo knows them.

        Individuals are made when somebody looks, once for every plan that is in the archive then:
        handing pymoo new ones every iteration would cost more than the iteration itself.
        """
        if self._population is None:
            known = self._individuals
            plans = self.plans
            self._individuals = {
                key: known.get(key) or _individual(plans, i, self._objectives[i])
                for i, key in enumerate(self._ids.tolist())
            }
            self._population = Population.create(*self._individuals.values())
        return self._population


def _individual(plans: PlanBatch, i: int, objectives: FloatArray) -> Individual:
    x = np.empty(1, dtype=object)
    x[0] = plans[i]
    individual = Individual(X=x, F=-objectives)
    individual.evaluated.update(("F", "G", "H"))
    return individual
