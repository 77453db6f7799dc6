"""Route graphs as Nav2 loads them: GeoJSON of points and directed lines."""

import json
import math

import networkx as nx
import pytest

from botohe_moo import Mission, MissionError, load_mission, save_mission
from tests.mission.made import feature, loaded_by_nav2

POINTS = {3: (0, 0), 4: (3, 4), 7: (3, 0)}


def point(number, place, **properties):
    return feature("Point", place, id=number, **properties)


def line(tail, head, shape="MultiLineString", **properties):
    return feature(shape, [], startid=tail, endid=head, **properties)


def both_ways(*pairs):
    return [line(*ends) for pair in pairs for ends in (pair, pair[::-1])]


@pytest.fixture
def site(tmp_path):
    """Writes a route graph of three points, and features that are given; returns its path."""

    def write(*features, points=POINTS, **members):
        nodes = [point(label, place) for label, place in points.items()]
        content = {"type": "FeatureCollection", "features": [*nodes, *features], **members}
        path = tmp_path / "site.geojson"
        path.write_text(json.dumps(content))
        return path

    return write


def test_what_the_file_says_counts(site):
    """Also attributes that are not ours."""
    path = site(
        line(3, 8, "LineString", metadata={"survival": 0.5, "length": 9}, cost=2.5, id=20),
        line(8, 3, metadata={"survival": 0.75}),
        *both_ways((3, 5)),
        point(8, (0, 2, 1), frame="map", metadata={"reward": 7, "class": "lab"}),
        point(5, (3, 4), label="b", metadata={"label": "c"}),
        points={3: (0, 0)},
        mission={"base": 3, "robots": 2, "name": "plant", "max_length": 30},
    )
    mission = load_mission(path, danger=0.01, reward=2)
    assert (mission.name, mission.base, mission.robots) == ("plant", 3, 2)
    assert (mission.nodes, mission.max_length) == ((3, 8, 5), 30)
    own = {"frame": "map", "reward": 7, "class": "lab"}
    assert mission.graph.nodes[8] == {**own, "pos": [0.0, 2.0]}
    assert mission.graph.nodes[5] == {"label": "c", "reward": 2.0, "pos": [3.0, 4.0]}
    assert mission.graph.edges[3, 8] == {"id": 20, "cost": 2.5, "survival": 0.5, "length": 9}
    assert mission.graph.edges[8, 3] == {"survival": 0.75, "length": 2.0}
    assert mission.graph.edges[3, 5] == {"length": 5.0, "survival": math.exp(-0.05)}


def test_what_is_left_out_is_said(site):
    path = site(
        *both_ways((3, 4), (4, 7)),
        line(3, 3),
        line(4, 7, metadata={"survival": 0.9}),
        line(4, 7, metadata={"survival": 0.99}),
        point(1, (9, 9)),
        point(2, (8, 8)),
        line(4, 2),
        feature("Polygon", []),
        {"type": "Feature", "geometry": None, "properties": None},
        feature("MultiPoint", [[1, 2]]),
        {"type": "FeatureCollection", "features": [point(9, (1, 1))]},
    )
    with pytest.warns(UserWarning, match="Left out") as said:
        mission = load_mission(path, danger=0.02, base=3, robots=1)
    assert [str(each.message) for each in said] == [
        "Left out features that are neither points, lines nor polygons with a rate: features[13], "
        "features[14], features[15], features[16]; "
        "arcs from a node to itself: features[7]; "
        "arcs parallel to one that is at least as safe: features[8], features[5]; "
        "nodes that the base does not reach, or that have no way back: 1, 2."
    ]
    assert mission.nodes == (3, 4, 7)
    assert mission.graph.edges[4, 7]["survival"] == 0.99


def placed(at):
    return [*both_ways((3, 5)), feature("Point", at, id=5)]


REFUSED = [
    (placed((1,)), r"node 5: expected pos \[x, y\], two finite numbers, got \[1\]"),
    (placed((1, math.nan)), r"node 5: expected pos .*, got \[1, nan\]"),
    ([point(None, (1, 1))], r"\[3\]: expected a property 'id', found none"),
    ([{**line(3, 4), "properties": None}], r"\[3\]: expected a property 'startid'"),
    ([{**line(3, 4), "properties": [1]}], r"expected properties to be an object, got \[1\]"),
    ([{**line(3, 4), "geometry": "x"}], r"expected geometry to be an object, got 'x'"),
    ([line(3, 4, metadata=[1])], r"\[3\]: expected metadata to be an object"),
    ([7], r"features\[3\]: expected a feature to be an object, got 7"),
]


