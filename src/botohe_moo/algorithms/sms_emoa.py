"""SMS-EMOA with operators for trail plans."""

from __future__ import annotations

from pymoo.algorithms.moo.sms import SMSEMOA, LeastHypervolumeContributionSurvival

from botohe_moo.algorithms.population import PlanGeneticAlgorithm

__all__ = ["PlanSMSEMOA"]


class PlanSMSEMOA(PlanGeneticAlgorithm, SMSEMOA):
    """SMS-EMOA with operators for trail plans.

    Its parameters are those of :class:`PlanGeneticAlgorithm`.

    Notes
    -----
    Beume, Naujoks and Emmerich, "SMS-EMOA: multiobjective selection based on dominated
    hypervolume", European Journal of Operational Research 181(3), 2007.
    """

    _new_survival = LeastHypervolumeContributionSurvival
