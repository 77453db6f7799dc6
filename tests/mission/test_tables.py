"""Missions from tables of nodes and arcs."""

import pandas as pd
import pytest

from botohe_moo import mission_from_tables
from botohe_moo.base.files import read_table
from tests.mission.made import BOTH, DRONE, faults_of

NODES = {"label": ["dock", "reef", "cave"], "reward": [0, 5, 2.5], "x": [0, 1, 2], "y": [0, 1, 0]}
ARCS = {"tail": ["dock", "reef"], "head": ["reef", "cave"], "survival": [0.9, 0.8]}
LOOP = {"tail": ["dock", "reef", "reef"], "head": ["reef", "dock", "cave"], "survival": [0.9] * 3}

ROW1, ROW2 = "nodes, row 1: ", "nodes, row 2: "
NO_WAY = "node '{}': has no way back to base 'dock'"
ALL_LEAD_ON = "no arc leads back; both_ways makes every arc passable both ways"


def made(nodes=None, arcs=None, *, base="dock", robots=2, both_ways=True, **options):
    tables = pd.DataFrame({**NODES, **(nodes or {})}), pd.DataFrame({**ARCS, **(arcs or {})})
    return mission_from_tables(*tables, base=base, robots=robots, both_ways=both_ways, **options)


def test_a_site():
    mission = made(name="pier", title="The pier", max_length=20)
    assert (mission.nodes, mission.base, mission.robots) == (("dock", "reef", "cave"), "dock", 2)
    assert (mission.name, mission.title, mission.max_length) == ("pier", "The pier", 20)
    assert dict(mission.graph.nodes["reef"]) == {"reward": 5, "pos": [1, 1]}
    there = {("dock", "reef"): 0.9, ("reef", "cave"): 0.8}
    both = there | {(head, tail): survival for (tail, head), survival in there.items()}
    assert {(u, v): s for u, v, s in mission.graph.edges(data="survival")} == both
    kept = made(arcs=LOOP | {"survival": [0.9, 0.8, 0.7]}).graph.edges  # an arc that has one back
    assert (kept["reef", "dock"], kept["cave", "reef"]) == ({"survival": 0.8}, {"survival": 0.7})


def test_names_of_columns_blanks_and_texts():
    nodes = {" Label ": ["dock ", "reef"], "REWARD": ["0", " 5 "], "Zone": ["a", ""], "": ["", ""]}
    arcs = {"Head": ["reef", "dock"], "TAIL": ["dock", "reef"], "Survival": ["9e-1", "1"]}
    arcs["length"] = ["12", None]
    mission = mission_from_tables(pd.DataFrame(nodes), pd.DataFrame(arcs), base=" dock", robots=1)
    assert dict(mission.graph.nodes) == {"dock": {"reward": 0, "zone": "a"}, "reef": {"reward": 5}}
    assert mission.graph.edges["dock", "reef"] == {"survival": 0.9, "length": 12}
    assert mission.graph.edges["reef", "dock"] == {"survival": 1}


def test_labels_that_are_numbers_and_nullable_types():
    rows = [(1, 0, 0, 1), (2, None, None, None), (3, 2, 0, 3)]
    nodes = pd.DataFrame(rows, columns=["label", "x", "y", "depth"]).astype({"label": int})
    arcs = pd.DataFrame(ARCS | {"tail": [1, 2], "head": [2, 3]})
    for convert in (pd.DataFrame.copy, pd.DataFrame.convert_dtypes):
        tables = convert(nodes), convert(arcs)
        mission = mission_from_tables(*tables, base=1, robots=1, both_ways=True)
        assert [*map(type, mission.nodes)] == [int] * 3
        assert dict(mission.graph.nodes[2]) == {"reward": 1}
        assert dict(mission.graph.nodes[3]) == {"reward": 1, "pos": [2, 0], "depth": 3}


@pytest.mark.parametrize(
    ("nodes", "arcs", "given", "faults"),
    [
        (
            {"label": ["dock", "reef", None], "reward": [0, -1, "2,5"], "x": [0, None, 1]},
            {"head": ["reef", None], "survival": [None, 0.8], "length": [-1, True]},
            {},
            [
                "nodes, row 2: expected label, found nothing",
                "arcs, row 1: expected head, found nothing",
                "arcs, row 0: arc 'dock' -> 'reef': expected a survival, found none (2 without "
                "one): give danger, the rate of loss for a unit of length",
                "nodes, row 1: node 'reef': expected a finite reward >= 0, got -1",
                "nodes, row 1: node 'reef': expected pos [x, y], two finite numbers, got [None, 1]",
                "arcs, row 0: arc 'dock' -> 'reef': expected a finite length >= 0, got -1",
            ],
        ),
        (
            {"label": ["dock", "reef", "reef"]},
            {"tail": ["dock", "reef"], "head": ["cavern", "dock"]},
            {},
            [
                "nodes, row 2: node 'reef' is listed more than once",
                "arcs, row 0: arc 'dock' -> 'cavern': there is no node 'cavern'",
            ],
        ),
        (
            {},
            {},
            {"both_ways": False},
            [ROW1 + NO_WAY.format("reef"), ROW2 + NO_WAY.format("cave"), ALL_LEAD_ON],
        ),
        ({}, LOOP, {"both_ways": False}, [ROW2 + NO_WAY.format("cave")]),
        (
            {},
            {"survival": ["95%", 0.5]},
            {},
            [
                "arcs, row 0: arc 'dock' -> 'reef': expected survival in (0, 1], got '95%'; write "
                "a number, such as 0.95",
            ],
        ),
    ],
)
def test_rows_and_the_mission_are_checked(nodes, arcs, given, faults):
    assert faults_of(nodes, arcs, make=made, **given) == faults


