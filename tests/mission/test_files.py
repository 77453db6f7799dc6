"""Mission files: reading and writing JSON and GraphML."""

import json
import math
import re
from datetime import date
from fractions import Fraction
from pathlib import Path

import networkx as nx
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from botohe_moo.mission import Mission, MissionError, read_mission, save_mission
from tests.strategies import missions

DATA = Path(__file__).parents[1] / "data"


def content(**changes):
    """Node-link data of a mission of two nodes, with changes."""
    return {
        "directed": True,
        "multigraph": False,
        "graph": {"name": "two", "base": "a", "robots": 2},
        "nodes": [{"id": "a", "reward": 0}, {"id": "b", "reward": 1}],
        "edges": [
            {"source": "a", "target": "b", "survival": 0.5},
            {"source": "b", "target": "a", "survival": 0.25},
        ],
        **changes,
    }


def mission_of(nodes=("a", "b"), **graph):
    graph = nx.DiGraph(**graph)
    for node in nodes:
        graph.add_node(node, reward=1)
    for tail, head in zip(nodes, [*nodes[1:], nodes[0]], strict=True):
        graph.add_edge(tail, head, survival=0.5)
    return Mission(graph, base=nodes[0], robots=1)


def faults_of(path, data, **options):
    """The faults of a file, which must name that file."""
    if not isinstance(data, bytes):
        data = data.encode() if isinstance(data, str) else json.dumps(data).encode()
    path.write_bytes(data)
    with pytest.raises(MissionError) as caught:
        read_mission(path, **options)
    assert str(caught.value).startswith(str(path))
    return list(caught.value.faults)


@pytest.fixture
def json_faults(tmp_path):
    return lambda data: faults_of(tmp_path / "bad.json", data)


@pytest.fixture
def graphml_faults(tmp_path):
    return lambda data: faults_of(tmp_path / "bad.graphml", data)


def attributes_of(mission):
    """All that a file must hold: the attributes of the graph, of its nodes and of its arcs."""
    graph = mission.graph
    own = {"name": mission.name, "base": mission.base, "robots": mission.robots}
    arcs = {(tail, head): attributes for tail, head, attributes in graph.edges(data=True)}
    return {**graph.graph, **own}, dict(graph.nodes(data=True)), arcs


class TestAnyFile:
    def test_unknown_suffix(self, tmp_path):
        name = "pier.xml"
        with pytest.raises(MissionError, match=r"one of .*\.geojson.*; found the suffix"):
            read_mission(tmp_path / name)
        with pytest.raises(ValueError, match=r"one of \.graphml, \.json, \.geojson; found"):
            save_mission(mission_of(), tmp_path / name)

    def test_missing_file_and_directory(self, tmp_path):
        path = tmp_path / "lost.GraphML"
        with pytest.raises(MissionError, match=re.escape(f"{path}: no such file")):
            read_mission(path)
        path.mkdir()
        with pytest.raises(
            MissionError,
            match=re.escape(f"{path}: is a directory"),
        ):
            read_mission(path)
        with pytest.raises(OSError, match="expected a file, found a folder"):
            save_mission(mission_of(), path)

    def test_suffix_in_any_case_and_path_as_string(self, tmp_path):
        path = str(tmp_path / "Pier.JSON")
        save_mission(read_mission(DATA / "pier.json"), path)
        assert read_mission(path) == read_mission(DATA / "pier.json")

    def test_robots_override_the_team_size(self):
        assert read_mission(DATA / "pier.json", robots=7).robots == 7
        assert read_mission(DATA / "points.txt", robots=7).robots == 7
        with pytest.raises(MissionError, match=r"pier\.json: expected robots .* >= 1, got 0"):
            read_mission(DATA / "pier.json", robots=0)

    def test_unknown_options(self):
        with pytest.raises(ValueError, match=r"pier\.json: there is no parameter 'scale'; known "):
            read_mission(DATA / "pier.json", scale=3)
        with pytest.raises(ValueError, match=r"parameter 'neighbors'; known are neighbours, "):
            read_mission(DATA / "points.txt", neighbors=3)

    def test_nameless_file_gives_its_own_name(self, tmp_path):
        path = tmp_path / "harbour.json"
        path.write_text(json.dumps(content(graph={"base": "a", "robots": 1})))
        assert read_mission(path).name == "harbour"

    @pytest.mark.parametrize("suffix", [".json", ".graphml", ".txt", ".geojson", ".yaml"])
    @given(data=st.binary())
    def test_any_bytes_at_all(self, tmp_path_factory, suffix, data):
        path = tmp_path_factory.getbasetemp() / f"any{suffix}"
        path.write_bytes(data)
        with pytest.raises(MissionError, match=re.escape(str(path))):
            read_mission(path)


