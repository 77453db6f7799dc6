"""What a mission makes of its graph: a frozen copy, and the ways of robots."""

import math
import pickle
from itertools import pairwise

import networkx as nx
import pytest
from hypothesis import given

from botohe_moo import BOTOHE
from botohe_moo.core.world import new_limits, uncollected
from botohe_moo.mission import Kind, Mission
from botohe_moo.mission.rules import by_kind
from tests.mission.made import BOTH, harbour, site
from tests.strategies import team_missions

PARTS = {
    "graph": ("first", "tail", "head", "survival", "reward"),
    "team": ("reward", "origin", "share", "end", "start"),
    "limits": ("floors", "budgets"),
    "ways": ("homeward", "home"),
}


def unlimited(mission):
    """The mission without any limit."""
    return mission.world.with_limits(new_limits([0.0], [math.inf], [mission.robots]))


class TestFrozen:
    def test_later_changes_of_the_graph_change_nothing(self):
        graph = harbour()
        mission = Mission(graph)
        graph.nodes["reef"]["reward"] = 99
        graph.edges["dock", "reef"]["survival"] = 0.1
        graph.remove_node(("buoy", 2))
        assert mission == Mission(harbour())
        assert mission.graph.nodes["reef"]["reward"] == 5
        assert mission.graph.edges["dock", "reef"]["survival"] == 0.9

    @pytest.mark.parametrize(
        "change",
        [
            lambda graph: graph.nodes["lab"].__setitem__("reward", 99),
            lambda graph: graph.nodes["lab"]["share"].update(drone=1),
            lambda graph: graph.edges["lab", "dock"]["survival"].__setitem__("drone", 1),
            lambda graph: nx.set_edge_attributes(graph, 0.5, "survival"),
        ],
    )
    def test_attributes_cannot_be_changed(self, change):
        graph = site()
        mission = Mission(graph, kinds=BOTH)
        before = nx.node_link_data(site(), edges="edges")
        change(graph)
        for frozen in (mission, pickle.loads(pickle.dumps(mission))):
            with pytest.raises(
                TypeError, match=r"cannot be changed: change mission\.graph\.copy()"
            ):
                change(frozen.graph)
            assert nx.node_link_data(frozen.graph, edges="edges") == before
        copied = mission.graph.copy()
        change(copied)
        assert nx.node_link_data(copied, edges="edges") != before

    @pytest.mark.parametrize("mission", [Mission(harbour()), Mission(site(), kinds=BOTH)])
    def test_graph_is_frozen_and_arrays_are_read_only(self, mission):
        for frozen in (mission, pickle.loads(pickle.dumps(mission))):
            with pytest.raises(nx.NetworkXError):
                frozen.graph.add_edge("dock", "new")
            with pytest.raises(AttributeError):
                frozen.world.graph = None
            for part, keys in PARTS.items():
                for key in keys:
                    with pytest.raises(ValueError, match="read-only"):
                        getattr(getattr(frozen.world, part), key)[0] = 0
            with pytest.raises(ValueError, match="read-only"):
                frozen.rewards[0] = 0


class TestWays:
    @given(team_missions())
    def test_staying_home_takes_the_safest_way(self, mission):
        home = mission.labels(mission.stay_home(unlimited(mission)))
        for trail, kind in zip(home, mission.kind_of, strict=True):
            start, end = kind.ends(mission.base)
            arcs = [mission.graph.edges[arc]["survival"] for arc in pairwise(trail)]
            survivals = [by_kind(survival, [kind])[0] for survival in arcs]
            least = nx.dijkstra_path_length(open_ways(mission, kind), start, end, "danger")
            assert (trail[0], trail[-1]) == (start, end)
            assert math.prod(survivals) == pytest.approx(math.exp(-least))

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
        assert mission.labels(mission.stay_home()) == (("a", "b"),)
        assert mission.labels(mission.stay_home(mission.limited(0, 6))) == (("a", "b"),)
        assert mission.labels(mission.stay_home(unlimited(mission))) == (("a", "d", "b"),)
        kept = r"'mission': robots of kind 'drone' cannot keep min_survival 0\.4 and max_length 3\."
        found = r"from 'a' to 'b', .* is survived with 0\.3 and is 1 long; no others are tried\.$"
        with pytest.raises(ValueError, match=f"{kept} .* {found}"):
            BOTOHE(mission, min_survival=0.4)


def open_ways(mission, kind):
    """The arcs that a kind may take, with their danger."""
    ways = nx.DiGraph()
    ways.add_nodes_from(mission.graph)
    for tail, head, survival in mission.graph.edges(data="survival"):
        if (alive := by_kind(survival, [kind])[0]) > 0:
            ways.add_edge(tail, head, danger=-math.log(alive))
    return ways
