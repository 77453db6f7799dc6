"""One plan as JSON, CSV and GeoJSON."""

import csv
import io
import json
import re

import networkx as nx
import pytest
from hypothesis import given

from botohe_moo import Mission
from botohe_moo.decide import plan_csv, plan_geojson, plan_json, write_plan
from tests.decide.made import MISSION, star, trips
from tests.strategies import missions_with_plans

LABELS = ["north hall", 7, (1, "x"), 'say "no"', "a,b", "</script>", "漢字", "line\nbreak"]


def placed(**positions):
    """The star, with positions of some nodes."""
    graph = nx.DiGraph(MISSION.graph)
    nx.set_node_attributes(graph, positions, "pos")
    return Mission(graph, base="dock", robots=2, name="star")


PLACES = {"dock": [0, 0], "a": [1, 2.5], "b": (-1, 0), "c": [3, 3]}


def test_json():
    content = json.loads(plan_json(MISSION, trips(MISSION, "a", "b")))
    assert content == {
        "mission": "star",
        "robots": 2,
        "reward": pytest.approx(3.8),
        "survivors": pytest.approx(1.4),
        "robot_survival": [0.5, 0.9],
        "trail_lengths": [2.0, 2.0],
        "trails": [["dock", "a", "dock"], ["dock", "b", "dock"]],
    }


@given(missions_with_plans())
def test_all_plans_are_read_back_with_equal_objectives(drawn):
    mission, plan = drawn
    content = json.loads(plan_json(mission, plan))
    again = mission.plan(content["trails"])
    assert again.trails == plan.trails
    assert mission.evaluate([again]).tolist() == [[content["reward"], content["survivors"]]]
    rows = list(csv.DictReader(io.StringIO(plan_csv(mission, plan))))
    trails = {}
    for row in rows:
        trail = trails.setdefault(int(row["robot"]), [])
        assert int(row["step"]) == len(trail)
        trail.append(int(row["node"]))
    assert mission.plan(trails[robot] for robot in range(mission.robots)).trails == plan.trails


def test_csv():
    mission = placed(**{**PLACES, "b": None})
    assert plan_csv(mission, trips(mission, "a", "b")).splitlines() == [
        "robot,step,node,x,y",
        "0,0,dock,0.0,0.0",
        "0,1,a,1.0,2.5",
        "0,2,dock,0.0,0.0",
        "1,0,dock,0.0,0.0",
        "1,1,b,,",
        "1,2,dock,0.0,0.0",
    ]


def test_csv_of_labels():
    mission = star(dict.fromkeys(LABELS, (1, 0.5)), robots=len(LABELS))
    rows = csv.DictReader(io.StringIO(plan_csv(mission, trips(mission, *LABELS)), newline=""))
    written = [row["node"] for row in rows if row["step"] == "1"]
    assert written == [label if isinstance(label, str) else json.dumps(label) for label in LABELS]


def test_geojson():
    mission = placed(**PLACES)
    content = json.loads(plan_geojson(mission, trips(mission, "a")))
    assert content["type"] == "FeatureCollection"
    assert all(feature["type"] == "Feature" for feature in content["features"])
    shapes = [
        (feature["geometry"]["type"], feature["geometry"]["coordinates"], feature["properties"])
        for feature in content["features"]
    ]
    assert shapes == [
        (
            "LineString",
            [[0, 0], [1, 2.5], [0, 0]],
            {"robot": 0, "survival": 0.5, "nodes": ["dock", "a", "dock"]},
        ),
        ("Point", [0, 0], {"robot": 1, "survival": 1, "nodes": ["dock"]}),
        ("Point", [0, 0], {"node": "dock", "reward": 0, "reached": 1}),
        ("Point", [1, 2.5], {"node": "a", "reward": 4, "reached": 0.5}),
    ]


def test_geojson_needs_the_places_that_are_visited():
    mission = placed(**{**PLACES, "b": None})
    plan_geojson(mission, trips(mission, "a"))
    expected = r"^Node 'b': expected pos \[x, y\] for GeoJSON, found none; a \.csv or \.json"
    with pytest.raises(ValueError, match=expected):
        plan_geojson(mission, trips(mission, "b"))


def test_labels_that_json_cannot_hold():
    mission = star({frozenset({3}): (1, 0.5)})
    for write in (plan_json, plan_csv):
        with pytest.raises(ValueError, match="frozenset"):
            write(mission, trips(mission, frozenset({3})))


def test_files(tmp_path):
    mission = placed(**PLACES)
    plan = trips(mission, "a", "c")
    for name, write in (("p.json", plan_json), ("p.CSV", plan_csv), ("p.geojson", plan_geojson)):
        write_plan(mission, plan, tmp_path / name)
        assert (tmp_path / name).read_bytes() == write(mission, plan).encode()


def test_files_that_cannot_be_written(tmp_path):
    plan = trips(MISSION, "a")
    expected = "ends in one of .json, .csv, .geojson, .plan; found the suffix '.txt'."
    with pytest.raises(ValueError, match=re.escape(expected)):
        write_plan(MISSION, plan, tmp_path / "plan.txt")
    with pytest.raises(ValueError, match="found none"):
        write_plan(MISSION, plan, tmp_path / "plan.geojson")
    assert list(tmp_path.iterdir()) == []
