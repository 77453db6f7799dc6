"""What holds for every format: files are recognised, read with any option, written, or refused."""

import json
import math
import re
from datetime import date
from fractions import Fraction
from importlib.metadata import EntryPoint, entry_points
from itertools import cycle, product
from pathlib import Path

import networkx as nx
import numpy as np
import pandas as pd
import pytest
import yaml
from hypothesis import given
from hypothesis import strategies as st
from PIL import Image

from botohe_moo import Kind, Mission, MissionError, load_mission, mission_from_tables, save_mission
from botohe_moo.mission import Draft, Format, format_of, read_mission, stem_of
from botohe_moo.mission.formats.reading import formats, is_file_name, suffixes
from tests.mission.made import feature, loaded_by_nav2, team_site
from tests.strategies import missions, team_missions

DATA = Path(__file__).parents[1] / "data"
FEATURES = {"type": "FeatureCollection", "features": []}
NODES = {"directed": True, "multigraph": False, "graph": {}, "nodes": [], "edges": []}
RMF_SITE = {"format_version": "0.1", "anchors": {}, "properties": {}, "levels": {}}
MAP = "{image: map.png, resolution: 1.0, origin: [0, 0, 0], mode: scale}"
WRITTEN = [".json", ".graphml", ".geojson"]


@pytest.fixture
def site(tmp_path, monkeypatch):
    """A folder with a map whose right half is dangerous, and of interest."""
    cells = np.full((8, 8), 255, np.uint8)
    cells[:, 4:] = 0
    Image.fromarray(cells).save(tmp_path / "map.png")
    (tmp_path / "map.yaml").write_text(MAP)
    monkeypatch.chdir(tmp_path)
    return tmp_path


def written(path, content):
    """Write a text, bytes, or what JSON or YAML holds; return the path."""
    if not isinstance(content, str | bytes):
        is_yaml = path.suffix.lower() in (".yaml", ".yml")
        content = (yaml.safe_dump if is_yaml else json.dumps)(content)
    path.write_bytes(content.encode() if isinstance(content, str) else content)
    return path


RECOGNISED = [
    ("site.json", NODES, "node-link"),
    ("site.json", FEATURES, "route-graph"),
    ("SITE.GeoJSON", FEATURES, "route-graph"),
    ("site.geojson", "{", "route-graph"),  # whose reader says what is wrong
    ("site.json", "{", "node-link"),
    ("site.json", {"name": "neither"}, "node-link"),
    ("site.txt", "n 1\nm 1\nTMAX 3\n0 0 0", "orienteering"),
    ("site.graphml", "", "graphml"),
    ("site.building.yaml", {"levels": {}}, "building"),
    ("0.YML", {"levels": {"L1": {"vertices": [[0, 0], [1, 1]]}}}, "building"),
    ("0.yaml", {"levels": {"L1": {"vertices": [[0, 0, 0, ""]]}, "L2": None}}, "building"),
    ("0.yaml", {"levels": {"L1": {"vertices": [[0, 0, None]]}}}, "navigation-graph"),
    ("a.building.yaml", {"levels": {"L1": {"vertices": [[0, 0, {}]]}}}, "navigation-graph"),
    ("0.yaml", {"levels": {"L1": {"vertices": [7, [0, 0, {}]]}}}, "building"),
    ("0.yaml", {"levels": {"L1": {"vertices": [7, [0, 0, {}], [1, 1, {}]]}}}, "navigation-graph"),
]


