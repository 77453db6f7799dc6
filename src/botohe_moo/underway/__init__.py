"""Missions under way: what has happened, plans made anew, and what replanning is worth."""

from typing import TYPE_CHECKING

from botohe_moo.base.runtime import lazy_names

if TYPE_CHECKING:
    from botohe_moo.mission.underway import Event as Event
    from botohe_moo.mission.underway import EventError as EventError
    from botohe_moo.mission.underway import UnderWay as UnderWay
    from botohe_moo.mission.underway import under_way as under_way
    from botohe_moo.underway.played import PlayedMission as PlayedMission
    from botohe_moo.underway.played import PlayedStep as PlayedStep
    from botohe_moo.underway.playing import play_mission as play_mission
    from botohe_moo.underway.policies import PolicyOutcomes as PolicyOutcomes
    from botohe_moo.underway.policies import simulate_policy as simulate_policy
    from botohe_moo.underway.reading import read_events as read_events
    from botohe_moo.underway.replanning import Replan as Replan
    from botohe_moo.underway.replanning import replan as replan
    from botohe_moo.underway.replanning import robot_price as robot_price

__getattr__, __dir__, __all__ = lazy_names(__name__)
