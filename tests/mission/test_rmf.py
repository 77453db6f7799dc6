"""Buildings as the traffic editor of Open-RMF writes them, and navigation graphs made of them."""

import json
import math
import re
from itertools import product

import pytest
from hypothesis import given
from hypothesis import strategies as st

from botohe_moo import MissionError, load_mission, save_mission
from botohe_moo.base.documents import Document
from tests.examples import examples
from tests.test_damaged_files import changed, read_and_saved

pytestmark = pytest.mark.filterwarnings("ignore:Left out", "ignore:Without elevations")

# Ten pixels are a metre. On level L2 they are 20, and the drawing is turned: right is up.
TEXT = """\
coordinate_system: reference_image
levels:
  L1:
    fiducials: [[0, 0, west], [100, 0, east]]
    lanes:
      - [2, 3, {bidirectional: [4, true], graph_idx: [2, 0], orientation: [1, ""]}]
      - [3, 4, {bidirectional: [4, true], graph_idx: [2, 0], speed_limit: [3, 0]}]
      - [4, 5, {bidirectional: [4, false], graph_idx: [2, 0]}]
      - [5, 2, {bidirectional: [4, false], graph_idx: [2, 0]}]
      - [2, 6, {bidirectional: [4, true], graph_idx: [2, 1]}]
    measurements:
      - [0, 1, {distance: [3, 10]}]
    vertices:
      - [0, 0, 0, ""]
      - [100, 0, 0, ""]
      - [0, 100, 0, dock, {is_charger: [4, true], spawn_robot_name: [1, tiny]}]
      - [30, 60, 0, hall]
      - [70, 60, 0, "", {lift_cabin: [1, Lift]}]
      - [70, 100, 0, hall]
      - [0, 140, 0, charger, {is_charger: [4, true]}]
      - [5, 5, 0, closet]
    walls: [[0, 1, {alpha: [3, 1]}]]
  L2:
    elevation: 4.5
    fiducials: [[200, 200, east], [200, 0, west]]
    lanes: [[0, 1, {bidirectional: [4, true], graph_idx: [2, 0]}]]
    vertices: [[80, 140, 0, ""], [80, 180, 0, ward]]
lifts:
  Lift: {depth: 2, width: 2, x: 70, y: 60, yaw: 0.5, reference_floor_name: L1,
         level_doors: {L1: [door], L2: [door]}}
  Hoist: {depth: 2, level_doors: {}, width: 2, x: 0, y: 0, yaw: 0}
name: depot
"""
# What `building_map_generator nav` makes of lanes of graph 0; lanes have more parameters.
NAV = """\
building_name: depot
levels:
  L1:
    lanes:
    - - 0
      - 1
      - {}
    - [1, 0, {}]
    - [1, 2, {door_name: gate, orientation_constraint: forward, speed_limit: 0.5}]
    - [2, 1, {mutex: corridor}]
    - [2, 3, {is_bidirectional: false}]
    - [3, 0, {is_bidirectional: false}]
    vertices:
    - [0.0, -10.0, {is_charger: true, name: dock, spawn_robot_name: tiny}]
    - [3.0, -6.0, {name: hall, is_holding_point: true}]
    - [7.0, -6.0, {lift: Lift, lift_cabin: Lift, name: ''}]
    - [7.0, -10.0, {name: hall}]
  L2:
    lanes: [[0, 1, {}], [1, 0, {}]]
    vertices: [[7.0, -6.0, {lift: Lift, name: ''}], [9.0, -6.0, {name: ward}]]
  L3: {lanes: [], vertices: []}
lifts: {Lift: {dims: [2.0, 2.0], position: [7.0, -6.0, 0.5]}}
"""
GIVEN = {"danger": 0.01, "robots": 2}


def writes(path, usual):
    """Return a function that writes a text, by default the usual one, with some changes."""

    def write(*changes, text=usual):
        for old, new in changes:
            assert old in text
            text = text.replace(old, new)
        path.write_text(text)
        return path

    return write


@pytest.fixture
def building(tmp_path):
    return writes(tmp_path / "depot.building.yaml", TEXT)


@pytest.fixture
def graph(tmp_path):
    return writes(tmp_path / "0.yaml", NAV)


def lengths(mission):
    return {arc: mission.graph.edges[arc]["length"] for arc in mission.graph.edges}


