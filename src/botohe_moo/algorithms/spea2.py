"""SPEA2 with operators for trail plans."""

from functools import partial

from pymoo.algorithms.moo.spea2 import SPEA2, SPEA2Survival

from botohe_moo.algorithms.population import PlanGeneticAlgorithm


class PlanSPEA2(PlanGeneticAlgorithm, SPEA2):
    """SPEA2 with operators for trail plans.

    Its parameters are ``pop_size``, ``n_offsprings`` (plans that a generation adds, by default
    ``pop_size``) and those of :class:`PopulationAlgorithm`.

    Notes
    -----
    Zitzler, Laumanns and Thiele, "SPEA2: improving the strength Pareto evolutionary algorithm",
    TIK report 103, ETH Zurich, 2001.

    Examples
    --------
    >>> from pymoo.optimize import minimize
    >>> from botohe_moo import BOTOHE, area_indicator, load_mission
    >>> from botohe_moo.algorithms import PlanSPEA2
    >>> toy = load_mission("toy")
    >>> algorithm = PlanSPEA2(pop_size=20, crossover="splice")
    >>> result = minimize(BOTOHE(toy), algorithm, ("n_eval", 200), seed=1)
    >>> area_indicator(-result.F, toy) > 0.5
    True
    """

    _new_survival = staticmethod(partial(SPEA2Survival, normalize=True))
