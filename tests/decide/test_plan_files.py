"""One plan as files: JSON, CSV, GeoJSON, and what robots take."""

import csv
import io
import json
import math
import re

import networkx as nx
import numpy as np
import pytest
from hypothesis import given

from botohe_moo import Kind, Mission
from botohe_moo.decide import (
    nav2_files,
    plan_csv,
    plan_geojson,
    plan_json,
    qgc_plans,
    robot_table,
    write_plan,
)
from botohe_moo.mission import read_mission
from tests.decide.made import MISSION, star, trips
from tests.strategies import missions_with_plans, team_missions_with_plans

LABELS = ["north hall", 7, (1, "x"), 'say "no"', "a,b", "</script>", "漢字", "line\nbreak"]


def starred(**positions):
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
        "robot_kinds": ["robot", "robot"],
        "robot_survival": [0.5, 0.9],
        "trail_lengths": [2.0, 2.0],
        "robot_rewards": pytest.approx([2.0, 1.8]),
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
    mission = starred(**{**PLACES, "b": None})
    assert plan_csv(mission, trips(mission, "a", "b")).splitlines() == [
        "robot,kind,step,node,x,y",
        "0,robot,0,dock,0.0,0.0",
        "0,robot,1,a,1.0,2.5",
        "0,robot,2,dock,0.0,0.0",
        "1,robot,0,dock,0.0,0.0",
        "1,robot,1,b,,",
        "1,robot,2,dock,0.0,0.0",
    ]


def test_csv_of_labels():
    mission = star(dict.fromkeys(LABELS, (1, 0.5)), robots=len(LABELS))
    rows = csv.DictReader(io.StringIO(plan_csv(mission, trips(mission, *LABELS)), newline=""))
    written = [row["node"] for row in rows if row["step"] == "1"]
    assert written == [label if isinstance(label, str) else json.dumps(label) for label in LABELS]


def test_geojson():
    mission = starred(**PLACES)
    content = json.loads(plan_geojson(mission, trips(mission, "a")))
    assert content["type"] == "FeatureCollection"
    assert all(feature["type"] == "Feature" for feature in content["features"])
    shapes = [
        (feature["geometry"]["type"], feature["geometry"]["coordinates"], feature["properties"])
        for feature in content["features"]
    ]
    own = [
        {"robot": 0, "kind": "robot", "survival": 0.5, "length": 2, "reward": 2},
        {"robot": 1, "kind": "robot", "survival": 1, "length": 0, "reward": 0},
    ]
    out = ["dock", "a", "dock"]
    assert shapes == [
        ("LineString", [[0, 0], [1, 2.5], [0, 0]], {**own[0], "nodes": out}),
        ("Point", [0, 0], {**own[1], "nodes": ["dock"]}),
        ("Point", [0, 0], {"node": "dock", "reward": 0, "reached": 1, "collected": 1}),
        ("Point", [1, 2.5], {"node": "a", "reward": 4, "reached": 0.5, "collected": 0.5}),
    ]


def test_what_cannot_be_written():
    mission = starred(**{**PLACES, "b": None})
    plan_geojson(mission, trips(mission, "a"))
    expected = r"^Node 'b': expected pos \[x, y\] for GeoJSON, found none"
    with pytest.raises(ValueError, match=expected):
        plan_geojson(mission, trips(mission, "b"))
    mission = star({frozenset({3}): (1, 0.5)})
    for write in (plan_json, plan_csv):
        with pytest.raises(ValueError, match="frozenset"):
            write(mission, trips(mission, frozenset({3})))


def test_files_of_texts(tmp_path):
    mission = starred(**PLACES)
    plan = trips(mission, "a", "c")
    for name, write in (("p.json", plan_json), ("p.CSV", plan_csv), ("p.geojson", plan_geojson)):
        write_plan(mission, plan, tmp_path / name)
        assert (tmp_path / name).read_bytes() == write(mission, plan).encode()


