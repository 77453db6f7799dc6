"""What takes a mission, and is given something else, says so before it does anything."""

import pandas as pd
import pytest

from botohe_moo import BOTOHE, area_indicator, load_mission, outcomes, plot_front, save_mission
from botohe_moo import decide as d
from botohe_moo import plots as p
from botohe_moo import underway as u

TOY = load_mission("toy")
PLAN = TOY.plan([[1, 2, 1], [1]])
POINTS = TOY.evaluate([PLAN])

TAKE_A_MISSION = {
    "BOTOHE": BOTOHE,
    "area_indicator": lambda m: area_indicator(POINTS, m),
    "plan_outcomes": lambda m: outcomes.plan_outcomes(m, PLAN),
    "reach_probabilities": lambda m: outcomes.reach_probabilities(m, PLAN),
    "reward_distribution": lambda m: outcomes.reward_distribution(m, PLAN),
    "simulate": lambda m: outcomes.simulate(m, PLAN, 3),
    "survivors_distribution": lambda m: outcomes.survivors_distribution(m, PLAN),
    "choose": lambda m: d.choose(m, [PLAN], "reward >= 1"),
    "compare": lambda m: d.compare(m, PLAN, PLAN),
    "knees": lambda m: d.knees(m, POINTS),
    "neighbours": lambda m: d.neighbours(m, POINTS, 0),
    "nav2_files": lambda m: d.nav2_files(m, PLAN),
    "qgc_plans": lambda m: d.qgc_plans(m, PLAN, altitude=1),
    "plan_csv": lambda m: d.plan_csv(m, PLAN),
    "plan_geojson": lambda m: d.plan_geojson(m, PLAN),
    "plan_json": lambda m: d.plan_json(m, PLAN),
    "representatives": lambda m: d.representatives(m, [PLAN]),
    "robustness": lambda m: d.robustness(m, [PLAN]),
    "worst_case": lambda m: d.worst_case(m, [PLAN]),
    "play_mission": lambda m: u.play_mission(m, PLAN),
    "read_events": lambda m: u.read_events(m, "events.csv"),
    "replan": lambda m: u.replan(m, PLAN, []),
    "survivor_price": lambda m: d.survivor_price(m, POINTS, 0),
    "simulate_policy": lambda m: u.simulate_policy(m, PLAN),
    "toward": lambda m: d.toward(m, [PLAN], reward=1, survivors=1),
    "save_mission": lambda m: save_mission(m, "never-written.json"),
    "plot_choices": lambda m: p.plot_choices(m, [PLAN]),
    "plot_front": lambda m: plot_front(POINTS, m),
    "plot_mission": lambda m: p.plot_mission(m),
    "plot_outcomes": lambda m: p.plot_outcomes(m, PLAN),
    "plot_pheromone": lambda m: p.plot_pheromone(m, pd.DataFrame()),
    "plot_plan": lambda m: p.plot_plan(m, PLAN),
}


def test_what_is_not_a_mission_is_named():
    expected = r"^Expected a Mission, got .*; load_mission\(name_or_path"
    for take in TAKE_A_MISSION.values():
        with pytest.raises(TypeError, match=expected):
            take(TOY.graph)


def test_labels_of_what_is_not_a_plan():
    with pytest.raises(TypeError, match=r"^Expected a TrailPlan, got \[\[1\], \[1\]\]\.$"):
        TOY.labels([[1], [1]])
