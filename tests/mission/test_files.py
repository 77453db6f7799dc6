import json
import math
import re
import tracemalloc
from datetime import date
from fractions import Fraction
from pathlib import Path

import networkx as nx
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from botohe_moo.mission import Mission, MissionError, read_mission, save_mission
from botohe_moo.mission.formats.benchmark import near_pairs, spanning_pairs
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
    return lambda data, **options: faults_of(tmp_path / "bad.json", data, **options)


@pytest.fixture
def graphml_faults(tmp_path):
    return lambda data, **options: faults_of(tmp_path / "bad.graphml", data, **options)


@pytest.fixture
def benchmark_faults(tmp_path):
    return lambda data, **options: faults_of(tmp_path / "bad.txt", data, **options)


def held(mission):
    """All that a file must hold: the attributes of the graph, of its nodes and of its arcs."""
    graph = mission.graph
    own = {"name": mission.name, "base": mission.base, "robots": mission.robots}
    arcs = {(tail, head): attributes for tail, head, attributes in graph.edges(data=True)}
    return {**graph.graph, **own}, dict(graph.nodes(data=True)), arcs


class TestAnyFile:
    @pytest.mark.parametrize("name", ["pier.xml", "pier", "pier.json.gz", ""])
    def test_unknown_suffix(self, tmp_path, name):
        with pytest.raises(MissionError, match=r"one of \.json, \.graphml, \.txt; found"):
            read_mission(tmp_path / name)

    @pytest.mark.parametrize("suffix", [".json", ".GraphML", ".txt"])
    def test_missing_file_and_directory(self, tmp_path, suffix):
        path = tmp_path / f"lost{suffix}"
        with pytest.raises(MissionError, match=re.escape(f"{path}: there is no such file")):
            read_mission(path)
        path.mkdir()
        with pytest.raises(MissionError, match=re.escape(f"{path}: expected a file, found a dir")):
            read_mission(path)

    def test_unreadable(self, tmp_path, monkeypatch):
        def refuse(path):
            raise PermissionError(13, "Permission denied")

        (tmp_path / "x.json").touch()
        monkeypatch.setattr(Path, "read_bytes", refuse)
        with pytest.raises(MissionError, match=r"x\.json: the file cannot be read: Permission de"):
            read_mission(tmp_path / "x.json")

    def test_null_character_in_path(self):
        with pytest.raises(MissionError, match=r"cannot be read: .*embedded null"):
            read_mission("\0.json")

    def test_suffix_in_any_case_and_path_as_string(self, tmp_path):
        path = tmp_path / "Pier.JSON"
        path.write_bytes((DATA / "pier.json").read_bytes())
        assert read_mission(str(path)) == read_mission(DATA / "pier.json")

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
        with pytest.raises(ValueError, match=r"parameter 'data'; known are robots\.$"):
            read_mission(DATA / "pier.json", data=b"")

    def test_nameless_file_gives_its_own_name(self, tmp_path):
        path = tmp_path / "harbour.json"
        path.write_text(json.dumps(content(graph={"base": "a", "robots": 1})))
        assert read_mission(path).name == "harbour"

    @pytest.mark.parametrize("suffix", [".json", ".graphml", ".txt"])
    def test_too_large(self, tmp_path, suffix):
        path = tmp_path / f"large{suffix}"
        with path.open("wb") as file:
            file.truncate(3 * 2**30)  # takes no room on the disk
        tracemalloc.start()
        with pytest.raises(MissionError, match=r"expected a file of at most 0.5 GiB, got .* 3 GiB"):
            read_mission(path)
        assert tracemalloc.get_traced_memory()[1] < 10**6
        tracemalloc.stop()

    @pytest.mark.parametrize("suffix", [".json", ".graphml", ".txt"])
    def test_devices_without_end(self, tmp_path, suffix):
        path = tmp_path / f"endless{suffix}"
        path.symlink_to("/dev/zero")
        with pytest.raises(MissionError, match="expected a file, found a device or a pipe"):
            read_mission(path)

    def test_a_files_name_that_is_no_text(self, tmp_path):
        path = tmp_path / "pier\udcff.json"
        path.write_text(json.dumps(content(graph={"base": "a", "robots": 1})))
        mission = read_mission(path)
        assert mission.name == r"pier\udcff"
        save_mission(mission, tmp_path / "saved.json")
        assert read_mission(tmp_path / "saved.json").name == mission.name

    @pytest.mark.parametrize(
        ("name", "data"),
        [
            ("arc.json", json.dumps(content(edges=[{"source": "a", "target": "x" * 5_000}]))),
            ("label.json", json.dumps(content(edges=[{"source": "a", "target": ["x"] * 900}]))),
            ("root.graphml", f"<{'x' * 5_000}/>"),
            ("type.graphml", f"<!DOCTYPE {'x' * 5_000}><graphml/>"),
            ("line.txt", f"n 1\nm 1\ntmax 5\n0 0 {'x' * 5_000}\n"),
            ("header.txt", f"n 1\nm {'9' * 5_000}\ntmax 5\n0 0 0\n"),
        ],
    )
    def test_messages_have_a_bounded_length(self, tmp_path, name, data):
        (tmp_path / name).write_text(data)
        with pytest.raises(MissionError, match=r"\.\.\.") as caught:
            read_mission(tmp_path / name)
        assert max(map(len, str(caught.value).splitlines())) < 1_000

    def test_so_have_those_of_missions_with_a_long_name(self):
        mission = Mission(read_mission(DATA / "pier.json").graph, name="x" * 5_000)
        for act in (
            lambda: mission.with_robots(0),
            lambda: mission.plan([]),
            lambda: mission.plan([["nowhere"], [3]]),
            lambda: mission.plan([[mission.base] * 2, [mission.base]]),
        ):
            with pytest.raises(ValueError, match=r"ission 'xxx.*\(5,000 characters\)") as caught:
                act()
            assert len(str(caught.value)) < 1_000

    @pytest.mark.parametrize("suffix", [".json", ".graphml", ".txt"])
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
        assert mission.arrays.reward.tolist() == [0, 2.5, 1]
        assert mission.arrays.survival.tolist() == [0.9, 1, 0.8]
        assert mission.graph.nodes["môle"]["zone"] == "north"
        assert mission.graph.edges[pier, "môle"]["dangers"] == 1
        assert mission.graph.graph["notes"] == "by hand"

    def test_byte_order_mark(self, tmp_path):
        path = tmp_path / "mark.json"
        path.write_bytes(b"\xef\xbb\xbf" + (DATA / "pier.json").read_bytes())
        assert read_mission(path) == read_mission(DATA / "pier.json")

    def test_not_utf8(self, json_faults):
        assert json_faults(b'{"a": "\xff"}') == [
            "expected text in UTF-8, found the byte 0xff at position 7"
        ]

    @pytest.mark.parametrize(
        ("text", "fault"),
        [
            ('{\n "directed": tru', "line 2, column 14: expected JSON"),
            ("", "line 1, column 1: expected JSON"),
            ("[]", "expected node-link data, a JSON object, got []"),
            ('{"nodes": %s}' % ("9" * 5000), "expected JSON of numbers in range"),
            ("[" * 100_000, "nested too deeply"),
            ('{"a": ' * 100_000, "nested too deeply"),
        ],
    )
    def test_not_node_link_json(self, json_faults, text, fault):
        (found,) = json_faults(text)
        assert fault in found

    @pytest.mark.parametrize("depth", range(100, 1300, 150))
    def test_deep_label_never_breaks_out(self, tmp_path, depth):
        path = tmp_path / "deep.json"
        deep = "[" * depth + "]" * depth
        text = json.dumps(content(graph={"base": "DEEP", "robots": 1}))
        path.write_text(text.replace('"DEEP"', deep))
        with pytest.raises(MissionError, match=r"nested too deeply|there is no such node"):
            read_mission(path)

    def test_missing_and_wrong_keys_all_at_once(self, json_faults):
        assert json_faults({"directed": "yes", "graph": [], "links": []}) == [
            "expected the key \"directed\" to hold true or false, got 'yes'",
            'expected the key "graph" to hold an object, got []',
            'expected the key "nodes", a list; found no such key',
            'expected the key "edges", a list; found no such key, but "links": '
            'nx.node_link_data(graph, edges="edges") writes "edges"',
        ]

    @pytest.mark.parametrize(
        ("changes", "fault"),
        [
            ({"directed": False}, "expected directed arcs"),
            ({"multigraph": True}, "expected at most one arc from a node to another"),
        ],
    )
    def test_kind_of_graph(self, json_faults, changes, fault):
        (found,) = json_faults(content(**changes))
        assert fault in found

    def test_undirected_unless_it_says_otherwise(self, json_faults):
        data = content()
        del data["directed"]
        assert "expected directed arcs" in json_faults(data)[0]

    def test_every_bad_node_and_arc(self, json_faults):
        data = content()
        data["nodes"] += [
            {"id": "b", "reward": 3},
            {"reward": 3},
            "c",
            {"id": None},
            {"id": {"a": 1}},
            {"id": "worthless", "reward": -1},
        ]
        data["edges"] += [
            {"source": "a", "target": "b", "survival": 0.1},
            {"source": "a", "target": "x", "survival": 0.1},
            {"source": "y", "target": "x", "survival": 0.1},
            {"source": "a"},
            7,
            {"source": "a", "target": ["b", None, {}]},
            {"source": "a", "target": "a", "survival": 2},
        ]
        expected = "expected a label, a string, a number, a boolean or a list of them, got "
        assert json_faults(data) == [
            "node 'b': is listed more than once, again as nodes[2]",
            "nodes[3]: found no key \"id\" in {'reward': 3}",
            "nodes[4]: expected an object, got 'c'",
            f'nodes[5]: "id": {expected}None',
            f"nodes[6]: \"id\": {expected}{{'a': 1}}",
            "arc 'a' -> 'b': is listed more than once, again as edges[2]",
            "arc 'a' -> 'x': there is no node 'x'",
            "arc 'y' -> 'x': there is no node 'y'",
            "arc 'y' -> 'x': there is no node 'x'",
            "edges[5]: found no key \"target\" in {'source': 'a'}",
            "edges[6]: expected an object, got 7",
            f'edges[7]: "target": {expected}{{}}',
            "node 'worthless': expected a finite reward >= 0, got -1",
            "arc 'a' -> 'a': a node must not have an arc to itself",
            "arc 'a' -> 'a': expected survival in (0, 1], got 2",
        ]

    def test_labels_that_python_takes_for_equal(self, json_faults):
        data = content(graph={"base": 1, "robots": 1}, edges=[])
        data["nodes"] = [{"id": 1, "reward": 0}, {"id": True, "reward": 0}]
        assert json_faults(data) == ["node True: is listed more than once, again as nodes[1]"]

    @pytest.mark.parametrize(("literal", "found"), [("NaN", "nan"), ("Infinity", "inf")])
    def test_numbers_that_are_none(self, json_faults, literal, found):
        text = json.dumps(content()).replace("0.25", literal).replace('"reward": 1', "%s")
        assert json_faults(text % f'"reward": {literal}') == [
            f"node 'b': expected a finite reward >= 0, got {found}",
            f"arc 'b' -> 'a': expected survival in (0, 1], got {found}",
        ]

    def test_numbers_beyond_floating_point(self, json_faults):
        text = json.dumps(content()).replace('"reward": 1', '"reward": 1' + "0" * 400)
        assert "node 'b': expected a finite reward >= 0" in json_faults(text)[0]

    def test_no_base_and_no_robots(self, json_faults):
        assert json_faults(content(graph={})) == [
            "expected robots to be an integer >= 1, found no graph attribute 'robots'",
            "expected the label of the base, found no graph attribute 'base'",
        ]
        assert json_faults(content(graph={"base": [{}], "robots": 1.0})) == [
            "expected robots to be an integer >= 1, got 1.0",
            "base [{}]: there is no such node; most alike are a, b",
        ]

    @pytest.mark.parametrize(
        ("value", "reason"),
        [
            ("Infinity", "JSON has no infinite numbers and no NaN"),
            ("[0, NaN]", "JSON has no infinite numbers and no NaN"),
            ('{"a": 1e999}', "JSON has no infinite numbers and no NaN"),
            (r'"\ud800"', r"'\ud800' is not valid Unicode text"),
            (r'{"\udfff": 1}', r"'\udfff' is not valid Unicode text"),
            ("[" * 60 + "]" * 60, "it is nested too deeply, more than 50 times"),
        ],
    )
    def test_attributes_that_could_not_be_written_again(self, json_faults, value, reason):
        data = content(graph={"base": "a", "robots": 1, "notes": "VALUE"})
        data["nodes"][0]["pos"] = data["edges"][0]["zone"] = "VALUE"
        found = json_faults(json.dumps(data).replace('"VALUE"', value))
        assert [fault.partition(", ")[0] for fault in found] == [
            "the graph: attribute 'notes'",
            "node 'a': attribute 'pos'",
            "arc 'a' -> 'b': attribute 'zone'",
        ]
        assert all(fault.endswith(f": {reason}") for fault in found)

    def test_an_attributes_name_that_could_not_be_written_again(self, json_faults):
        data = content()
        data["nodes"][0]["\udfff"] = 1
        (fault,) = json_faults(data)
        assert fault == r"node 'a': attribute '\udfff', 1: '\udfff' is not valid Unicode text"

    @pytest.mark.parametrize("label", ["1e999", r'"\ud800"', r'[1, "\udfff"]', "[-Infinity]"])
    def test_labels_that_could_not_be_written_again(self, json_faults, label):
        text = json.dumps(content(graph={"base": "a", "robots": 1}, edges=[]))
        found = json_faults(text.replace('"id": "b"', f'"id": {label}'))
        assert found[0].startswith('nodes[1]: "id": ')

    @pytest.mark.parametrize("key", ["name", "title"])
    @pytest.mark.parametrize("value", [["a"], {"a": 1}])
    def test_name_and_title_are_text(self, json_faults, key, value):
        assert json_faults(content(graph={"base": "a", "robots": 1, key: value})) == [
            f"the graph: expected {key} to be text, got {value}"
        ]

    def test_a_key_that_is_there_twice(self, json_faults):
        text = json.dumps(content()).replace('"reward": 1}', '"reward": 1, "reward": 2}')
        assert json_faults(text) == [
            "expected each key once in an object, found 'reward' again in {'id': 'b', 'reward': 2}"
        ]

    def test_messages_stay_short_whatever_is_found(self, json_faults):
        long = "x" * 10**6
        data = content(graph={"base": [long], "robots": long, "title": [long]})
        data["nodes"][0]["reward"] = long
        data["nodes"].append({"id": {long: long}})
        data["edges"][0]["survival"] = [long] * 9
        faults = json_faults(data)
        assert len(faults) == 6
        assert max(map(len, faults)) < 600

    def test_a_message_of_many_faults_ends_somewhere(self, tmp_path):
        path = tmp_path / "many.json"
        path.write_text(json.dumps(content(nodes=[[]] * 300, edges=[])))
        with pytest.raises(MissionError) as caught:
            read_mission(path)
        assert len(caught.value.faults) == 301
        assert str(caught.value).startswith(
            f"{path} has 301 faults:\n  - nodes[0]: expected an obj"
        )
        assert str(caught.value).endswith("nodes[99]: expected an object, got []\n  - and 201 more")

    def test_nodes_without_a_way(self, json_faults):
        assert json_faults(content(edges=content()["edges"][:1])) == [
            "node 'b': has no way back to base 'a'"
        ]

    def test_attributes_named_like_networkx_parameters(self, tmp_path):
        data = content()
        data["nodes"][0]["node_for_adding"] = data["edges"][0]["u_of_edge"] = 1
        path = tmp_path / "names.json"
        path.write_text(json.dumps(data))
        mission = read_mission(path)
        assert mission.graph.nodes["a"]["node_for_adding"] == 1
        assert mission.graph.edges["a", "b"]["u_of_edge"] == 1


