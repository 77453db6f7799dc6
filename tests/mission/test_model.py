"""What a mission makes of its graph: arrays, a frozen copy, lengths, ways, and plans."""

import copy
import json
import math
import pickle
import re
from fractions import Fraction
from pathlib import Path

import networkx as nx
import numpy as np
import pytest
from hypothesis import given

from botohe_moo import BOTOHE, Kind, Mission, MissionError, load_mission
from botohe_moo.core.world import new_limits, uncollected
from botohe_moo.mission import PlanError
from botohe_moo.mission.model import mission_digest, numbers_digest
from botohe_moo.mission.rules import by_kind
from botohe_moo.trails import PlanBatch, TrailPlan
from tests.mission.made import BOTH, harbour, team_site
from tests.strategies import missions_with_plans, team_missions

ROOT = Path(__file__).parents[2]


@pytest.fixture
def mission():
    return Mission(harbour(), name="harbour")


def ring(lengths=(1, 2.5, 0), **own):
    """Three nodes in a ring, the arcs from 0, 1 and 2 of these lengths; None for no length."""
    graph = nx.DiGraph(base=0, robots=2, **own)
    graph.add_nodes_from(range(3), reward=1)
    for tail, length in enumerate(lengths):
        known = {} if length is None else {"length": length}
        graph.add_edge(tail, (tail + 1) % 3, survival=0.5, **known)
    return graph


class TestConstruction:
    def test_attributes(self, mission):
        assert (mission.title, mission.base, mission.robots) == ("A small harbour", "dock", 2)
        assert Mission(harbour()).name == mission.title
        assert mission.nodes == ("dock", "reef", ("buoy", 2))
        assert [mission.index(node) for node in mission.nodes] == [0, 1, 2]
        assert repr(mission) == (
            "<Mission 'harbour': 3 nodes, 5 arcs, 2 robots at base 'dock', total reward 6.5>"
        )

    def test_what_is_given_goes_before_the_graphs_attributes(self):
        graph = harbour(graph={"base": "reef", "robots": 4, "name": "own", "title": None})
        mission = Mission(graph)
        assert (mission.base, mission.robots, mission.name) == ("reef", 4, "own")
        assert mission.title == "own"
        mission = Mission(graph, base="dock", robots=np.int16(1), name="given")
        assert (mission.base, mission.name, type(mission.robots)) == ("dock", "given", int)

    def test_robots_of_a_plain_mission_start_and_end_at_the_base(self):
        for ends, is_plain in (
            ({}, True),
            ({"start": "dock", "end": "dock"}, True),
            ({"start": "reef", "end": "reef"}, False),
            ({"start": "reef"}, False),
        ):
            mission = Mission(harbour(), base="dock", kinds=[Kind("robot", 2, **ends)])
            assert mission.is_plain == mission.with_robots(3).is_plain == is_plain


class TestFrozen:
    @pytest.mark.parametrize(
        "change",
        [
            lambda graph: graph.nodes["lab"].__setitem__("reward", 99),
            lambda graph: graph.nodes["lab"]["share"].update(drone=1),
            lambda graph: graph.edges["lab", "dock"]["survival"].__setitem__("drone", 1),
            lambda graph: nx.set_edge_attributes(graph, 0.5, "survival"),
        ],
    )
    def test_attributes_are_the_missions_own_and_cannot_be_changed(self, change):
        graph, before = team_site(), nx.node_link_data(team_site(), edges="edges")
        mission = Mission(graph, kinds=BOTH)
        change(graph)
        assert mission == Mission(team_site(), kinds=BOTH)
        for frozen in (mission, pickle.loads(pickle.dumps(mission))):
            with pytest.raises(TypeError, match=r"cannot be changed: change mission\.graph\.copy"):
                change(frozen.graph)
            assert nx.node_link_data(frozen.graph, edges="edges") == before
        copied = mission.graph.copy()
        change(copied)
        assert nx.node_link_data(copied, edges="edges") != before

    @pytest.mark.parametrize("mission", [Mission(harbour()), Mission(team_site(), kinds=BOTH)])
    def test_copies_are_equal_and_as_frozen(self, mission):
        assert copy.deepcopy([mission])[0] is mission
        twin = pickle.loads(pickle.dumps(mission))
        assert (twin, twin.name, twin.title) == (mission, mission.name, mission.title)
        assert mission_digest(twin) == mission_digest(mission)
        for frozen in (mission, twin):
            with pytest.raises(nx.NetworkXError):
                frozen.graph.add_edge("dock", "new")
            with pytest.raises(AttributeError):
                frozen.world.graph = None
            for array in (frozen.rewards, frozen.world.ways.home):
                assert not array.flags.writeable