@pytest.mark.parametrize(("features", "fault"), REFUSED)
def test_what_is_wrong_is_named_by_its_feature(site, features, fault):
    with pytest.raises(MissionError, match=fault) as raised:
        load_mission(site(*features), base=3, danger=1, robots=1)
    assert "site.geojson" in str(raised.value)


def saved_for_nav2(mission, path):
    """Save a mission, which comes back; return what Nav2 loads of its file."""
    save_mission(mission, path)
    assert load_mission(path) == mission
    return loaded_by_nav2(json.loads(path.read_text()))


@pytest.mark.parametrize("label", ["dock", 2**31 - 1, -1, 1.5, False])
def test_labels_that_nav2_cannot_read_are_numbered(tmp_path, label):
    """2³¹ − 1 marks deleted nodes."""
    mission = Mission(nx.relabel_nodes(load_mission("toy").graph, {4: label}))
    points, _ = saved_for_nav2(mission, tmp_path / "x.geojson")
    assert list(points) == [1, 2, 3, 4, 5]


def test_there_is_not_one_penalty_of_several_kinds(tmp_path):
    mission = load_mission("drones_and_rovers")
    _, lines = saved_for_nav2(mission, tmp_path / "plant.geojson")
    assert not any("penalty" in line["metadata"] for line in lines)


def square(x, y, side=1):
    return [[x, y], [x + side, y], [x + side, y + side], [x, y + side], [x, y]]


def test_polygons_with_a_rate_are_zones(site):
    """Along 3 -> 7, of length 3: a unit in a square, and half a unit in each of two others."""
    halves = [[square(0, -0.25, 0.5)], [square(2.5, -0.5)]]
    path = site(
        *both_ways((3, 7), (3, 4)),
        feature("Polygon", [square(1, -0.5)], rate=0.1),
        feature("MultiPolygon", halves, metadata={"rate": 0.2}),
    )
    mission = load_mission(path, danger=0.01, base=3, robots=1)
    rate = 0.01 * 3 + 0.1 + 0.2 * (0.5 + 0.5)
    assert mission.graph.edges[3, 7]["survival"] == pytest.approx(math.exp(-rate))
    zones_alone = load_mission(path, base=3, robots=1)
    assert zones_alone.graph.edges[3, 7]["survival"] == pytest.approx(math.exp(0.03 - rate))


def test_a_polygon_that_is_wrong_is_named_by_its_feature(site):
    bad = (
        feature("Polygon", [[[0, 0], [1, 1]]], rate=0.1),
        feature("Polygon", [square(0, 0)], rate=-1),
    )
    path = site(*both_ways((3, 7)), *bad)
    with pytest.raises(MissionError) as raised:
        load_mission(path, base=3, robots=1, danger=1)
    assert [fault.partition(",")[0] for fault in raised.value.faults] == [
        "features[5]: expected a polygon of at least three corners [[x",
        "features[6]: expected a rate >= 0",
    ]


def test_longitudes_and_latitudes(site, tmp_path):
    """A degree of a meridian is 111 195 m on the mean sphere; along 60 degrees north half of it."""
    points = {3: (10, 60), 4: (10, 61), 7: (11, 60)}
    crs = {"type": "name", "properties": {"name": "urn:ogc:def:crs:OGC:1.3:CRS84"}}
    path = site(*both_ways((3, 4), (3, 7)), points=points, crs=crs)
    given = {"danger": 1e-6, "base": 3, "robots": 1}
    said = "Positions count as metres: give geographic=True if the crs is right"
    with pytest.warns(UserWarning, match=said):
        assert load_mission(path, **given).graph.edges[3, 4]["length"] == 1
    mission = load_mission(path, geographic=True, **given)
    arcs = mission.graph.edges
    assert arcs[3, 4]["length"] == pytest.approx(111_195, abs=1)
    assert arcs[3, 7]["length"] == pytest.approx(111_195 / 2, rel=1e-4)
    assert arcs[3, 4]["survival"] == pytest.approx(math.exp(-0.111195), rel=1e-6)
    save_mission(mission, tmp_path / "again.geojson")
    again = load_mission(tmp_path / "again.geojson")
    assert again == mission
    assert again.graph.graph["geographic"] is True
    assert again.with_lengths_from_pos() == mission