def place(mission, label):
    return pytest.approx(mission.graph.nodes[label]["pos"], abs=1e-9)


def test_by_hand(building):
    with pytest.warns(UserWarning, match="^Left out") as said:
        mission = load_mission(building(), reward=3, **GIVEN)
    assert (mission.name, mission.base, mission.robots) == ("depot", "dock", 2)
    assert mission.nodes == ("dock", "L1/3", "L1/4", "L1/5", "L2/0", "ward")
    assert mission.rewards.tolist() == [0, 3, 3, 3, 3, 3]
    own = {"is_charger": True, "spawn_robot_name": "tiny"}
    assert mission.graph.nodes["dock"] == {"reward": 0, **own, "zone": "L1", "pos": [0, -10]}
    assert mission.graph.nodes["L1/3"]["name"] == "hall"
    assert place(mission, "L1/3") == [3, -6]
    # From west, the origin, one goes 10 pixels down and 60 to the left for 7 and 6 metres.
    assert mission.graph.nodes["L2/0"]["zone"] == "L2"
    assert (place(mission, "L2/0"), place(mission, "ward")) == ([7, -6], [9, -6])
    ways = {("dock", "L1/3"): 5, ("L1/3", "L1/4"): 4, ("L2/0", "ward"): 2, ("L1/4", "L2/0"): 4.5}
    ways |= {(head, tail): length for (tail, head), length in ways.items()}
    assert lengths(mission) == pytest.approx(ways | {("L1/4", "L1/5"): 4, ("L1/5", "dock"): 7})
    assert mission.graph.edges["L1/4", "L2/0"]["survival"] == pytest.approx(math.exp(-0.045))
    assert [str(each.message) for each in said] == [
        "Left out lanes of graph 1: line 10; named waypoints without a lane: "
        "'charger', 'closet'; lifts that join no levels: Hoist."
    ]


def test_a_navigation_graph_by_hand(graph):
    with pytest.warns(UserWarning, match="^Without elevations") as said:
        mission = load_mission(graph(), reward=3, **GIVEN)
    assert (mission.name, mission.title) == ("0", "depot")
    own = {"is_holding_point": True, "name": "hall"}
    assert mission.graph.nodes["L1/1"] == {"reward": 3, **own, "zone": "L1", "pos": [3, -6]}
    assert mission.graph.nodes["L2/0"]["lift"] == "Lift"
    own = {"door_name": "gate", "orientation_constraint": "forward", "speed_limit": 0.5}
    way = {"length": 4, "survival": pytest.approx(math.exp(-0.04))}
    assert mission.graph.edges["L1/1", "L1/2"] == own | way
    assert mission.graph.edges["L1/2", "L1/1"]["mutex"] == "corridor"
    [warning] = said
    assert str(warning.message) == "Without elevations, levels count as 4 m apart: L1, L2, L3."


def test_a_building_and_its_navigation_graph_are_the_same_site(building, graph, tmp_path):
    """But for the lift, whose height only the building has."""
    whole, made = load_mission(building(), **GIVEN), load_mission(graph(), **GIVEN)
    names = {"L1/3": "L1/1", "L1/4": "L1/2", "L1/5": "L1/3"}
    assert tuple(names.get(label, label) for label in whole.nodes) == made.nodes
    for label in whole.nodes:
        assert place(made, names.get(label, label)) == whole.graph.nodes[label]["pos"]
    renamed = {tuple(names.get(end, end) for end in arc): n for arc, n in lengths(whole).items()}
    rides = dict.fromkeys([("L1/2", "L2/0"), ("L2/0", "L1/2")], 4.0)
    assert lengths(made) == pytest.approx(renamed | rides)
    for mission, suffix in product((whole, made), (".json", ".geojson", ".graphml")):
        save_mission(mission, tmp_path / f"again{suffix}")
        assert load_mission(tmp_path / f"again{suffix}") == mission


