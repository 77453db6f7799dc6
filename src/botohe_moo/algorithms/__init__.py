"""Algorithms for BOTOHE problems, and the registry that makes them by name.

Names are imported when they are first used: each algorithm loads what it needs itself.
"""

from typing import TYPE_CHECKING

from botohe_moo._base.lazy import lazy_names

if TYPE_CHECKING:
    from botohe_moo._plugins.types import SameResult as SameResult
    from botohe_moo.algorithms.base import ArchiveAlgorithm as ArchiveAlgorithm
    from botohe_moo.algorithms.baselines import Exact as Exact
    from botohe_moo.algorithms.baselines import Greedy as Greedy
    from botohe_moo.algorithms.baselines import RandomTrails as RandomTrails
    from botohe_moo.algorithms.bo_aco import BOACO as BOACO
    from botohe_moo.algorithms.genetic import PlanNSGA2 as PlanNSGA2
    from botohe_moo.algorithms.genetic import PlanSMSEMOA as PlanSMSEMOA
    from botohe_moo.algorithms.genetic import PlanSPEA2 as PlanSPEA2
    from botohe_moo.algorithms.moead import PlanMOEAD as PlanMOEAD
    from botohe_moo.algorithms.pareto_local_search import ParetoLocalSearch as ParetoLocalSearch
    from botohe_moo.algorithms.population import PopulationAlgorithm as PopulationAlgorithm
    from botohe_moo.algorithms.registry import algorithm_names as algorithm_names
    from botohe_moo.algorithms.registry import make_algorithm as make_algorithm
    from botohe_moo.algorithms.simulated_annealing import SimulatedAnnealing as SimulatedAnnealing

__getattr__, __dir__, __all__ = lazy_names(__name__)
