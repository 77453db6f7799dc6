"""NSGA-II with operators for trail plans."""

from __future__ import annotations

from typing import Any

from pymoo.algorithms.moo.nsga2 import NSGA2
from pymoo.operators.survival.rank_and_crowding import RankAndCrowding

from botohe_moo.algorithms.population import PopulationAlgorithm, genetic_sizes

__all__ = ["PlanNSGA2"]


class PlanNSGA2(PopulationAlgorithm, NSGA2):
    """NSGA-II with operators for trail plans.

    Parameters
    ----------
    pop_size
        Plans in the population, at least 2.
    n_offsprings
        Plans that a generation adds, at least 1; default: as many as the population holds.
    **options
        Operators, as for :class:`PopulationAlgorithm`, and pymoo's own options.

    Raises
    ------
    ValueError
        If a parameter is out of its range, or a name unknown.
    TypeError
        If an option is unknown, or the problem is not a :class:`BOTOHE`.

    Notes
    -----
    Deb, Pratap, Agarwal and Meyarivan, "A fast and elitist multiobjective genetic algorithm:
    NSGA-II", IEEE Transactions on Evolutionary Computation 6(2), 2002.

    Examples
    --------
    >>> from pymoo.optimize import minimize
    >>> from botohe_moo import BOTOHE, load_mission
    >>> algorithm = PlanNSGA2(pop_size=50, mutation="ruin")
    >>> result = minimize(BOTOHE(load_mission("art_museum")), algorithm, ("n_eval", 120), seed=1)
    >>> result.algorithm.evaluator.n_eval
    120
    """

    def __init__(
        self, *, pop_size: int = 100, n_offsprings: int | None = None, **options: Any
    ) -> None:
        arguments = genetic_sizes(pop_size, n_offsprings)
        super().__init__({**arguments, "survival": RankAndCrowding()}, **options)
