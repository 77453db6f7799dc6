import copy
import pickle
import re

import networkx as nx
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from botohe_moo.mission import Kind, Mission, PlanError
from botohe_moo.trails import PlanBatch, TrailPlan
from tests.mission.made import harbour
from tests.strategies import missions, missions_with_plans
from tests.twins import evaluate


@pytest.fixture
def graph():
    return harbour()


@pytest.fixture
def mission():
    return Mission(harbour(), name="harbour")


class TestConstruction:
    def test_attributes(self, mission):
        assert (mission.name, mission.title) == ("harbour", "A small harbour")
        assert (mission.base, mission.robots) == ("dock", 2)
        assert mission.nodes == ("dock", "reef", ("buoy", 2))
        assert [mission.index(node) for node in mission.nodes] == [0, 1, 2]
        assert mission.total_reward == 6.5
        assert repr(mission) == (
            "<Mission 'harbour': 3 nodes, 5 arcs, 2 robots at base 'dock', total reward 6.5>"
        )
        with pytest.raises(KeyError):
            mission.index("buoy")

    def test_arrays(self, mission):
        arrays, team = mission.world.graph, mission.world.team
        assert (arrays.n_nodes, arrays.n_arcs) == (3, 5)
        assert (team.start.tolist(), team.end.tolist()) == ([0, 0], [0, 0, 0])
        assert arrays.first.tolist() == [0, 2, 4, 5]
        assert arrays.tail.tolist() == [0, 0, 1, 1, 2]
        assert arrays.head.tolist() == [1, 2, 0, 2, 1]
        assert arrays.survival.tolist() == [0.9, 0.25, 0.8, 0.5, 1]
        assert arrays.reward.tolist() == team.reward.tolist() == [1, 5, 0.5]
        assert arrays.tail.dtype == arrays.head.dtype == np.int64
        assert arrays.first.dtype == np.int64

    def test_graphs_own_attributes_and_overrides(self, graph):
        graph.graph.update(base="reef", robots=4, name="own", title=None)
        mission = Mission(graph)
        assert (mission.base, mission.robots, mission.name) == ("reef", 4, "own")
        assert mission.title == "own"
        mission = Mission(graph, base="dock", robots=np.int16(1), name="given")
        assert (mission.base, mission.robots, mission.name) == ("dock", 1, "given")
        assert type(mission.robots) is int

    def test_single_node(self):
        graph = nx.DiGraph()
        graph.add_node("home", reward=2)
        mission = Mission(graph, base="home", robots=3)
        assert mission.evaluate([mission.plan([["home"]] * 3)]).tolist() == [[2, 3]]

    @pytest.mark.parametrize(
        ("ends", "is_plain"),
        [
            ({}, True),
            ({"start": "dock", "end": "dock"}, True),
            ({"start": "reef", "end": "reef"}, False),
            ({"start": "reef"}, False),
            ({"end": "reef"}, False),
        ],
    )
    def test_robots_of_a_plain_mission_start_and_end_at_the_base(self, graph, ends, is_plain):
        mission = Mission(graph, base="dock", kinds=[Kind("robot", 2, **ends)])
        assert mission.is_plain == is_plain
        assert mission.with_robots(3).is_plain == is_plain


class TestCopies:
    def test_deep_copies_are_the_same(self, mission):
        assert copy.deepcopy([mission])[0] is mission

    def test_pickle(self, mission):
        twin = pickle.loads(pickle.dumps(mission))
        assert twin == mission
        assert twin is not mission
        assert (twin.name, twin.title) == (mission.name, mission.title)
        assert nx.is_frozen(twin.graph)
        assert not twin.world.graph.reward.flags.writeable
        plan = [["dock", "reef", "dock"], ["dock"]]
        assert twin.plan(plan) == mission.plan(plan)


class TestEquality:
    def test_what_makes_missions_equal(self, graph, mission):
        twin = Mission(graph, base="dock", robots=2, name="another name")
        assert twin == mission
        assert hash(twin) == hash(mission)
        assert mission.with_robots(3) != mission
        assert mission.with_robots(3).with_robots(2) == mission
        assert mission != "harbour"

    def test_what_makes_them_differ(self, graph, mission):
        others = [graph.copy() for _ in range(3)]
        others[0].nodes["reef"]["reward"] = 6
        others[1].edges["dock", "reef"]["survival"] = 0.95
        others[2].remove_edge("dock", ("buoy", 2))
        others.append(nx.relabel_nodes(graph, {"reef": "rift"}))
        others.append(nx.DiGraph())
        others[-1].add_nodes_from(reversed(list(graph.nodes(data=True))))
        others[-1].add_edges_from(graph.edges(data=True))
        for other in others:
            assert Mission(other, base="dock", robots=2) != mission
        assert Mission(graph, base="reef", robots=2) != mission

    def test_with_robots(self, mission):
        larger = mission.with_robots(np.int64(5))
        assert larger.robots == 5
        assert type(larger.robots) is int
        assert mission.robots == 2
        assert larger.world.graph.survival.tolist() == mission.world.graph.survival.tolist()
        assert larger.name == "harbour"

    @given(missions())
    def test_balanced(self, mission):
        degrees = [mission.graph.in_degree(v) - mission.graph.out_degree(v) for v in mission.nodes]
        assert mission.balanced == (not any(degrees))