def graphml(body, keys="", edgedefault="directed"):
    return (
        '<graphml xmlns="http://graphml.graphdrawing.org/xmlns">'
        '<key id="s" for="edge" attr.name="survival" attr.type="double"/>'
        '<key id="r" for="node" attr.name="reward" attr.type="double"/>'
        '<key id="b" for="graph" attr.name="base" attr.type="string"/>'
        f'<key id="k" for="graph" attr.name="robots" attr.type="int"/>{keys}'
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
        assert mission.arrays.survival.tolist() == [0.9, 0.8]

    def test_as_networkx_writes_it(self, tmp_path):
        written = mission_of((1, 2, 3)).graph.copy()
        written.graph.update(base=1, robots=2, name="ring")
        path = tmp_path / "ring.graphml"
        nx.write_graphml(written, path)
        mission = read_mission(path)
        assert mission.nodes == ("1", "2", "3")
        assert (mission.base, mission.robots, mission.name) == ("1", 2, "ring")

    def test_as_networkx_reads_it(self, tmp_path):
        mission = read_mission(DATA / "gephi.graphml")
        path = tmp_path / "ours.graphml"
        save_mission(mission, path)
        theirs = nx.read_graphml(path)
        assert theirs.nodes["1"] == {"reward": 0.0, "label": "dock", "x": -3.5, "y": 2.0}
        assert Mission(theirs) == mission
        save_mission(Mission(theirs), path)  # with the bookkeeping of networkx' reader
        assert read_mission(path) == mission

    def test_other_encodings(self, tmp_path):
        path = tmp_path / "wide.graphml"
        path.write_bytes(
            ('<?xml version="1.0" encoding="UTF-16"?>' + graphml(TWO)).encode("utf-16")
        )
        assert read_mission(path).nodes == ("a", "b")

    def test_every_arc_says_itself_that_it_is_directed(self, tmp_path):
        path = tmp_path / "each.graphml"
        directed = TWO.replace("<edge ", '<edge directed="true" ')
        path.write_text(graphml(directed, edgedefault="undirected"))
        assert read_mission(path).arrays.survival.tolist() == [0.5, 0.25]

    @pytest.mark.parametrize(
        ("text", "fault"),
        [
            ("", "line 1, column 1: expected XML, found: no element found"),
            ("<graphml>\n <node></graphml>", "line 2, column 10: expected XML, found: mismatched"),
            ("<svg/>", "expected the XML element graphml, got 'svg'"),
            ("<graphml/>", "expected one graph in the GraphML, found 0"),
            ('<?xml version="1.0" encoding="latin-99"?><a/>', "expected XML"),
            (graphml(TWO, edgedefault="undirected"), "expected directed arcs (nx.DiGraph), got a"),
        ],
    )
    def test_not_a_directed_graph(self, graphml_faults, text, fault):
        (found,) = graphml_faults(text)
        assert fault in found

    def test_what_the_parser_says_is_cut_short(self, graphml_faults):
        (found,) = graphml_faults(f'<?xml version="1.0" encoding="{"utf-" * 999}"?><a/>')
        assert "expected XML" in found
        assert len(found) < 400

    @pytest.mark.parametrize(
        "declaration",
        [
            '<!DOCTYPE graphml [<!ENTITY a "ha"><!ENTITY b "&a;&a;&a;&a;&a;&a;&a;&a;&a;&a;">]>',
            '<!DOCTYPE graphml [<!ENTITY a SYSTEM "file:///etc/passwd">]>',
            '<!DOCTYPE graphml SYSTEM "http://localhost/graphml.dtd">',
        ],
    )
    def test_document_types_are_refused(self, graphml_faults, declaration):
        assert graphml_faults(declaration + graphml(TWO)) == [
            "expected XML without a document type, found <!DOCTYPE graphml>; "
            "remove that declaration"
        ]

    def test_every_bad_node_and_arc(self, graphml_faults):
        body = TWO + (
            '<node id="b"/><node/><node id="c"><data key="r">much</data></node>'
            '<edge source="a" target="b"/><edge source="a" target="x"/><edge source="a"/>'
            '<edge source="c" target="a" directed="false"><data key="s">0,5</data></edge>'
            '<node id="d"><data key="lost">1</data><data key="r">1</data></node>'
            "<hyperedge/>"
        )
        assert graphml_faults(graphml(body)) == [
            "arc 'c' -> 'a': expected it to be directed",
            "expected arcs from one node to another, found hyperedges",
            "the node data 'lost': there is no key of that id",
            "node 'b': is listed more than once, again as nodes[2]",
            'nodes[3]: found no key "id" in {}',
            "arc 'a' -> 'b': is listed more than once, again as edges[2]",
            "arc 'a' -> 'x': there is no node 'x'",
            "edges[4]: found no key \"target\" in {'source': 'a'}",
            "node 'c': expected a finite reward >= 0, got 'much'",
            "arc 'c' -> 'a': expected survival in (0, 1], got '0,5'",
        ]

    def test_robots_must_be_declared_as_integers(self, graphml_faults):
        keys = '<key id="k" for="graph" attr.name="robots" attr.type="string"/>'
        assert graphml_faults(graphml(TWO, keys)) == [
            "expected robots to be an integer >= 1, got '2'"
        ]

    @pytest.mark.parametrize("number", ["nan", "INF", "1e999"])
    def test_numbers_that_are_none(self, graphml_faults, number):
        keys = '<key id="h" for="node" attr.name="height" attr.type="double"/>'
        body = TWO.replace('<node id="a">', f'<node id="a"><data key="h">{number}</data>')
        (fault,) = graphml_faults(graphml(body, keys))
        assert fault.startswith("node 'a': attribute 'height', ")
        assert fault.endswith(": JSON has no infinite numbers and no NaN")

    def test_places_are_two_numbers(self, graphml_faults):
        keys = '<key id="p" for="node" attr.name="pos" attr.type="string"/>'
        body = TWO.replace('<node id="a">', '<node id="a"><data key="p">0, 1</data>')
        assert graphml_faults(graphml(body, keys)) == [
            "node 'a': expected its place as the numbers x and y, found the data 'pos'"
        ]

    def test_data_that_is_there_twice(self, graphml_faults):
        body = TWO.replace('<node id="a">', '<node id="a"><data key="r">3</data>')
        assert graphml_faults(graphml(body)) == ["the node data 'reward': is there more than once"]

    def test_line_ends_and_what_networkx_leaves_behind(self, tmp_path):
        path = tmp_path / "ends.graphml"
        keys = '<key id="t" for="graph" attr.name="title" attr.type="string"/>'
        keys += '<key id="n" for="graph" attr.name="node_default" attr.type="string"/>'
        body = '<data key="t">two&#13;&#10;reefs&#13;</data><data key="n">{}</data>'
        path.write_text(graphml(body + TWO, keys))
        mission = read_mission(path)
        assert mission.title == "two\nreefs\n"
        assert "node_default" not in mission.graph.graph
        save_mission(mission, tmp_path / "again.graphml")
        assert held(read_mission(tmp_path / "again.graphml")) == held(mission)

    def test_labels_that_are_no_strings_are_refused(self, tmp_path):
        path = tmp_path / "ring.graphml"
        message = r"ring\.graphml: expected a node's label to be a string.*got 2; a \.json file can"
        with pytest.raises(ValueError, match=message):
            save_mission(mission_of(("1", 2)), path)
        assert not path.exists()

    @pytest.mark.parametrize(
        ("attributes", "message"),
        [
            ({"tags": ["a"]}, r"node 'a': attribute 'tags', \['a'\], is not a number"),
            ({"tags": None}, r"node 'a': attribute 'tags', None, is not a number"),
            ({"pos": [1, 2, 3]}, r"node 'a': expected pos to be \[x, y\]"),
            ({"pos": [1, 2], "x": 1}, r"node 'a': expected pos to be \[x, y\]"),
            ({"note": "a\rb"}, r"node 'a': attribute 'note': XML has no character '\\r'"),
            ({"a\0": 1}, r"an attribute's name: XML has no character"),
        ],
    )
    def test_attributes_that_it_cannot_hold_are_refused(self, tmp_path, attributes, message):
        graph = nx.DiGraph()
        graph.add_node("a", reward=1, **attributes)
        with pytest.raises(ValueError, match=message):
            save_mission(Mission(graph, base="a", robots=1), tmp_path / "x.graphml")

    def test_label_with_a_character_that_xml_has_not(self, tmp_path):
        with pytest.raises(ValueError, match=r"a node's label: XML has no character '\\x00'"):
            save_mission(mission_of(("a\0", "b")), tmp_path / "x.graphml")


class TestBenchmark:
    def test_by_hand(self):
        mission = read_mission(DATA / "points.txt", neighbours=1)
        assert mission.nodes == (0, 1, 2, 3, 4)
        assert (mission.base, mission.robots, mission.name) == (0, 2, "points")
        assert mission.arrays.reward.tolist() == [0, 7, 5, 24, 1.5]
        assert mission.graph.nodes[4]["pos"] == [3, -4]
        # The nearest: 0-1, 1-2 (at the same place), 2-1, 3-1, 4-0; they span already.
        near, far = math.exp(-5 / 10), math.exp(-45 / 10)
        survivals = {(0, 1): near, (1, 2): 1.0, (1, 3): far, (0, 4): near}
        both = survivals | {(v, u): s for (u, v), s in survivals.items()}
        assert {(u, v): s for u, v, s in mission.graph.edges(data="survival")} == both

    def test_spaces_semicolons_tabs_blank_lines(self):
        assert read_mission(DATA / "points_semicolons.TXT") == read_mission(DATA / "points.txt")

    def test_more_neighbours_than_points(self):
        assert read_mission(DATA / "points.txt").arrays.n_arcs == 5 * 4

    def test_spanning_tree_joins_what_neighbours_leave_apart(self, tmp_path):
        path = tmp_path / "clusters.txt"
        path.write_text("n 4\nm 1\ntmax 9\n0 0 0\n1 0 1\n50 0 1\n51 0 1\n")
        arcs = read_mission(path, neighbours=1).graph.edges
        assert set(arcs) == {(0, 1), (1, 0), (1, 2), (2, 1), (2, 3), (3, 2)}

    def test_scale(self):
        mission = read_mission(DATA / "points.txt", scale=2.5)
        assert mission.graph.edges[0, 1]["survival"] == math.exp(-5 / 2.5)

    def test_single_point(self, tmp_path):
        path = tmp_path / "alone.txt"
        path.write_text("n 1\nm 1\ntmax 9\n0 0 4")
        assert read_mission(path).total_reward == 4

    def test_survival_that_vanishes(self, benchmark_faults):
        text = "n 3\nm 1\ntmax 9\n0 0 0\n1 0 1\n9000 0 1\n"
        fault = (
            "arc {} -> 2: expected survival in (0, 1], got exp(-{} / 9), which is 0 in "
            "floating-point numbers; give a larger scale"
        )
        assert benchmark_faults(text) == [fault.format(0, 9000), fault.format(1, 8999)]

    def test_coordinates_beyond_floating_point(self, benchmark_faults):
        faults = benchmark_faults("n 3\nm 1\ntmax 9\n-1e308 0 0\n1e308 0 1\n0 1e308 1\n")
        assert len(faults) == 3

    def test_tmax_as_scale(self, benchmark_faults, tmp_path):
        text = "n 1\nm 1\ntmax 0\n0 0 0\n"
        assert benchmark_faults(text) == ["expected tmax > 0 to be the scale, got 0; give a scale"]
        (tmp_path / "zero.txt").write_text(text)
        assert read_mission(tmp_path / "zero.txt", scale=1).nodes == (0,)

    def test_every_bad_line(self, benchmark_faults):
        text = "n five\nk 3\ntmax inf\n\n0 0\n1 2 three\n1 nan 3\n1 2 -3\n1 2 3\n"
        point = "expected three finite numbers, x, y and a score >= 0"
        assert benchmark_faults(text) == [
            "line 1: expected 'n' and an integer, got 'n five'",
            "line 2: expected 'm' and an integer, got 'k 3'",
            "line 3: expected 'tmax' and a finite number, got 'tmax inf'",
            f"line 5: {point}, got '0 0'",
            f"line 6: {point}, got '1 2 three'",
            f"line 7: {point}, got '1 nan 3'",
            f"line 8: {point}, got '1 2 -3'",
        ]

    @pytest.mark.parametrize(
        ("text", "fault"),
        [
            ("n 2\nm 1\ntmax 9\n0 0 0", "expected 2 lines 'x y score' after tmax, got 1"),
            ("n 1\nm 1\ntmax 9\n0 0 0\n1 1 1", "expected 1 lines 'x y score' after tmax, got 2"),
            ("n 0\nm 1\ntmax 9\n", "line 1: expected n >= 1, got 0"),
            ("n 1\n", "expected the lines n, m and tmax first, found 1 lines"),
            ("n 1\nm 0\ntmax 9\n0 0 0", "expected robots to be an integer >= 1, got 0"),
            (b"\x80", "expected text in UTF-8, found the byte 0x80 at position 0"),
        ],
    )
    def test_too_few_and_too_many(self, benchmark_faults, text, fault):
        assert benchmark_faults(text) == [fault]

    @pytest.mark.parametrize(
        ("options", "message"),
        [
            ({"neighbours": 0}, "Expected neighbours >= 1 or 'all', got 0."),
            (
                {"neighbours": 1.5},
                "Expected neighbours to be an integer >= 1 or 'all', got 1.5.",
            ),
            ({"scale": 0}, "Expected scale > 0, got 0."),
            ({"scale": math.inf}, "Expected scale to be a finite number > 0, got inf."),
            ({"scale": "9"}, "Expected scale to be a number > 0, got '9'."),
        ],
    )
    def test_options_out_of_range(self, options, message):
        with pytest.raises(ValueError, match=re.escape(message)):
            read_mission(DATA / "points.txt", **options)

    @given(st.lists(st.tuples(*[st.integers(0, 5)] * 2), min_size=1, max_size=12))
    def test_spanning_tree_is_as_short_as_networkx_finds(self, grid):
        points = np.array(grid, float)
        ours = spanning_pairs(points)
        every = nx.Graph()
        every.add_nodes_from(range(len(grid)))
        for u, v in near_pairs(points, math.inf):
            every.add_edge(u, v, weight=math.dist(grid[u], grid[v]))
        theirs = nx.minimum_spanning_tree(every)
        assert nx.number_connected_components(nx.Graph([*ours, *[(v, v) for v in every]])) == 1
        assert len(ours) == len(grid) - 1
        length = sum(math.dist(grid[u], grid[v]) for u, v in ours)
        assert length == pytest.approx(theirs.size(weight="weight"))

    @given(st.lists(st.tuples(*[st.integers(0, 5)] * 2), min_size=1), st.integers(0, 5))
    def test_near_pairs_are_all_near_pairs(self, grid, radius):
        expected = [
            (u, v)
            for u in range(len(grid))
            for v in range(u + 1, len(grid))
            if math.dist(grid[u], grid[v]) <= radius
        ]
        assert near_pairs(np.array(grid, float), radius) == expected


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
    extra = st.dictionaries(st.sampled_from(["zone", "notes", "dangers", "ключ", ""]), values)
    graph = nx.DiGraph(**draw(extra))
    for node, attributes in mission.graph.nodes(data=True):
        graph.add_node(new[node], **attributes, **draw(extra))
    for tail, head, attributes in mission.graph.edges(data=True):
        graph.add_edge(new[tail], new[head], **attributes, **draw(extra))
    if draw(st.booleans()):
        graph.nodes[new[-1]]["pos"] = draw(st.lists(numbers, min_size=2, max_size=2))
    name = draw(xml_text.filter(bool))
    return Mission(graph, base=new[0], robots=mission.robots, name=name)


class TestAnyContent:
    @given(st.dictionaries(st.sampled_from(["directed", "graph", "nodes", "edges"]), json_values))
    def test_of_the_file(self, tmp_path_factory, changes):
        faults_of(tmp_path_factory.getbasetemp() / "any.json", {"graph": {}, **changes})

    @given(json_values, json_values, json_values)
    def test_of_its_entries(self, tmp_path_factory, label, reward, survival):
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
            assert mission.arrays.survival[0] == survival


class TestRoundTrip:
    @given(labelled_missions(tuples, json_values))
    def test_json(self, tmp_path_factory, mission):
        path = tmp_path_factory.getbasetemp() / "round.json"
        save_mission(mission, path)
        read = read_mission(path)
        assert read == mission
        assert held(read) == held(mission)

    @given(labelled_missions(xml_text, xml_values))
    def test_graphml(self, tmp_path_factory, mission):
        path = tmp_path_factory.getbasetemp() / "round.graphml"
        save_mission(mission, path)
        read = read_mission(path)
        assert read == mission
        assert held(read) == held(mission)

    def test_json_is_standard_and_a_node_or_arc_a_line(self, tmp_path):
        path = tmp_path / "pier.json"
        save_mission(read_mission(DATA / "pier.json"), path)
        assert path.read_bytes() == (DATA / "pier.json").read_bytes()

    def test_graphml_is_stable(self, tmp_path):
        first, second = tmp_path / "1.graphml", tmp_path / "2.graphml"
        save_mission(read_mission(DATA / "gephi.graphml"), first)
        save_mission(read_mission(first), second)
        assert first.read_bytes() == second.read_bytes()

    @pytest.mark.parametrize("suffix", [".json", ".graphml"])
    def test_mission_rules_over_its_graphs_attributes(self, tmp_path, suffix):
        graph = mission_of(name="old").graph.copy()
        graph.graph.update(base="b", robots=9, title="A pier")
        mission = Mission(graph, base="a", robots=3, name="new").with_robots(4)
        save_mission(mission, tmp_path / f"x{suffix}")
        read = read_mission(tmp_path / f"x{suffix}")
        assert (read.base, read.robots, read.name, read.title) == ("a", 4, "new", "A pier")

    @pytest.mark.parametrize("suffix", [".json", ".graphml"])
    def test_a_title_alone_stays_the_name(self, tmp_path, suffix):
        save_mission(mission_of(title="A pier"), tmp_path / f"x{suffix}")
        read = read_mission(tmp_path / f"x{suffix}")
        assert (read.name, read.title) == ("A pier", "A pier")

    @pytest.mark.parametrize("suffix", [".json", ".graphml"])
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
        kinds = {
            type(value) for _, values in read.graph.nodes(data=True) for value in values.values()
        }
        assert kinds <= {int, float, bool, str, list}

    def test_rewards_that_are_fractions(self, tmp_path):
        graph = nx.DiGraph()
        graph.add_node("a", reward=Fraction(1, 3))
        mission = Mission(graph, base="a", robots=1)
        save_mission(mission, tmp_path / "x.json")
        assert read_mission(tmp_path / "x.json") == mission

    def test_labels_that_are_numpy_numbers(self, tmp_path):
        mission = mission_of(
            (np.int64(1), np.float64(0.5), (np.int8(3), np.str_("x")), np.bool_(False))
        )
        save_mission(mission, tmp_path / "x.json")
        read = read_mission(tmp_path / "x.json")
        assert read == mission
        assert [type(label) for label in read.nodes] == [int, float, tuple, bool]

    @pytest.mark.parametrize(
        "label",
        [b"x", frozenset({1}), math.nan, math.inf, 1j, ("a", b"x"), date(2025, 1, 1), "\ud800"],
    )
    def test_labels_that_json_cannot_hold(self, tmp_path, label):
        path = tmp_path / "x.json"
        with pytest.raises(ValueError, match=re.escape(f"{path}: Node {label!r} cannot be saved")):
            save_mission(mission_of((label, "b")), path)
        assert list(tmp_path.iterdir()) == []

    def test_label_that_json_would_change(self, tmp_path):
        graph = mission_of((Fraction(1, 3), "b"))
        with pytest.raises(ValueError, match=r"Node Fraction\(1, 3\) .* come back as 0\.333"):
            save_mission(graph, tmp_path / "x.json")

    @pytest.mark.parametrize(
        ("attributes", "message"),
        [
            ({"when": date(2025, 1, 1)}, "node 'a': attribute 'when', datetime.date(2025, 1, 1), "),
            ({"h": [math.nan]}, "node 'a': attribute 'h', [nan], cannot be saved: JSON has no inf"),
            ({"h": {3: 1}}, "node 'a': attribute 'h', {3: 1}, cannot be saved: JSON has no dict"),
            (
                {"id": 3},
                "node 'a': expected a string other than id as an attribute's name, got 'id'",
            ),
        ],
    )
    def test_attributes_that_json_cannot_hold(self, tmp_path, attributes, message):
        graph = nx.DiGraph()
        graph.add_node("a", reward=1, **attributes)
        with pytest.raises(ValueError, match=re.escape(message)):
            save_mission(Mission(graph, base="a", robots=1), tmp_path / "x.json")

    def test_attributes_of_arcs_and_of_the_graph_are_named(self, tmp_path):
        mission = mission_of(when=date(2025, 1, 1))
        with pytest.raises(ValueError, match="the graph: attribute 'when'"):
            save_mission(mission, tmp_path / "x.json")
        graph = mission_of().graph.copy()
        graph.edges["b", "a"]["target"] = 1
        with pytest.raises(ValueError, match="arc 'b' -> 'a': expected a string other than source"):
            save_mission(Mission(graph, base="a", robots=1), tmp_path / "x.json")
        graph = mission_of().graph.copy()
        graph.nodes["b"][3] = 1
        with pytest.raises(ValueError, match=r"node 'b': expected a string other than id .* got 3"):
            save_mission(Mission(graph, base="a", robots=1), tmp_path / "x.json")

    def test_attribute_that_holds_itself(self, tmp_path):
        endless = []
        endless.append(endless)
        with pytest.raises(
            ValueError, match=r"x\.json: the graph: attribute 'endless', .* too deep"
        ):
            save_mission(mission_of(endless=endless), tmp_path / "x.json")


class TestWriting:
    @pytest.mark.parametrize("name", ["x.txt", "x.xml", "x"])
    def test_unknown_suffix(self, tmp_path, name):
        with pytest.raises(ValueError, match=r"one of \.json, \.graphml; found"):
            save_mission(mission_of(), tmp_path / name)

    def test_suffix_in_any_case_and_path_as_string(self, tmp_path):
        save_mission(mission_of(), str(tmp_path / "X.JSON"))
        assert read_mission(tmp_path / "X.JSON") == mission_of(robots=1, base="a")

    def test_no_such_folder(self, tmp_path):
        path = tmp_path / "nowhere" / "x.json"
        with pytest.raises(FileNotFoundError) as caught:
            save_mission(mission_of(), path)
        assert caught.value.filename == str(path.parent)

    def test_over_a_directory(self, tmp_path):
        (tmp_path / "x.json").mkdir()
        with pytest.raises(IsADirectoryError):
            save_mission(mission_of(), tmp_path / "x.json")
        assert [path.name for path in tmp_path.iterdir()] == ["x.json"]

    @pytest.mark.parametrize("error", [OSError(28, "No space left on device"), KeyboardInterrupt()])
    def test_old_file_survives_a_failure(self, tmp_path, monkeypatch, error):
        path = tmp_path / "x.json"
        save_mission(mission_of(), path)
        before = path.read_bytes()

        def fail(*_):
            raise error

        monkeypatch.setattr("os.fsync", fail)
        with pytest.raises(type(error)):
            save_mission(mission_of(("c", "d")), path)
        assert path.read_bytes() == before
        assert list(tmp_path.iterdir()) == [path]

    def test_replaces_a_file_and_leaves_nothing_else(self, tmp_path):
        path = tmp_path / "x.json"
        for nodes in (("a", "b"), ("c", "d", "e")):
            save_mission(mission_of(nodes), path)
            assert read_mission(path).nodes == nodes
        assert list(tmp_path.iterdir()) == [path]
