"""Algorithms for BOTOHE problems, the registry that makes them by name, and samplings for them.

Names are imported when they are first used: each algorithm loads what it needs itself.
"""

from typing import TYPE_CHECKING

from botohe_moo.base.runtime import lazy_names

if TYPE_CHECKING:
    from botohe_moo.algorithms.annealing.algorithm import SimulatedAnnealing as SimulatedAnnealing
    from botohe_moo.algorithms.base import ArchiveAlgorithm as ArchiveAlgorithm
    from botohe_moo.algorithms.bo_aco.algorithm import BOACO as BOACO
    from botohe_moo.algorithms.bo_aco.algorithm import RandomTrails as RandomTrails
    from botohe_moo.algorithms.exact.algorithm import Exact as Exact
    from botohe_moo.algorithms.exact.front import TooLargeError as TooLargeError
    from botohe_moo.algorithms.exact.front import exact_front as exact_front
    from botohe_moo.algorithms.genetic.algorithms import PlanMOEAD as PlanMOEAD
    from botohe_moo.algorithms.genetic.algorithms import PlanNSGA2 as PlanNSGA2
    from botohe_moo.algorithms.genetic.algorithms import PlanSMSEMOA as PlanSMSEMOA
    from botohe_moo.algorithms.genetic.algorithms import PlanSPEA2 as PlanSPEA2
    from botohe_moo.algorithms.genetic.population import PopulationAlgorithm as PopulationAlgorithm
    from botohe_moo.algorithms.genetic.sampling import CornerSampling as CornerSampling
    from botohe_moo.algorithms.genetic.sampling import GivenSampling as GivenSampling
    from botohe_moo.algorithms.genetic.sampling import GuidedTrailSampling as GuidedTrailSampling
    from botohe_moo.algorithms.genetic.sampling import MixedSampling as MixedSampling
    from botohe_moo.algorithms.genetic.sampling import PlanSampling as PlanSampling
    from botohe_moo.algorithms.genetic.sampling import RandomTrailSampling as RandomTrailSampling
    from botohe_moo.algorithms.greedy.algorithm import Greedy as Greedy
    from botohe_moo.algorithms.local_search.algorithm import ParetoLocalSearch as ParetoLocalSearch
    from botohe_moo.algorithms.registry import algorithm_names as algorithm_names
    from botohe_moo.algorithms.registry import make_algorithm as make_algorithm
    from botohe_moo.base.parameters import SameResult as SameResult

__getattr__, __dir__, __all__ = lazy_names(__name__)