class TestRecognised:
    def test_every_format_is(self):
        assert {name for *_, name in RECOGNISED} == formats().keys()
        assert len(suffixes()) == len({*suffixes()})

    @pytest.mark.parametrize(("name", "content", "expected"), RECOGNISED)
    def test_by_suffix_and_content(self, tmp_path, name, content, expected):
        assert format_of(written(tmp_path / name, content)) == formats()[expected]

    @pytest.mark.parametrize(
        ("name", "content", "kind"),
        [
            ("office.json", RMF_SITE, "a site of Open-RMF's site editor"),
            ("office.building.yaml", RMF_SITE, "a site of Open-RMF's site editor"),
            ("roads.geojson", {"arcs": [], "objects": {}}, "a TopoJSON topology"),
            ("layout.json", {"metaInformation": {}, "layouts": []}, "a layout of VDA 5050"),
            ("graph.json", {"elements": {"nodes": []}}, "a graph of Cytoscape"),
            ("plan.json", {"fileType": "Plan", "mission": {}}, "a plan of QGroundControl"),
            ("survey.plan", {"fileType": "Plan", "mission": {}}, "a plan of QGroundControl"),
            ("a.json", {"geometryType": "x", "features": []}, "features of ArcGIS"),
            ("a.json", {"generator": "Overpass API", "elements": []}, "OpenStreetMap data"),
            ("a.json", {"graph": {"nodes": {}, "edges": []}}, "a graph in JSON Graph Format"),
            ("a.json", {"nodes": [], "adjacency": [[]]}, "adjacency data of networkx"),
            ("a.tmap2", {"pointset": "orchard"}, "a topological map of LCAS"),
            ("a.yaml", [{"node": {}, "meta": {"pointset": "a"}}], "a topological map of LCAS"),
            ("floor.yaml", {"image": "a.pgm", "resolution": 1}, "a map: `botohe missions from-map"),
            ("runs.yml", {"missions": ["toy"], "algorithms": []}, "a study, which `botohe study"),
            ("fleet.yaml", {"rmf_fleet": {}}, "a fleet configuration of Open-RMF"),
        ],
    )
    def test_another_kind_of_file_is_refused_by_its_name(self, tmp_path, name, content, kind):
        path = written(tmp_path / name, content)
        for read in (format_of, read_mission):
            with pytest.raises(MissionError) as caught:
                read(path)
            assert str(caught.value).startswith(f"{path}: expected a mission, found {kind}")

    @pytest.mark.parametrize("name", ["a", "z"])
    def test_another_writer_of_json_does_not_replace_the_built_in_one(
        self, site, monkeypatch, name
    ):
        toy = load_mission("toy")
        entry = EntryPoint(name, f"{__name__}:OTHER", "botohe_moo.formats")
        known = {e.name: e for e in (entry, *entry_points(group="botohe_moo.formats"))}
        monkeypatch.setattr("botohe_moo.base.registry._registered", lambda *_: known)
        save_mission(toy, "toy.json")
        assert read_mission("toy.json") == toy
        Path("toy.json").write_bytes(b"other")
        assert format_of("toy.json") == OTHER

    def test_names_of_files(self):
        for name, stem, is_file in (
            ("maps/Hotel.Building.YAML", "Hotel", True),
            ("hotel.v2.geojson", "hotel.v2", True),
            (".json", ".json", True),
            ("hotel.pdf", "hotel", False),
            ("b/hotel", "hotel", True),
            ("hotel", "hotel", False),
        ):
            assert (stem_of(name), stem_of(Path(name)), is_file_name(name)) == (stem, stem, is_file)


OTHER = Format((".json",), lambda source: source.data == b"other", Draft, lambda _: b"other")

# A site in metres, whose arcs lead around, and its nodes on a map of 8 by 8 cells.
LABELS = ("dock", "lab", "hall", "roof")
PLACES = ((1.0, 1.0), (5.0, 1.0), (5.0, 4.0), (1.0, 4.0))
ARCS = ((0, 1), (1, 2), (2, 3), (3, 0))
ENDS = [(LABELS[u], LABELS[v]) for u, v in ARCS]


def in_levels(vertices, **members):
    lanes = [[u, v, {}] for u, v in ARCS]
    return {**members, "levels": {"L1": {"vertices": vertices, "lanes": lanes}}}


