"""Missions from tables of nodes and arcs."""

import numpy as np
import pandas as pd
import pytest
from hypothesis import given

from botohe_moo import MissionError, mission_from_tables
from botohe_moo.mission.formats.tables import read_table
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
            {"reward": [0, -1, "much"]},
            {},
            [
                "nodes, row 1, column 'reward': expected a number >= 0, found -1",
                "nodes, row 2, column 'reward': expected a number >= 0, found 'much'",
            ],
        ),
        (
            {"reward": [0, "", "2,5"]},
            {},
            [
                "nodes, row 1, column 'reward': expected a number >= 0, found nothing",
                "nodes, row 2, column 'reward': expected a number >= 0, found '2,5'; write numbers "
                "with a point",
            ],
        ),
        (
            {"x": [0, None, "e"]},
            {},
            [
                "nodes, row 1, column 'x': expected a number, found nothing",
                "nodes, row 2, column 'x': expected a number, found 'e'",
            ],
        ),
        (
            {"label": ["dock", "reef", "reef"]},
            {"tail": ["dock", "dock"], "head": ["reef", "dock"]},
            [
                "nodes, row 2: node 'reef' is listed more than once, first in row 1",
                "arcs, row 1: expected an arc between two nodes, found both ends at 'dock'",
            ],
        ),
        (
            {},
            {"head": ["reef", "cavern"], "survival": [1.2, 0]},
            [
                "arcs, row 0, column 'survival': expected a number in (0, 1], found 1.2",
                "arcs, row 1, column 'head': expected the label of a node, found 'cavern', which "
                "no row of nodes has",
                "arcs, row 1, column 'survival': expected a number in (0, 1], found 0.0",
            ],
        ),
        (
            {},
            {"tail": ["dock", "reef"], "head": ["reef", "dock"]},
            [
                "arcs, row 1: arc 'reef' -> 'dock' is there already, in row 0",
                "arcs, row 1: arc 'dock' -> 'reef' is there already, in row 0",
            ],
        ),
        (
            {"label": ["dock", None, "cave"]},
            {"length": [-1, True]},
            [
                "nodes, row 1, column 'label': expected the label of a node, found nothing",
                "arcs, row 0, column 'head': expected the label of a node, found 'reef', which "
                "no row of nodes has",
                "arcs, row 0, column 'length': expected a number >= 0, found -1",
                "arcs, row 1, column 'tail': expected the label of a node, found 'reef', which "
                "no row of nodes has",
                "arcs, row 1, column 'length': expected a number >= 0, found True",
            ],
        ),
    ],
)
def test_cells_are_checked(nodes, arcs, faults):
    assert faults_of(nodes, arcs) == faults


def test_nullable_types():
    nodes = pd.DataFrame({**NODES, "zone": ["a", None, "b"], "depth": [1, None, 3]})
    arcs = pd.DataFrame(ARCS).convert_dtypes()
    mission = mission_from_tables(
        nodes.convert_dtypes(), arcs, base="dock", robots=2, both_ways=True
    )
    assert dict(mission.graph.nodes["reef"]) == {"reward": 5, "pos": [1, 1]}
    assert dict(mission.graph.nodes["cave"])["depth"] == 3
    [fault] = faults_of({"reward": pd.array([0, None, 1], dtype="Int64")})
    assert fault == "nodes, row 1, column 'reward': expected a number >= 0, found nothing"


def test_cells_that_hold_arrays():
    cells = [np.zeros(2), np.ones(2), np.ones(1)]
    mission = made({"sizes": cells})
    assert mission.graph.nodes["reef"]["sizes"] is cells[1]
    faults = faults_of({"reward": cells})
    assert faults[0].startswith("nodes, row 0, column 'reward': expected a number >= 0, found arr")
    faults = faults_of({"label": [*NODES["label"][:2], [1]]})
    assert "nodes, row 2, column 'label': expected the label of a node, found [1]" in faults


def test_columns_are_checked():
    nodes, arcs = pd.DataFrame({**NODES, "Label": "x"}), pd.DataFrame({"from": [], "to": []})
    with pytest.raises(MissionError) as caught:
        mission_from_tables(nodes, arcs, base="dock", robots=1)
    assert caught.value.faults == (
        "nodes: expected one column 'label', found 2",
        "arcs: expected a column 'tail', found from, to",
        "arcs: expected a column 'head', found from, to",
        "arcs: expected a column 'survival', found from, to",
    )


@pytest.mark.parametrize("axis", ["x", "y"])
def test_one_axis_alone_is_one_fault(axis):
    nodes = pd.DataFrame({**NODES, axis: range(3)})
    nodes = nodes.drop(columns={"x", "y"} - {axis}, errors="ignore")
    with pytest.raises(MissionError) as caught:
        mission_from_tables(nodes, pd.DataFrame(ARCS), base="dock", robots=1)
    expected = f"nodes: expected both columns 'x' and 'y' or neither, found only {axis!r}"
    assert caught.value.faults == (expected,)