def test_files_that_cannot_be_written(tmp_path):
    plan = trips(MISSION, "a")
    expected = "ends in one of .json, .csv, .geojson, .plan; found the suffix '.txt'"
    with pytest.raises(ValueError, match=re.escape(expected)):
        write_plan(MISSION, plan, tmp_path / "plan.txt")
    with pytest.raises(ValueError, match="found none"):
        write_plan(MISSION, plan, tmp_path / "plan.geojson")
    assert list(tmp_path.iterdir()) == []


AT = {"dock": (8.5, 47.25), "reef": (8.75, 47.25), "pier": (8.75, 47.5)}


def harbour(labels=("dock", "reef", "pier"), *, robots=2, **more):
    """A triangle that is sailed around one way."""
    graph = nx.DiGraph(base=labels[0])
    for label, place in zip(labels, AT.values(), strict=True):
        graph.add_node(label, reward=1.0, pos=place)
    for i, survival in enumerate((0.5, 0.8, 1.0)):
        graph.add_edge(labels[i], labels[(i + 1) % 3], survival=survival)
    graph.graph["geographic"] = True
    return Mission(graph, name="harbour", **({} if "kinds" in more else {"robots": robots}), **more)


def around(mission):
    stays = [[mission.base]] * (mission.robots - 1)
    return mission.plan([[*mission.nodes, mission.base], *stays])


def facing(degrees):
    half = math.radians(degrees) / 2
    turn = {"x": 0, "y": 0, "z": math.sin(half), "w": math.cos(half)}
    return pytest.approx(turn)


def test_legs_by_hand():
    mission = harbour()
    files = nav2_files(mission, around(mission))
    assert list(files) == ["graph.geojson", "robot_0.json", "robot_1.json"]
    robot = json.loads(files["robot_0.json"])
    legs = robot.pop("legs")
    start = robot.pop("start")
    assert robot == {
        "mission": "harbour",
        "robot": 0,
        "kind": "robot",
        "survival": 0.4,
        "length": 3,
        "reward": pytest.approx(1 + 0.5 + 0.4),
    }
    # Labels are texts: nodes have the numbers 1 to 3, and lines 4 to 6.
    hops = [(leg["edge"], leg["start"], leg["goal"]) for leg in legs]
    assert hops == [(4, 1, 2), (5, 2, 3), (6, 3, 1)]
    assert [leg["survival"] for leg in legs] == [0.5, 0.4, 0.4]
    stops = [start, *legs]
    assert [stop["node"] for stop in stops] == ["dock", "reef", "pier", "dock"]
    assert [stop["frame"] for stop in stops] == ["map"] * 4
    at = [[stop["pose"]["position"][axis] for axis in "xyz"] for stop in stops]
    assert at == [[*AT[stop["node"]], 0] for stop in stops]
    turns = [stop["pose"]["orientation"] for stop in stops]
    assert turns == [facing(0), facing(0), facing(90), facing(-135)]


def test_robots_that_stay_kinds_and_ids_of_nav2():
    mission = harbour(kinds=[Kind("boat", 1), Kind("buoy", 1)])
    files = nav2_files(mission, around(mission))
    boat, buoy = (json.loads(files[f"robot_{i}.json"]) for i in range(2))
    assert (boat["kind"], buoy["kind"]) == ("boat", "buoy")
    assert (buoy["legs"], buoy["start"]["node"]) == ([], "dock")
    assert buoy["start"]["pose"]["orientation"] == facing(0)
    mission = harbour((7, 0, 12))
    legs = json.loads(nav2_files(mission, around(mission))["robot_0.json"])["legs"]
    assert [(leg["start"], leg["goal"]) for leg in legs] == [(7, 0), (0, 12), (12, 7)]


def placed(mission):
    """The same mission, with places."""
    graph = mission.graph.copy()
    nx.set_node_attributes(graph, {node: (i, i * i) for i, node in enumerate(graph)}, "pos")
    return Mission(graph, base=mission.base, kinds=mission.kinds, pays=mission.pays)


