"""Missions from tables of nodes and arcs."""

import numpy as np
import pandas as pd
import pytest
from hypothesis import given

from botohe_moo import MissionError, mission_from_tables
from botohe_moo.base.files import read_table
from tests.strategies import missions

NODES = {"label": ["dock", "reef", "cave"], "reward": [0, 5, 2.5], "x": [0, 1, 2], "y": [0, 1, 0]}
ARCS = {"tail": ["dock", "reef"], "head": ["reef", "cave"], "survival": [0.9, 0.8]}


def made(nodes=None, arcs=None, *, base="dock", robots=2, both_ways=True, **options):
    tables = pd.DataFrame({**NODES, **(nodes or {})}), pd.DataFrame({**ARCS, **(arcs or {})})
    return mission_from_tables(*tables, base=base, robots=robots, both_ways=both_ways, **options)


def faults_of(*args, **options):
    with pytest.raises(MissionError) as caught:
        made(*args, **options)
    return list(caught.value.faults)


def test_a_site():
    mission = made(name="pier", title="The pier")
    assert mission.nodes == ("dock", "reef", "cave")
    assert (mission.base, mission.robots, mission.name) == ("dock", 2, "pier")
    assert (mission.title, mission.total_reward) == ("The pier", 7.5)
    assert dict(mission.graph.nodes["reef"]) == {"reward": 5, "pos": [1, 1]}
    assert {(u, v): s for u, v, s in mission.graph.edges(data="survival")} == {
        ("dock", "reef"): 0.9,
        ("reef", "dock"): 0.9,
        ("reef", "cave"): 0.8,
        ("cave", "reef"): 0.8,
    }


def test_one_way():
    arcs = {"tail": ["dock", "reef"], "head": ["reef", "dock"], "survival": [0.9, 0.8]}
    nodes = pd.DataFrame({"label": ["dock", "reef"], "reward": [0, 1]})
    mission = mission_from_tables(nodes, pd.DataFrame(arcs), base="dock", robots=1)
    assert mission.graph.edges["dock", "reef"]["survival"] == 0.9
    assert mission.graph.edges["reef", "dock"]["survival"] == 0.8
    assert "pos" not in mission.graph.nodes["dock"]


def test_names_of_columns_blanks_and_texts():
    nodes = {" Label ": ["dock ", "reef"], "REWARD": ["0", " 5 "], "Zone": ["a", ""], "": ["", ""]}
    arcs = {"Head": ["reef"], "TAIL": ["dock"], "Survival": ["9e-1"], "length": ["12"]}
    mission = mission_from_tables(
        pd.DataFrame(nodes), pd.DataFrame(arcs), base=" dock", robots=1, both_ways=True
    )
    assert mission.nodes == ("dock", "reef")
    assert dict(mission.graph.nodes["dock"]) == {"reward": 0, "zone": "a"}
    assert dict(mission.graph.nodes["reef"]) == {"reward": 5}
    assert dict(mission.graph.edges["reef", "dock"]) == {"survival": 0.9, "length": 12}


def test_labels_that_are_numbers():
    nodes = {"label": [1, 2, 3], "x": [0, np.nan, 2], "y": [0, np.nan, 0]}
    mission = made(nodes, {"tail": [1, 2], "head": [2, 3]}, base=1)
    assert mission.nodes == (1, 2, 3)
    assert all(type(node) is int for node in mission.nodes)
    assert "pos" not in mission.graph.nodes[2]


@given(missions(min_nodes=2))
def test_what_tables_hold_is_what_the_mission_has(mission):
    graph = mission.graph
    nodes = pd.DataFrame(graph.nodes(data="reward"), columns=["label", "reward"])
    arcs = pd.DataFrame(graph.edges(data="survival"), columns=["tail", "head", "survival"])
    arcs["length"] = pd.Series([length for *_, length in graph.edges(data="length")], dtype=float)
    assert mission_from_tables(nodes, arcs, base=0, robots=mission.robots) == mission


@pytest.mark.parametrize(
    ("nodes", "arcs", "faults"),
    [
        (
            {"label": ["dock", "reef", None], "reward": [0, -1, "2,5"], "x": [0, None, 1]},
            {"head": ["reef", None], "survival": [None, 0.8], "length": [-1, True]},
            [
                "nodes, row 2: expected label, found nothing",
                "arcs, row 1: expected head, found nothing",
                "arcs, row 0: arc 'dock' -> 'reef': expected a survival, found none (2 without "
                "one): give danger, the rate of loss for a unit of length",
                "node 'reef': expected a finite reward >= 0, got -1",
                "node 'reef': expected pos [x, y], two finite numbers, got [None, 1]",
                "arc 'dock' -> 'reef': expected a finite length >= 0, got -1",
                "arc 'reef' -> 'dock': expected a finite length >= 0, got -1",
            ],
        ),
        (
            {"reward": [0, 5, "2,5"]},
            {},
            ["node 'cave': expected a finite reward >= 0, got '2,5'; write numbers with a point"],
        ),
        (
            {"label": ["dock", "reef", "reef"]},
            {"tail": ["dock", "reef"], "head": ["cavern", "dock"]},
            [
                "nodes, row 2: node 'reef' is listed more than once",
                "arcs, row 0: arc 'dock' -> 'cavern': there is no node 'cavern'",
                "arcs, row 0: arc 'cavern' -> 'dock': there is no node 'cavern'",
            ],
        ),
    ],
)
def test_rows_are_checked(nodes, arcs, faults):
    assert faults_of(nodes, arcs) == faults


