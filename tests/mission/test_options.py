"""An option gives in every format what it gives for the same mission in tables."""

import json
import math
from itertools import cycle, product

import networkx as nx
import numpy as np
import pandas as pd
import pytest
from PIL import Image

from botohe_moo import Kind, Mission, MissionError, load_mission, mission_from_tables, save_mission

# A site in metres, whose arcs lead around, and its nodes on a map of 8 by 8 cells.
LABELS = ("dock", "lab", "hall", "roof")
PLACES = ((1.0, 1.0), (5.0, 1.0), (5.0, 4.0), (1.0, 4.0))
ARCS = ((0, 1), (1, 2), (2, 3), (3, 0))


def node_link(path):
    nodes = [{"id": LABELS[i], "pos": list(PLACES[i])} for i in range(4)]
    edges = [{"source": LABELS[u], "target": LABELS[v]} for u, v in ARCS]
    content = {"directed": True, "multigraph": False, "graph": {}, "nodes": nodes, "edges": edges}
    path.write_text(json.dumps(content))


def graphml(path):
    graph = nx.DiGraph()
    for label, (x, y) in zip(LABELS, PLACES, strict=True):
        graph.add_node(label, x=x, y=y)
    graph.add_edges_from((LABELS[u], LABELS[v]) for u, v in ARCS)
    nx.write_graphml(graph, path)


def route_graph(path):
    features = [
        {
            "type": "Feature",
            "properties": {"id": label},
            "geometry": {"type": "Point", "coordinates": place},
        }
        for label, place in zip(LABELS, PLACES, strict=True)
    ]
    features += [
        {
            "type": "Feature",
            "properties": {"startid": LABELS[u], "endid": LABELS[v]},
            "geometry": {"type": "LineString", "coordinates": [PLACES[u], PLACES[v]]},
        }
        for u, v in ARCS
    ]
    path.write_text(json.dumps({"type": "FeatureCollection", "features": features}))


def building(path):
    vertices = [[x, y, 0, label] for label, (x, y) in zip(LABELS, PLACES, strict=True)]
    level = {"vertices": vertices, "lanes": [[u, v, {}] for u, v in ARCS]}
    content = {"coordinate_system": "cartesian_meters", "levels": {"L1": level}}
    path.write_text(json.dumps(content))  # which is YAML


def navigation_graph(path):
    vertices = [[x, y, {"name": label}] for label, (x, y) in zip(LABELS, PLACES, strict=True)]
    level = {"vertices": vertices, "lanes": [[u, v, {}] for u, v in ARCS]}
    path.write_text(json.dumps({"building_name": "site", "levels": {"L1": level}}))


FORMATS = {
    "site.json": node_link,
    "site.graphml": graphml,
    "site.geojson": route_graph,
    "site.building.yaml": building,
    "site.yaml": navigation_graph,
}
DANGER = {"danger": 0.1}
OPTIONS = {
    "base": {**DANGER, "base": "hall"},
    "robots": {**DANGER, "robots": 5},
    "danger": {"danger": 0.3},
    "hazard": {**DANGER, "hazard": "map.yaml"},
    "danger_zones": {"danger_zones": [{"circle": [3, 1, 1], "rate": 0.5}]},
    "reward": {**DANGER, "reward": 2.5},
    "interest": {**DANGER, "interest": "map.yaml", "sight": 2.0},
    "pays": {**DANGER, "pays": "return"},
    "both_ways": {**DANGER, "both_ways": True},
    "kinds": {**DANGER, "kinds": [Kind("drone", 2, start="lab"), Kind("rover", 1, end="roof")]},
}


def in_tables(**options):
    nodes = pd.DataFrame(PLACES, columns=["x", "y"]).assign(label=LABELS)
    ends = [(LABELS[u], LABELS[v]) for u, v in ARCS]
    return mission_from_tables(nodes, pd.DataFrame(ends, columns=["tail", "head"]), **options)