PLACED = list(zip(LABELS, PLACES, strict=True))
AROUND = nx.DiGraph(ENDS)
nx.set_node_attributes(AROUND, {label: dict(zip("xy", at, strict=True)) for label, at in PLACED})
FORMATS = {
    "site.json": {
        **NODES,
        "nodes": [{"id": label, "pos": place} for label, place in PLACED],
        "edges": [{"source": tail, "target": head} for tail, head in ENDS],
    },
    "site.geojson": {
        "features": [feature("Point", place, id=label) for label, place in PLACED]
        + [feature("LineString", [], startid=tail, endid=head) for tail, head in ENDS]
    },
    "site.building.yaml": in_levels(
        [[*place, 0, label] for label, place in PLACED], coordinate_system="cartesian_meters"
    ),
    "site.yaml": in_levels([[*place, {"name": label}] for label, place in PLACED]),
    "site.graphml": "\n".join(nx.generate_graphml(AROUND)),
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


def in_tables(*, lengths=None, **options):
    nodes = pd.DataFrame(PLACES, columns=["x", "y"]).assign(label=LABELS)
    arcs = pd.DataFrame(ENDS, columns=["tail", "head"])
    arcs = arcs if lengths is None else arcs.assign(length=lengths)
    return mission_from_tables(nodes, arcs, **options)


def ring(labels, **attributes):
    """Node-link data around some labels, whose rewards and survivals are texts."""
    nodes = [{"id": label, "reward": str(i)} for i, label in enumerate(labels)]
    around = zip(labels, [*labels[1:], labels[0]], strict=True)
    edges = [{"source": u, "target": v, "survival": "0.5", "length": "1e1"} for u, v in around]
    return {"directed": True, "graph": attributes, "nodes": nodes, "edges": edges}


class TestOptions:
    @pytest.mark.parametrize(
        ("name", "option"), [p for i, p in enumerate(product(FORMATS, OPTIONS)) if i % 3 == 0]
    )
    def test_give_in_a_format_what_they_give_in_tables(self, site, name, option):
        """Each format with three or four, and each option with one or two."""
        written(site / name, FORMATS[name])
        given = {"base": "dock", "robots": 3} | OPTIONS[option]
        if option == "kinds":
            del given["robots"]
        mission, expected = load_mission(name, name="harbour", **given), in_tables(**given)
        assert (mission, mission.name, mission.pays) == (expected, "harbour", expected.pays)
        assert [tuple(mission.graph.nodes[v]["pos"]) for v in mission.nodes] == [*PLACES]

    def test_mean_what_they_say(self, site):
        def made(**given):
            return in_tables(base="dock", robots=1, **given)

        arcs = made(**DANGER).graph.edges
        assert arcs["dock", "lab"] == {"length": 4, "survival": math.exp(-0.4)}
        assert made(reward=2, **DANGER).rewards.tolist() == [0, 2, 2, 2]
        both = made(both_ways=True, **DANGER).graph.edges
        assert both["lab", "dock"] == both["dock", "lab"]
        zone = made(**OPTIONS["danger_zones"]).graph.edges
        hazard = made(lengths=(4, 9, 4, 3), **OPTIONS["hazard"]).graph.edges
        assert zone["dock", "lab"]["survival"] == pytest.approx(math.exp(-0.5 * 2))
        assert zone["lab", "hall"]["survival"] == hazard["roof", "dock"]["survival"] == 1
        # Also along an arc that is longer than its ends are apart.
        assert hazard["lab", "hall"]["survival"] == pytest.approx(math.exp(-0.1 * 9))
        # Of the black cells, where x >= 4, only lab and hall at x = 5 see some.
        seen = made(**OPTIONS["interest"]).rewards
        assert seen[0] == seen[3] == 0 < seen[1]

    FAULTS = (
        ({"base": None}, "base"),
        ({"robots": None}, "robots"),
        ({"danger": None}, r"expected a survival, found none \(4 without one\): give danger"),
        ({"base": "deck"}, "base 'deck': no such node; most alike are dock"),
        ({"base": [3, {}]}, r"expected a label, a string, a number, .* got {}"),
        ({"sight": 1}, "expected interest, a map, and sight"),
        ({"danger_zones": 3}, "danger_zones to be a list"),
        ({"hazard": "no.yaml"}, r"no\.yaml: no such"),
        ({"hazard": "small.yaml"}, r"small\.yaml: expected a map that covers \[5\.0, 1\.0\]"),
        ({"hazard": 3}, "Expected hazard to be a path, got 3"),
        ({"interest": "", "sight": 1}, "Expected interest to be a path, got ''"),
        ({"danger": 200}, "200.* 4"),
        ({"danger": -1}, "Expected danger >= 0, got -1"),
        ({"kinds": [{"name": "drone"}]}, "kind 'drone': expected robots to be an integer"),
    )

    @pytest.mark.parametrize(
        ("name", "options", "fault"),
        [(name, *fault) for name, fault in zip(cycle(FORMATS), FAULTS, strict=False)],
    )
    def test_are_refused_with_the_same_words(self, site, name, options, fault):
        """In a format each, and in tables: one place makes a mission of either."""
        written(site / name, FORMATS[name])
        written(site / "small.yaml", MAP.replace("1.0", "0.5"))
        given = {**DANGER, "base": "dock", "robots": 1, **options}
        given = {key: value for key, value in given.items() if value is not None}
        for make in (lambda **of: load_mission(name, **of), in_tables):
            with pytest.raises((ValueError, TypeError), match=fault):
                make(**given)

    def test_that_are_not_known_are_named(self):
        with pytest.raises(ValueError, match=r"pier\.json: there is no parameter 'scale'; known "):
            read_mission(DATA / "pier.json", scale=3)
        with pytest.raises(ValueError, match=r"parameter 'neighbors'; known are neighbours, "):
            read_mission(DATA / "points.txt", neighbors=3)

    def test_change_nothing_that_a_file_says(self, site):
        toy = load_mission("toy")
        save_mission(toy, "toy.geojson")
        with pytest.warns(UserWarning, match="All arcs have survivals; danger, hazard and zones"):
            assert load_mission("toy.geojson", danger=9, hazard="map.yaml", reward=7) == toy

    def test_of_kinds_take_the_place_of_those_of_the_file(self, site):
        save_mission(in_tables(base="dock", kinds=[Kind("drone", 2)], **DANGER), "kinds.json")
        assert load_mission("kinds.json", robots=4).team == "4 robots"
        rovers = [{"name": "rover", "robots": "1", "start": "lab"}, {"name": "drone", "robots": 1}]
        mission = load_mission("kinds.json", kinds=rovers)
        assert (mission.team, mission.kinds[0].start) == ("2 robots (1 rover, 1 drone)", "lab")

    @pytest.mark.parametrize(
        ("labels", "typed", "base"),
        [
            *((["007", "1e3", "true", "null", "0x1f", "7"], t, t) for t in ("007", "1e3", "null")),
            (["7", "8"], 7, "7"),
            ([7, 1000, 0.5], "007", 7),
            ([7, 1000, 0.5], "1e3", 1000),
            *(([7, "7"], typed, typed) for typed in (7, "7")),
            *(([[0, 1], [1, 0]], typed, (1, 0)) for typed in ("[1, 0]", "(1, 0)")),
            ([True, "b"], "true", True),
            (["true", "b"], True, "true"),
        ],
    )
    def test_of_the_base_mean_labels_as_they_are_typed(self, site, labels, typed, base):
        written(site / "site.json", ring(labels))
        found = load_mission("site.json", base=typed, robots=1).base
        assert (found, type(found)) == (base, type(base))

    def test_of_the_base_mean_a_name_that_is_the_only_one(self, site):
        content = ring(["a", "b", "c"])
        for node, name in zip(content["nodes"], ["pier", "quay", "quay"], strict=True):
            node["name"] = name
        written(site / "site.json", content)
        assert load_mission("site.json", base="pier", robots=1).base == "a"
        with pytest.raises(MissionError, match="base 'quay': no such node"):
            load_mission("site.json", base="quay", robots=1)


class TestAttributes:
    @pytest.mark.parametrize("suffix", [".json", ".graphml"])
    def test_that_are_texts_or_in_upper_case_are_read(self, site, suffix):
        content = ring(["a", "b"], base="a", robots="2", max_length="99.5", geographic="no")
        content["nodes"][1] |= {"share": "0.5", "DEPOT": "yes", "pays": "Return"}
        path = site / f"site{suffix}"
        if suffix == ".json":
            content["nodes"][0] |= {"reward": None, "depot": None}  # as empty cells
            written(path, content)
        else:
            nx.write_graphml(nx.node_link_graph(content, edges="edges"), path)
        mission = load_mission(path)
        assert (mission.name, mission.robots, mission.max_length) == ("site", 2, 99.5)
        assert mission.graph.graph["geographic"] is False
        assert mission.graph.edges["a", "b"] == {"survival": 0.5, "length": 10}
        node = {"reward": 1, "share": 0.5, "depot": True, "pays": "return"}
        assert mission.graph.nodes["b"] == node

    @pytest.mark.parametrize("suffix", [".json", ".graphml"])
    def test_of_undirected_edges_hold_both_ways_if_that_is_said(self, site, suffix):
        graph = nx.Graph([("a", "b")], base="a", robots=1)
        nx.set_node_attributes(graph, {"a": 0, "b": 2}, "reward")
        nx.set_edge_attributes(graph, 0.5, "survival")
        path = site / f"site{suffix}"
        if suffix == ".json":
            written(path, nx.node_link_data(graph, edges="edges"))
        else:
            nx.write_graphml(graph, path)
        expected = "expected directed arcs, found undirected edges: give both_ways"
        with pytest.raises(MissionError, match=expected):
            load_mission(path)
        assert load_mission(path, both_ways=True) == Mission(graph.to_directed())

    def test_rewards_that_some_nodes_lack_are_told(self, site, recwarn):
        content = ring(["a", "b", "c", "d"], base="a", robots=1)
        del content["nodes"][0]["reward"], content["nodes"][2]["reward"]
        written(site / "site.json", content)
        expected = r"^These nodes have no reward and get 1: 'c'; set reward to change it\.$"
        with pytest.warns(UserWarning, match=expected):
            assert load_mission("site.json").rewards.tolist() == [0, 1, 1, 3]
        assert load_mission("site.json", reward=7).rewards.tolist() == [0, 1, 7, 3]
        assert not recwarn.list

    def test_that_maps_need_are_missed_only_with_maps(self, site):
        content = ring(["a", "b"], base="a", robots=1)
        content["edges"][0]["survival"] = None
        written(site / "site.json", content)
        arc = load_mission("site.json", **DANGER).graph.edges["a", "b"]
        assert arc == {"length": 10, "survival": math.exp(-1)}
        expected = r"edges\[0\]: arc 'a' -> 'b': expected pos \[x, y\] of 'a', found none"
        with pytest.raises(MissionError, match=expected):
            load_mission("site.json", hazard="map.yaml", **DANGER)
        del content["nodes"][1]["reward"]
        written(site / "site.json", content)
        with pytest.raises(MissionError, match=r"node 'b': expected pos \[x, y\], found none"):
            load_mission("site.json", interest="map.yaml", sight=1, **DANGER)


numbers = st.integers() | st.floats(allow_nan=False, allow_infinity=False)
scalars = numbers | st.text() | st.booleans()
tuples = st.recursive(scalars, lambda inner: st.lists(inner, max_size=3).map(tuple), max_leaves=4)
json_values = st.recursive(
    st.none() | scalars,
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.text(), inner, max_size=3),
    max_leaves=4,
)
xml_text = st.text(
    st.characters(exclude_categories=["Cs", "Cc"], exclude_characters="\ufffe\uffff")
    | st.sampled_from("\t\n")
)
xml_values = numbers | st.booleans() | xml_text
# Among them some that Nav2 reads, as numbers or texts.
NAMES = st.sampled_from(["zone", "startid", "ключ", "label", "frame", "cost", "penalty"])


