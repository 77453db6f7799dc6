"""The plain mission by which missions of kinds and with rewards on return are bounded."""

from itertools import combinations_with_replacement, product

import networkx as nx
import numpy as np
import pytest
from hypothesis import assume, given

from botohe_moo import Kind, Mission, bound_front, load_mission
from botohe_moo.bounds import proof, schedule
from botohe_moo.bounds.bound import relaxed_to_plain
from botohe_moo.bounds.proof import NOTE, Proof
from botohe_moo.trails import TrailPlan
from tests.examples import examples
from tests.strategies import missions, small_team_missions, team_missions_with_plans


def relaxed(mission):
    return relaxed_to_plain(mission, mission.limits())


def all_objectives(mission, trails):
    """The objectives of all plans that keep the kinds' limits; ``trails`` has those of each."""
    teams = (
        combinations_with_replacement(own, kind.robots)
        for own, kind in zip(trails, mission.kinds, strict=True)
    )
    found = [TrailPlan(sum(team, ())) for team in product(*teams)]
    limits = mission.limits()
    keeps = (mission.robot_survival(found) >= limits.floors).all(axis=1)
    keeps &= (mission.trail_lengths(found) <= limits.budgets).all(axis=1)
    return mission.evaluate(found)[keeps]


class TestByHand:
    @pytest.fixture
    def graph(self):
        """From the gate to the lab and on to the roof by stairs; nobody gets to the tank."""
        graph = nx.DiGraph()
        graph.add_node("gate", reward=0)
        graph.add_node("lab", reward=8, share={"drone": 0.25, "rover": 0}, pays="return")
        graph.add_node("roof", reward=2, share=0, depot=True)
        graph.add_node("tank", reward=4)
        survivals = {
            ("gate", "lab"): {"drone": 0.5, "rover": 0.75},
            ("lab", "roof"): {"drone": 0.5, "rover": 0},
            ("roof", "tank"): {"drone": 0, "rover": 0},
        }
        for (tail, head), survival in survivals.items():
            graph.add_edge(tail, head, survival=survival, length=2)
            graph.add_edge(head, tail, survival=survival)
        return graph

    KINDS = (Kind("drone", 1, min_survival=0.125, max_length=7), Kind("rover", 2, min_survival=0.5))

    @pytest.mark.filterwarnings("ignore:.*no kind of robots can collect")
    def test_the_best_of_all_kinds(self, graph):
        graph.graph["max_length"] = 5
        plain = relaxed(Mission(graph, base="gate", kinds=self.KINDS))
        assert plain.kinds == (Kind("robot", 3, min_survival=0.125, max_length=7.0),)
        assert (plain.base, plain.robots, plain.is_plain) == ("gate", 3, True)
        assert dict(plain.graph.nodes(data="reward")) == {"gate": 0, "lab": 8, "roof": 0}
        assert sorted(plain.graph.edges(data="survival")) == [
            ("gate", "lab", 0.75),
            ("lab", "gate", 0.75),
            ("lab", "roof", 0.5),
            ("roof", "lab", 0.5),
        ]
        lengths = nx.get_edge_attributes(plain.graph, "length")
        assert [lengths["gate", "lab"], lengths["lab", "gate"]] == [2, 1]

    @pytest.mark.filterwarnings("ignore:.*no kind of robots can collect")
    def test_one_start_for_all(self, graph):
        kinds = [Kind("drone", 1, start="roof", end="gate"), Kind("rover", 1)]
        plain = relaxed(Mission(graph, base="gate", kinds=kinds))
        assert plain.kinds == (Kind("robot", 2),)
        start = plain.base
        assert start not in graph
        assert {*plain.graph[start]} == {"roof", "gate"}
        assert [*plain.graph.predecessors(start)] == ["gate"]
        drone = [start, "roof", "lab", "gate", start]
        plan = plain.plan([drone, [start, "gate", start]])
        assert plain.evaluate([plan]).tolist() == [[8 * 0.5, 0.5 * 0.75 + 1]]
        assert plain.trail_lengths([plan]).tolist() == [[2.0, 0.0]]

    def test_on_return(self):
        """Two robots bring 10 from a node, and are lost half-way on each of two arcs."""
        graph = nx.DiGraph([(0, 1), (1, 0)])
        nx.set_node_attributes(graph, {0: 0.0, 1: 10.0}, "reward")
        nx.set_edge_attributes(graph, 0.5, "survival")
        mission = Mission(graph, base=0, robots=2, pays="return")
        bound = bound_front(mission)
        assert bound.bound([0.5, 1.25, 2.0]) == pytest.approx([7.5, 5.0, 0.0])
        assert bound.notes == (NOTE,)
        front = mission.evaluate([mission.plan([[0, 1, 0]] * n + [[0]] * (2 - n)) for n in (2, 1)])
        area = 10 * (7 / 16 * 0.5 + 1 / 4 * 0.75) / 20  # of these plans
        assert bound.gap(front) == pytest.approx((7.5 * 0.5 + 5 * 0.75) / 20 / area - 1)

    def test_robots_that_end_elsewhere_move_in_every_plan(self):
        graph = nx.DiGraph([("a", "b"), ("b", "a")])
        nx.set_node_attributes(graph, 1.0, "reward")
        nx.set_edge_attributes(graph, 0.5, "survival")
        bound = bound_front(Mission(graph, base="a", kinds=[Kind("robot", 2, end="b")]))
        assert bound.bound([0.0, 1.0, 1.1]) == pytest.approx([1.75, 1.75, -np.inf])
        assert bound.area == pytest.approx(1.75 / 4)
        assert bound.points == pytest.approx(np.array([[1.75, 1.0]]))
        graph.add_node("c", reward=0.0)  # where the other robot cannot leave
        both = [Kind("robot", 1, end="b"), Kind("other", 1, start="c", end="c")]
        bound = bound_front(Mission(graph, base="a", kinds=both))
        assert bound.bound([1.5, 1.6]) == pytest.approx([1.5, -np.inf])

    def test_no_plan_keeps_the_limits(self):
        graph = nx.DiGraph([("a", "b"), ("b", "a")])
        nx.set_node_attributes(graph, 1.0, "reward")
        nx.set_edge_attributes(graph, 0.5, "survival")
        mission = Mission(graph, base="a", kinds=[Kind("robot", 1, end="b")])
        bound = bound_front(mission, min_survival=0.75)
        assert (bound.bound(0.0), bound.area, len(bound.points)) == (-np.inf, 0.0, 0)

    def test_what_robots_carry_is_refused(self):
        toy = load_mission("toy")
        kinds = [Kind("drone", 1, aboard=(4,)), Kind("rover", 1)]
        mission = Mission(toy.graph, base=1, kinds=kinds, pays="return")
        said = "^bound_front does not support mission 'toy', in which .*: those of kind 'drone'.$"
        with pytest.raises(ValueError, match=said):
            bound_front(mission)
        toy = nx.DiGraph(toy.graph)
        toy.nodes[4]["reward"] = 0
        assert bound_front(Mission(toy, base=1, kinds=kinds, pays="return")).area > 0


