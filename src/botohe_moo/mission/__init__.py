"""Missions: the model, files, the named ones and generators."""

from botohe_moo.mission.formats.files import read_mission, save_mission
from botohe_moo.mission.library import load_mission, mission_names
from botohe_moo.mission.model import Mission
from botohe_moo.mission.plan_faults import PlanError
from botohe_moo.mission.validation import MissionError

__all__ = [
    "Mission",
    "MissionError",
    "PlanError",
    "load_mission",
    "mission_names",
    "read_mission",
    "save_mission",
]
