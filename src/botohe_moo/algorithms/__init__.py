"""Algorithms for BOTOHE problems, and the registry that makes them by name.

Names are imported when they are first used: each algorithm loads what it needs itself.
"""

from typing import TYPE_CHECKING

from botohe_moo._base.lazy import lazy_names

if TYPE_CHECKING:
    from botohe_moo._plugins.types import SameResult
    from botohe_moo.algorithms.bo_aco import BOACO
    from botohe_moo.algorithms.exact import Exact
    from botohe_moo.algorithms.greedy import Greedy
    from botohe_moo.algorithms.moead import PlanMOEAD
    from botohe_moo.algorithms.nsga2 import PlanNSGA2
    from botohe_moo.algorithms.pareto_local_search import ParetoLocalSearch
    from botohe_moo.algorithms.population import PopulationAlgorithm
    from botohe_moo.algorithms.random_trails import RandomTrails
    from botohe_moo.algorithms.registry import algorithm_names, make_algorithm
    from botohe_moo.algorithms.simulated_annealing import SimulatedAnnealing
    from botohe_moo.algorithms.sms_emoa import PlanSMSEMOA
    from botohe_moo.algorithms.spea2 import PlanSPEA2

__all__ = [
    "BOACO",
    "Exact",
    "Greedy",
    "ParetoLocalSearch",
    "PlanMOEAD",
    "PlanNSGA2",
    "PlanSMSEMOA",
    "PlanSPEA2",
    "PopulationAlgorithm",
    "RandomTrails",
    "SameResult",
    "SimulatedAnnealing",
    "algorithm_names",
    "make_algorithm",
]

_HOMES = {
    "botohe_moo._plugins.types": ("SameResult",),
    ".bo_aco": ("BOACO",),
    ".exact": ("Exact",),
    ".greedy": ("Greedy",),
    ".moead": ("PlanMOEAD",),
    ".nsga2": ("PlanNSGA2",),
    ".pareto_local_search": ("ParetoLocalSearch",),
    ".population": ("PopulationAlgorithm",),
    ".random_trails": ("RandomTrails",),
    ".registry": ("algorithm_names", "make_algorithm"),
    ".simulated_annealing": ("SimulatedAnnealing",),
    ".sms_emoa": ("PlanSMSEMOA",),
    ".spea2": ("PlanSPEA2",),
}
__getattr__, __dir__ = lazy_names(__name__, _HOMES)
