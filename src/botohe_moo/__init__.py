"""Bi-objective team orienteering in hazardous environments (BOTOHE), for pymoo.

Names are imported when they are first used, so that ``import botohe_moo`` and the command line's
``--help`` do not wait for numba and pandas.
"""

from typing import TYPE_CHECKING

from botohe_moo._base.lazy import lazy_names

if TYPE_CHECKING:
    from botohe_moo.algorithms import (
        BOACO,
        Exact,
        Greedy,
        ParetoLocalSearch,
        RandomTrails,
        SimulatedAnnealing,
        algorithm_names,
        make_algorithm,
    )
    from botohe_moo.indicators import area_indicator
    from botohe_moo.mission import (
        Mission,
        MissionError,
        PlanError,
        load_mission,
        mission_names,
        read_mission,
        save_mission,
    )
    from botohe_moo.outcomes.distribution import Distribution
    from botohe_moo.outcomes.outcomes import (
        Outcomes,
        plan_outcomes,
        reward_distribution,
        simulate,
        survivors_distribution,
    )
    from botohe_moo.plots import plot_front, plot_mission
    from botohe_moo.problem import BOTOHE, FrontOutput
    from botohe_moo.search.exact import TooLargeError, exact_front
    from botohe_moo.search.sequential import plan_sequentially
    from botohe_moo.trails import PlanBatch, TrailPlan

__all__ = [
    "BOACO",
    "BOTOHE",
    "Distribution",
    "Exact",
    "FrontOutput",
    "Greedy",
    "Mission",
    "MissionError",
    "Outcomes",
    "ParetoLocalSearch",
    "PlanBatch",
    "PlanError",
    "RandomTrails",
    "SimulatedAnnealing",
    "TooLargeError",
    "TrailPlan",
    "algorithm_names",
    "area_indicator",
    "exact_front",
    "load_mission",
    "make_algorithm",
    "mission_names",
    "plan_outcomes",
    "plan_sequentially",
    "plot_front",
    "plot_mission",
    "read_mission",
    "reward_distribution",
    "save_mission",
    "simulate",
    "survivors_distribution",
]

_HOMES = {
    ".algorithms": (
        "BOACO",
        "Exact",
        "Greedy",
        "ParetoLocalSearch",
        "RandomTrails",
        "SimulatedAnnealing",
        "algorithm_names",
        "make_algorithm",
    ),
    ".outcomes.distribution": ("Distribution",),
    ".search.exact": ("TooLargeError", "exact_front"),
    ".indicators": ("area_indicator",),
    ".mission": (
        "Mission",
        "MissionError",
        "PlanError",
        "load_mission",
        "mission_names",
        "read_mission",
        "save_mission",
    ),
    ".outcomes.outcomes": (
        "Outcomes",
        "plan_outcomes",
        "reward_distribution",
        "simulate",
        "survivors_distribution",
    ),
    ".plots": ("plot_front", "plot_mission"),
    ".problem": ("BOTOHE", "FrontOutput"),
    ".search.sequential": ("plan_sequentially",),
    ".trails": ("PlanBatch", "TrailPlan"),
}
__getattr__, __dir__ = lazy_names(__name__, _HOMES)