class TestJSON:
    def test_by_hand(self):
        mission = read_mission(DATA / "pier.json")
        pier = ("pier", (1, True))
        assert mission.nodes == (pier, "môle", 3)
        assert (mission.base, mission.robots, mission.name) == (pier, 2, "pier")
        assert mission.title == "A pier, its mole and two boats"
        assert mission.rewards.tolist() == [0, 2.5, 1]
        assert mission.world.graph.survival.tolist() == [0.9, 1, 0.8]
        assert mission.graph.nodes["môle"]["zone"] == "north"
        assert mission.graph.edges[pier, "môle"]["dangers"] == 1
        assert mission.graph.graph["notes"] == "by hand"

    def test_byte_order_mark(self, tmp_path):
        path = tmp_path / "mark.json"
        path.write_bytes(b"\xef\xbb\xbf" + (DATA / "pier.json").read_bytes())
        assert read_mission(path) == read_mission(DATA / "pier.json")

    @pytest.mark.parametrize(
        ("text", "fault"),
        [
            (b'{"a": "\xff"}', "can't decode byte 0xff in position 7"),
            ('{\n "directed": tru', "Expecting value: line 2 column 14"),
            ("[]", "expected the file to be a mapping, got []"),
            (
                content(directed=False),
                "expected directed arcs, found undirected edges: give both_ways",
            ),
            (content(multigraph=True), "expected at most one arc from a node to another"),
            (content(nodes=[7]), "nodes[0]: expected an object with id, got 7"),
            (
                content(nodes=[{"reward": 1}]),
                "nodes[0]: expected an object with id, got {'reward': 1}",
            ),
            (content(nodes=[{"id": {}}]), "nodes[0]: expected a label, a string, a number, a bool"),
        ],
    )
    def test_what_is_not_a_mission(self, json_faults, text, fault):
        (found,) = json_faults(text)
        assert fault in found

    def test_arcs_that_lead_one_way(self, json_faults):
        assert json_faults(content(edges=content()["edges"][:1])) == [
            "node 'b': has no way back to base 'a'",
            "no arc leads back; both_ways makes every arc passable both ways",
        ]

    def test_what_is_nested_too_deep(self, json_faults):
        assert "recursion" in json_faults("[" * 100_000)[0]
        assert json_faults('{"nodes": [{"id": 1, "reward": 1, "reward": 2}], "edges": []}') == [
            "expected each key of an object once, found 'reward' twice"
        ]

    def test_missing_and_wrong_keys_all_at_once(self, json_faults):
        assert json_faults({"directed": "yes", "graph": [], "nodes": []}) == [
            "expected directed to be true or false, got 'yes'",
            "expected graph to be a mapping, got []",
            "expected the key 'edges', which is missing",
        ]

    def test_arcs_as_older_networkx_names_them(self, tmp_path):
        path = tmp_path / "links.json"
        path.write_text(json.dumps(content()).replace('"edges"', '"links"'))
        assert read_mission(path).world.graph.survival.tolist() == [0.5, 0.25]

    def test_every_node_and_arc_that_is_named_twice_or_not_at_all(self, json_faults):
        data = content()
        data["edges"][1]["survival"] = 2
        data["nodes"].append({"id": "b", "reward": 3})
        data["edges"] += [
            {"source": "a", "target": "b", "survival": 0.1},
            {"source": "y", "target": "x", "survival": 0.1},
        ]
        assert json_faults(data) == [
            "nodes[2]: node 'b' is listed more than once",
            "edges[2]: arc 'a' -> 'b': is listed more than once",
            "edges[3]: arc 'y' -> 'x': there is no node 'y'",
            "edges[3]: arc 'y' -> 'x': there is no node 'x'",
            "arc 'b' -> 'a': expected survival in (0, 1], got 2",
        ]

    def test_numbers_that_are_none_and_attributes_that_could_not_be_saved(self, json_faults):
        text = json.dumps(content()).replace("0.25", "Infinity")
        assert json_faults(text.replace('"reward": 1', '"reward": NaN')) == [
            "node 'b': expected a finite reward >= 0, got nan",
            "arc 'b' -> 'a': expected survival in (0, 1], got inf",
        ]
        (fault,) = json_faults(content(nodes=[{"id": "a", "reward": 1, "h": math.nan}], edges=[]))
        assert fault.startswith("node 'a': {'reward': 1, 'h': nan} cannot be saved: Out of range")

    def test_no_base_and_no_robots(self, json_faults):
        assert json_faults(content(graph={})) == [
            "expected robots, an integer >= 1, found none: give robots",
            "expected base, the label of a node, found none: give base",
        ]