@st.composite
def any_missions(draw, labels, values, is_placed):
    """Missions of one or several kinds, with labels and further attributes of the given kinds."""
    mission = draw(missions(max_nodes=5) | team_missions())
    size = len(mission.nodes)
    new = draw(st.lists(labels, min_size=size, max_size=size, unique=True))
    graph = mission.graph.copy()
    for attributes in (*graph.nodes.values(), *graph.edges.values()):
        attributes.update(draw(st.dictionaries(NAMES, values, max_size=2)))
    graph.graph.update(draw(st.dictionaries(NAMES, values, max_size=2)))
    if draw(st.booleans()):
        graph.graph["max_length"] = draw(st.floats(99.5, 1e9) | st.integers(100, 999))
    for node in graph if is_placed or draw(st.booleans()) else ():
        graph.nodes[node]["pos"] = draw(st.lists(numbers, min_size=2, max_size=2))
    named = dict(zip(mission.nodes, new, strict=True))
    kinds = []
    for kind in mission.kinds:
        ends = {"start": named.get(kind.start), "end": named.get(kind.end)}
        aboard = tuple(map(named.get, kind.aboard))
        kinds.append(Kind(**vars(kind) | ends | {"aboard": aboard}))
    own = {"pays": mission.pays, "name": draw(xml_text.filter(bool))}
    return Mission(nx.relabel_nodes(graph, named), base=new[0], kinds=kinds, **own)


