"""NSGA-II with operators for trail plans."""

from pymoo.algorithms.moo.nsga2 import NSGA2
from pymoo.operators.survival.rank_and_crowding import RankAndCrowding

from botohe_moo.algorithms.population import PlanGeneticAlgorithm


class PlanNSGA2(PlanGeneticAlgorithm, NSGA2):
    """NSGA-II with operators for trail plans.

    Its parameters are ``pop_size``, ``n_offsprings`` (plans that a generation adds, by default
    ``pop_size``) and those of :class:`PopulationAlgorithm`.

    Notes
    -----
    Deb, Pratap, Agarwal and Meyarivan, "A fast and elitist multiobjective genetic algorithm:
    NSGA-II", IEEE Transactions on Evolutionary Computation 6(2), 2002.

    Examples
    --------
    >>> from pymoo.optimize import minimize
    >>> from botohe_moo import BOTOHE, load_mission
    >>> from botohe_moo.algorithms import PlanNSGA2
    >>> algorithm = PlanNSGA2(pop_size=50, mutation="ruin")
    >>> result = minimize(BOTOHE(load_mission("art_museum")), algorithm, ("n_eval", 120), seed=1)
    >>> result.algorithm.evaluator.n_eval
    120
    """

    _new_survival = RankAndCrowding