def graphml(body, edgedefault="directed"):
    return (
        '<graphml xmlns="http://graphml.graphdrawing.org/xmlns">'
        '<key id="s" for="edge" attr.name="survival" attr.type="double"/>'
        '<key id="r" for="node" attr.name="reward" attr.type="double"/>'
        '<key id="b" for="graph" attr.name="base" attr.type="string"/>'
        '<key id="k" for="graph" attr.name="robots" attr.type="int"/>'
        f'<graph edgedefault="{edgedefault}">{body}</graph></graphml>'
    )


TWO = (
    '<data key="b">a</data><data key="k">2</data>'
    '<node id="a"><data key="r">0</data></node><node id="b"><data key="r">1</data></node>'
    '<edge source="a" target="b"><data key="s">0.5</data></edge>'
    '<edge source="b" target="a"><data key="s">0.25</data></edge>'
)


class TestGraphML:
    def test_as_gephi_and_yed_write_it(self):
        mission = read_mission(DATA / "gephi.graphml")
        assert mission.nodes == ("1", "2")
        assert (mission.base, mission.robots, mission.name) == ("1", 2, "gephi")
        assert mission.graph.nodes["1"] == {"reward": 0.0, "label": "dock", "pos": [-3.5, 2.0]}
        assert mission.graph.nodes["2"] == {"reward": 5.0, "visited": True, "r": 153}
        assert mission.rewards.tolist() == [0, 5]
        assert mission.world.graph.survival.tolist() == [0.9, 0.8]

    def test_what_yed_has_drawn_moves_no_node(self, tmp_path):
        path = tmp_path / "drawn.graphml"
        text = (DATA / "gephi.graphml").read_text()
        drawn = '<data key="y">2</data><data key="shape"><y:ShapeNode><y:Geometry x="9" y="9"/>'
        path.write_text(text.replace('<data key="y">2</data>', f"{drawn}</y:ShapeNode></data>"))
        assert read_mission(path).graph.nodes["1"]["pos"] == [-3.5, 2.0]

    def test_as_networkx_writes_and_reads_it(self, tmp_path):
        written = mission_of((1, 2, 3)).graph.copy()
        written.graph.update(base=1, robots=2, name="ring")
        path = tmp_path / "ring.graphml"
        nx.write_graphml(written, path)
        mission = read_mission(path)
        assert mission.nodes == ("1", "2", "3")
        assert (mission.base, mission.robots, mission.name) == ("1", 2, "ring")
        gephis = read_mission(DATA / "gephi.graphml")
        save_mission(gephis, path)
        theirs = Mission(nx.read_graphml(path))
        assert theirs == gephis
        save_mission(theirs, path)  # with the defaults that networkx' reader leaves in the graph
        assert read_mission(path) == gephis

    @pytest.mark.parametrize(
        ("text", "fault"),
        [
            ("", "no element found: line 1, column 0"),
            ("<svg/>", "expected GraphML with one directed graph, found 0 graphs"),
            (
                graphml(TWO, edgedefault="undirected"),
                "expected directed arcs, found undirected edges",
            ),
            (graphml(TWO + "</graph><graph>"), "with one directed graph, found 2 graphs"),
            (
                graphml(TWO.replace(">1<", ">five<")),
                "node 'b': expected 'reward' of type double, got 'five'",
            ),
            (graphml(TWO.replace('key="r"', 'key="z"')), "there is no key 'z'"),
            (
                graphml(TWO + '<edge source="a" target="z"/>'),
                "arc 'a' -> 'z': there is no node 'z'",
            ),
            (graphml(TWO + "<node/>"), "node None: expected id, found none"),
            (graphml(TWO + '<node id="a"/>'), "node 'a' is listed more than once"),
            (graphml(TWO + "<hyperedge/>"), "expected edges only, found a hyperedge"),
            (graphml(TWO + '<edge source="a" target="b"/>'), "arc 'a' -> 'b': is listed more than"),
        ],
    )
    def test_what_is_not_a_mission(self, graphml_faults, text, fault):
        assert any(fault in found for found in graphml_faults(text))

    @pytest.mark.parametrize(
        ("kind", "text", "fault"),
        [
            ("int", "5.0", "expected 'danger' of type int, got '5.0'"),
            ("long", "1e3", "expected 'danger' of type long, got '1e3'"),
            ("double", "five", "expected 'danger' of type double, got 'five'"),
            ("boolean", "maybe", "expected 'danger' of type boolean, got 'maybe'"),
            ("decimal", "5", "expected 'danger' of type 'decimal', one of int, .*, got '5'"),
        ],
    )
    @pytest.mark.parametrize("owner", ["node", "edge", "graph"])
    def test_values_that_are_not_of_their_type(self, graphml_faults, owner, kind, text, fault):
        key = f'<key id="d" for="{owner}" attr.name="danger" attr.type="{kind}"/><graph '
        value = f'<data key="d">{text}</data>'
        begin, named = {
            "node": ('<node id="a">', "node 'a'"),
            "edge": ('<edge source="a" target="b">', "arc 'a' -> 'b'"),
            "graph": ('<data key="b">', "the graph"),
        }[owner]
        changed = TWO.replace(begin, value + begin if owner == "graph" else begin + value)
        (found,) = graphml_faults(graphml(changed).replace("<graph ", key))
        assert re.match(f"{re.escape(named)}: {fault}", found)

    def test_names_on_yeds_drawings(self, tmp_path):
        drawing = "<y:ShapeNode><y:NodeLabel>Dock</y:NodeLabel></y:ShapeNode>"
        drawn = TWO.replace('<node id="a">', f'<node id="a"><data key="g">{drawing}</data>')
        key = '<key id="g" for="node" yfiles.type="nodegraphics"/><graph '
        text = graphml(drawn).replace("<graph ", key)
        path = tmp_path / "drawn.graphml"
        yworks = 'xmlns:y="http://www.yworks.com/xml/graphml"'
        path.write_text(text.replace("<graphml ", f"<graphml {yworks} "))
        assert read_mission(path).graph.nodes["a"]["label"] == "Dock"
        assert read_mission(path, base="Dock").base == "a"

    @pytest.mark.parametrize(
        ("label", "attributes", "message"),
        [
            (2, {}, "Node 2: expected a label that is text, as all labels in GraphML"),
            ("a", {"tags": ["a"]}, "node 'a': expected numbers, booleans and texts"),
        ],
    )
    def test_what_it_cannot_hold_is_refused(self, tmp_path, label, attributes, message):
        graph = nx.DiGraph()
        graph.add_node(label, reward=1, **attributes)
        with pytest.raises(ValueError, match=re.escape(message)):
            save_mission(Mission(graph, base=label, robots=1), tmp_path / "x.graphml")
        assert list(tmp_path.iterdir()) == []


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