def attributes_of(mission):
    """All that a file must hold: attributes of the graph, of its nodes and of its arcs."""
    graph = mission.graph
    given = {key: value for key, value in graph.graph.items() if value is not None}
    own = {name: getattr(mission, name) for name in ("name", "base", "robots", "pays")}
    return {**given, **own, "kinds": ()}, dict(graph.nodes), dict(graph.edges)


class TestWritten:
    @pytest.mark.filterwarnings("ignore:.*no kind of robots can collect")
    @pytest.mark.parametrize("suffix", WRITTEN)
    @given(data=st.data())
    def test_is_read_again_bit_for_bit(self, tmp_path_factory, suffix, data):
        kept = (xml_text, xml_values) if suffix == ".graphml" else (tuples, json_values)
        mission = data.draw(any_missions(*kept, suffix == ".geojson"))
        path = tmp_path_factory.getbasetemp() / f"round{suffix}"
        save_mission(mission, path)
        read = read_mission(path)
        assert read == mission
        assert read.world.graph.length.tobytes() == mission.world.graph.length.tobytes()
        assert (read.max_length, read.pays) == (mission.max_length, mission.pays)
        shares = [node.get("share") for node in mission.graph.nodes.values()]
        if suffix != ".graphml" or {} not in shares:  # GraphML has no empty mappings
            assert attributes_of(read) == attributes_of(mission)
        if suffix == ".geojson":
            loaded_by_nav2(json.loads(path.read_text()))

    def test_is_standard_json_with_a_node_or_arc_a_line(self, tmp_path):
        mission = read_mission(DATA / "pier.json")
        pier = ("pier", (1, True))
        assert (mission.nodes, mission.base, mission.robots) == ((pier, "môle", 3), pier, 2)
        assert mission.title == "A pier, its mole and two boats"
        assert mission.graph.edges[pier, "môle"]["dangers"] == 1
        save_mission(mission, str(tmp_path / "Pier.JSON"))
        assert (tmp_path / "Pier.JSON").read_bytes() == (DATA / "pier.json").read_bytes()
        mark = written(tmp_path / "m.json", b"\xef\xbb\xbf" + (DATA / "pier.json").read_bytes())
        assert read_mission(mark) == mission

    def test_is_what_the_mission_says_not_its_graph(self, site):
        graph = team_site(graph={"kinds": [{"name": "rover", "robots": 9}], "pays": "return"})
        graph.graph |= {"base": "roof", "robots": 9, "name": "old", "title": "A site"}
        drone = Kind("drone", np.int64(2), start="roof", max_length=Fraction(5, 2))
        mission = Mission(
            graph, base="dock", kinds=[drone, Kind("rover", 1)], pays="arrival", name="new"
        )
        save_mission(mission, "site.json")
        assert json.loads(Path("site.json").read_text())["graph"] == {
            "name": "new",
            "title": "A site",
            "base": "dock",
            "kinds": [
                {"name": "drone", "robots": 2, "start": "roof", "max_length": 2.5},
                {"name": "rover", "robots": 1},
            ],
            "pays": "arrival",
        }
        assert read_mission("site.json") == mission

    @pytest.mark.parametrize("suffix", WRITTEN)
    def test_holds_numbers_of_other_types_as_plain_ones(self, tmp_path, suffix):
        graph = nx.DiGraph(base="a", robots=np.int64(2))
        graph.add_node("a", reward=np.int32(3), pos=np.array([0.5, 1.0]), seen=np.bool_(True))
        graph.add_node("b", reward=Fraction(1, 3), pos=(1, 2), tag=np.str_("x"))
        graph.add_edge("a", "b", survival=np.float64(0.1))
        graph.add_edge("b", "a", survival=np.float32(0.3))
        mission = Mission(graph)
        save_mission(mission, tmp_path / f"x{suffix}")
        read = read_mission(tmp_path / f"x{suffix}")
        assert read == mission
        assert read.graph.nodes["a"] == {"reward": 3, "pos": [0.5, 1.0], "seen": True}
        assert read.graph.nodes["b"]["pos"] == [1, 2]

    def test_holds_labels_of_other_types_as_plain_ones(self, tmp_path):
        labels = (np.int64(1), np.float64(0.5), (np.int8(3), np.str_("x")), np.bool_(False))
        graph = nx.cycle_graph(labels, nx.DiGraph)
        nx.set_node_attributes(graph, 1, "reward")
        nx.set_edge_attributes(graph, 0.5, "survival")
        mission = Mission(graph, base=1, robots=1)
        save_mission(mission, tmp_path / "x.json")
        read = read_mission(tmp_path / "x.json")
        assert (read, [*map(type, read.nodes)]) == (mission, [int, float, tuple, bool])

    @pytest.mark.parametrize(
        ("suffix", "label", "changes", "words"),
        [
            (".json", b"x", {}, "Node b'x' cannot be saved"),
            (".json", Fraction(1, 3), {}, "Node Fraction(1, 3) cannot be saved"),
            (".json", "a", {"when": date(2025, 1, 1)}, "cannot be saved: JSON has no date"),
            (".json", "a", {"id": 1}, "'id' is the name of a label"),
            (".json", "a", {"h": [math.inf]}, "[inf]} cannot be saved"),
            (".graphml", 2, {}, "Node 2: expected a label that is text, as all labels in GraphML"),
            (".graphml", "a", {"tags": ["a"]}, "node 'a': expected numbers, booleans and texts"),
            (".geojson", "a", {}, "node 'a': expected pos [x, y] for GeoJSON, found none"),
            (".xml", "a", {}, "one of .graphml, .json, .geojson; found"),
        ],
    )
    def test_is_nothing_that_a_format_cannot_hold(self, tmp_path, suffix, label, changes, words):
        graph = nx.DiGraph()
        graph.add_node(label, reward=1, **changes)
        with pytest.raises(ValueError, match=re.escape(words)) as caught:
            save_mission(Mission(graph, base=label, robots=1), tmp_path / f"x{suffix}")
        assert str(tmp_path) in str(caught.value)
        assert not [*tmp_path.iterdir()]

    def test_is_no_folder(self, tmp_path):
        (tmp_path / "x.json").mkdir()
        with pytest.raises(OSError, match="expected a file, found a folder"):
            save_mission(load_mission("toy"), tmp_path / "x.json")
        with pytest.raises(MissionError, match="is a directory"):
            read_mission(tmp_path / "x.json")


