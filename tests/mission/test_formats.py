"""Which format a file is in, by its suffix and its content."""

import json
import re
from importlib.metadata import EntryPoint, entry_points
from pathlib import Path

import pytest
import yaml

from botohe_moo import load_mission, save_mission
from botohe_moo.mission import MissionError, read_mission
from botohe_moo.mission.formats.reading import (
    Draft,
    Format,
    Row,
    Source,
    format_of,
    formats,
    is_file_name,
    make_mission,
    stem_of,
    suffixes,
)

DATA = Path(__file__).parents[1] / "data"
FEATURES = {"type": "FeatureCollection", "features": []}
NODES = {"directed": True, "multigraph": False, "graph": {}, "nodes": [], "edges": []}


@pytest.fixture
def file(tmp_path):
    """Writes a file of some name with a content; returns its path."""

    def write(name, content):
        path = tmp_path / name
        is_yaml = path.suffix.lower() in (".yaml", ".yml")
        text = (yaml.safe_dump if is_yaml else json.dumps)(content)
        path.write_text(content if isinstance(content, str) else text)
        return path

    return write


def test_formats_are_registered():
    assert {"node-link", "graphml", "route-graph", "building", "orienteering"} <= formats().keys()
    assert {".json", ".graphml", ".geojson", ".building.yaml", ".yaml", ".txt"} <= {*suffixes()}
    assert len(suffixes()) == len(set(suffixes()))


@pytest.mark.parametrize(
    ("name", "content", "expected"),
    [
        ("site.json", NODES, "node-link"),
        ("site.json", FEATURES, "route-graph"),
        ("site.geojson", FEATURES, "route-graph"),
        ("SITE.GeoJSON", FEATURES, "route-graph"),
        ("site.geojson", "{", "route-graph"),  # whose reader says what is wrong
        ("site.geojson", [], "route-graph"),
        ("site.json", "{", "node-link"),
        ("site.json", {"name": "neither"}, "node-link"),
        ("site.txt", "n 1\nm 1\nTMAX 3\n0 0 0", "orienteering"),
        ("site.txt", "", "orienteering"),
        ("site.building.yaml", {"levels": {}}, "building"),
        ("site.graphml", "", "graphml"),
    ],
)
def test_the_format_of_a_file(file, name, content, expected):
    path = file(name, content)
    assert format_of(path) == formats()[expected]
    assert format_of(Source(path)) == formats()[expected]


def test_a_route_graph_named_json(tmp_path):
    toy = load_mission("toy")
    save_mission(toy, tmp_path / "toy.geojson")
    (tmp_path / "toy.geojson").rename(tmp_path / "renamed.json")
    assert read_mission(tmp_path / "renamed.json") == toy


OTHER = Format((".json",), lambda source: source.data == b"other", Draft, lambda _: b"other")
LAYOUT = {"layoutId": "1", "nodes": [], "edges": [], "stations": []}
PLAN_MISSION = {"items": [], "plannedHomePosition": [47.25, 8.5, 0], "version": 2}


