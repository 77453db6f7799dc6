"""Drift keeps what can be relied on of every algorithm."""

from botohe_drift import Drift

from botohe_moo import area_indicator, load_mission, solve
from botohe_moo.testing import parametrize_with_checks


@parametrize_with_checks([Drift])
def test_conforms(check):
    check()


def test_it_is_better_than_chance():
    mission = load_mission("art_museum")
    drifted = solve(mission, Drift(), evaluations=2_000, seed=1)
    drawn = solve(mission, "random", evaluations=2_000, seed=1)
    assert area_indicator(drifted.objectives, mission) > drawn.area