class TestPlan:
    def test_everybody_may_stay_home(self, mission):
        assert mission.labels(mission.stay_home()) == (("dock",), ("dock",))
        assert mission.evaluate([mission.stay_home()]).tolist() == [[1, 2]]

    def test_labels_come_back(self, mission):
        trails = [["dock", "reef", ("buoy", 2), "reef", "dock"], ("dock",)]
        plan = mission.plan(trails)
        assert plan.trails == ((0, 1, 2, 1, 0), (0,))
        assert mission.labels(plan) == (tuple(trails[0]), ("dock",))

    @given(missions_with_plans())
    def test_labels_come_back_on_any_mission(self, drawn):
        mission, plan = drawn
        assert mission.plan(mission.labels(plan)) == plan

    def test_lists_stand_for_tuples(self):
        graph = nx.DiGraph(base=("dock", 1), robots=1)
        graph.add_nodes_from([("dock", 1), ("reef", (2, 3))], reward=1)
        graph.add_edge(("dock", 1), ("reef", (2, 3)), survival=0.5)
        graph.add_edge(("reef", (2, 3)), ("dock", 1), survival=0.5)
        mission = Mission(graph)
        trail = [["dock", 1], ["reef", [2, 3]], ["dock", 1]]
        assert mission.labels(mission.plan([trail])) == (
            (("dock", 1), ("reef", (2, 3)), ("dock", 1)),
        )
        with pytest.raises(PlanError, match=r"position 0: mission .* has no node \['cape', 1\]"):
            mission.plan([[["cape", 1]]])

    @pytest.mark.parametrize(
        ("trails", "message"),
        [
            ([["dock"]], "Plan 0: expected 2 trails, got 1. Mission 'harbour' has 2 robots."),
            (
                [["dock"], ["dock", "deck", "dock"]],
                "Robot 1, position 1: mission 'harbour' has no node 'deck'.",
            ),
            (
                [["reef", "dock"], ["dock"]],
                "Robot 0, position 0: expected the trail to begin at base 'dock', got 'reef'.",
            ),
            (
                [["dock"], ["dock", "reef"]],
                "Robot 1, position 1: expected the trail to end at base 'dock', got 'reef'.",
            ),
            (
                [["dock", ("buoy", 2), "dock"], ["dock"]],
                "Robot 0, position 2: arc ('buoy', 2) -> 'dock' is missing in mission 'harbour'.",
            ),
            (
                [["dock"], ["dock", "reef", "dock", "reef", "dock"]],
                "Robot 1, position 3: arc 'dock' -> 'reef' is used twice in this trail; a trail "
                "uses an arc at most once, in mission 'harbour'.",
            ),
        ],
    )
    def test_faults(self, mission, trails, message):
        with pytest.raises(PlanError, match=re.escape(message)):
            mission.plan(trails)


class TestEvaluate:
    def test_by_hand(self, mission):
        plans = [
            mission.plan([["dock"], ["dock"]]),
            mission.plan([["dock", "reef", "dock"], ["dock"]]),
            mission.plan([["dock", "reef", "dock"]] * 2),
            mission.plan([["dock", ("buoy", 2), "reef", "dock"], ["dock", "reef", "dock"]]),
        ]
        expected = [
            [1, 2],
            [1 + 5 * 0.9, 1 + 0.9 * 0.8],
            [1 + 5 * (1 - 0.1**2), 2 * 0.9 * 0.8],
            [1 + 0.5 * 0.25 + 5 * (1 - 0.75 * 0.1), 0.25 * 0.8 + 0.9 * 0.8],
        ]
        assert mission.evaluate(plans) == pytest.approx(np.array(expected))

    def test_any_container_of_plans(self, mission):
        plans = [mission.plan([["dock", "reef", "dock"], ["dock"]]), mission.plan([["dock"]] * 2)]
        expected = mission.evaluate(plans)
        assert expected.shape == (2, 2)
        column = PlanBatch.from_plans(plans, 2).to_array()
        for container in (iter(plans), tuple(plans), mission.batch(plans), column, column[:, 0]):
            assert np.array_equal(mission.evaluate(container), expected)
        assert mission.evaluate([]).shape == (0, 2)

    @given(missions_with_plans(), st.randoms())
    def test_formulas_and_order_of_robots(self, drawn, random):
        mission, plan = drawn
        (found,) = mission.evaluate([plan])
        assert found == pytest.approx(np.array(evaluate(mission, mission.labels(plan))))
        shuffled = list(plan.trails)
        random.shuffle(shuffled)
        assert mission.evaluate([TrailPlan(shuffled)]).tolist() == [found.tolist()]

    @pytest.mark.parametrize(
        ("trails", "message"),
        [
            ([[0, 1, 0], [0, 3, 0]], "Robot 1, position 1: node index 3 is unknown, mission 'ha"),
            ([[0, 2, 0], [0]], "Robot 0, position 2: arc ('buoy', 2) -> 'dock' is missing in"),
        ],
    )
    def test_plans_of_other_missions(self, mission, trails, message):
        with pytest.raises(PlanError, match=re.escape(message)):
            mission.evaluate([TrailPlan(trails)])

    def test_batches_of_another_team_size(self, mission):
        batch = mission.with_robots(3).batch([TrailPlan([[0], [0], [0]])])
        message = "Plan 0: expected 2 trails, got 3. Mission 'harbour' has 2 robots."
        with pytest.raises(PlanError, match=re.escape(message)):
            mission.evaluate(batch)

    def test_what_is_no_plan(self, mission):
        with pytest.raises(TypeError, match=r"Plan 1: expected a TrailPlan, got \[\[0\], \[0\]\]"):
            mission.evaluate([TrailPlan([[0], [0]]), [[0], [0]]])
        with pytest.raises(TypeError, match="Expected a sequence of TrailPlans, got one TrailPlan"):
            mission.evaluate(TrailPlan([[0], [0]]))