def graphml(body, keys="", edgedefault="directed"):
    return (
        '<graphml xmlns="http://graphml.graphdrawing.org/xmlns" xmlns:y="http://y/">'
        '<key id="s" for="edge" attr.name="survival" attr.type="double"/>'
        '<key id="r" for="node" attr.name="reward" attr.type="double"/>'
        '<key id="b" for="graph" attr.name="base" attr.type="string"/>'
        '<key id="k" for="graph" attr.name="robots" attr.type="int"/>'
        f'{keys}<graph edgedefault="{edgedefault}">{body}</graph></graphml>'
    )


TWO = (
    '<data key="b">a</data><data key="k">2</data>'
    '<node id="a"><data key="r">0</data></node><node id="b"><data key="r">1</data></node>'
    '<edge source="a" target="b"><data key="s">0.5</data></edge>'
    '<edge source="b" target="a"><data key="s">0.25</data></edge>'
)


def typed(kind, text):
    """GraphML whose graph, nodes and arcs hold a text as a number of some type."""
    key = f'<key id="d" for="all" attr.name="danger" attr.type="{kind}"/>'
    value = f'<data key="d">{text}</data>'
    return graphml(value + TWO.replace('<data key="r">', value + '<data key="r">', 1), key)


def two(nodes=None, edges=None, graph=None, **members):
    """Node-link data of two nodes."""
    usual = {"source": "a", "target": "b", "survival": 0.5}
    back = {"source": "b", "target": "a", "survival": 0.25}
    about = {"base": "a", "robots": 2} if graph is None else graph
    nodes = [{"id": "a", "reward": 0}, {"id": "b", "reward": 1}] if nodes is None else nodes
    edges = [usual, back] if edges is None else edges
    return {"directed": True, "graph": about, "nodes": nodes, "edges": edges, **members}


