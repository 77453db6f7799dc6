"""Missions: the model, files, the named ones and generators."""

from typing import TYPE_CHECKING

from botohe_moo.base.runtime import lazy_names

if TYPE_CHECKING:
    from botohe_moo.mission.formats.maps import roadmap_from_map as roadmap_from_map
    from botohe_moo.mission.formats.reading import Draft as Draft
    from botohe_moo.mission.formats.reading import Format as Format
    from botohe_moo.mission.formats.reading import Row as Row
    from botohe_moo.mission.formats.reading import Source as Source
    from botohe_moo.mission.formats.reading import format_of as format_of
    from botohe_moo.mission.formats.reading import mission_from_tables as mission_from_tables
    from botohe_moo.mission.formats.reading import stem_of as stem_of
    from botohe_moo.mission.hazards import rewards_from_raster as rewards_from_raster
    from botohe_moo.mission.hazards import survival_from_raster as survival_from_raster
    from botohe_moo.mission.hazards import survival_from_zones as survival_from_zones
    from botohe_moo.mission.loading import load_mission as load_mission
    from botohe_moo.mission.loading import mission_names as mission_names
    from botohe_moo.mission.loading import read_mission as read_mission
    from botohe_moo.mission.loading import save_mission as save_mission
    from botohe_moo.mission.model import Mission as Mission
    from botohe_moo.mission.rules import Kind as Kind
    from botohe_moo.mission.rules import MissionError as MissionError
    from botohe_moo.mission.rules import PlanError as PlanError
    from botohe_moo.mission.scenarios import Scenario as Scenario
    from botohe_moo.mission.scenarios import independent_zones as independent_zones
    from botohe_moo.mission.scenarios import scenarios_from_samples as scenarios_from_samples

__getattr__, __dir__, __all__ = lazy_names(__name__)
