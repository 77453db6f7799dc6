"""SMS-EMOA with operators for trail plans."""

from pymoo.algorithms.moo.sms import SMSEMOA, LeastHypervolumeContributionSurvival

from botohe_moo.algorithms.population import PlanGeneticAlgorithm


class PlanSMSEMOA(PlanGeneticAlgorithm, SMSEMOA):
    """SMS-EMOA with operators for trail plans.

    Its parameters are ``pop_size``, ``n_offsprings`` (plans that a generation adds, by default
    ``pop_size``) and those of :class:`PopulationAlgorithm`.

    Notes
    -----
    Beume, Naujoks and Emmerich, "SMS-EMOA: multiobjective selection based on dominated
    hypervolume", European Journal of Operational Research 181(3), 2007.
    """

    _new_survival = LeastHypervolumeContributionSurvival