@pytest.fixture
def site(tmp_path, monkeypatch):
    """A folder with a map whose right half is dangerous, and of interest."""
    cells = np.full((8, 8), 255, np.uint8)
    cells[:, 4:] = 0
    Image.fromarray(cells).save(tmp_path / "map.png")
    text = "{image: map.png, resolution: 1.0, origin: [0, 0, 0], mode: scale}"
    (tmp_path / "map.yaml").write_text(text)
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.mark.parametrize(
    ("name", "option"), [pair for i, pair in enumerate(product(FORMATS, OPTIONS)) if i % 3 == 0]
)
def test_an_option_in_a_format(site, name, option):
    """Each format with three or four, and each option with one or two."""
    FORMATS[name](site / name)
    given = {"base": "dock", "robots": 3} | OPTIONS[option]
    if option == "kinds":
        del given["robots"]
    mission, expected = load_mission(name, **given), in_tables(**given)
    assert mission == expected
    assert mission.rewards.tolist() == expected.rewards.tolist()
    assert (mission.pays, mission.team) == (expected.pays, expected.team)
    places = [mission.graph.nodes[node]["pos"] for node in mission.nodes]
    assert np.array_equal(places, PLACES)
    assert mission != in_tables(base="dock", robots=3, danger=0.2)


def test_what_the_options_mean(site):
    rates = in_tables(base="dock", robots=1, danger=0.1).graph.edges
    assert rates["dock", "lab"] == {"length": 4, "survival": math.exp(-0.4)}
    zone = in_tables(base="dock", robots=1, **OPTIONS["danger_zones"]).graph.edges
    assert zone["dock", "lab"]["survival"] == pytest.approx(math.exp(-0.5 * 2))
    assert zone["lab", "hall"]["survival"] == 1
    hazard = in_tables(base="dock", robots=1, **OPTIONS["hazard"]).graph.edges
    assert hazard["roof", "dock"]["survival"] == 1
    assert hazard["lab", "hall"]["survival"] == pytest.approx(math.exp(-0.3))
    seen = in_tables(base="dock", robots=1, **OPTIONS["interest"]).graph.nodes(data="reward")
    assert dict(seen)["dock"] == dict(seen)["roof"] == 0 < dict(seen)["lab"]
    both = in_tables(base="dock", robots=1, both_ways=True, **DANGER).graph.edges
    assert both["lab", "dock"] == both["dock", "lab"]


SITE = {**DANGER, "base": "dock", "robots": 1}
FAULTS = [
    ({**SITE, "base": None}, "base"),
    ({**SITE, "robots": None}, "robots"),
    ({**SITE, "danger": None}, r"expected a survival, found none \(4 without one\): give danger"),
    ({**SITE, "base": "deck"}, "base 'deck': there is no such node; most alike are dock"),
    ({**SITE, "robots": 0}, r"xpected robots (to be an integer )?>= 1, got 0"),
    ({**SITE, "pays": "never"}, "pays to be 'arrival' or 'return'"),
    ({**SITE, "sight": 1}, "expected interest, a map, and sight"),
    ({**SITE, "danger_zones": 3}, "danger_zones to be a list"),
    ({**SITE, "hazard": "no.yaml"}, r"no\.yaml: no such"),
    ({**SITE, "danger": 200}, "200.* 4"),
    ({**SITE, "danger": -1}, "Expected danger >= 0, got -1"),
    ({**SITE, "kinds": [{"name": "drone"}]}, "kind 'drone': expected robots to be an integer"),
    (
        {**SITE, "kinds": [Kind("drone", 1, start="labb")]},
        "start 'labb': there is no such node; most alike are lab",
    ),
]


@pytest.mark.parametrize(
    ("name", "options", "fault"),
    [(name, *fault) for name, fault in zip(cycle(FORMATS), FAULTS, strict=False)],
)
def test_messages_are_the_same(site, name, options, fault):
    """In a format each, and in tables: one place makes a mission of either."""
    FORMATS[name](site / name)
    given = {key: value for key, value in options.items() if value is not None}
    with pytest.raises(ValueError, match=fault):
        load_mission(name, **given)
    with pytest.raises((ValueError, TypeError), match=fault):
        in_tables(**given)