@given(team_missions_with_plans(max_nodes=6, aboard=False))
def test_each_plan_is_one_of_the_relaxation(drawn):
    mission, plan = drawn
    plain = relaxed(mission)
    trails = mission.labels(plan)
    if plain.base != mission.base:
        trails = [(plain.base, *trail, plain.base) for trail in trails]
    same = plain.plan(trails)
    assert (plain.evaluate([same]) >= mission.evaluate([plan]) * (1 - 1e-12)).all()
    assert (plain.robot_survival([same]) >= mission.robot_survival([plan])).all()
    assert plain.trail_lengths([same]) == pytest.approx(mission.trail_lengths([plan]))
    limits = plain.limits()
    for kind in mission.kinds:
        assert limits.floors[0] <= kind.min_survival
        assert limits.budgets[0] >= (np.inf if kind.max_length is None else kind.max_length)


@pytest.mark.parametrize("true_front", [True, pytest.param(False, marks=pytest.mark.slow)])
@examples(40)
@given(small_team_missions(max_teams=500, aboard=False))
def test_no_plan_lies_above(true_front, drawn):
    mission, trails = drawn
    assume(not mission.is_plain)
    with pytest.MonkeyPatch.context() as patch:
        if not true_front:  # as if the mission were large
            patch.setattr(Proof, "find_front", lambda _: False)
            patch.setattr(proof, "_EVALUATIONS", 1_000)
            patch.setattr(schedule, "_MOST_ROUNDS", 1)
        bound = bound_front(mission, time_limit=60)
    bound.check("front", all_objectives(mission, trails))


@given(missions(max_robots=4))
def test_kinds_that_are_alike(plain):
    """With shares of 1, and on return to depots, which all nodes are."""
    graph = plain.graph.copy()
    for node in graph.nodes.values():
        node.update(share={"other": 1.0}, depot=True, pays="return")
    for arc in graph.edges.values():
        arc["survival"] = {"one": arc["survival"], "other": arc["survival"]}
    kinds = [Kind("one", 1, max_length=9), Kind("other", plain.robots)]
    mission = Mission(graph, base=plain.base, kinds=kinds)
    assert relaxed(mission) == plain.with_robots(plain.robots + 1)
