"""Plans made anew, and what replanning is worth."""

from pathlib import Path

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from botohe_moo import Event, Kind, Mission, load_mission, replan, simulate_policy, solve
from botohe_moo.decide import survivor_price
from botohe_moo.mission import PlanError
from botohe_moo.underway import POLICIES, EventError, read_events
from tests.examples import examples
from tests.mission.test_underway import LOST, keeps_limits, moments
from tests.strategies import missions_with_plans, team_missions_with_plans
from tests.underway.corner import MISSION, PLAN


@examples(60)
@given(missions_with_plans(max_robots=3) | team_missions_with_plans(), st.data())
def test_it_is_never_worse_and_keeps_limits(case, data):
    mission, plan = case
    states, events = data.draw(moments(mission.labels(plan)))
    if all(how == LOST for _, how in states):
        return
    price = data.draw(st.sampled_from([0.0, 1.0, 30.0]))
    assume(keeps_limits(mission, plan))
    longest = float(mission.trail_lengths([plan]).max())
    found = replan(mission, plan, events, price=price, evaluations=50, max_length=longest)
    rest = found.left.mission
    assert found.gain >= 0
    assert found.plan in found.plans
    assert not (found.before >= found.objectives).all() or found.plan == found.left.plan
    assert rest.evaluate([found.plan])[0] == pytest.approx(found.objectives, rel=1e-12)
    lengths = rest.trail_lengths([found.left.plan])[0]
    for robot, old in enumerate(found.left.robots):
        walked = mission.trail_lengths([plan])[0][old] - lengths[robot]
        assert walked + rest.trail_lengths([found.plan])[0][robot] <= longest * (1 + 1e-9)


@pytest.mark.parametrize("limit", [{"min_survival": 0.9}, {"max_length": 3}])
def test_limits_of_the_plan_are_checked(solution, limit):
    for ask in (lambda *g, **k: replan(*g, [], **k), simulate_policy):
        with pytest.raises(PlanError, match=r"^Plan 0, robot \d: expected a (sur|length)"):
            ask(solution.mission, solution.plans[0], **limit)


def test_a_robot_is_sent_on_where_another_was_lost():
    """By hand: the lost robot was to visit the lab, which pays most."""
    lost = [Event("lost", 0, "lab"), Event("reached", 1, "hall")]
    found = replan(MISSION, PLAN, lost, price=2)
    assert found.left.banked == 1
    assert found.left.mission.labels(found.plan) == (("hall", "base", "lab", "base"),)
    assert found.objectives.tolist() == [5, 0.25]
    assert found.gain == 5 - 2 * 0.75
    assert str(found) == (
        "One more survivor costs 2 reward. The new plan has 5 more reward and 0.75 fewer survivors."
    )
    kept = replan(MISSION, PLAN, lost, price=100)
    assert kept.plan == kept.left.plan
    assert str(kept).endswith("What is left of the plan stays as it is.")


@pytest.fixture(scope="module")
def solution():
    return solve("art_museum", evaluations=3_000)


@pytest.mark.slow
def test_policies_meet_the_same_dangers(solution):
    museum = solution.mission
    row = int(np.argmin(abs(solution.objectives[:, 1] - 1.6)))
    plan, price = solution.plans[row], survivor_price(museum, solution.objectives, row)
    given = {"price": price, "evaluations": 60}
    table = simulate_policy(museum, plan, tuple(POLICIES), missions=20, **given).table
    assert table["policy"].tolist() == list(POLICIES)
    assert table["gain"][0] == table["replans"][0] == 0
    assert (table["replans"][1:] > 0.5).all()
    again = simulate_policy(museum, plan, "losses", missions=20, **given).table
    columns = ["reward", "survivors", "gain", "gain_se", "replans"]
    assert again[columns].to_numpy().tolist() == table[columns][:2].to_numpy().tolist()
    static = simulate_policy(museum, plan, "static", missions=4_000, **given).played
    for name, expected in zip(("reward", "survivors"), solution.objectives[row], strict=True):
        assert abs(static[name].mean() - expected) < 3 * static[name].sem()


def test_a_plan_implies_a_price(solution):
    museum = solution.mission
    row = int(np.argmin(abs(solution.objectives[:, 1] - 1.6)))
    found = replan(museum, solution.plans[row], [Event("lost", 2)])
    price = survivor_price(museum, solution.objectives, row)
    assert found.price == pytest.approx(price, rel=0.35)
    assert simulate_policy(museum, solution.plans[row], "static", missions=2).price == found.price


@pytest.mark.slow
def test_any_number_of_workers_plays_the_same_missions():
    toy, done = load_mission("toy"), []
    plan = toy.plan([[1, 2, 4, 2, 1], [1, 3, 1]])
    given = {"price": 2, "missions": 60, "progress": done.append}
    one, two = (simulate_policy(toy, plan, workers=n, **given).played for n in (1, 2))
    assert one.drop(columns="seconds").equals(two.drop(columns="seconds"))
    assert done == [*range(1, 61)] * 2


class TestEvents:
    @pytest.fixture(autouse=True)
    def folder(self, tmp_path, monkeypatch):
        monkeypatch.chdir(tmp_path)

    def read(self, text):
        Path("events.csv").write_text(text)
        return read_events(load_mission("toy"), "events.csv")

    def test_what_happened(self):
        text = "Robot,Event,Node\n0,reached,2\n0,Lost,\n1,home,\n"
        assert self.read(text) == [Event("reached", 0, 2), Event("lost", 0), Event("home", 1)]
        logged = "time,robot,event,node\n12:00:05,1,reached,2\n12:00:09,0,lost,\n"
        assert self.read(logged) == [Event("reached", 1, 2), Event("lost", 0)]

    def test_what_is_wrong(self):
        for text, fault in (
            ("robot,event,node\n0,lost\n0,reached,9\n1\n", "row 3: mission 'toy' has no node 9;"),
            ("robot,node\n0,1\n", "expected the columns robot, event and node, and"),
        ):
            with pytest.raises(EventError, match=fault):
                self.read(text)
        toy = load_mission("toy")
        events = self.read("robot,event,node\n0,lost,\n0,lost,\n")
        with pytest.raises(EventError, match=r"^events\.csv, row 3: robot 0 lost: it is lost alr"):
            toy.after(toy.plan([[1, 2, 1], [1]]), events)


def test_kinds_keep_their_names():
    mission = Mission(load_mission("toy").graph, kinds=[Kind("drone", 2), Kind("rover", 1)])
    plan = mission.plan([[1, 2, 1], [1], [1, 3, 1]])
    rest = mission.after(plan, [Event("reached", 0, 2), Event("lost", 2)])
    assert [kind.name for kind in rest.kinds] == ["drone 0", "drone"]