def test_columns_are_checked():
    nodes, arcs = pd.DataFrame({**NODES, "Label": "x"}), pd.DataFrame({"from": [], "to": []})
    assert faults_of(nodes, arcs, make=mission_from_tables, base="dock", robots=1) == [
        "nodes: expected one column 'label', found 'label, reward, x, y, Label'",
        "arcs: expected one column 'tail', found 'from, to'",
        "arcs: expected one column 'head', found 'from, to'",
    ]
    with pytest.raises(TypeError, match=r"Expected nodes to be a pandas\.DataFrame, got {"):
        mission_from_tables(NODES, pd.DataFrame(ARCS), base="dock", robots=1)


def test_rows_of_files_are_named_by_their_lines(tmp_path):
    (tmp_path / "a, b.csv").write_text("label;reward;x;y\ndock;0;0;0\nreef;1;1;1\n\n;1\n")
    (tmp_path / "arcs.csv").write_text("tail\thead\tsurvival\ndock\treef\t2\nreef\tpier\t1\n")
    tables = (read_table(tmp_path / name) for name in ("a, b.csv", "arcs.csv"))
    assert faults_of(*tables, make=mission_from_tables, base="dock", robots=1) == [
        f"{tmp_path}/a, b.csv, row 5: expected label, found nothing",
        f"{tmp_path}/arcs.csv, row 3: arc 'reef' -> 'pier': there is no node 'pier'",
        f"{tmp_path}/arcs.csv, row 2: arc 'dock' -> 'reef': expected survival in (0, 1], got 2",
    ]


class TestColumnsOfKinds:
    NODES = pd.DataFrame(
        [
            ["dock", "0", "", "", "", "no"],
            ["lab", "5", "0.75", "0.5", "Return", None],
            ["roof", "1", "", "", "", "Yes"],
        ],
        columns=["label", "reward", "share", "Share: drone", "pays", "depot"],
    )
    ARCS = pd.DataFrame({"tail": ["dock", "lab", "dock"], "head": ["lab", "roof", "roof"]})

    def made(self, kinds=BOTH, **columns):
        arcs = self.ARCS.assign(**columns)
        return mission_from_tables(self.NODES, arcs, base="dock", kinds=kinds, both_ways=True)

    def test_are_read(self):
        columns = {"survival:drone": [0.5, 0.8, None], "Survival : rover": ["0.9", "", "0.7"]}
        mission = self.made(**columns)
        there = {
            ("dock", "lab"): {"drone": 0.5, "rover": 0.9},
            ("lab", "roof"): {"drone": 0.8, "rover": 0.0},
            ("dock", "roof"): {"drone": 0.0, "rover": 0.7},
        }
        survivals = {way: arc["survival"] for way, arc in mission.graph.edges.items()}
        assert survivals == there | {(v, u): values for (u, v), values in there.items()}
        assert mission.kinds == BOTH
        share = {"drone": 0.5, "rover": 0.75}
        assert dict(mission.graph.nodes) == {
            "dock": {"reward": 0, "depot": False},
            "lab": {"reward": 5, "share": share, "pays": "return"},
            "roof": {"reward": 1, "depot": True},
        }

    def test_stand_beside_a_column_for_all(self):
        mission = self.made(survival=[0.9, 0.9, 0.4], **{"survival:drone": [0.5, 0, None]})
        survivals = [arc["survival"] for *_, arc in mission.graph.edges("dock", data=True)]
        assert survivals == [{"drone": 0.5, "rover": 0.9}, 0.4]
        assert mission.graph.edges["lab", "roof"]["survival"] == {"drone": 0, "rover": 0.9}

    def test_are_checked(self):
        no_kind = "arcs, row 0: column 'survival:rov': no such kind; the kinds are drone"
        comma = {"survival:drone": ["0,5", 1, 1], "survival:rover": 1}
        for kinds, columns, *starts in (
            (BOTH, {"survival:drone": 1, "survival:rov": 1}, no_kind + ", rover"),
            ([DRONE], {"survival": 1, "survival:rov": 1}, no_kind),
            (
                None,
                {"survival:drone": 1},
                "nodes, row 1: column 'share:drone': no such kind; the m",
            ),
            (
                BOTH,
                {"survival:drone": 1},
                "arcs, row 0: expected a column 'survival:rover', found n",
            ),
            (BOTH, comma, "arcs, row 0: arc 'dock' -> 'lab': expected survival in"),
        ):
            found = faults_of(kinds, make=self.made, **columns)
            assert [f[: len(s)] for f, s in zip(found, starts, strict=True)] == starts
