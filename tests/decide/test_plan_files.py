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

from botohe_moo import Kind, Mission, read_solution
from botohe_moo.cli.plans import trails_text
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
from tests.decide.made import ATTIC, BOTH, HOUSE, IN_HOUSE, MISSION, solution_of, star, trips
from tests.strategies import missions_with_plans, team_missions_with_plans

LABELS = ["north hall", 7, (1, "x"), 'say "no"', "a,b", "</script>", "漢字", "line\nbreak"]


def starred(**positions):
    """The star, with positions of its nodes but c; others are given."""
    graph = nx.DiGraph(MISSION.graph)
    places = {"dock": [0, 0], "a": [1, 2.5], "b": (-1, 0)} | positions
    nx.set_node_attributes(graph, places, "pos")
    return Mission(graph, base="dock", robots=2, name="star")


def rows_of(mission, plan):
    return list(csv.DictReader(io.StringIO(plan_csv(mission, plan), newline="")))


def test_json():
    assert json.loads(plan_json(MISSION, trips(MISSION, "a", "b"))) == {
        "mission": "star",
        "robots": 2,
        "robot_kinds": ["robot", "robot"],
        "reward": pytest.approx(3.8),
        "survivors": pytest.approx(1.4),
        "robot_survival": [0.5, 0.9],
        "trail_lengths": [2.0, 2.0],
        "robot_rewards": pytest.approx([2.0, 1.8]),
        "trails": [["dock", "a", "dock"], ["dock", "b", "dock"]],
    }


@pytest.mark.filterwarnings("ignore:.*no kind of robots can collect")
@given(missions_with_plans() | team_missions_with_plans())
def test_all_plans_are_read_back_with_equal_objectives(drawn):
    mission, plan = drawn
    content, kinds = json.loads(plan_json(mission, plan)), [kind.name for kind in mission.kind_of]
    again = mission.plan(content["trails"])
    assert (again.trails, content["robot_kinds"]) == (plan.trails, kinds)
    assert mission.evaluate([again]).tolist() == [[content["reward"], content["survivors"]]]
    trails = {}
    for row in rows_of(mission, plan):
        trail = trails.setdefault(int(row["robot"]), [])
        assert (int(row["step"]), row["kind"]) == (len(trail), kinds[int(row["robot"])])
        trail.append(int(row["node"]))
    assert mission.plan(trails[robot] for robot in range(mission.robots)).trails == plan.trails


def test_csv():
    mission = starred(b=None)
    assert plan_csv(mission, trips(mission, "a", "b")).splitlines() == [
        "robot,kind,step,node,x,y",
        *("0,robot,0,dock,0.0,0.0", "0,robot,1,a,1.0,2.5", "0,robot,2,dock,0.0,0.0"),
        *("1,robot,0,dock,0.0,0.0", "1,robot,1,b,,", "1,robot,2,dock,0.0,0.0"),
    ]
    mission = star(dict.fromkeys(LABELS, (1, 0.5)), robots=len(LABELS))
    rows = rows_of(mission, trips(mission, *LABELS))
    texts = [label if isinstance(label, str) else json.dumps(label) for label in LABELS]
    assert [row["node"] for row in rows if row["step"] == "1"] == texts


def test_geojson():
    mission = starred()
    content = json.loads(plan_geojson(mission, trips(mission, "a")))
    assert content["type"] == "FeatureCollection"
    assert all(feature["type"] == "Feature" for feature in content["features"])
    shapes = [(*each["geometry"].values(), each["properties"]) for each in content["features"]]
    goes = {"robot": 0, "kind": "robot", "survival": 0.5, "length": 2, "reward": 2}
    stays = {"robot": 1, "kind": "robot", "survival": 1, "length": 0, "reward": 0}
    assert shapes == [
        ("LineString", [[0, 0], [1, 2.5], [0, 0]], {**goes, "nodes": ["dock", "a", "dock"]}),
        ("Point", [0, 0], {**stays, "nodes": ["dock"]}),
        ("Point", [0, 0], {"node": "dock", "reward": 0, "reached": 1, "collected": 1}),
        ("Point", [1, 2.5], {"node": "a", "reward": 4, "reached": 0.5, "collected": 0.5}),
    ]


