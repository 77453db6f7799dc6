"""Kinds of robots: what is wrong with a mission of them, and their files and tables."""

import json
import math
import warnings
from dataclasses import replace
from fractions import Fraction

import networkx as nx
import numpy as np
import pandas as pd
import pytest
from hypothesis import given
from hypothesis import strategies as st

from botohe_moo import (
    BOTOHE,
    Kind,
    Mission,
    MissionError,
    load_mission,
    mission_from_tables,
    save_mission,
)
from botohe_moo.kernels.graph.graph import NO_LIMITS
from botohe_moo.mission import read_mission
from tests.strategies import team_missions

DRONE, ROVER = Kind("drone", 2, start="roof", end="roof"), Kind("rover", 1)
BOTH = (DRONE, ROVER)


def site(**changes):
    """A dock and a roof with a lab between them; attributes of "lab" and of arcs may be changed."""
    graph = nx.DiGraph(base="dock")
    graph.add_node("dock", reward=0)
    graph.add_node("lab", reward=5, share={"drone": 0.5})
    graph.add_node("roof", reward=1, share={"rover": 0})
    for one, other, survival in (
        ("dock", "lab", {"drone": 0.5, "rover": 0.9}),
        ("lab", "roof", {"drone": 0.8, "rover": 0}),
    ):
        graph.add_edge(one, other, survival=survival)
        graph.add_edge(other, one, survival=survival)
    graph.nodes["lab"].update(changes.pop("lab", {}))
    graph.graph.update(changes.pop("graph", {}))
    for way, attributes in changes.items():
        graph.edges[tuple(way.split("_"))].update(attributes)
    return graph


def faults_of(graph, kinds=BOTH, **given):
    with pytest.raises(MissionError) as caught:
        Mission(graph, kinds=kinds, **given)
    return list(caught.value.faults)


NAMES = "columns survival:NAME and in --kind NAME=ROBOTS,..."
UNSEPARATED = (
    f"expected a printable name without : , = and blanks around it, as names stand in {NAMES}"
)