@st.composite
def labelled_missions(draw, labels, values):
    """Missions with labels and further attributes of the given kinds."""
    mission = draw(missions())
    size = len(mission.nodes)
    new = draw(st.lists(labels, min_size=size, max_size=size, unique=True))
    extra = st.dictionaries(st.sampled_from(["zone", "notes", "dangers", "ключ"]), values)
    graph = nx.DiGraph(**draw(extra))
    for node, attributes in mission.graph.nodes(data=True):
        graph.add_node(new[node], **attributes, **draw(extra))
    for tail, head, attributes in mission.graph.edges(data=True):
        graph.add_edge(new[tail], new[head], **attributes, **draw(extra))
    if draw(st.booleans()):
        graph.nodes[new[-1]]["pos"] = draw(st.lists(numbers, min_size=2, max_size=2))
    name = draw(xml_text.filter(bool))
    return Mission(graph, base=new[0], robots=mission.robots, name=name)


class TestRoundTrip:
    @given(labelled_missions(tuples, json_values))
    def test_json(self, tmp_path_factory, mission):
        path = tmp_path_factory.getbasetemp() / "round.json"
        save_mission(mission, path)
        read = read_mission(path)
        assert read == mission
        assert attributes_of(read) == attributes_of(mission)

    @given(labelled_missions(xml_text, xml_values))
    def test_graphml(self, tmp_path_factory, mission):
        path = tmp_path_factory.getbasetemp() / "round.graphml"
        save_mission(mission, path)
        read = read_mission(path)
        assert read == mission
        assert attributes_of(read) == attributes_of(mission)

    @given(labelled_missions(tuples | st.integers(0, 9), json_values), st.randoms())
    def test_route_graphs(self, tmp_path_factory, mission, random):
        path = tmp_path_factory.getbasetemp() / "round.geojson"
        graph = mission.graph.copy()
        for node in graph:
            graph.nodes[node]["pos"] = [random.uniform(-9, 9), random.uniform(-9, 9)]
        mission = Mission(graph, base=mission.base, robots=mission.robots, name=mission.name)
        save_mission(mission, path)
        read = read_mission(path)
        assert read == mission
        assert attributes_of(read) == attributes_of(mission)

    @given(json_values, json_values, json_values)
    def test_whatever_json_holds(self, tmp_path_factory, label, reward, survival):
        data = content()
        data["nodes"][0]["id"] = data["graph"]["base"] = label
        data["nodes"][1]["reward"] = reward
        data["edges"][0].update(source=label, survival=survival)
        data["edges"][1]["target"] = label
        path = tmp_path_factory.getbasetemp() / "any.json"
        path.write_text(json.dumps(data))
        try:
            mission = read_mission(path)
        except MissionError as error:
            assert error.source == str(path)  # noqa: PT017
        else:
            assert mission.world.graph.survival[0] == survival

    def test_json_is_standard_and_a_node_or_arc_a_line(self, tmp_path):
        path = tmp_path / "pier.json"
        save_mission(read_mission(DATA / "pier.json"), path)
        assert path.read_bytes() == (DATA / "pier.json").read_bytes()

    def test_mission_rules_over_its_graphs_attributes(self, tmp_path):
        graph = mission_of(name="old").graph.copy()
        graph.graph.update(base="b", robots=9, title="A pier")
        mission = Mission(graph, base="a", robots=3, name="new").with_robots(4)
        save_mission(mission, tmp_path / "x.json")
        read = read_mission(tmp_path / "x.json")
        assert (read.base, read.robots, read.name, read.title) == ("a", 4, "new", "A pier")

    def test_a_title_alone_stays_the_name(self, tmp_path):
        save_mission(mission_of(title="A pier"), tmp_path / "x.json")
        read = read_mission(tmp_path / "x.json")
        assert (read.name, read.title) == ("A pier", "A pier")

    @pytest.mark.parametrize("suffix", [".json", ".graphml", ".geojson"])
    def test_numpy_numbers_become_plain(self, tmp_path, suffix):
        graph = nx.DiGraph(base="a", robots=np.int64(2))
        graph.add_node("a", reward=np.int32(3), pos=np.array([0.5, 1.0]), seen=np.bool_(True))
        graph.add_node("b", reward=np.float32(0.1), pos=(1, 2), tag=np.str_("x"))
        graph.add_edge("a", "b", survival=np.float64(0.1))
        graph.add_edge("b", "a", survival=np.float32(0.3))
        mission = Mission(graph)
        save_mission(mission, tmp_path / f"x{suffix}")
        read = read_mission(tmp_path / f"x{suffix}")
        assert read == mission
        assert read.graph.nodes["a"] == {"reward": 3, "pos": [0.5, 1.0], "seen": True}
        assert read.graph.nodes["b"]["pos"] == [1, 2]

    def test_labels_and_rewards_of_other_kinds(self, tmp_path):
        labels = (np.int64(1), np.float64(0.5), (np.int8(3), np.str_("x")), np.bool_(False))
        graph = mission_of(labels).graph.copy()
        graph.nodes[1]["reward"] = Fraction(1, 3)
        mission = Mission(graph, base=1, robots=1)
        save_mission(mission, tmp_path / "x.json")
        read = read_mission(tmp_path / "x.json")
        assert read == mission
        assert [type(label) for label in read.nodes] == [int, float, tuple, bool]

    @pytest.mark.parametrize("label", [b"x", math.nan, Fraction(1, 3)])
    def test_labels_that_json_cannot_hold(self, tmp_path, label):
        path = tmp_path / "x.json"
        with pytest.raises(ValueError, match=re.escape(f"{path}: Node {label!r} cannot be saved")):
            save_mission(mission_of((label, "b")), path)
        assert list(tmp_path.iterdir()) == []

    def test_attributes_that_json_cannot_hold_are_named(self, tmp_path):
        path = tmp_path / "x.json"
        with pytest.raises(ValueError, match=r"the graph: {.*} cannot be saved: JSON has no date"):
            save_mission(mission_of(when=date(2025, 1, 1)), path)
        graph = mission_of().graph.copy()
        graph.edges["b", "a"]["target"] = 1
        with pytest.raises(ValueError, match=r"arc 'b' -> 'a': .* 'target' is the name of a label"):
            save_mission(Mission(graph, base="a", robots=1), path)
        graph = mission_of().graph.copy()
        graph.nodes["b"]["h"] = [math.inf]
        with pytest.raises(ValueError, match=r"node 'b': {.*\[inf\]} cannot be saved"):
            save_mission(Mission(graph, base="a", robots=1), path)