def test_nullable_types():
    nodes = pd.DataFrame({**NODES, "zone": ["a", None, "b"], "depth": [1, None, 3]})
    arcs = pd.DataFrame(ARCS).convert_dtypes()
    mission = mission_from_tables(
        nodes.convert_dtypes(), arcs, base="dock", robots=2, both_ways=True
    )
    assert dict(mission.graph.nodes["reef"]) == {"reward": 5, "pos": [1, 1]}
    assert dict(mission.graph.nodes["cave"])["depth"] == 3


def test_columns_are_checked():
    nodes, arcs = pd.DataFrame({**NODES, "Label": "x"}), pd.DataFrame({"from": [], "to": []})
    with pytest.raises(MissionError) as caught:
        mission_from_tables(nodes, arcs, base="dock", robots=1)
    assert caught.value.faults == (
        "nodes: expected one column 'label', found 'label, reward, x, y, Label'",
        "arcs: expected one column 'tail', found 'from, to'",
        "arcs: expected one column 'head', found 'from, to'",
    )


def test_all_faults_of_both_files_are_listed(tmp_path):
    (tmp_path / "a, b.csv").write_text("label;reward;x;y\ndock;0;0;0\nreef;1;1;1\n\n;1\n")
    (tmp_path / "arcs.csv").write_text("tail\thead\tsurvival\ndock\treef\t2\nreef\tpier\t1\n")
    nodes, arcs = (read_table(tmp_path / name) for name in ("a, b.csv", "arcs.csv"))
    with pytest.raises(MissionError) as caught:
        mission_from_tables(nodes, arcs, base="dock", robots=1)
    assert caught.value.faults == (
        f"{tmp_path}/a, b.csv, row 5: expected label, found nothing",
        f"{tmp_path}/arcs.csv, row 3: arc 'reef' -> 'pier': there is no node 'pier'",
        "arc 'dock' -> 'reef': expected survival in (0, 1], got 2",
    )


def test_the_mission_is_checked():
    assert faults_of(robots=0, base="pier") == [
        "expected robots to be an integer >= 1, got 0",
        "base 'pier': there is no such node; most alike are cave, reef, dock",
    ]
    assert faults_of(both_ways=False) == [
        "node 'reef': has no way back to base 'dock'",
        "node 'cave': has no way back to base 'dock'",
        "no arc leads back; both_ways makes every arc passable both ways",
    ]
    back = {"tail": ["dock", "reef", "reef"], "head": ["reef", "dock", "cave"], "survival": 0.9}
    assert faults_of(arcs=back, both_ways=False) == ["node 'cave': has no way back to base 'dock'"]


@pytest.mark.parametrize("both_ways", [False, True])
def test_a_self_loop(both_ways):
    arcs = {"tail": ["dock", "reef"], "head": ["reef", "dock"], "survival": [0.9, 0.8]}
    nodes = pd.DataFrame({"label": ["dock", "reef"], "reward": [0, 1]})
    looped = pd.concat([pd.DataFrame(arcs), pd.DataFrame({"tail": ["reef"], "head": ["reef"]})])
    with pytest.raises(MissionError) as caught:
        mission_from_tables(nodes, looped, base="dock", robots=1, both_ways=both_ways)
    assert caught.value.faults == ("arc 'reef' -> 'reef': a node must not have an arc to itself",)


def test_an_arc_that_has_one_back_keeps_it():
    arcs = {"tail": ["dock", "reef", "reef"], "head": ["reef", "dock", "cave"]}
    graph = made(arcs={**arcs, "survival": [0.9, 0.8, 0.7]}).graph
    assert {ends: graph.edges[ends]["survival"] for ends in graph.edges} == {
        ("dock", "reef"): 0.9,
        ("reef", "dock"): 0.8,
        ("reef", "cave"): 0.7,
        ("cave", "reef"): 0.7,
    }


def test_what_is_not_a_table():
    with pytest.raises(TypeError, match=r"Expected nodes to be a pandas\.DataFrame, got {"):
        mission_from_tables(NODES, pd.DataFrame(ARCS), base="dock", robots=1)