A, B = two()["nodes"]
AB, BA = two()["edges"]
LOST = {"source": "y", "target": "x", "survival": 0.1}
# The name of a file, its content, and words of all its faults, in their order.
REFUSED = [
    ("x.json", b'{"a": "\xff"}', "can't decode byte 0xff in position 7"),
    ("x.json", '{\n "directed": tru', "line 2: not valid JSON: Expecting value"),
    ("x.json", "[]", "expected the file to be a mapping, got []"),
    ("x.json", "[" * 100_000, "recursion"),
    ("x.json", '{"nodes": [{"id": 1, "id": 2}]}', "each key of an object once, found 'id' twice"),
    ("x.json", two(multigraph=True), "expected at most one arc from a node to another"),
    ("x.json", two([7]), "nodes[0]: expected an object with id, got 7"),
    ("x.json", two([{"id": {}}]), "nodes[0]: expected a label, a string, a number, a boolean"),
    ("x.json", two(edges=[{"source": 1}]), "edges[0]: expected an object with source and target"),
    ("x.json", two(edges=[AB]), "'b': has no way back to base 'a'", "no arc leads back; both_ways"),
    (
        "x.json",
        {"directed": "yes", "graph": [], "nodes": []},
        "expected directed to be true or false, got 'yes'",
        "expected graph to be a mapping, got []",
        "expected the key 'edges', which is missing",
    ),
    (
        "x.json",
        two([A, B, {"id": "b", "reward": 3}], [AB, BA | {"survival": 2}, AB, LOST]),
        "nodes[2]: node 'b' is listed more than once",
        "edges[2]: arc 'a' -> 'b': is listed more than once",
        "edges[3]: arc 'y' -> 'x': there is no node 'y'",
        "edges[3]: arc 'y' -> 'x': there is no node 'x'",
        "arc 'b' -> 'a': expected survival in (0, 1], got 2",
    ),
    ("x.json", two([A | {"h": math.nan}], []), "node 'a': {'reward': 0, 'h': nan} cannot be saved"),
    ("x.json", two(graph={}), "expected robots, an integer >= 1", "expected base, the label"),
    ("x.graphml", "", "no element found: line 1, column 0"),
    ("x.graphml", graphml(TWO + "</graph><graph>"), "with one directed graph, found 2 graphs"),
    ("x.graphml", graphml(TWO, edgedefault="undirected"), "expected directed arcs, found undirec"),
    ("x.graphml", graphml(TWO.replace(">1<", ">a<")), "node 'b': expected 'reward' of type double"),
    ("x.graphml", graphml(TWO.replace('"s">0.5', '"z">0.5')), "'b': there is no key 'z'", "surv"),
    ("x.graphml", graphml(TWO + '<edge source="a" target="z"/>'), "survival", "no node 'z'"),
    ("x.graphml", graphml(TWO + "<node/>"), "node None: expected id, found none"),
    ("x.graphml", graphml(TWO + "<hyperedge/>"), "expected edges only, found a hyperedge"),
    ("x.graphml", typed("int", "5.0"), *[": expected 'danger' of type int, got '5.0'"] * 2),
    ("x.graphml", typed("decimal", "5"), *["of type 'decimal', one of int, integer, long"] * 2),
    ("x.geojson", "{", "line 1: not valid JSON: the file is empty or ends too early"),
    ("x.json", "\n", "line 2: not valid JSON: the file is empty or ends too early"),
    ("x.geojson", {"features": 3}, "expected GeoJSON with a list of features"),
    ("x.geojson", {"features": [], "mission": 3}, "expected mission to be an object, got 3"),
    ("x.txt", "n five\nm 1\ntmax 2", "line 1: expected 'n' and a number, got 'n five'"),
    ("x.txt", "", *(f"the end: expected '{key}' and a number" for key in ("n", "m", "tmax"))),
    (
        "x.txt",
        "n 4\nm 3\ntmax 9\n\n0 0\n1 2 three\n1 2 3\n1 2 3 0 4\n1 inf 3",
        "line 5: expected three numbers, x, y and a score, got '0 0'",
        "line 6: expected three numbers, x, y and a score, got '1 2 three'",
        "line 8: expected three numbers, x, y and a score, got '1 2 3 0 4'",
        "line 9: expected three numbers, x, y and a score, got '1 inf 3'",
    ),
    ("x.txt", "n 2\nm 1\ntmax 9\n0 0 0", "line 1: expected n 1, the number of lines after tmax"),
    ("x.txt", "n 1\nm 0\ntmax 9\n0 0 -1", "robots to be an integer", "node 0: expected a finite"),
    ("x.txt", "n 2\nm 1.5\ntmax 9\n0 0 0\n1 1 0", "'robot': expected robots to be", "robots"),
    ("x.txt", "n 0\nm 1\ntmax 9", "base 0: no such node"),
    ("x.txt", "n 1\nm 1\ntmax 0\n0 0 0", "expected tmax > 0 to be the scale, got 0; give a scale"),
]  # fmt: skip