def test_rides_between_levels_whose_elevations_are_known(graph, recwarn):
    heights = [(f"  L{i}:", f"  L{i}:\n    elevation: {4.5 * i}") for i in (1, 2)]
    path = graph(*heights, ("  L3: {", "  L3: {elevation: 20, "))
    assert lengths(load_mission(path, **GIVEN))["L1/2", "L2/0"] == 4.5
    assert not recwarn
    # If not, they are as many storeys apart as they are in the file.
    path = graph(("  L2:", "  L15: {lanes: null}\n  L2:"))
    with pytest.warns(UserWarning, match=r"levels count as 4 m apart: L1, L15, L2, L3\.$"):
        assert lengths(load_mission(path, **GIVEN))["L1/2", "L2/0"] == 8


@pytest.mark.parametrize(
    ("around", "lanes", "more"),
    [
        ("levels: {L1: ", "[[0, 1, {}], [1, 0, {}]]", ""),
        (
            "lifts: [], doors: null, levels: {L0: null, L1: ",
            "[[0, 1, null], [1, 0]]",
            ", [0, 0, null]",
        ),
    ],
)
def test_the_smallest_navigation_graphs(graph, around, lanes, more, recwarn):
    vertices = "[1.0, -2.0, {is_charger: true, name: dock}], [4.0, -6.0, {name: lab}]"
    text = f"{{{around}{{lanes: {lanes}, vertices: [{vertices}{more}]}}}}}}"
    mission = load_mission(graph(text=text), **GIVEN)
    assert not recwarn
    assert (mission.base, mission.nodes, mission.title) == ("dock", ("dock", "lab"), "0")
    assert mission.graph.nodes["dock"]["pos"] == [1.0, -2.0]
    assert mission.graph.nodes["lab"] == {"reward": 1.0, "zone": "L1", "pos": [4.0, -6.0]}
    assert lengths(mission) == {("dock", "lab"): 5, ("lab", "dock"): 5}


def test_another_base_and_other_graphs(building):
    path = building()
    other = load_mission(path, base="charger", **GIVEN)
    assert (other.nodes, other.base) == (("dock", "charger"), "charger")
    assert load_mission(path, base="L1/6", **GIVEN) == other
    assert load_mission(path, base="charger", graph=1, **GIVEN) == other
    assert len(load_mission(path, base="ward", graph="all", **GIVEN).nodes) == 7
    # The name of a vertex that is not the only one of this name.
    assert load_mission(path, base="L1/5", **GIVEN).base == "L1/5"
    for own, fault in (
        ({"base": "hall"}, r"base 'hall': no such node; most alike are L1/3, L1/"),
        ({"graph": 7}, r"expected lanes of graph 7, found graphs \[0, 1\]$"),
        ({"graph": "any"}, "Expected graph "),
    ):
        with pytest.raises(ValueError, match=fault):
            load_mission(path, **GIVEN, **own)


MEASURED = "      - [0, 1, {distance: [3, 10]}]\n"
MARKED = '[80, 140, 0, "", {lift_cabin: [1, Lift]}]'
ODD_LANES = "      - [5, 5, {}]\n      - [2, 3, {}]\n      - [5, 7]\n      - [5, 2,"
SAID = [
    ([("hall]", "hall, {is_charger: [4, true]}]")],
     r"The base is 'dock', the first of 3 chargers\.$", "dock", [0, -10]),
    ([("200, 0, west", "200, 0, north"), ('[80, 140, 0, ""]', MARKED)],
     r"Level L2 lies as drawn: it has no two fiducials of L1\.$", "L2/0", [8, -14]),
    ([(MEASURED, "")],
     "Level L1 has no measurements: its pixels count as met", "L1/3", [30, -60]),
    # The scale is the mean of 0.1 and 0.3.
    ([(MEASURED, MEASURED + MEASURED.replace("1, {", "7, {").replace("10", repr(1.5 * 2**0.5)))],
     "Left out", "L1/3", [6, -12]),
    # Also ways that lead nowhere.
    ([("      - [5, 2,", ODD_LANES)],
     r"(?s)self: line 9; arcs parallel to one that is at least as safe: line 10;.* back: 'closet'",
     "L1/5", [7, -10]),
]  # fmt: skip


@pytest.mark.parametrize(("changes", "said", "label", "at"), SAID)
def test_what_is_missing_or_left_out_is_said(building, changes, said, label, at):
    with pytest.warns(UserWarning, match=said):
        mission = load_mission(building(*changes), **GIVEN)
    assert (place(mission, label), mission.base) == (at, "dock")


