"""Kinds of robots: their files and tables, and missions of them."""

import json
import math
from fractions import Fraction

import networkx as nx
import numpy as np
import pandas as pd
import pytest
from hypothesis import given
from hypothesis import strategies as st

from botohe_moo import Kind, Mission, MissionError, load_mission, mission_from_tables, save_mission
from botohe_moo.mission import read_mission
from tests.mission.made import BOTH, DRONE, ROVER, site
from tests.strategies import team_missions

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
            ("survival:drone", "survival:rover", "column 'survival:rover': no such kind; the k"),
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
                ["arcs, row 0: column 'survival:rovr': no such kind; the kinds are drone, rover"],
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
                ["arcs, row 0: expected a column 'survival:rover', found none"],
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


def test_another_number_of_robots():
    mission = Mission(site(), kinds=BOTH, name="site")
    with pytest.raises(MissionError, match=r"'site': it has 3 robots \(2 drone, 1 rover\): e"):
        mission.with_robots(4)


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
