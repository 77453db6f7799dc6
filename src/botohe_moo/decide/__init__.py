"""Choosing a plan from a front: wishes, marks, comparisons, robustness, and plans as files."""

from typing import TYPE_CHECKING

from botohe_moo.base.runtime import lazy_names

if TYPE_CHECKING:
    from botohe_moo.decide.choosing import Choice as Choice
    from botohe_moo.decide.choosing import Difference as Difference
    from botohe_moo.decide.choosing import Miss as Miss
    from botohe_moo.decide.choosing import choose as choose
    from botohe_moo.decide.choosing import compare as compare
    from botohe_moo.decide.choosing import toward as toward
    from botohe_moo.decide.fronts import Mark as Mark
    from botohe_moo.decide.fronts import TradeOff as TradeOff
    from botohe_moo.decide.fronts import knees as knees
    from botohe_moo.decide.fronts import neighbours as neighbours
    from botohe_moo.decide.fronts import representatives as representatives
    from botohe_moo.decide.fronts import survivor_price as survivor_price
    from botohe_moo.decide.hazards import by_scenario as by_scenario
    from botohe_moo.decide.hazards import robustness as robustness
    from botohe_moo.decide.hazards import worst_case as worst_case
    from botohe_moo.decide.plan_files import nav2_files as nav2_files
    from botohe_moo.decide.plan_files import plan_csv as plan_csv
    from botohe_moo.decide.plan_files import plan_geojson as plan_geojson
    from botohe_moo.decide.plan_files import plan_json as plan_json
    from botohe_moo.decide.plan_files import qgc_plans as qgc_plans
    from botohe_moo.decide.plan_files import robot_table as robot_table
    from botohe_moo.decide.plan_files import write_plan as write_plan
    from botohe_moo.decide.wishes import Wish as Wish
    from botohe_moo.decide.wishes import parse_wishes as parse_wishes

__getattr__, __dir__, __all__ = lazy_names(__name__)