class TestBadInput:
    @pytest.mark.parametrize(
        ("kinds", "faults"),
        [
            ([], ["expected at least one kind, got none"]),
            ("drone", ["expected kinds to be a list of kinds, got 'drone'"]),
            (3, ["expected kinds to be a list of kinds, got 3"]),
            (
                [DRONE, 7, {"robots": 1}, {"name": "rover", "robot": 1}],
                [
                    "kinds[1]: expected a Kind, or an object, got 7",
                    "kinds[2]: expected name, found none in {'robots': 1}",
                    "kinds[3]: there is no 'robot' of a kind; most alike are robots, start, "
                    "aboard, max_length, min_survival",
                ],
            ),
            (
                [DRONE, Kind("rover", 0), Kind("rover", "3"), Kind("rover", math.nan)],
                [
                    "kind 'rover': there are two kinds of this name",
                    "kind 'rover': there are two kinds of this name",
                    "kind 'rover': expected robots to be an integer >= 1, got 0",
                    "kind 'rover': expected robots to be an integer >= 1, got '3'",
                    "kind 'rover': expected robots to be an integer >= 1, got nan",
                ],
            ),
            (
                [
                    Kind("drone", 1, min_survival="0.5", max_length=math.nan),
                    Kind("rover", 1, start="dok", end=["dock"], min_survival=1.5, max_length=-1),
                ],
                [
                    "kind 'drone': expected min_survival in [0, 1], got '0.5'",
                    "kind 'drone': expected a finite max_length >= 0, got nan",
                    "kind 'rover': expected min_survival in [0, 1], got 1.5",
                    "kind 'rover': expected a finite max_length >= 0, got -1",
                    "kind 'rover': start 'dok': there is no such node; most alike are dock, roof, "
                    "lab",
                    "kind 'rover': end ['dock']: there is no such node; most alike are dock, roof, "
                    "lab",
                ],
            ),
        ],
    )
    def test_kinds(self, kinds, faults):
        assert faults_of(site(), kinds) == faults

    def test_what_is_aboard(self):
        graph = site()
        graph.nodes["lab"]["pays"] = "return"
        for aboard, fault in (
            ("lab", "expected aboard to be a list of nodes, got 'lab'"),
            (["lab", "lab"], "aboard: 'lab' is there more than once"),
            (["labs"], "aboard 'labs': there is no such node; most alike are lab"),
            (["roof"], "aboard 'roof': expected a node that pays on return"),
        ):
            [found] = faults_of(graph, [DRONE, Kind("rover", 1, aboard=aboard)])
            assert found.startswith(f"kind 'rover': {fault}")

    @pytest.mark.parametrize("name", ["a:b", "a,b", "a=b", " a", "a\n", "a\nb"])
    def test_names_that_columns_and_options_cannot_hold(self, name):
        graph = nx.DiGraph(base=0)
        graph.add_node(0, reward=0)
        assert faults_of(graph, [Kind(name, 1)]) == [f"kind {name!r}: {UNSEPARATED}"]
        assert "text that is not blank" in faults_of(graph, [Kind("", 1)])[0]
        assert "text that is not blank" in faults_of(graph, [Kind(3, 1)])[0]

    @pytest.mark.parametrize(
        ("changes", "faults"),
        [
            (
                {"lab": {"share": {"drone": 2, "rovr": 1}}},
                [
                    "node 'lab': share of kind 'rovr': there is no such kind; most alike are "
                    "rover, drone",
                    "node 'lab': expected share in [0, 1] of kind 'drone', got 2",
                ],
            ),
            (
                {"lab": {"share": "1", "pays": "later", "depot": "yes"}},
                [
                    "node 'lab': expected share in [0, 1], got '1'",
                    "node 'lab': expected pays to be 'arrival' or 'return', got 'later'",
                    "node 'lab': expected depot to be true or false, got 'yes'",
                ],
            ),
            (
                {
                    "dock_lab": {"survival": {"drone": 0.5, "rovr": 0.9}},
                    "lab_dock": {"survival": {"drone": math.nan}},
                    "lab_roof": {"survival": {"drone": "0,8", "rover": -1}},
                    "roof_lab": {"survival": 0},
                },
                [
                    "arc 'dock' -> 'lab': survival of kind 'rovr': there is no such kind; most "
                    "alike are rover, drone",
                    "arc 'lab' -> 'dock': expected survival in [0, 1] of kind 'drone', got nan",
                    "arc 'lab' -> 'dock': expected survival in [0, 1] of kind 'rover', found none",
                    "arc 'lab' -> 'roof': expected survival in [0, 1] of kind 'drone', got '0,8'; "
                    "write numbers with a point",
                    "arc 'lab' -> 'roof': expected survival in [0, 1] of kind 'rover', got -1",
                    "arc 'roof' -> 'lab': expected survival in (0, 1], got 0",
                ],
            ),
            (
                {"graph": {"pays": "home"}},
                ["expected pays to be 'arrival' or 'return', got 'home'"],
            ),
            (
                {"lab": {"share:rover": 0.5, "pays": np.zeros(2)}},
                [
                    "node 'lab': expected share to be a mapping from kinds to numbers, found an "
                    "attribute 'share:rover', which stands in tables and GraphML only",
                    "node 'lab': expected pays to be 'arrival' or 'return', got array([0., 0.])",
                ],
            ),
        ],
    )
    def test_attributes(self, changes, faults):
        assert sorted(faults_of(site(**changes))) == sorted(faults)

    def test_kinds_that_no_mission_lists(self):
        with pytest.raises(MissionError) as caught:
            Mission(site(), robots=2)
        assert caught.value.faults[0] == (
            "node 'lab': expected share in [0, 1], got {'drone': 0.5}; the mission lists no kinds"
        )
        assert len(caught.value.faults) == 2 + 4

    def test_robots_beside_kinds(self):
        fault = ["expected robots to be 3, the robots of all kinds together, or none, got 4"]
        assert faults_of(site(), robots=4) == fault
        assert faults_of(site(graph={"kinds": BOTH, "robots": 4}), kinds=None) == fault
        assert Mission(site(graph={"robots": 4}), kinds=BOTH).robots == 3
        one = {"name": "drone", "robots": 2}
        graph = nx.DiGraph(base=0, kinds=[one])
        graph.add_node(0, reward=1)
        assert Mission(graph, robots=5).kinds == (Kind("drone", 5),)
        graph.graph["robots"] = 3
        fault = ["expected robots to be 2, the robots of all kinds together, or none, got 3"]
        assert faults_of(graph, kinds=None) == fault

    @pytest.mark.parametrize(
        ("rover", "faults"),
        [
            (
                Kind("rover", 1, start="roof"),
                ["kind 'rover': has no way from its start 'roof' to its end 'dock'"],
            ),
            (
                Kind("rover", 1, start="lab", min_survival=0.91, max_length=0.5),
                [
                    "kind 'rover': expected min_survival to be at most 0.9, that of the safest "
                    "way from its start 'lab' to its end 'dock', got 0.91",
                    "kind 'rover': expected max_length to be at least 1, that of the shortest "
                    "way from its start 'lab' to its end 'dock', got 0.5",
                ],
            ),
            (Kind("rover", 1, start="lab", min_survival=0.9, max_length=1), []),
        ],
    )
    def test_a_kind_that_cannot_get_home(self, rover, faults):
        if faults:
            assert faults_of(site(), [DRONE, rover]) == faults
        else:
            Mission(site(), kinds=[DRONE, rover])

    def test_the_missions_own_budget_is_too_short_for_a_kind(self):
        graph, rover = site(graph={"max_length": 0.5}), Kind("rover", 1, start="lab")
        assert faults_of(graph, [DRONE, rover]) == [
            "kind 'rover': expected max_length to be at least 1, that of the shortest way from its "
            "start 'lab' to its end 'dock', got 0.5"
        ]
        assert Mission(graph, kinds=[DRONE, replace(rover, max_length=1)]).robots == 3

    def test_what_no_kind_can_collect(self):
        graph = site(lab={"share": {"drone": 0, "rover": 0}})
        with pytest.warns(UserWarning, match=r"no kind of robots can collect .* of 'lab'\.$"):
            Mission(graph, kinds=BOTH)
        graph = site(lab_dock={"survival": {"drone": 0, "rover": 0.9}})
        with pytest.warns(UserWarning, match=r"no kind of robots can collect .* of 'roof'\.$"):
            Mission(graph, kinds=BOTH, pays="return")  # drones, the only ones there, pass no depot
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            graph.nodes["roof"]["depot"] = True
            Mission(graph, kinds=BOTH, pays="return")

    def test_another_number_of_robots(self):
        mission = Mission(site(), kinds=BOTH, name="site")
        with pytest.raises(MissionError, match=r"'site': it has 3 robots \(2 drone, 1 rover\): e"):
            mission.with_robots(4)


