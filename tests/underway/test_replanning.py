"""Plans made anew, and what replanning is worth."""

import networkx as nx
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from botohe_moo import Event, Kind, Mission, load_mission, replan, simulate_policy, solve
from botohe_moo.underway import EventError, read_events, robot_price
from botohe_moo.underway.playing import POLICIES
from tests.examples import examples
from tests.mission.test_underway import LOST, moments
from tests.strategies import missions_with_plans, team_missions_with_plans


@examples(60)
@given(missions_with_plans(max_robots=3) | team_missions_with_plans(), st.data())
def test_it_is_never_worse_and_keeps_limits(case, data):
    mission, plan = case
    states, events = data.draw(moments(mission.labels(plan)))
    if all(how == LOST for _, how in states):
        return
    price = data.draw(st.sampled_from([0.0, 1.0, 30.0]))
    longest = float(mission.trail_lengths([plan]).max())
    found = replan(mission, plan, events, price=price, evaluations=50, max_length=longest)
    rest = found.left.mission
    assert found.gain >= 0
    assert rest.evaluate([found.plan])[0] == pytest.approx(found.objectives, rel=1e-12)
    if events:
        lengths = rest.trail_lengths([found.left.plan])[0]
        for robot, old in enumerate(found.left.robots):
            walked = mission.trail_lengths([plan])[0][old] - lengths[robot]
            assert walked + rest.trail_lengths([found.plan])[0][robot] <= longest * (1 + 1e-9)


def test_a_robot_is_sent_on_where_another_was_lost():
    """By hand: the lost robot was to visit the node that pays most."""
    graph = nx.DiGraph()
    graph.add_node(0, reward=0)
    graph.add_node(1, reward=10)
    graph.add_node(2, reward=1)
    for node, survival in ((1, 0.5), (2, 1.0)):
        graph.add_edge(0, node, survival=survival)
        graph.add_edge(node, 0, survival=survival)
    mission = Mission(graph, base=0, robots=2)
    plan = mission.plan([[0, 1, 0], [0, 2, 0]])
    lost = [Event("lost", 0, 1), Event("reached", 1, 2)]
    found = replan(mission, plan, lost, price=2)
    assert found.left.banked == 1
    assert found.left.mission.labels(found.plan) == ((2, 0, 1, 0),)
    assert found.objectives.tolist() == [5, 0.25]
    assert found.gain == 5 - 2 * 0.75
    assert str(found) == (
        "A robot more costs 2 reward. The new plan has 5 more reward and 0.75 fewer survivors."
    )
    kept = replan(mission, plan, lost, price=100)
    assert kept.plan == kept.left.plan
    assert str(kept).endswith("What is left of the plan stays as it is.")


def test_the_price_of_a_robot():
    toy, front = load_mission("toy"), [[8, 0], [7, 1], [4, 1.4], [0, 2]]
    prices = [robot_price(toy, front, i) for i in range(4)]
    assert prices == pytest.approx([1, 4, 7, 7])  # the third is below the hull
    assert robot_price(toy, [[3, 1]], 0) == 0


def test_policies_meet_the_same_dangers():
    museum = load_mission("art_museum")
    solution = solve(museum, evaluations=3_000)
    row = int(np.argmin(abs(solution.objectives[:, 1] - 1.6)))
    price = robot_price(museum, solution.objectives, row)
    given = {"price": price, "missions": 60, "evaluations": 60}
    plan = solution.plans[row]
    table = simulate_policy(museum, plan, POLICIES, **given).table
    assert table["policy"].tolist() == list(POLICIES)
    assert table["gain"][0] == table["replans"][0] == 0
    assert table["reward"][0] == pytest.approx(solution.objectives[row, 0], abs=1.2)
    assert (table["replans"][1:] > 0).all()
    again = simulate_policy(museum, plan, "losses", **given).table
    columns = ["reward", "survivors", "gain", "gain_se", "replans"]
    assert again[columns].to_numpy().tolist() == table[columns][:2].to_numpy().tolist()


def test_a_plan_implies_a_price():
    museum = load_mission("art_museum")
    solution = solve(museum, evaluations=3_000)
    row = int(np.argmin(abs(solution.objectives[:, 1] - 1.6)))
    found = replan(museum, solution.plans[row], [Event("lost", 2)])
    price = robot_price(museum, solution.objectives, row)
    assert found.price == pytest.approx(price, rel=0.35)
    outcomes = simulate_policy(museum, solution.plans[row], "static", missions=2)
    assert outcomes.price == found.price


@pytest.mark.slow
def test_any_number_of_workers_plays_the_same_missions(capsys):
    toy = load_mission("toy")
    plan = toy.plan([[1, 2, 4, 2, 1], [1, 3, 1]])
    one, two = (
        simulate_policy(toy, plan, price=2, missions=60, workers=workers, progress=True)
        for workers in (1, 2)
    )
    assert one.played.drop(columns="seconds").equals(two.played.drop(columns="seconds"))
    assert "missions played" in capsys.readouterr().err


class TestTables:
    def read(self, tmp_path, text):
        path = tmp_path / "events.csv"
        path.write_text(text)
        return read_events(load_mission("toy"), path)

    def test_what_happened(self, tmp_path):
        text = "Robot,Event,Node\n0,reached,2\n0,Lost,\n1,home,\n"
        assert self.read(tmp_path, text) == [
            Event("reached", 0, 2),
            Event("lost", 0),
            Event("home", 1),
        ]

    def test_a_log_has_times(self, tmp_path):
        text = "time,robot,event,node\n12:00:05,1,reached,2\n12:00:09,0,lost,\n"
        assert self.read(tmp_path, text) == [Event("reached", 1, 2), Event("lost", 0)]

    def test_what_is_wrong(self, tmp_path):
        with pytest.raises(EventError) as caught:
            self.read(tmp_path, "robot,event,node\nx,lost,\n0,reached,9\n")
        assert str(caught.value).splitlines() == [
            "events.csv, row 2: expected a robot, a whole number, got 'x'.",
            "events.csv, row 3: mission 'toy' has no node '9'; most alike are 1, 2, 3, 4, 5.",
        ]
        with pytest.raises(EventError, match="expected the columns robot, event and node, found"):
            self.read(tmp_path, "robot,node\n0,1\n")

    def test_rows_are_named(self, tmp_path):
        toy = load_mission("toy")
        events = self.read(tmp_path, "robot,event,node\n0,lost,\n0,lost,\n")
        plan = toy.plan([[1, 2, 1], [1]])
        with pytest.raises(EventError, match=r"^events\.csv, row 3: robot 0 lost: it is lost alr"):
            toy.after(plan, events)


def test_kinds_keep_their_names():
    toy = load_mission("toy")
    kinds = [Kind("drone", 2), Kind("rover", 1)]
    mission = Mission(toy.graph, base=1, kinds=kinds)
    plan = mission.plan([[1, 2, 1], [1], [1, 3, 1]])
    rest = mission.after(plan, [Event("reached", 0, 2), Event("lost", 2)])
    assert [kind.name for kind in rest.kinds] == ["drone", "drone 0"]