POINTS = "n 4\nm 2\ntmax 40\n1 1 0\n5 1 3\n5 4 2\n1 1 0\n"


@pytest.mark.parametrize(
    "given",
    [
        {},
        {"base": 2},
        {"base": "2"},
        {"robots": 5},
        {"reward": 2},  # all points have a score
        {"pays": "return"},
        {"both_ways": True},  # as they are
        {"kinds": [Kind("drone", 2, start=1), Kind("rover", 1)]},
    ],
)
def test_an_option_for_points_with_scores(site, given):
    (site / "points.txt").write_text(POINTS)
    nodes = [[1, 1, 0], [5, 1, 3], [5, 4, 2], [1, 1, 0]]
    at = {i: (x, y) for i, (x, y, _) in enumerate(nodes)}
    lengths = {(u, v): math.dist(at[u], at[v]) for u in at for v in at if u != v}
    arcs = [(u, v, length, math.exp(-length / 40)) for (u, v), length in lengths.items()]
    expected = mission_from_tables(
        pd.DataFrame(nodes, columns=["x", "y", "reward"]).assign(label=[*at]),
        pd.DataFrame(arcs, columns=["tail", "head", "length", "survival"]),
        max_length=40,
        **{"base": 0, **({} if "kinds" in given else {"robots": 2}), **given},
    )
    assert load_mission("points.txt", **given) == expected
    with pytest.warns(UserWarning, match="All arcs have survivals; danger"):
        assert load_mission("points.txt", danger=0.1, **given) == expected


def ring(labels, **attributes):
    """A mission around some labels, whose rewards and survivals are texts."""
    nodes = [{"id": label, "reward": str(i)} for i, label in enumerate(labels)]
    around = zip(labels, [*labels[1:], labels[0]], strict=True)
    edges = [{"source": u, "target": v, "survival": "0.5", "length": "1e1"} for u, v in around]
    return {"directed": True, "graph": attributes, "nodes": nodes, "edges": edges}


@pytest.mark.parametrize(
    ("labels", "typed", "base"),
    [
        *((["007", "1e3", "true", "null", "0x1f", "7"], text, text) for text in ("007", "1e3")),
        *((["007", "1e3", "true", "null", "0x1f", "7"], text, text) for text in ("true", "0x1f")),
        (["007", "1e3", "true", "null"], "null", "null"),
        (["7", "8"], 7, "7"),
        ([7, 1000, 0.5], "7", 7),
        ([7, 1000, 0.5], "007", 7),
        ([7, 1000, 0.5], "1e3", 1000),
        ([7, 1000, 0.5], "0.50", 0.5),
        ([7, "7"], "7", "7"),
        ([7, "7"], 7, 7),
        ([[0, 1], [1, 0]], "[0, 1]", (0, 1)),
        ([[0, 1], [1, 0]], "(1, 0)", (1, 0)),
        ([True, "b"], "true", True),
        (["true", "b"], True, "true"),
    ],
)
def test_labels_as_they_are_typed(site, labels, typed, base):
    (site / "site.json").write_text(json.dumps(ring(labels)))
    found = load_mission("site.json", base=typed, robots=1).base
    assert (found, type(found)) == (base, type(base))


@pytest.mark.parametrize("typed", ["1", "nan", "[0]", "None", "Infinity"])
def test_a_text_that_is_no_label(site, typed):
    (site / "site.json").write_text(json.dumps(ring([True, "b", 2.5])))
    with pytest.raises(MissionError, match="there is no such node"):
        load_mission("site.json", base=typed, robots=1)