texts = st.text("abé", max_size=3)
labels = texts | st.tuples(st.integers(0, 9), texts)


@pytest.mark.filterwarnings("ignore:.*no kind of robots can collect")
class TestFiles:
    @given(team_missions(labels=labels))
    def test_json(self, tmp_path_factory, mission):
        path = tmp_path_factory.getbasetemp() / "kinds.json"
        save_mission(mission, path)
        read = read_mission(path)
        assert read == mission
        assert dict(read.graph.nodes) == dict(mission.graph.nodes)
        assert dict(read.graph.edges) == dict(mission.graph.edges)
        written = path.read_bytes()
        save_mission(read, path)
        assert path.read_bytes() == written

    @given(team_missions(labels=texts))
    def test_graphml(self, tmp_path_factory, mission):
        path = tmp_path_factory.getbasetemp() / "kinds.graphml"
        save_mission(mission, path)
        assert read_mission(path) == mission

    def test_what_is_written(self, tmp_path):
        robots, length = np.int64(2), Fraction(5, 2)
        kinds = [Kind("drone", robots, start="roof", max_length=length), ROVER]
        save_mission(Mission(site(), kinds=kinds, pays="return"), tmp_path / "site.json")
        assert json.loads((tmp_path / "site.json").read_text())["graph"] == {
            "name": "mission",
            "base": "dock",
            "kinds": [
                {"name": "drone", "robots": 2, "start": "roof", "max_length": 2.5},
                {"name": "rover", "robots": 1},
            ],
            "pays": "return",
        }

    def test_arguments_go_before_the_graphs_attributes(self, tmp_path):
        graph = site(graph={"kinds": [{"name": "rover", "robots": 9}], "pays": "return"})
        mission = Mission(graph, kinds=BOTH, pays="arrival")
        save_mission(mission, tmp_path / "site.json")
        read = read_mission(tmp_path / "site.json")
        assert (read, read.pays) == (mission, "arrival")

    @pytest.mark.parametrize(
        ("kinds", "fault"),
        [
            ({"name": "drone"}, "expected kinds to be a list of kinds, got {'name': 'drone'}"),
            ([{"name": "drone", "robots": 1, "start": {}}], "expected a label, a string, a number"),
        ],
    )
    def test_kinds_that_are_none(self, tmp_path, kinds, fault):
        path = tmp_path / "site.json"
        save_mission(Mission(site(), kinds=BOTH), path)
        content = json.loads(path.read_text())
        content["graph"]["kinds"] = kinds
        path.write_text(json.dumps(content))
        with pytest.raises(MissionError, match=fault):
            read_mission(path)

    def test_graphml_by_hand(self, tmp_path):
        path = tmp_path / "site.graphml"
        graph = site(graph={"kinds": '[{"name": "drone", "robots": 2, "end": "lab"}]'})
        for *_, attributes in (*graph.nodes(data=True), *graph.edges(data=True)):
            for name in {"share", "survival"} & set(attributes):
                attributes.update({f"{name}:drone": attributes.pop(name).get("drone", 1)})
        nx.write_graphml(graph, path)
        mission = read_mission(path)
        assert mission.kinds == (Kind("drone", 2, end="lab"),)
        assert mission.graph.nodes["lab"]["share"] == {"drone": 0.5}
        assert mission.graph.edges["lab", "roof"]["survival"] == {"drone": 0.8}
        text = path.read_text()
        for old, new, fault in (
            ("survival:drone", "survival:rover", "column 'survival:rover': there is no kind 'rov"),
            ('"robots": 2', '"robots"', "expected kinds as JSON, got '"),
        ):
            path.write_text(text.replace(old, new))
            with pytest.raises(MissionError, match=fault):
                read_mission(path)


