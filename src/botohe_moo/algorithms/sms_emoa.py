"""SMS-EMOA with operators for trail plans."""

from __future__ import annotations

from typing import Any

from pymoo.algorithms.moo.sms import SMSEMOA, LeastHypervolumeContributionSurvival

from botohe_moo.algorithms.population import PopulationAlgorithm, genetic_sizes

__all__ = ["PlanSMSEMOA"]


class PlanSMSEMOA(PopulationAlgorithm, SMSEMOA):
    """SMS-EMOA with operators for trail plans.

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
    Beume, Naujoks and Emmerich, "SMS-EMOA: multiobjective selection based on dominated
    hypervolume", European Journal of Operational Research 181(3), 2007.
    """

    def __init__(
        self, *, pop_size: int = 100, n_offsprings: int | None = None, **options: Any
    ) -> None:
        arguments = genetic_sizes(pop_size, n_offsprings)
        survival = LeastHypervolumeContributionSurvival()
        super().__init__({**arguments, "survival": survival}, **options)