def test_files_of_texts_are_these_texts_or_not_written(tmp_path):
    mission = starred()
    plan = trips(mission, "a", "b")
    for name, write in (("p.json", plan_json), ("p.CSV", plan_csv), ("p.geojson", plan_geojson)):
        [path] = write_plan(mission, plan, tmp_path / name)
        assert path.read_bytes() == write(mission, plan).encode()
        path.unlink()
    expected = "ends in one of .json, .csv, .geojson, .plan; found the suffix '.txt'"
    with pytest.raises(ValueError, match=re.escape(expected)):
        write_plan(MISSION, plan, tmp_path / "plan.txt")
    with pytest.raises(ValueError, match=r"^Node 'c': expected pos \[x, y\] for GeoJSON, found no"):
        write_plan(mission, trips(mission, "c"), tmp_path / "plan.geojson")
    mission = star({frozenset({3}): (1, 0.5)})
    for suffix in (".json", ".csv"):
        with pytest.raises(ValueError, match="frozenset"):
            write_plan(mission, trips(mission, frozenset({3})), tmp_path / f"plan{suffix}")
    assert list(tmp_path.iterdir()) == []


AT = {"dock": (8.5, 47.25), "reef": (8.75, 47.25), "pier": (8.75, 47.5)}


def harbour(labels=("dock", "reef", "pier"), *, robots=2, geographic=True, **more):
    """A triangle that is sailed around one way; ``more`` are attributes of nodes."""
    graph = nx.DiGraph(base=labels[0], geographic=geographic)
    nx.add_cycle(graph, labels)
    for label, place, survival in zip(labels, AT.values(), (0.5, 0.8, 1.0), strict=True):
        graph.nodes[label].update({"reward": 1.0, "pos": place} | more.get(label, {}))
        graph.edges[next(iter(graph.edges(label)))]["survival"] = survival
    team = {"kinds": robots} if isinstance(robots, list) else {"robots": robots}
    return Mission(graph, name="harbour", **team)


def around(mission, n=1):
    """Return the plan in which the first ``n`` robots sail around and the others stay."""
    trail = [*mission.nodes, mission.base]
    return mission.plan([trail] * n + [[mission.base]] * (mission.robots - n))


def robots_of(mission):
    """What Nav2's robots are given, for a plan in which the first one sails around."""
    graph, *files = nav2_files(mission, around(mission)).items()
    assert graph[0] == "graph.geojson"
    assert [name for name, _ in files] == [f"robot_{i}.json" for i in range(mission.robots)]
    return [json.loads(text) for _, text in files]


def facing(degrees):
    half = math.radians(degrees) / 2
    return pytest.approx({"x": 0, "y": 0, "z": math.sin(half), "w": math.cos(half)})


def test_legs_by_hand():
    kinds = [Kind("boat", 1), Kind("buoy", 1)]
    frames = {"reef": {"frame": None}, "pier": {"frame": "sea"}}
    boat, buoy = robots_of(harbour(robots=kinds, **frames))
    legs, start = boat.pop("legs"), boat.pop("start")
    own = {"mission": "harbour", "robot": 0, "kind": "boat", "survival": 0.4, "length": 3}
    assert boat == {**own, "reward": pytest.approx(1 + 0.5 + 0.4)}
    # Labels are texts: nodes have the numbers 1 to 3, and lines 4 to 6.
    hops = [(leg["edge"], leg["start"], leg["goal"], leg["survival"]) for leg in legs]
    assert hops == [(4, 1, 2, 0.5), (5, 2, 3, 0.4), (6, 3, 1, 0.4)]
    stops = [start, *legs]
    assert [stop["node"] for stop in stops] == ["dock", "reef", "pier", "dock"]
    assert [stop["frame"] for stop in stops] == ["map", "map", "sea", "map"]
    at = [[stop["pose"]["position"][axis] for axis in "xyz"] for stop in stops]
    assert at == [[*AT[stop["node"]], 0] for stop in stops]
    turns = [stop["pose"]["orientation"] for stop in stops]
    assert turns == [facing(0), facing(0), facing(90), facing(-135)]
    assert (buoy["kind"], buoy["legs"], buoy["start"]["node"]) == ("buoy", [], "dock")
    assert buoy["start"]["pose"]["orientation"] == facing(0)
    # Labels that are ids of Nav2:
    legs = robots_of(harbour((7, 0, 12)))[0]["legs"]
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
    graph, *robots = write_plan(mission, plan, tmp_path_factory.mktemp("nav2"))
    assert read_mission(graph) == mission
    own = [feature["properties"] for feature in json.loads(graph.read_text())["features"]]
    lines = {each["id"]: (each["startid"], each["endid"]) for each in own if "startid" in each}
    table = robot_table(mission, plan)
    for path, trail, survival in zip(robots, mission.labels(plan), table["survival"], strict=True):
        robot = json.loads(path.read_text())
        legs = robot["legs"]
        assert (robot["start"]["node"], *(leg["node"] for leg in legs)) == trail
        assert (legs[-1]["survival"] if legs else 1) == pytest.approx(survival)
        assert [lines[leg["edge"]] for leg in legs] == [(leg["start"], leg["goal"]) for leg in legs]


