"""MOEA/D with operators for trail plans."""

from __future__ import annotations

from typing import Annotated, Any

import numpy as np
from pydantic import Field
from pymoo.algorithms.moo.moead import ParallelMOEAD
from pymoo.core.individual import Individual
from pymoo.core.population import Population
from pymoo.decomposition.tchebicheff import Tchebicheff

from botohe_moo._base.types import FloatArray
from botohe_moo._plugins.checks import checked
from botohe_moo._plugins.types import Probability
from botohe_moo.algorithms.population import PopulationAlgorithm, PopulationSize, even_weights
from botohe_moo.problem import BOTOHE


class _BoundedTchebicheff(Tchebicheff):
    """Tchebicheff with each objective measured by its bound."""

    def __init__(self, bounds: FloatArray) -> None:
        super().__init__()
        self.bounds = bounds

    def _do(self, F: FloatArray, weights: FloatArray, **_: Any) -> FloatArray:
        distances: FloatArray = np.abs(F - self.utopian_point) / self.bounds * weights
        return np.asarray(distances.max(axis=1))


class PlanMOEAD(PopulationAlgorithm, ParallelMOEAD):
    """MOEA/D with operators for trail plans.

    The weights are spread evenly. Objectives are divided by their bounds, total reward and team
    size. A feasible plan replaces an infeasible one; of two infeasible plans, the one with the
    smaller violation replaces the other. This is pymoo's ``ParallelMOEAD``, since ``MOEAD`` cannot
    be pickled within a run.

    Parameters
    ----------
    pop_size
        Weights, and plans in the population.
    n_neighbors
        Neighbouring weights whose plans mate, and whose plan a child may replace; at most
        ``pop_size``.
    prob_neighbor_mating
        Probability of mating among neighbours rather than all.
    **options
        Operators, as for :class:`PopulationAlgorithm`, and pymoo's own options.

    Notes
    -----
    Zhang and Li, "MOEA/D: a multiobjective evolutionary algorithm based on decomposition", IEEE
    Transactions on Evolutionary Computation 11(6), 2007; constraints as in Jan and Khanum, "A
    study of two penalty-parameterless constraint handling techniques in the framework of MOEA/D",
    Applied Soft Computing 13(1), 2013.

    Examples
    --------
    >>> from pymoo.optimize import minimize
    >>> from botohe_moo import BOTOHE, area_indicator, load_mission
    >>> from botohe_moo.algorithms import PlanMOEAD
    >>> toy = load_mission("toy")
    >>> algorithm = PlanMOEAD(pop_size=20)
    >>> result = minimize(BOTOHE(toy), algorithm, ("n_eval", 200), seed=1)
    >>> area_indicator(-result.F, toy) > 0.5
    True
    """

    # pymoo draws one of each mating's children, but from pools that mix matings.
    _n_children = 1

    indices: Any

    @checked
    def __init__(
        self,
        *,
        pop_size: PopulationSize = 100,
        n_neighbors: Annotated[int, Field(ge=2)] = 20,
        prob_neighbor_mating: Probability = 0.9,
        **options: Any,
    ) -> None:
        arguments = {
            "ref_dirs": even_weights(pop_size),
            "n_neighbors": min(n_neighbors, pop_size),
            "prob_neighbor_mating": prob_neighbor_mating,
        }
        super().__init__(arguments, **options)

    def _setup(self, problem: BOTOHE, **_: Any) -> None:
        distances = np.abs(self.ref_dirs[:, :1] - self.ref_dirs[:, 0])
        self.neighbors = np.argsort(distances, axis=1, kind="stable")[:, : self.n_neighbors]
        bounds = np.array(problem.objective_bounds, np.float64)
        self.decomposition = _BoundedTchebicheff(np.where(bounds > 0, bounds, 1.0))

    def _initialize_advance(self, infills: Population, **kwargs: Any) -> None:
        super()._initialize_advance(infills, **kwargs)
        self._update_ideal()
        if len(infills) <= self.pop_size:
            return
        # More plans to start from than weights: each weight takes its best.
        best = infills[infills.get("CV")[:, 0] == infills.get("CV").min()]
        values = self.decomposition.do(
            best.get("F"), self.ref_dirs, _type="many_to_many", ideal_point=self.ideal
        )
        self.pop = best[values.argmin(axis=0)]

    def infill(self) -> Population | None:
        """Return the plans to evaluate next, no more than the budget allows."""
        infills = super().infill()
        if infills is not None and self.indices is not None:
            self.indices = self.indices[: len(infills)]
        return infills

    def _advance(self, infills: Population, **_: Any) -> None:
        self._update_ideal()
        for weight, child in zip(self.indices, infills, strict=True):
            self._replace(weight, child)

    def _update_ideal(self) -> None:
        """Set the ideal point to that of the archive; pymoo's includes infeasible plans."""
        if len(self.archive):
            self.ideal = -self.archive.objectives.max(axis=0)

    def _replace(self, weight: int, child: Individual) -> None:
        """Put a child in the place of each plan of neighbouring weights that is worse than it."""
        near = self.neighbors[weight]
        rivals, weights = self.pop[near], self.ref_dirs[near]
        values = self.decomposition.do(rivals.get("F"), weights, ideal_point=self.ideal)
        value = self.decomposition.do(child.F[np.newaxis], weights, ideal_point=self.ideal)
        violations, violation = rivals.get("CV")[:, 0], child.CV[0]
        better = (violation < violations) | ((violation == violations) & (value < values))
        self.pop[near[better]] = child
