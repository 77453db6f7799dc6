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

    Examples
    --------
    >>> from pymoo.optimize import minimize
    >>> from botohe_moo import BOTOHE, area_indicator, load_mission
    >>> from botohe_moo.algorithms import PlanSMSEMOA
    >>> toy = load_mission("toy")
    >>> algorithm = PlanSMSEMOA(pop_size=20, mutation={"ruin": 2, "moves": 1})
    >>> result = minimize(BOTOHE(toy), algorithm, ("n_eval", 200), seed=1)
    >>> area_indicator(-result.F, toy) > 0.5
    True
    """

    _new_survival = LeastHypervolumeContributionSurvival