def test_a_name_that_one_node_has(site):
    content = ring(["n0", "n1", "n2"])
    for node, name in zip(content["nodes"], ["dock", "lab", "lab"], strict=True):
        node["label"] = name
    (site / "site.json").write_text(json.dumps(content))
    assert load_mission("site.json", base="dock", robots=1).base == "n0"
    with pytest.raises(MissionError, match="base 'lab': there is no such node"):
        load_mission("site.json", base="lab", robots=1)


@pytest.mark.parametrize("suffix", [".json", ".graphml"])
def test_numbers_that_are_written_as_texts(site, suffix):
    texts = ring(["a", "b"], base="a", robots="2", max_length="99.5")
    texts["nodes"][1] |= {"share": "0.5", "depot": "yes", "pays": "Return"}
    graph = nx.node_link_graph(texts, edges="edges")
    if suffix == ".json":
        (site / "site.json").write_text(json.dumps(texts))
    else:
        graph.nodes["b"]["depot"] = True
        nx.write_graphml(graph, site / "site.graphml")
        text = (site / "site.graphml").read_text()
        assert text.count(">True<") == 1
        (site / "site.graphml").write_text(text.replace(">True<", ">yes<"))
    mission = load_mission(site / f"site{suffix}")
    assert (mission.robots, mission.max_length, mission.total_reward) == (2, 99.5, 1)
    assert mission.graph.edges["a", "b"] == {"survival": 0.5, "length": 10}
    node = {"reward": 1, "share": 0.5, "depot": True, "pays": "return"}
    assert mission.graph.nodes["b"] == node


@pytest.mark.parametrize("suffix", [".json", ".graphml"])
def test_undirected_edges(site, suffix):
    graph = nx.Graph(base="a", robots=1)
    graph.add_node("a", reward=0)
    graph.add_node("b", reward=2)
    graph.add_edge("a", "b", survival=0.5)
    path = site / f"site{suffix}"
    if suffix == ".json":
        path.write_text(json.dumps(nx.node_link_data(graph, edges="edges")))
    else:
        nx.write_graphml(graph, path)
    expected = "expected directed arcs, found undirected edges: give both_ways"
    with pytest.raises(MissionError, match=expected):
        load_mission(path)
    assert load_mission(path, both_ways=True) == Mission(graph.to_directed())


def test_nodes_without_a_reward_are_named_where_others_have_one(site, recwarn):
    content = ring(["a", "b", "c", "d"], base="a", robots=1)
    del content["nodes"][0]["reward"], content["nodes"][2]["reward"]
    (site / "site.json").write_text(json.dumps(content))
    expected = r"^These nodes have no reward and get 1: 'c'; set reward to change it\.$"
    with pytest.warns(UserWarning, match=expected):
        assert load_mission("site.json").rewards.tolist() == [0, 1, 1, 3]
    assert load_mission("site.json", reward=7).rewards.tolist() == [0, 1, 7, 3]
    assert not recwarn.list


def test_kinds_of_a_file_and_in_its_place(site):
    mission = in_tables(base="dock", kinds=[Kind("drone", 2)], **DANGER)
    save_mission(mission, "kinds.json")
    assert load_mission("kinds.json", robots=4).team == "4 robots"
    rovers = [{"name": "rover", "robots": "1", "start": "lab"}, {"name": "drone", "robots": 1}]
    assert load_mission("kinds.json", kinds=rovers).team == "2 robots (1 rover, 1 drone)"
    plain = in_tables(base="dock", robots=2, **DANGER)
    save_mission(plain, "plain.json")
    assert load_mission("plain.json", kinds=rovers).kinds[0].start == "lab"


def test_a_node_that_its_map_does_not_see(site):
    content = ring(["a", "b"], base="a", robots=1)
    for edge in content["edges"]:
        del edge["survival"]
    (site / "site.json").write_text(json.dumps(content))
    survivals = load_mission("site.json", **DANGER).graph.edges
    assert survivals["a", "b"] == {"length": 10, "survival": math.exp(-1)}
    expected = r"edges\[0\]: arc 'a' -> 'b': expected pos \[x, y\] of 'a', found none"
    with pytest.raises(MissionError, match=expected):
        load_mission("site.json", hazard="map.yaml", **DANGER)