def test_a_lift_holds_what_is_within_its_cabin(building):
    """Turned by 0.5, it reaches 1.05 m along its width: to (70 + 9.2, 60 - 5)."""
    unmarked, whole = (", {lift_cabin: [1, Lift]}", ""), load_mission(building(), **GIVEN).nodes
    for changes, joins in (
        ([], True),
        ([("x: 70", "x: 60.9")], True),
        ([("x: 70", "x: 58")], False),
        ([("y: 60", "y: 75")], False),
        # Half of the width, and half of the diagonal: outside of the one, within the other.
        ([("x: 70", "x: 59"), ("y: 60", "y: 66")], False),
    ):
        found = load_mission(building(unmarked, *changes), **GIVEN).nodes
        assert found == (whole if joins else whole[:4])
    closed = load_mission(building((", L2: [door]", "")), **GIVEN)
    assert closed.nodes == whole[:4]


@pytest.mark.parametrize(
    ("system", "first", "second", "place", "length"),
    [
        ("cartesian_meters", "1, 2", "4, 6", [4, 6], 5),
        # A minute of latitude is 1852 m, but on the ellipsoid 1842.9 m at the equator; the degree
        # of longitude is 111319.5 m there.
        ("wgs84", "10, 0", "10, 0.016666666667", [0, 1842.9], 1842.9),
        ("wgs84", "10, 0", "10.001, 0", [111.3195, 0], 111.3195),
        ("wgs84", "10, 60", "10.001, 60", [55.8, 0], 55.8),
    ],
)
def test_other_coordinates(building, system, first, second, place, length):
    vertices = f'[{first}, 0, gate, {{is_charger: [4, true]}}], [{second}, 0, ""]'
    level = f"lanes: [[0, 1, {{bidirectional: [4, true]}}]], vertices: [{vertices}]"
    path = building(text=f"{{coordinate_system: {system}, levels: {{ground: {{{level}}}}}}}")
    mission = load_mission(path, **GIVEN)
    assert mission.nodes == ("gate", "ground/1")
    assert mission.graph.nodes["ground/1"]["pos"] == pytest.approx(place, rel=1e-4)
    assert mission.graph.edges["gate", "ground/1"]["length"] == pytest.approx(length, rel=1e-4)


OF_BUILDINGS = [
    ("[4, 5, {", "[4, 50, {", "line 8: arc 'L1/4' -> 'L1/50': there is no node 'L1/50'"),
    ("[2, 3, {", "[2, x, {", r"line 6: expected lanes\[0\]\[1\] to be an integer, got 'x'"),
    ("[30, 60, 0, hall]", "[30, x]", r"line 17: expected vertices\[3\]\[1\] to be a number"),
    ("graph_idx: [2, 1]", "graph_idx: [1, a]", "line 10: expected graph_idx to be an integer"),
    ("distance: [3, 10]", "distance: [3, -1]", "line 12: expected distance > 0, got "),
    ("[0, 1, {distance", "[0, 0, {distance", "line 12: expected a measurement between two"),
    ("[0, 1, {distance", "[0, 8, {distance", r"line 12: .* of level L1, got vertices \[0, 8\]"),
    ("elevation: 4.5", "elevation: up", "line 24: expected elevation to be a number, got 'up'"),
    ("floor_name: L1", "floor_name: L9", r"reference levels among \['L1', 'L2'\], got \['L9'\]"),
    ("reference_image", "web_mercator", "line 1: expected coordinate_system to be 'ref"),
    ("is_charger: [4, true]", "x: [4, true]", "expected base, found no vertex with is_charger"),
    ("name: depot", "name: [", "33: not valid YAML"),
]
OF_GRAPHS = [
    ("[1, 2, {", "[1, 40, {", "line 9: arc 'L1/1' -> 'L1/40': there is no node"),
    ("- - 0\n      - 1", "- - 0\n      - 40", "line 5: arc 'dock' -> 'L1/40': there is no node"),
    ("[2, 1, {mutex", "[2, -1, {mutex", r"line 10: expected lanes\[3\]\[1\] >= 0, got -1"),
    ("[3.0, -6.0, {", "[3.0, north, {", r"line 15: expected vertices\[1\]\[1\] to be a number"),
]