def test_lines_that_all_lead_away(site):
    path, given = site(line(3, 4), line(4, 7)), {"danger": 0.01, "base": 3, "robots": 1}
    expected = "expected a node that can be reached from base 3 and left again, found none; both_w"
    with pytest.raises(MissionError, match=expected):
        load_mission(path, **given)
    arcs = load_mission(path, both_ways=True, **given).graph.edges
    assert {*arcs} == {(3, 4), (4, 3), (4, 7), (7, 4)}
    assert arcs[4, 3] == arcs[3, 4]


def test_attributes_that_mission_files_use_for_labels(site):
    path = site(
        line(3, 4, metadata={"survival": 0.9, "source": "survey"}),
        line(4, 3, metadata={"survival": 0.9}),
        point(4, (1, 1), metadata={"id": "kitchen", "class": "room"}),
        points={3: (0, 0)},
    )
    said = r"Left out attributes id, source and target, .*: features\[3\], features\[1\]\.$"
    with pytest.warns(UserWarning, match=said):
        mission = load_mission(path, base=3, robots=1)
    assert mission.graph.nodes[4] == {"class": "room", "pos": [1.0, 1.0], "reward": 1.0}


def test_ids_and_penalties_of_lines(site, tmp_path):
    """What Nav2 can read stays; others get numbers above, and penalties are ours."""
    path = site(
        line(3, 4, id=20, metadata={"survival": 0.5, "penalty": 50, "id": 8}),
        line(4, 3, id=21.0, metadata={"survival": 0.5, "penalty": "high"}),
        line(4, 7, id=22, metadata={"survival": 0.5}),
        line(7, 4, id=22, metadata={"survival": 1}),
        line(3, 7, id="south", metadata={"survival": 0.5}),
        line(7, 3, id=4, metadata={"survival": 0.5}),  # as a point has
    )
    mission = load_mission(path, base=3, robots=1)
    _, lines = saved_for_nav2(mission, tmp_path / "again.geojson")
    of_ends = {(each["startid"], each["endid"]): each for each in lines}
    assert {ends: each["id"] for ends, each in of_ends.items()} == {
        (3, 4): 20, (4, 3): 21, (3, 7): 23, (4, 7): 24, (7, 4): 25, (7, 3): 26
    }  # fmt: skip
    penalties = {ends: each["metadata"]["penalty"] for ends, each in of_ends.items()}
    assert penalties == {ends: 0 if ends == (7, 4) else math.log(2) for ends in of_ends}
    assert {*map(type, penalties.values())} == {float}
    assert '"penalty": 0.0' in (tmp_path / "again.geojson").read_text()


def test_what_nav2_reads_beside_metadata(tmp_path):
    """It refuses a whole file for a property of another type, and for null in metadata."""
    graph = load_mission("toy").graph.copy()
    door = {"type": "OpenDoor", "trigger": "ON_ENTER", "metadata": {"door_id": 54}}
    graph.nodes[1].update(frame="odom", operations=[door], zones=[[1, 2], [3, 4]])
    graph.nodes[2].update(frame=None, operations="none", note=None, region={"x": [0.5, True]})
    own = {"cost": 2.5, "overridable": False, "operations": {"open": door}}
    graph.edges[1, 2].update(own, region={"x": None})
    graph.edges[2, 1].update(cost="low", overridable=1, penalty=50, speed_limit=80.0)
    mission = Mission(graph)
    _, lines = saved_for_nav2(mission, tmp_path / "x.geojson")
    content = json.loads((tmp_path / "x.geojson").read_text())
    first, second = (feature["properties"] for feature in content["features"][:2])
    assert (first["frame"], first["operations"]) == ("odom", [door])
    assert "frame" not in second
    assert second["metadata"]["region"] == {"x": [0.5, True]}
    of_ends = {(each["startid"], each["endid"]): each for each in lines}
    there, back = of_ends[1, 2], of_ends[2, 1]
    assert {name: there[name] for name in own} == own
    assert back["metadata"]["speed_limit"] == 80.0
    assert not {"cost", "overridable"} & back.keys()