@pytest.mark.parametrize("option", ["hazard", "interest"])
@pytest.mark.parametrize("value", [3, [1], True, ""])
def test_a_map_that_is_no_path(site, option, value):
    with pytest.raises(ValueError, match=f"Expected {option} to be a path, got"):
        in_tables(base="dock", robots=1, sight=1, danger=1, **{option: value})


def test_null_is_an_empty_cell_and_names_may_be_in_upper_case(site):
    content = ring(["a", "b"], base="a", robots=1)
    content["nodes"][0] |= {"reward": None, "share": None, "depot": None}
    content["nodes"][1] = {"id": "b", "Reward": "4"}
    content["edges"][0] |= {"survival": None, "length": None}
    content["edges"][1] = {"source": "b", "target": "a", "Survival": 0.5, "LENGTH": 2}
    (site / "site.json").write_text(json.dumps(content))
    mission = load_mission("site.json", danger=0.5)
    assert mission.rewards.tolist() == [0, 4]
    assert mission.graph.edges["a", "b"]["survival"] == math.exp(-0.5)
    assert mission.graph.edges["b", "a"] == {"survival": 0.5, "length": 2}


def test_what_only_kinds_reach_is_not_left_out(site):
    route_graph(site / "site.geojson")
    content = json.loads((site / "site.geojson").read_text())
    content["features"].pop()  # the line back to the dock
    (site / "site.geojson").write_text(json.dumps(content))
    kinds = [{"name": "drone", "robots": 1, "end": "roof"}]
    mission = load_mission("site.geojson", base="dock", danger=0.1, kinds=kinds)
    assert mission.nodes == LABELS
    save_mission(mission, "saved.geojson")
    assert load_mission("saved.geojson") == mission


@pytest.mark.parametrize("name", FORMATS)
def test_a_name(site, name):
    FORMATS[name](site / name)
    named = load_mission(name, base="dock", robots=2, danger=0.1, name="harbour")
    assert named.name == "harbour"


def test_a_team_that_is_no_team_of_the_kinds(site):
    (site / "site.json").write_text(json.dumps(ring(["a", "b"], base="a", robots=1)))
    expected = "expected robots to be 2, the robots of all kinds together, or none, got 3"
    with pytest.raises(MissionError, match=expected):
        load_mission("site.json", robots=3, kinds=[{"name": "drone", "robots": 2}])


@pytest.mark.parametrize("aboard", [5, "xyz", {"a": 1}])
def test_nodes_aboard_that_are_no_list(site, aboard):
    (site / "site.json").write_text(json.dumps(ring(["a", "b"], base="a", robots=1)))
    with pytest.raises(MissionError, match="kind 'drone': expected aboard to be a list of nodes"):
        load_mission("site.json", kinds=[{"name": "drone", "robots": 2, "aboard": aboard}])


@pytest.mark.parametrize(("written", "length"), [("yes", 111_195), ("no", 1)])
def test_whether_a_mission_is_geographic_as_a_text(site, written, length):
    content = ring(["a", "b"], base="a", robots=1, geographic=written)
    for node, x in zip(content["nodes"], (0, 1), strict=True):
        node["pos"] = [x, 0]
    for arc in content["edges"]:
        del arc["survival"], arc["length"]
    (site / "site.json").write_text(json.dumps(content))
    lengths = load_mission("site.json", danger=1e-9).world.graph.length
    assert lengths == pytest.approx([length, length], rel=1e-3)


def test_an_interest_that_needs_positions(site):
    content = ring(["a", "b"], base="a", robots=1)
    del content["nodes"][1]["reward"]
    (site / "site.json").write_text(json.dumps(content))
    with pytest.raises(MissionError, match=r"node 'b': expected pos \[x, y\], found none"):
        load_mission("site.json", interest="map.yaml", sight=1)