class TestTables:
    NODES = pd.DataFrame(
        {
            "label": ["dock", "lab", "roof"],
            "reward": ["0", "5", "1"],
            "share": ["", "0.75", ""],
            "Share: drone": ["", "0.5", ""],
            "pays": ["", "Return", ""],
            "depot": ["no", None, "Yes"],
        }
    )
    ARCS = pd.DataFrame({"tail": ["dock", "lab", "dock"], "head": ["lab", "roof", "roof"]})

    def made(self, kinds=BOTH, **columns):
        arcs = self.ARCS.assign(**columns)
        return mission_from_tables(self.NODES, arcs, base="dock", kinds=kinds, both_ways=True)

    def test_a_column_for_each_kind(self):
        columns = {"survival:drone": [0.5, 0.8, None], "Survival : rover": ["0.9", "", "0.7"]}
        mission = self.made(**columns)
        assert mission.kinds == BOTH
        survivals = {way: arc["survival"] for way, arc in mission.graph.edges.items()}
        there = {
            ("dock", "lab"): {"drone": 0.5, "rover": 0.9},
            ("lab", "roof"): {"drone": 0.8, "rover": 0.0},
            ("dock", "roof"): {"drone": 0.0, "rover": 0.7},
        }
        assert survivals == there | {(v, u): values for (u, v), values in there.items()}
        assert dict(mission.graph.nodes["dock"]) == {"reward": 0, "depot": False}
        assert dict(mission.graph.nodes["roof"]) == {"reward": 1, "depot": True}
        share = {"drone": 0.5, "rover": 0.75}
        assert dict(mission.graph.nodes["lab"]) == {"reward": 5, "share": share, "pays": "return"}

    def test_beside_a_column_for_all(self):
        mission = self.made(survival=[0.9, 0.9, 0.4], **{"survival:drone": [0.5, 0, None]})
        assert [arc["survival"] for *_, arc in mission.graph.edges("dock", data=True)] == [
            {"drone": 0.5, "rover": 0.9},
            0.4,
        ]
        assert mission.graph.edges["lab", "roof"]["survival"] == {"drone": 0, "rover": 0.9}

    def test_flags_and_pays_for_all(self):
        nodes = pd.DataFrame({"label": [1, 2], "reward": [0, 1], "depot": [1.0, 0.0]})
        arcs = pd.DataFrame({"tail": [1], "head": [2], "survival": [0.9]})
        mission = mission_from_tables(nodes, arcs, base=1, robots=1, pays="return", both_ways=True)
        assert mission.pays == "return"
        assert [mission.graph.nodes[node]["depot"] for node in (1, 2)] == [True, False]

    @pytest.mark.parametrize(
        ("columns", "faults"),
        [
            (
                {"survival:drone": 0.9, "survival:rovr": 0.9},
                ["arcs: column 'survival:rovr': there is no kind 'rovr'; most alike are rover, dr"],
            ),
            (
                {"survival:drone": ["0,5", 0.9, 0.9], "survival:rover": [0.9, 2, 0.9]},
                [
                    "arc 'dock' -> 'lab': expected survival in [0, 1] of kind 'drone', got '0,5'",
                    "arc 'lab' -> 'dock': expected survival in [0, 1] of kind 'drone', got '0,5'",
                    "arc 'lab' -> 'roof': expected survival in [0, 1] of kind 'rover', got 2",
                    "arc 'roof' -> 'lab': expected survival in [0, 1] of kind 'rover', got 2",
                ],
            ),
            (
                {"survival:drone": 0.9},
                ["arcs: expected a column 'survival:rover', found none"],
            ),
        ],
    )
    def test_what_is_wrong(self, columns, faults):
        with pytest.raises(MissionError) as caught:
            self.made(**columns)
        found = sorted(caught.value.faults)
        assert len(found) == len(faults)
        assert all(map(str.startswith, found, sorted(faults)))

    def test_names_come_before_columns(self):
        with pytest.raises(MissionError, match=r"kind 'drone': there are two kinds of this name$"):
            self.made([DRONE, DRONE], **{"survival:rover": 0.9})