class TestEquality:
    def test_what_makes_missions_equal(self, mission):
        twin = Mission(harbour(), base="dock", robots=2, name="another name")
        assert (twin, hash(twin)) == (mission, hash(mission))
        assert mission.with_robots(3).with_robots(2) == mission
        assert Mission(ring((1, 1, 1))) == Mission(ring((None, None, None), max_length=None))

    def test_what_makes_them_differ(self, mission):
        reordered = nx.DiGraph(**harbour().graph)
        reordered.add_nodes_from(reversed(list(harbour().nodes(data=True))))
        reordered.add_edges_from(harbour().edges(data=True))
        fewer = harbour()
        fewer.remove_edge("dock", ("buoy", 2))
        others = [
            Mission(harbour(reef={"reward": 6})),
            Mission(harbour(dock_reef={"survival": 0.95})),
            Mission(harbour(dock_reef={"length": 2})),
            Mission(harbour(graph={"max_length": 3})),
            Mission(nx.relabel_nodes(harbour(), {"reef": "rift"})),
            Mission(reordered, base="dock", robots=2),
            Mission(fewer),
            Mission(harbour(), base="reef"),
            mission.with_robots(3),
        ]
        for other in others:
            assert mission not in (other, "harbour")
            assert mission_digest(other) != mission_digest(mission)
        assert numbers_digest(others[4]) == numbers_digest(mission)  # labels do not count

    def test_another_number_of_robots(self, mission):
        larger = mission.with_robots(np.int64(5))
        assert (larger.robots, type(larger.robots), mission.robots) == (5, int, 2)
        assert (
            larger.world.graph.mean_survival.tolist() == mission.world.graph.mean_survival.tolist()
        )
        assert (larger.name, larger.max_length) == ("harbour", None)
        with pytest.raises(MissionError, match=r"'site': it has 3 robots \(2 drone, 1 rover\): e"):
            Mission(team_site(), kinds=BOTH, name="site").with_robots(4)

    def test_digests_of_stored_studies_stay(self):
        manifest = json.loads((ROOT / "results" / "smoke" / "study.json").read_text())
        for entry in manifest["missions"].values():
            name = entry["source"]["name_or_path"]
            assert mission_digest(load_mission(name)) == entry["digest"]


class TestLengths:
    def test_by_hand(self):
        mission = Mission(ring((Fraction(1, 2), np.float32(2.5), None), max_length=Fraction(1, 4)))
        assert mission.world.graph.length.tolist() == [0.5, 2.5, 1]
        assert mission.max_length == 0.25
        plan = mission.plan([[0, 1, 2, 0], [0]])
        assert mission.trail_lengths([plan, plan]).tolist() == [[4, 0]] * 2

    def test_up_to_the_first_fault(self):
        """Not back at base; a missing arc; not from base; a missing arc after the first one."""
        lengths = {(0, 1, 2): 3.5, (0, 2, 0): 0, (1, 2, 0): 0, (0, 1, 0, 1, 2, 0): 1}
        for trail, length in lengths.items():
            found = Mission(ring()).trail_lengths([TrailPlan([trail] * 2)])
            assert found.tolist() == [[length] * 2]

    def test_from_positions(self):
        graph = ring((None, 9, None), max_length=3, title="Ring")
        for node, place in enumerate([[0, 0], [3, 4], [3, 0]]):
            graph.nodes[node]["pos"] = place
        measured = Mission(graph, name="ring").with_lengths_from_pos()
        assert measured.world.graph.length.tolist() == [5, 4, 3]
        assert (measured.name, measured.title, measured.max_length) == ("ring", "Ring", 3)
        with pytest.raises(MissionError) as caught:
            Mission(ring(), name="ring").with_lengths_from_pos()
        assert caught.value.faults[0] == "node 0: expected pos [x, y], found none"
        assert len(caught.value.faults) == 3


def open_ways(mission, kind):
    """The arcs that a kind may take, with their danger."""
    ways = nx.DiGraph()
    ways.add_nodes_from(mission.graph)
    for tail, head, survival in mission.graph.edges(data="survival"):
        if (alive := by_kind(survival, [kind])[0]) > 0:
            ways.add_edge(tail, head, danger=-math.log(alive))
    return ways


