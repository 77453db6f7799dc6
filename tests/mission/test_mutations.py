"""Mission files that were changed at random: what can be read can be saved.

``BOTOHE_MUTATIONS=16000 pytest tests/mission/test_mutations.py`` looks longer.
"""

import copy
import json
import os
import re
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import botohe_moo.mission
from botohe_moo.mission import MissionError, read_mission, save_mission
from botohe_moo.mission.digest import mission_digest
from botohe_moo.mission.formats.nodelink import mission_content

DATA = Path(__file__).parents[1] / "data"
MISSIONS = Path(botohe_moo.mission.__file__).parent / "data"
N_EXAMPLES = int(os.environ.get("BOTOHE_MUTATIONS", "150"))

NODE_LINK = [json.loads((DATA / "pier.json").read_text(encoding="utf-8"))]
NODE_LINK.append(json.loads((MISSIONS / "toy.json").read_text(encoding="utf-8")))
GRAPHML = (DATA / "gephi.graphml").read_bytes()
BENCHMARK = (DATA / "points.txt").read_bytes()
OURS = b"""<graphml><key id="0" for="graph" attr.name="base" attr.type="string"/>
<key id="1" for="graph" attr.name="robots" attr.type="long"/>
<key id="2" for="graph" attr.name="title" attr.type="string"/>
<key id="3" for="node" attr.name="reward" attr.type="double"><default>1.5</default></key>
<key id="4" for="node" attr.name="x" attr.type="double"/>
<key id="5" for="node" attr.name="y" attr.type="double"/>
<key id="6" for="node" attr.name="zone" attr.type="string"/>
<key id="7" for="edge" attr.name="survival" attr.type="double"/>
<key id="8" for="all" attr.name="seen" attr.type="boolean"/>
<graph edgedefault="directed"><data key="0">a</data><data key="1">2</data><data key="2">T</data>
<node id="a"><data key="4">0</data><data key="5">1</data><data key="6">q</data></node>
<node id="b"><data key="3">2</data></node><edge source="a" target="b"><data key="7">1</data></edge>
<edge source="b" target="a"><data key="7">0.5</data><data key="8">true</data></edge>
</graph></graphml>"""
# What stands between quotes, between elements, or between spaces.
VALUE = re.compile(rb'(?<=")[^"\n]+(?=")|(?<=>)[^<>\n]+(?=<)|[0-9.]+')


def nested(depth):
    value = []
    for _ in range(depth):
        value = [value]
    return value


# What json.loads can give, and a mission or a file can not always hold.
VALUES = [
    *(None, True, False, 0, 1, 2, -1, 3, 0.5, -0.0, 1e308, 5e-324, 10**30, 10**400),
    *(float("nan"), float("inf"), -float("inf"), "", "a", "pier", "\0", "\r", "\ud800", "\ufffe"),
    *([], [1, 2], [[None]], [float("nan"), 0], ["\udfff"], [float("inf"), 1], nested(45)),
    *(nested(60), nested(300), {}, {"a": 1}, {"a": [float("nan")]}, {"\ud800": 1}, {"id": {}}),
]
KEYS = ["id", "source", "target", "name", "title", "base", "robots", "pos", "zone", "reward"]
KEYS += [
    "survival",
    "length",
    "max_length",
    "node_default",
    "x",
    "y",
    "",
    "\ud800",
    "\0",
    "directed",
]
TOKENS = [
    *(b"NaN", b"-Infinity", b"nan", b"inf", b"1e999", b"1" * 30, b"9" * 5000, b"\xff", b"\0"),
    *(b"&#13;", b"&#10;", b"&amp;", b"&x;", b"&#xFFFE;", b"]]>", b"<!DOCTYPE a []>", b"\r", b" "),
    *(b'<data key="2">x</data>', b'attr.name="pos"', b'attr.name="id"', b'"', b"'", b"\\ud800"),
    *(b'"base": 1,', b'"title": [Infinity],', b"{}", b"[", b"1_0", b"-1", b";", b"\xc2\x85"),
]