class TestRefused:
    @pytest.mark.parametrize(("name", "content", "words"), [(n, c, w) for n, c, *w in REFUSED])
    def test_a_file_with_these_faults(self, tmp_path, name, content, words):
        path = written(tmp_path / name, content)
        with pytest.raises(MissionError) as caught:
            read_mission(path)
        assert str(caught.value).startswith(str(path))
        assert len(caught.value.faults) == len(words), caught.value
        assert all(map(str.__contains__, caught.value.faults, words)), caught.value

    def test_a_file_that_is_not_there(self, tmp_path):
        for path in (tmp_path / f"lost{suffix}" for suffix in (*suffixes(), ".GraphML")):
            for read, error in ((format_of, ValueError), (read_mission, MissionError)):
                with pytest.raises(error, match=re.escape(f"{path}: no such file")):
                    read(path)

    @given(suffix=st.sampled_from(suffixes()), data=st.binary())
    def test_any_bytes_at_all(self, tmp_path_factory, suffix, data):
        path = written(tmp_path_factory.getbasetemp() / f"any{suffix}", data)
        with pytest.raises(MissionError, match=re.escape(str(path))):
            read_mission(path)


class TestGraphML:
    def test_as_gephi_and_yed_write_it(self, tmp_path):
        """Drawings move no node, and what is drawn on them are labels."""
        text = (DATA / "gephi.graphml").read_text()
        drawn = '<data key="y">2</data><data key="shape"><y:ShapeNode><y:Geometry x="9" y="9"/>'
        drawn += "<y:NodeLabel> Pier </y:NodeLabel></y:ShapeNode></data>"
        text = text.replace('<data key="y">2</data>', drawn).replace(
            '"shape"><y:ShapeNode><y:Geometry x="9" y="9"/></',
            '"shape"><y:ShapeNode><y:NodeLabel>Reef</y:NodeLabel></',
        )
        mission = read_mission(written(tmp_path / "gephi.graphml", text))
        assert (mission.base, mission.robots, mission.name) == ("1", 2, "gephi")
        assert mission.graph.nodes["1"] == {"reward": 0.0, "label": "dock", "pos": [-3.5, 2.0]}
        drawn = {"reward": 5.0, "visited": True, "r": 153, "label": "Reef"}
        assert mission.graph.nodes["2"] == drawn
        assert mission.world.graph.mean_survival.tolist() == [0.9, 0.8]
        other = read_mission(tmp_path / "gephi.graphml", base="Reef")
        assert (other.base, other.rewards.tolist()) == ("2", [0, 5])  # 0 is the default of nodes

    def test_as_networkx_writes_and_reads_it(self, tmp_path):
        path, gephis = tmp_path / "ring.graphml", read_mission(DATA / "gephi.graphml")
        save_mission(gephis, path)
        theirs = Mission(nx.read_graphml(path))
        assert theirs == gephis
        save_mission(theirs, path)  # with the defaults that networkx' reader leaves in the graph
        assert read_mission(path) == gephis

    def test_kinds_stand_in_columns(self, tmp_path):
        path = tmp_path / "site.graphml"
        graph = team_site(graph={"kinds": '[{"name": "drone", "robots": 2, "end": "lab"}]'})
        for *_, attributes in (*graph.nodes(data=True), *graph.edges(data=True)):
            for name in {"share", "survival"} & {*attributes}:
                attributes.update({f"{name}:drone": attributes.pop(name).get("drone", 1)})
        nx.write_graphml(graph, path)
        mission, text = read_mission(path), path.read_text()
        assert mission.kinds == (Kind("drone", 2, end="lab"),)
        assert mission.graph.nodes["lab"]["share"] == {"drone": 0.5}
        assert mission.graph.edges["lab", "roof"]["survival"] == {"drone": 0.8}
        for old, new, fault in (
            ("survival:drone", "survival:rover", "column 'survival:rover': no such kind; the k"),
            ('"robots": 2', '"robots"', "expected kinds as JSON, got '"),
        ):
            path.write_text(text.replace(old, new))
            with pytest.raises(MissionError, match=fault):
                read_mission(path)


def test_arcs_as_older_networkx_names_them(tmp_path):
    content = two()
    content["links"] = content.pop("edges")
    mission = read_mission(written(tmp_path / "links.json", content))
    assert mission.world.graph.mean_survival.tolist() == [0.5, 0.25]