@pytest.mark.filterwarnings("ignore:.*no kind of robots can collect")
@given(missions_with_plans() | team_missions_with_plans())
def test_legs_are_those_of_the_graph_beside_them(tmp_path_factory, drawn):
    mission, plan = placed(drawn[0]), drawn[1]
    folder = tmp_path_factory.mktemp("nav2")
    graph, *robots = write_plan(mission, plan, folder)
    assert read_mission(graph) == mission
    lines = {
        line["properties"]["id"]: line["properties"]
        for line in json.loads(graph.read_text())["features"]
        if line["geometry"]["type"] == "LineString"
    }
    table = robot_table(mission, plan)
    for path, trail, survival in zip(robots, mission.labels(plan), table["survival"], strict=True):
        robot = json.loads(path.read_text())
        legs = robot["legs"]
        assert (robot["start"]["node"], *(leg["node"] for leg in legs)) == trail
        assert (legs[-1]["survival"] if legs else 1) == pytest.approx(survival)
        for leg in legs:
            line = lines[leg["edge"]]
            assert (line["startid"], line["endid"]) == (leg["start"], leg["goal"])


def test_waypoints_by_hand():
    mission = harbour()
    plans = qgc_plans(mission, around(mission), altitude=30)
    assert list(plans) == [0]
    content = json.loads(plans[0])
    assert (content["fileType"], content["version"]) == ("Plan", 1)
    assert content["mission"]["plannedHomePosition"] == [47.25, 8.5, 0]
    assert content["mission"]["vehicleType"] == 2
    items = content["mission"]["items"]
    assert [item["params"] for item in items] == [
        [0, 0, 0, None, 47.25, 8.75, 30],
        [0, 0, 0, None, 47.5, 8.75, 30],
        [0, 0, 0, None, 47.25, 8.5, 30],
    ]
    commands = [(item["command"], item["frame"], item["doJumpId"]) for item in items]
    assert commands == [(16, 3, 1), (16, 3, 2), (16, 3, 3)]


def test_positions_that_may_be_metres():
    graph = harbour().graph.copy()
    del graph.graph["geographic"]
    mission = Mission(graph, robots=2)
    with pytest.raises(ValueError, match=r"positions are longitudes .*'mission' does not say so"):
        qgc_plans(mission, around(mission), altitude=3)


def test_all_files_are_checked_before_any_is_written(tmp_path):
    mission = harbour()
    (tmp_path / "file").write_text("mine")
    with pytest.raises(OSError, match="expected a folder to write to"):
        write_plan(mission, around(mission), tmp_path / "file")
    (tmp_path / "nav2" / "robot_1.json").mkdir(parents=True)
    with pytest.raises(OSError, match="expected a file, found a folder"):
        write_plan(mission, around(mission), tmp_path / "nav2")
    assert [path.name for path in (tmp_path / "nav2").iterdir()] == ["robot_1.json"]


def test_frames():
    graph = harbour().graph.copy()
    graph.nodes["reef"]["frame"], graph.nodes["pier"]["frame"] = None, "sea"
    mission = Mission(graph, robots=2)
    legs = json.loads(nav2_files(mission, around(mission))["robot_0.json"])["legs"]
    assert [leg["frame"] for leg in legs] == ["map", "sea", "map"]


def test_a_file_for_each_robot_that_leaves(tmp_path):
    mission = harbour(robots=3)
    trail = [*mission.nodes, "dock"]
    plan = mission.plan([trail, ["dock"], trail])
    written = write_plan(mission, plan, tmp_path / "site.plan", altitude=30)
    assert [path.name for path in written] == ["site-0.plan", "site-2.plan"]
    assert sorted(tmp_path.iterdir()) == list(written)
    alone = harbour(robots=1)
    [path] = write_plan(alone, around(alone), tmp_path / "alone.PLAN", altitude=30)
    assert path.name == "alone-0.PLAN"
    assert path.read_text() == qgc_plans(alone, around(alone), altitude=30)[0]