def test_numbers_by_kind_are_frozen():
    graph = site()
    mission = Mission(graph, kinds=BOTH)
    graph.nodes["lab"]["share"]["drone"] = 1
    assert mission.graph.nodes["lab"]["share"] == {"drone": 0.5}
    with pytest.raises(TypeError, match="cannot be changed"):
        mission.graph.edges["lab", "dock"]["survival"]["drone"] = 1
    copied = mission.graph.copy()
    copied.edges["lab", "dock"]["survival"]["drone"] = 1
    assert mission.graph.edges["lab", "dock"]["survival"] == {"drone": 0.5, "rover": 0.9}


def test_ways_between_the_safest_and_the_shortest_are_not_tried():
    graph = nx.DiGraph()
    graph.add_nodes_from("abcd", reward=1)
    graph.add_edge("a", "b", survival=0.3, length=1)
    nx.add_path(graph, "acb", survival=0.7, length=1)
    nx.add_path(graph, "adb", survival=0.95, length=3)
    mission = Mission(graph, base="b", kinds=[Kind("drone", 1, start="a", max_length=3)])
    assert mission.labels(mission.stay_home()) == (("a", "b"),)
    assert mission.labels(mission.stay_home(mission.limits(0, 6))) == (("a", "b"),)
    assert mission.labels(mission.stay_home(NO_LIMITS)) == (("a", "d", "b"),)
    kept = r"'mission': robots of kind 'drone' cannot keep min_survival 0\.4 and max_length 3\."
    found = r"from 'a' to 'b', .* is survived with 0\.3 and is 1 long; no others are tried\.$"
    with pytest.raises(ValueError, match=f"{kept} .* {found}"):
        BOTOHE(mission, min_survival=0.4)


def test_the_museum_on_return():
    museum, on_return = load_mission("art_museum"), load_mission("art_museum_return")
    assert (on_return.pays, on_return.kinds) == ("return", museum.kinds)
    assert on_return.title == f"{museum.title}, rewards on return"
    assert load_mission("art_museum_return", robots=5).robots == 5
    plan = museum.plan([[1, 2, 3, 2, 1], [1], [1]])
    arrival, later = (mission.evaluate([plan])[0] for mission in (museum, on_return))
    survival = [museum.graph.edges[arc]["survival"] for arc in ((1, 2), (2, 3), (3, 2), (2, 1))]
    assert arrival[0] == pytest.approx(math.prod(survival[:2]))  # only node 3 has a reward, of 1
    assert later[0] == pytest.approx(math.prod(survival))
    assert later[1] == arrival[1]
