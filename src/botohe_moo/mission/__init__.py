"""Missions: the model, files, the named ones and generators."""

from botohe_moo.mission.model import Mission, MissionArrays, PlanError
from botohe_moo.mission.validation import MissionError

__all__ = ["Mission", "MissionArrays", "MissionError", "PlanError"]