def places(value, path=()):
    """All paths into nested lists and objects but the empty one."""
    if isinstance(value, dict | list):
        for key, item in value.items() if isinstance(value, dict) else enumerate(value):
            yield (*path, key)
            yield from places(item, (*path, key))


@st.composite
def node_links(draw):
    """Texts of node-link files with one to three changes."""
    content = copy.deepcopy(draw(st.sampled_from(NODE_LINK)))
    for _ in range(draw(st.integers(1, 3))):
        path = draw(st.sampled_from(list(places(content))))
        owner = content
        for key in path[:-1]:
            owner = owner[key]
        value = copy.deepcopy(draw(st.sampled_from(VALUES)))
        change = draw(st.sampled_from(["set", "set", "delete", "add", "repeat"]))
        if change == "set":
            owner[path[-1]] = value
        elif change == "delete":
            del owner[path[-1]]
        elif isinstance(owner, dict):
            owner[draw(st.sampled_from(KEYS))] = value
        else:
            owner.insert(0, owner[-1] if change == "repeat" else value)
    return json.dumps(content)


@st.composite
def changed_bytes(draw, data):
    """Bytes with one to four stretches replaced."""
    for _ in range(draw(st.integers(1, 4))):
        begin = draw(st.integers(0, len(data)))
        end = min(len(data), begin + draw(st.sampled_from([0, 0, 1, 1, 3, 20])))
        if (whole := list(VALUE.finditer(data))) and draw(st.booleans()):
            begin, end = draw(st.sampled_from(whole)).span()
        data = data[:begin] + draw(st.sampled_from(TOKENS) | st.binary(max_size=2)) + data[end:]
    return data


def written(mission):
    """All that a file must hold, types and signs included."""
    return json.dumps(mission_content(mission), sort_keys=True), mission_digest(mission)


def saved_and_read(mission, path):
    save_mission(mission, path)
    read = read_mission(path)
    assert read == mission
    assert (read.name, read.title) == (mission.name, mission.title)
    assert written(read) == written(mission)


def refused_or_saved(path, data, **options):
    """Read what was changed, and save it as what it was and as JSON."""
    path.write_bytes(data)
    try:
        mission = read_mission(path, **options)
    except MissionError as error:
        assert str(error).startswith(str(path))  # noqa: PT017
        return
    saved_and_read(mission, path.with_name("saved.json"))
    again = path.with_name("saved.graphml")
    # XML holds a carriage return only as a reference, which is read and not written.
    if path.suffix == ".graphml" and b"&#13;" not in data:
        saved_and_read(mission, again)
        return
    try:
        save_mission(mission, again)
    except ValueError as error:
        assert str(error).startswith(str(again))  # noqa: PT017
    else:
        saved_and_read(mission, again)


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return tmp_path_factory.mktemp("mutations")


@settings(max_examples=N_EXAMPLES)
@given(text=node_links())
def test_values_of_node_link_json(folder, text):
    refused_or_saved(folder / "mission.json", text.encode())


@settings(max_examples=N_EXAMPLES)
@given(data=st.sampled_from([json.dumps(c).encode() for c in NODE_LINK]).flatmap(changed_bytes))
def test_bytes_of_node_link_json(folder, data):
    refused_or_saved(folder / "mission.json", data)


@settings(max_examples=N_EXAMPLES)
@given(data=st.sampled_from([GRAPHML, OURS]).flatmap(changed_bytes))
def test_bytes_of_graphml(folder, data):
    refused_or_saved(folder / "mission.graphml", data)


@settings(max_examples=N_EXAMPLES)
@given(data=changed_bytes(BENCHMARK))
def test_bytes_of_a_benchmark(folder, data):
    refused_or_saved(folder / "mission.txt", data)