def test_vehicles(tmp_path):
    mission = harbour(robots=1)
    for vehicle, mav_type, altitude, height in (
        ("multicopter", 2, 30, 30),
        ("fixed-wing", 1, np.float32(30), 30),
        ("vtol", 20, 30, 30),
        ("rover", 10, None, 0),
        ("boat", 11, 30, 30),
        ("submarine", 12, -4.5, -4.5),
        ("submarine", 12, 0, 0),
    ):
        given = {"altitude": altitude, "vehicle": vehicle}
        [path] = write_plan(mission, around(mission), tmp_path / "site.plan", **given)
        assert path.read_text() == qgc_plans(mission, around(mission), **given)[0]
        content = json.loads(path.read_text())["mission"]
        assert content["vehicleType"] == mav_type
        assert {(item["frame"], item["Altitude"]) for item in content["items"]} == {(3, height)}
        assert {item["params"][6] for item in content["items"]} == {height}


def test_altitudes_and_vehicles_that_are_refused(tmp_path):
    mission = harbour()
    for altitude, vehicle, fault in (
        (None, "multicopter", "an altitude for the multicopter, in metres (--altitude), got none."),
        (-3, "multicopter", "altitude (of a multicopter, in metres) > 0, got -3."),
        (math.nan, "vtol", "altitude (of a vtol, in metres) to be a finite number > 0, got nan."),
        (math.inf, "boat", "altitude (of a boat, in metres) to be a finite number, got inf."),
        (None, "submarine", "an altitude for the submarine, in metres (--altitude), got none."),
        (3, "submarine", "altitude (of a submarine, in metres) <= 0, got 3."),
        (3, "rovr", "vehicle among rover, boat, vtol, submarine, multicopter, fixed-wing, got"),
    ):
        given = {"altitude": altitude, "vehicle": vehicle}
        with pytest.raises(ValueError, match=f"^Expected {re.escape(fault)}"):
            write_plan(mission, around(mission), tmp_path / "site.plan", **given)
    for more in ({"altitude": 30}, {"vehicle": "rover"}):
        with pytest.raises(ValueError, match=r"expected altitude and vehicle with a \.plan only"):
            write_plan(mission, around(mission), tmp_path / "site.csv", **more)
    with pytest.raises(ValueError, match=r"expected a robot that leaves where it starts"):
        write_plan(mission, mission.stay_home(), tmp_path / "none.plan", altitude=30)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(("place", "found"), [(None, "None"), ((200, 3), r"\(200.0, 3.0\)")])
def test_places_that_are_not_on_earth(place, found):
    graph = harbour().graph.copy()
    graph.nodes["pier"]["pos"] = place
    mission = Mission(graph, robots=1)
    with pytest.raises(ValueError, match=f"Node 'pier': expected pos .longitude.*found {found}"):
        qgc_plans(mission, around(mission), altitude=3)


def test_nothing_is_written_without_places(tmp_path):
    graph = harbour().graph.copy()
    del graph.nodes["pier"]["pos"]
    mission = Mission(graph, robots=1)
    with pytest.raises(ValueError, match=r"node 'pier': expected pos \[x, y\] for GeoJSON"):
        write_plan(mission, around(mission), tmp_path / "nav2")
    assert list(tmp_path.iterdir()) == []


def test_files_of_more_robots_are_not_left_beside(tmp_path):
    many, one = harbour(robots=3), harbour(robots=1)
    write_plan(many, around(many), tmp_path / "nav2")
    write_plan(many, many.stay_home(), tmp_path / "nav2")  # as many robots: replaced
    with pytest.raises(FileExistsError, match=r"robot_1\.json: a file of another plan"):
        write_plan(one, around(one), tmp_path / "nav2")
    assert json.loads((tmp_path / "nav2" / "robot_0.json").read_text())["legs"] == []


def test_waypoints_of_more_robots_are_not_left_beside(tmp_path):
    mission = harbour(robots=2)
    trail = [*mission.nodes, "dock"]
    write_plan(mission, mission.plan([trail, trail]), tmp_path / "site.plan", altitude=30)
    with pytest.raises(FileExistsError, match=r"site-1\.plan: a file of another plan"):
        write_plan(mission, around(mission), tmp_path / "site.plan", altitude=30)