@pytest.mark.parametrize(
    ("kind", "change"),
    [*(("building", row) for row in OF_BUILDINGS), *(("graph", row) for row in OF_GRAPHS)],
)
@pytest.mark.filterwarnings("ignore")
def test_what_is_wrong_is_named_by_its_line(request, kind, change):
    old, new, fault = change
    path = request.getfixturevalue(kind)((old, new))
    with pytest.raises(MissionError, match=rf"{path.name}.*{fault}"):
        load_mission(path, **GIVEN)


def test_dangers_of_a_place_are_those_of_all_levels(building):
    """Levels lie above each other, and a ride is at the place of its lift."""
    zones = [{"circle": [8, -6, 1.5], "rate": 0.5}]
    arcs = load_mission(building(), robots=2, danger_zones=zones).graph.edges
    assert arcs["L1/4", "L2/0"]["survival"] == pytest.approx(math.exp(-0.5 * 4.5))
    assert arcs["L2/0", "ward"]["survival"] == pytest.approx(math.exp(-0.5 * 2))
    assert arcs["L1/3", "L1/4"]["survival"] == pytest.approx(math.exp(-0.5 * 0.5))


NAMED = """\
levels:
  L1:
    lanes: &both [[0, 1], [1, 0], [1, 2], [2, 1]]
    vertices:
      - [0, 0, 0, dock, {is_charger: [4, true]}]
      - [1, 0, 0, L1/1]
      - &lift [2, 0, 0, '', {lift_cabin: [1, Lift]}]
  L2:
    lanes: *both
    vertices: [*lift, [3, 0, 0, ''], [4, 0, 0, L2/1]]
"""


@pytest.mark.filterwarnings("ignore:Level", "ignore:These levels")
def test_a_name_that_is_the_label_of_another_vertex(building):
    """It is no label then, and as a base it means the other vertex."""
    path = building(text=NAMED)
    mission = load_mission(path, **GIVEN)
    assert mission.nodes == ("dock", "L1/1", "L1/2", "L2/0", "L2/1", "L2/2")
    names = {label: node.get("name") for label, node in mission.graph.nodes(data=True)}
    assert names == dict.fromkeys(mission.nodes) | {"L2/2": "L2/1"}
    by_label = load_mission(path, base="L2/1", **GIVEN)
    assert (by_label.base, by_label.graph.nodes["L2/1"]["pos"][0]) == ("L2/1", 3)
    assert load_mission(path, base="L2/2", **GIVEN).base == "L2/2"
    # Also where the other vertex has no lane.
    text = NAMED.replace("L2/1]]", "L3/0]]") + "  L3: {vertices: [[0, 0]]}"
    mission = load_mission(building(text=text), **GIVEN)
    assert (mission.nodes[-1], mission.graph.nodes["L2/2"]["name"]) == ("L2/2", "L3/0")


@pytest.mark.parametrize(
    "text",
    [
        *("[]", "levels: {}", "levels: [1]", "levels: {L1: }", "", "image: map.pgm\n", "levels:"),
        *("levels: {L1: 7}", "levels: {L1: {lanes: [[]]}}"),
        "levels: {L1: {vertices: [[0, 0, {}]]}}",
    ],
)
@pytest.mark.filterwarnings("ignore")
def test_what_is_not_a_building(building, text):
    for own in ({}, {"base": "L1/0"}):
        with pytest.raises(MissionError, match=r"depot\.building\.yaml(: | has )"):
            load_mission(building(text=text), **GIVEN, **own)


VALUE = re.compile(rb"(?<=[ \[])[\w.-]+|\{[^}]*\}")  # numbers and names, and parameters
# As JSON, which is YAML, so that its parts can be changed, too.
AS_JSON = changed(json.dumps(Document(NAV).content).encode(), is_json=True, value=VALUE)


@pytest.mark.fuzz
@pytest.mark.parametrize(
    ("name", "contents"),
    [
        ("changed.building.yaml", changed(TEXT.encode(), value=VALUE)),
        ("changed.yaml", changed(NAV.encode(), value=VALUE) | AS_JSON),
    ],
)
@examples(200)
@given(data=st.data())
@pytest.mark.filterwarnings("ignore")
def test_changed_files(tmp_path_factory, name, contents, data):
    path = tmp_path_factory.getbasetemp() / name
    read_and_saved(path, data.draw(contents), **GIVEN)
