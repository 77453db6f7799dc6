"""Bi-objective team orienteering in hazardous environments (BOTOHE), for pymoo.

Names are imported when they are first used, so that ``import botohe_moo`` and the command line's
``--help`` do not wait for numba and pandas.
"""

from typing import TYPE_CHECKING

from botohe_moo.base.runtime import lazy_names

if TYPE_CHECKING:
    from botohe_moo.algorithms import BOACO as BOACO
    from botohe_moo.algorithms import Exact as Exact
    from botohe_moo.algorithms import Greedy as Greedy
    from botohe_moo.algorithms import ParetoLocalSearch as ParetoLocalSearch
    from botohe_moo.algorithms import RandomTrails as RandomTrails
    from botohe_moo.algorithms import SimulatedAnnealing as SimulatedAnnealing
    from botohe_moo.algorithms import algorithm_names as algorithm_names
    from botohe_moo.algorithms import make_algorithm as make_algorithm
    from botohe_moo.bounds import FrontBound as FrontBound
    from botohe_moo.bounds import bound_front as bound_front
    from botohe_moo.decide import worst_case as worst_case
    from botohe_moo.indicators import area_indicator as area_indicator
    from botohe_moo.mission import Kind as Kind
    from botohe_moo.mission import Mission as Mission
    from botohe_moo.mission import MissionError as MissionError
    from botohe_moo.mission import Scenario as Scenario
    from botohe_moo.mission import independent_zones as independent_zones
    from botohe_moo.mission import load_mission as load_mission
    from botohe_moo.mission import mission_from_tables as mission_from_tables
    from botohe_moo.mission import mission_names as mission_names
    from botohe_moo.mission import rewards_from_raster as rewards_from_raster
    from botohe_moo.mission import roadmap_from_map as roadmap_from_map
    from botohe_moo.mission import save_mission as save_mission
    from botohe_moo.mission import scenarios_from_samples as scenarios_from_samples
    from botohe_moo.mission import survival_from_raster as survival_from_raster
    from botohe_moo.mission import survival_from_zones as survival_from_zones
    from botohe_moo.mission.underway import Event as Event
    from botohe_moo.outcomes import plan_outcomes as plan_outcomes
    from botohe_moo.plots import plot_front as plot_front
    from botohe_moo.plots import plot_mission as plot_mission
    from botohe_moo.problem import BOTOHE as BOTOHE
    from botohe_moo.solution import Solution as Solution
    from botohe_moo.solution import read_solution as read_solution
    from botohe_moo.solving import solve as solve
    from botohe_moo.trails import TrailPlan as TrailPlan
    from botohe_moo.underway import replan as replan
    from botohe_moo.underway import simulate_policy as simulate_policy

__getattr__, __dir__, __all__ = lazy_names(__name__)