def test_waypoints_by_hand():
    mission = harbour()
    plans = qgc_plans(mission, around(mission), altitude=30)
    assert list(plans) == [0]
    content = json.loads(plans[0])
    assert (content["fileType"], content["version"]) == ("Plan", 1)
    assert content["mission"]["plannedHomePosition"] == [47.25, 8.5, 0]
    items = content["mission"]["items"]
    places = [(47.25, 8.75), (47.5, 8.75), (47.25, 8.5)]
    assert [item["params"] for item in items] == [[0, 0, 0, None, *at, 30] for at in places]
    assert [(item["command"], item["doJumpId"]) for item in items] == [(16, 1), (16, 2), (16, 3)]


def test_a_file_for_each_robot_that_leaves(tmp_path):
    mission = harbour(robots=3)
    trail = [*mission.nodes, "dock"]
    plan = mission.plan([trail, ["dock"], trail])
    written = write_plan(mission, plan, tmp_path / "site.PLAN", altitude=30)
    assert [path.name for path in written] == ["site-0.PLAN", "site-2.PLAN"]
    assert sorted(tmp_path.iterdir()) == list(written)
    assert [path.read_text() for path in written] == [
        *qgc_plans(mission, plan, altitude=30).values()
    ]


def test_vehicles():
    mission = harbour()
    for vehicle, mav_type, altitude, height in (
        ("multicopter", 2, 30, 30),
        ("fixed-wing", 1, np.float32(30), 30),
        ("vtol", 20, 30, 30),
        ("rover", 10, None, 0),
        ("boat", 11, 30, 30),
        ("submarine", 12, -4.5, -4.5),
        ("submarine", 12, 0, 0),
    ):
        [text] = qgc_plans(mission, around(mission), altitude=altitude, vehicle=vehicle).values()
        content = json.loads(text)["mission"]
        assert content["vehicleType"] == mav_type
        assert {(item["frame"], item["Altitude"]) for item in content["items"]} == {(3, height)}
        assert {item["params"][6] for item in content["items"]} == {height}


