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
    from botohe_moo.mission import Mission, MissionError, load_mission, mission_names, save_mission
    from botohe_moo.outcomes import plan_outcomes
    from botohe_moo.plots import plot_front, plot_mission
    from botohe_moo.problem import BOTOHE
    from botohe_moo.solution import Solution, read_solution
    from botohe_moo.solving import solve
    from botohe_moo.trails import TrailPlan

__all__ = [
    "BOACO",
    "BOTOHE",
    "Exact",
    "Greedy",
    "Mission",
    "MissionError",
    "ParetoLocalSearch",
    "RandomTrails",
    "SimulatedAnnealing",
    "Solution",
    "TrailPlan",
    "algorithm_names",
    "area_indicator",
    "load_mission",
    "make_algorithm",
    "mission_names",
    "plan_outcomes",
    "plot_front",
    "plot_mission",
    "read_solution",
    "save_mission",
    "solve",
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
    ".indicators": ("area_indicator",),
    ".mission": ("Mission", "MissionError", "load_mission", "mission_names", "save_mission"),
    ".outcomes": ("plan_outcomes",),
    ".plots": ("plot_front", "plot_mission"),
    ".problem": ("BOTOHE",),
    ".solution": ("Solution", "read_solution"),
    ".solving": ("solve",),
    ".trails": ("TrailPlan",),
}
# Names that were here once and now belong to the modules that have them.
_MOVED = {
    ".mission": ("PlanError", "read_mission"),
    ".outcomes": (
        "Distribution",
        "Outcomes",
        "reward_distribution",
        "simulate",
        "survivors_distribution",
    ),
    ".problem": ("FrontOutput",),
    ".search.exact": ("TooLargeError", "exact_front"),
    ".search.sequential": ("plan_sequentially",),
    ".trails": ("PlanBatch",),
}
__getattr__, __dir__ = lazy_names(__name__, _HOMES, _MOVED)