@pytest.mark.parametrize(
    ("name", "content", "kind"),
    [
        (
            "office.site.json",
            {"format_version": "0.1", "anchors": {}, "properties": {"name": "x"}, "levels": {}},
            "a site of Open-RMF's site editor: export navigation graphs",
        ),
        (
            "roads.json",
            {"type": "Topology", "arcs": [[[0, 0], [1, 1]]], "objects": {"roads": {}}},
            "a TopoJSON topology: convert it to GeoJSON",
        ),
        (
            "roads.geojson",
            {"type": "Topology", "arcs": [], "objects": {}},
            "a TopoJSON topology: convert it to GeoJSON",
        ),
        (
            "layout.json",
            {"metaInformation": {"lifVersion": "1.0.0"}, "layouts": [LAYOUT]},
            "a layout of VDA 5050 (LIF)",
        ),
        (
            "graph.json",
            {"format_version": "1.0", "data": {}, "elements": {"nodes": [], "edges": []}},
            "a graph of Cytoscape: export GraphML",
        ),
        (
            "plan.json",
            {"fileType": "Plan", "version": 1, "mission": PLAN_MISSION, "geoFence": {}},
            "a plan of QGroundControl",
        ),
        ("survey.plan", {"fileType": "Plan", "mission": {}}, "a plan of QGroundControl"),
        (
            "layer.json",
            {"geometryType": "esriGeometryPoint", "spatialReference": {}, "features": []},
            "features of ArcGIS: convert them to GeoJSON",
        ),
        (
            "streets.json",
            {"version": 0.6, "generator": "Overpass API", "osm3s": {}, "elements": []},
            "OpenStreetMap data: docs/mission-maps.md has a recipe for streets",
        ),
        (
            "graph.json",
            {"graph": {"directed": True, "nodes": {"a": {}}, "edges": []}},
            "a graph in JSON Graph Format",
        ),
        (
            "graph.json",
            {"directed": True, "graph": [], "nodes": [{"id": "a"}], "adjacency": [[]]},
            "adjacency data of networkx: write it by node_link_data",
        ),
        (
            "orchard.tmap2",
            {"name": "orchard", "pointset": "orchard", "nodes": [{"node": {}, "meta": {}}]},
            "a topological map of LCAS: docs/mission-robots.md has a recipe",
        ),
        (
            "floor.yaml",
            {"image": "floor.pgm", "resolution": 0.05, "origin": [0, 0, 0]},
            "a map: `botohe missions from-map` makes a mission from it",
        ),
        (
            "runs.yml",
            {"missions": ["toy"], "algorithms": ["bo-aco"], "seeds": 3},
            "a study, which `botohe study run` runs",
        ),
        (
            "fleet.yaml",
            {"rmf_fleet": {"name": "tinyRobot"}},
            "a fleet configuration of Open-RMF: read its navigation graph",
        ),
        (
            "topological.yaml",
            {"name": "orchard", "pointset": "orchard", "nodes": [{"node": {}, "meta": {}}]},
            "a topological map of LCAS: docs/mission-robots.md has a recipe",
        ),
        (
            "topological.yaml",
            [{"node": {"name": "a"}, "meta": {"pointset": "orchard"}}],
            "a topological map of LCAS: docs/mission-robots.md has a recipe",
        ),
    ],
)
def test_another_kind_of_file_is_refused_by_its_name(file, name, content, kind):
    path = file(name, content)
    for read in (format_of, read_mission):
        with pytest.raises(MissionError) as caught:
            read(path)
        assert str(caught.value) == f"{path}: expected a mission, found {kind}"


@pytest.mark.parametrize("label", [{"a"}, {"a": 1}, None, [{"a"}]])
def test_what_cannot_be_a_label(label):
    draft = Draft([Row("line 1", ("dock",), {}), Row("line 2", (label,), {})], [])
    with pytest.raises(ValueError, match="expected a label, a string, a number, a boolean or a l"):
        make_mission(draft, base="dock", robots=1)


@pytest.mark.parametrize("name", ["a", "z"])
def test_another_writer_of_json_does_not_replace_the_built_in_one(tmp_path, monkeypatch, name):
    toy, path = load_mission("toy"), tmp_path / "toy.json"
    entry = EntryPoint(name, f"{__name__}:OTHER", "botohe_moo.formats")
    known = {e.name: e for e in (entry, *entry_points(group="botohe_moo.formats"))}
    monkeypatch.setattr("botohe_moo.base.registry._registered", lambda *_: known)
    save_mission(toy, path)
    assert read_mission(path) == toy
    path.write_bytes(b"other")
    assert format_of(path) == OTHER


def test_a_suffix_that_no_format_has(file):
    with pytest.raises(ValueError, match=r"ends in one of .*\.json.*; found the suffix '\.plan'"):
        format_of(file("survey.plan", {"fileType": "Plan"}))


@pytest.mark.parametrize("name", ["lost.json", "lost.geojson", "lost.yaml"])
def test_a_file_that_is_not_there(tmp_path, name):
    path = tmp_path / name
    for read, error in ((format_of, ValueError), (read_mission, MissionError)):
        with pytest.raises(error, match=re.escape(f"{path}: no such file")):
            read(path)


@pytest.mark.parametrize(
    ("name", "stem"),
    [
        ("hotel.json", "hotel"),
        ("maps/hotel.building.yaml", "hotel"),
        ("Hotel.Building.YAML", "Hotel"),
        ("hotel.yaml", "hotel"),
        ("hotel.v2.geojson", "hotel.v2"),
        (".json", ".json"),
        ("hotel.pdf", "hotel"),
        ("hotel", "hotel"),
    ],
)
def test_the_stem_of_a_name(name, stem):
    assert stem_of(name) == stem
    assert stem_of(Path(name)) == stem


@pytest.mark.parametrize(
    ("name", "expected"),
    [
        ("a.json", True),
        ("a.TXT", True),
        (Path("b/a.geojson"), True),
        ("a.pdf", False),
        ("toy", False),
    ],
)
def test_names_of_mission_files(name, expected):
    assert is_file_name(name) is expected