def test_what_qgroundcontrol_cannot_fly_is_refused(tmp_path):
    mission, path = harbour(), tmp_path / "site.plan"
    for altitude, vehicle, fault in (
        (None, "multicopter", "an altitude for the multicopter, in metres (--altitude), got none."),
        (-3, "multicopter", "altitude (of a multicopter, in metres) > 0, got -3."),
        (math.nan, "vtol", "altitude (of a vtol, in metres) to be a finite number > 0, got nan."),
        (math.inf, "boat", "altitude (of a boat, in metres) to be a finite number, got inf."),
        (3, "submarine", "altitude (of a submarine, in metres) <= 0, got 3."),
        (3, "rovr", "vehicle among rover, boat, vtol, submarine, multicopter, fixed-wing, got"),
    ):
        with pytest.raises(ValueError, match=f"^Expected {re.escape(fault)}"):
            write_plan(mission, around(mission), path, altitude=altitude, vehicle=vehicle)
    for more in ({"altitude": 30}, {"vehicle": "rover"}):
        with pytest.raises(ValueError, match=r"expected altitude and vehicle with a \.plan only"):
            write_plan(mission, around(mission), tmp_path / "site.csv", **more)
    with pytest.raises(ValueError, match="expected a robot that leaves where it starts"):
        write_plan(mission, mission.stay_home(), path, altitude=30)
    for bad, fault in (
        (harbour(geographic=None), r"positions are longitudes .*'harbour' does not say so"),
        (harbour(pier={"pos": None}), "Node 'pier': expected pos .longitude.*found None"),
        (harbour(pier={"pos": (200, 3)}), r"'pier': expected pos .*found \(200.0, 3.0\)"),
    ):
        with pytest.raises(ValueError, match=fault):
            write_plan(bad, around(bad), path, altitude=3)
    assert list(tmp_path.iterdir()) == []


def test_all_files_for_nav2_are_checked_before_any_is_written(tmp_path):
    mission, folder = harbour(), tmp_path / "nav2"
    (tmp_path / "file").write_text("mine")
    with pytest.raises(OSError, match="expected a folder to write to"):
        write_plan(mission, around(mission), tmp_path / "file")
    nowhere = harbour(pier={"pos": None})
    with pytest.raises(ValueError, match=r"node 'pier': expected pos \[x, y\] for GeoJSON"):
        write_plan(nowhere, around(nowhere), folder)
    assert not folder.exists()
    (folder / "robot_1.json").mkdir(parents=True)
    with pytest.raises(OSError, match="expected a file, found a folder"):
        write_plan(mission, around(mission), folder)
    assert [path.name for path in folder.iterdir()] == ["robot_1.json"]


def test_files_of_more_robots_are_not_left_beside(tmp_path):
    many, one = harbour(robots=3), harbour(robots=1)
    write_plan(many, around(many), tmp_path / "nav2")
    write_plan(many, many.stay_home(), tmp_path / "nav2")  # as many robots: replaced
    with pytest.raises(FileExistsError, match=r"robot_1\.json: a file of another plan"):
        write_plan(one, around(one), tmp_path / "nav2")
    assert json.loads((tmp_path / "nav2" / "robot_0.json").read_text())["legs"] == []
    write_plan(many, around(many, 2), tmp_path / "site.plan", altitude=30)
    with pytest.raises(FileExistsError, match=r"site-1\.plan: a file of another plan"):
        write_plan(many, around(many), tmp_path / "site.plan", altitude=30)


def test_kinds_stand_in_tables_and_geojson():
    assert robot_table(HOUSE, BOTH).to_dict("list") == {
        "robot": [0, 1, 2],
        "kind": ["drone", "drone", "rover"],
        "survival": [0.25, 0.5, 0.75],
        "length": [4, 2, 2],
        "reward": [0.75, 2, 4.5],
    }
    shapes = [shape["properties"] for shape in json.loads(plan_geojson(HOUSE, BOTH))["features"]]
    own = {"robot": 1, "survival": 0.5, "kind": "drone", "length": 2, "reward": 2}
    assert shapes[1] == {**own, "nodes": ["roof", "attic", "roof"]}
    assert shapes[-1] == {"node": "cellar", "reward": 6, "reached": 0.8125, "collected": 0.78125}


def test_a_solution_of_kinds_is_read_back(tmp_path):
    written = solution_of(HOUSE, IN_HOUSE)
    (tmp_path / "plans.json").write_text(written.to_json())
    again = read_solution(tmp_path, mission=HOUSE)
    assert again.plans == written.plans
    assert np.array_equal(again.objectives, written.objectives)


def test_the_text_of_a_choice_names_kinds():
    assert trails_text(HOUSE, ATTIC).splitlines() == [
        "robot 0 (drone, survival 0.500):  roof -> attic -> roof",
        "robot 1 (drone, survival 1.000):  stays at roof",
        "robot 2 (rover, survival 0.750):  dock -> cellar -> dock",
    ]
