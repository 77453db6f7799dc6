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
    """

    _new_survival = staticmethod(partial(SPEA2Survival, normalize=True))