class TestWays:
    @given(team_missions(aboard=False))
    def test_what_no_kind_can_collect(self, mission):
        nodes = mission.graph.nodes
        depots = {label for label in nodes if nodes[label].get("depot") or label == mission.base}
        collected = set()
        for kind in mission.kinds:
            ways, (start, end) = open_ways(mission, kind), kind.ends(mission.base)
            there = {start, *nx.descendants(ways, start)} & {end, *nx.ancestors(ways, end)}
            ways = ways.subgraph(there)
            for label in there:
                on_return = nodes[label].get("pays", mission.pays) == "return"
                ahead = {label, *nx.descendants(ways, label)}
                if by_kind(nodes[label].get("share", 1), [kind])[0] > 0:
                    collected |= {label} if not on_return or ahead & depots else set()
        lost = [label for label in nodes if nodes[label]["reward"] > 0 and label not in collected]
        assert [mission.nodes[node] for node in uncollected(mission.world)] == lost

    def test_ways_between_the_safest_and_the_shortest_are_not_tried(self):
        graph = nx.DiGraph()
        graph.add_nodes_from("abcd", reward=1)
        graph.add_edge("a", "b", survival=0.3, length=1)
        nx.add_path(graph, "acb", survival=0.7, length=1)
        nx.add_path(graph, "adb", survival=0.95, length=3)
        mission = Mission(graph, base="b", kinds=[Kind("drone", 1, start="a", max_length=3)])
        unlimited = mission.world.with_limits(new_limits([0.0], [math.inf], [1]))
        assert mission.labels(mission.stay_home()) == (("a", "b"),)
        assert mission.labels(mission.stay_home(mission.limited(0, 6))) == (("a", "b"),)
        assert mission.labels(mission.stay_home(unlimited)) == (("a", "d", "b"),)
        kept = r"'mission': robots of kind 'drone' cannot keep min_survival 0\.4 and max_length 3\."
        found = r"from 'a' to 'b', .* is survived with 0\.3 and is 1 long; no others are tried\.$"
        with pytest.raises(ValueError, match=f"{kept} .* {found}"):
            BOTOHE(mission, min_survival=0.4)


class TestPlans:
    @given(missions_with_plans())
    def test_labels_come_back(self, drawn):
        mission, plan = drawn
        assert mission.plan(mission.labels(plan)) == plan

    def test_lists_stand_for_tuples(self):
        dock, reef = ("dock", 1), ("reef", (2, 3))
        graph = nx.DiGraph([(dock, reef), (reef, dock)], base=dock, robots=1)
        nx.set_node_attributes(graph, 1, "reward")
        nx.set_edge_attributes(graph, 0.5, "survival")
        mission = Mission(graph)
        trail = [["dock", 1], ["reef", [2, 3]], ["dock", 1]]
        assert mission.labels(mission.plan([trail])) == ((dock, reef, dock),)
        with pytest.raises(PlanError, match=r"position 0: mission .* has no node \['cape', 1\]"):
            mission.plan([[["cape", 1]]])

    def test_faults(self, mission):
        to_buoy = ["dock", ("buoy", 2), "dock"]
        for trails, message in (
            ([["dock"]], "Plan 0: expected 2 trails, got 1. Mission 'harbour' has 2 robots."),
            ([["dock"], []], "Robot 1: expected a sequence of node labels, got []"),
            ([["dock"], ["dock", "deck", "dock"]], "Robot 1, position 1: mission 'harbour' has"),
            ([["reef", "dock"], ["dock"]], "0: expected the trail to begin at base 'dock'"),
            ([["dock"], ["dock", "reef"]], "1: expected the trail to end at base 'dock', got"),
            ([to_buoy, ["dock"]], "0, position 2: arc ('buoy', 2) -> 'dock' is missing in mission"),
            ([["dock"], ["dock", "reef"] * 2], "1, position 3: arc 'dock' -> 'reef' is used twice"),
        ):
            with pytest.raises(PlanError, match=re.escape(message)):
                mission.plan(trails)
        for trails, message in (
            ([[0, 1, 0], [0, 3, 0]], "Robot 1, position 1: node index 3 is unknown, mission 'ha"),
            ([[0, 2, 0], [0]], "Robot 0, position 2: arc ('buoy', 2) -> 'dock' is missing in"),
            ([[0]] * 3, "Plan 0: expected 2 trails, got 3. Mission 'harbour' has 2 robots."),
        ):
            plans = [TrailPlan(trails)]
            for each in (plans, PlanBatch.from_plans(plans, len(trails))):
                with pytest.raises(PlanError, match=re.escape(message)):
                    mission.evaluate(each)

    def test_of_other_kinds(self):
        mission = Mission(team_site(), kinds=BOTH, name="site")
        trails = [["roof"], ["roof"], ["dock", "lab", "roof", "lab", "dock"]]
        with pytest.raises(PlanError, match="arc 'lab' -> 'roof' cannot be taken by kind 'rover'"):
            mission.plan(trails)
        expected = "trail to begin at node 'roof', got 'roof' of kind 'rover'"
        with pytest.raises(PlanError, match=expected):
            mission.evaluate([TrailPlan([[5], [2], [3]])])


class TestEvaluate:
    def test_by_hand(self, mission):
        plans = [
            mission.stay_home(),
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

    def test_rewards_on_return(self):
        """Only node 3 has a reward, of 1."""
        museum, on_return = load_mission("art_museum"), load_mission("art_museum_return")
        assert (on_return.pays, on_return.kinds) == ("return", museum.kinds)
        plan = museum.plan([[1, 2, 3, 2, 1], [1], [1]])
        [arrival], [later] = (mission.evaluate([plan]) for mission in (museum, on_return))
        survival = [museum.graph.edges[arc]["survival"] for arc in ((1, 2), (2, 3), (3, 2), (2, 1))]
        assert arrival[0] == pytest.approx(math.prod(survival[:2]))
        assert later[0] == pytest.approx(math.prod(survival))
        assert later[1] == arrival[1]