def test_files_are_named_by_row(tmp_path):
    (tmp_path / "a, b.csv").write_text("label;reward;x;y\ndock;0;0;0\nreef;1;east;0\nreef;2;1;1\n")
    (tmp_path / "arcs.csv").write_text("tail\thead\tsurvival\ndock\treef\t2\nreef\treef\t1\n")
    nodes, arcs = (read_table(tmp_path / name) for name in ("a, b.csv", "arcs.csv"))
    with pytest.raises(MissionError) as caught:
        mission_from_tables(nodes, arcs, base="dock", robots=1)
    assert caught.value.faults == (
        f"{tmp_path}/a, b.csv, row 3, column 'x': expected a number, found 'east'",
        f"{tmp_path}/a, b.csv, row 4: node 'reef' is listed more than once, first in row 3",
        f"{tmp_path}/arcs.csv, row 2, column 'survival': expected a number in (0, 1], found '2'",
        f"{tmp_path}/arcs.csv, row 3: expected an arc between two nodes, found both ends at 'reef'",
    )


def test_the_mission_is_checked():
    assert faults_of(robots=0, base="pier") == [
        "expected robots to be an integer >= 1, got 0",
        "base 'pier': there is no such node; most alike are cave, reef, dock",
    ]
    assert faults_of(both_ways=False) == [
        "node 'reef': has no way back to base 'dock'",
        "node 'cave': has no way back to base 'dock'",
        "no arc leads back; both_ways (--both-ways) makes every row two arcs",
    ]
    alone = {"tail": ["dock", "reef"], "head": ["reef", "dock"]}
    assert faults_of({}, alone, both_ways=False) == [
        "node 'cave': cannot be reached from base 'dock'",
        "node 'cave': has no way back to base 'dock'",
    ]


def test_what_is_not_a_table():
    with pytest.raises(TypeError, match=r"Expected nodes to be a pandas\.DataFrame, got {"):
        mission_from_tables(NODES, pd.DataFrame(ARCS), base="dock", robots=1)
    empty = pd.DataFrame({name: [] for name in NODES})
    with pytest.raises(MissionError, match="base 'dock': there is no such node"):
        mission_from_tables(empty, pd.DataFrame(ARCS)[:0], base="dock", robots=1)


class TestReading:
    @pytest.mark.parametrize("separator", [",", ";", "\t"])
    @pytest.mark.parametrize("start", ["", "\ufeff"])
    def test_a_file(self, tmp_path, separator, start):
        lines = ["Label,Reward", "dock,0", "", '"north ""hall""",5', ",", " 7 ,NA"]
        text = start + "\r\n".join(lines).replace(",", separator)
        (tmp_path / "nodes.csv").write_bytes(text.encode())
        table = read_table(tmp_path / "nodes.csv")
        assert list(table.columns) == ["Label", "Reward"]
        assert list(table.index) == [2, 4, 6]  # as a spreadsheet counts them
        assert table.to_numpy().tolist() == [["dock", "0"], ['north "hall"', "5"], [" 7 ", "NA"]]

    @pytest.mark.parametrize("sign", ["\u2028", "\v", "\f", "\x85"])
    def test_a_cell_with_what_unicode_takes_for_the_end_of_a_line(self, tmp_path, sign):
        path = tmp_path / "nodes.csv"
        path.write_bytes(f"label,reward\na{sign}b,5\n".encode())
        assert read_table(path).to_numpy().tolist() == [[f"a{sign}b", "5"]]

    def test_old_ends_of_lines_and_one_in_a_cell(self, tmp_path):
        path = tmp_path / "nodes.csv"
        path.write_bytes(b'label,reward\ra,1\r"b\r\nc",5\r')
        assert read_table(path).to_numpy().tolist() == [["a", "1"], ["b\r\nc", "5"]]

    @pytest.mark.parametrize(
        ("data", "fault"),
        [
            (None, "there is no such file"),
            (b"", "expected a first row of column names, found an empty file"),
            (b"\n , \n", "expected a first row of column names, found an empty file"),
            (b"label,reward\na,1,5\nb\n", "row 2: expected 2 cells, as the first row has, found 3"),
            (
                "label,reward\ncafé,1\n".encode("cp1252"),
                "text in UTF-8, found the byte 0xe9 at position 16; save it as 'CSV UTF-8'",
            ),
            (b"label,reward\n" + b"x" * 200_000, r"expected a table \(CSV\), found: field larger"),
        ],
    )
    def test_damage_is_named(self, tmp_path, data, fault):
        path = tmp_path / "nodes.csv"
        if data is not None:
            path.write_bytes(data)
        with pytest.raises(MissionError, match=fault) as caught:
            read_table(path)
        assert str(caught.value).startswith(str(path))

    def test_messages_have_a_bounded_length(self, tmp_path):
        path = tmp_path / "nodes.csv"
        names = ",".join(f"{'x' * 900}{i}" for i in range(900))
        path.write_text(f"{names}\n{'1,' * 899}1\n")
        arcs = pd.DataFrame({"tail": ["a"], "head": ["b" * 5_000], "survival": [1]})
        nodes = pd.DataFrame({"label": ["a", "c" * 5_000, "c" * 5_000], "reward": [1, 1, 1]})
        for table, said in ((read_table(path), "and 888 more"), (nodes, "listed more than once")):
            with pytest.raises(MissionError, match=said) as caught:
                mission_from_tables(table, arcs, base="a", robots=1)
            assert max(map(len, str(caught.value).splitlines())) < 2_000
