"""Buildings as the traffic editor of Open-RMF writes them: lanes on levels, joined by lifts."""

import math
import re

import pytest
from hypothesis import given

from botohe_moo import MissionError, load_mission, save_mission
from tests.examples import examples
from tests.test_damaged_files import changed, read_and_saved

# Ten pixels are a metre. On level L2 they are 20, and the drawing is turned: right is up.
TEXT = """\
coordinate_system: reference_image
graphs: {}
levels:
  L1:
    drawing: {filename: site.png}
    elevation: 0
    fiducials:
      - [0, 0, west]
      - [100, 0, east]
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
    walls:
      - [0, 1, {alpha: [3, 1]}]
  L2:
    elevation: 4.5
    fiducials:
      - [200, 200, east]
      - [200, 0, west]
    lanes:
      - [0, 1, {bidirectional: [4, true], graph_idx: [2, 0]}]
    vertices:
      - [80, 140, 0, ""]
      - [80, 180, 0, ward]
lifts:
  Lift:
    depth: 2
    level_doors:
      L1: [door]
      L2: [door]
    reference_floor_name: L1
    width: 2
    x: 70
    y: 60
    yaw: 0.5
  Hoist: {depth: 2, level_doors: {}, width: 2, x: 0, y: 0, yaw: 0}
name: depot
"""
GIVEN = {"danger": 0.01, "robots": 2}


@pytest.fixture
def building(tmp_path):
    """Writes a building; returns its path."""

    def write(*changes, text=TEXT):
        for old, new in changes:
            assert old in text
            text = text.replace(old, new)
        path = tmp_path / "depot.building.yaml"
        path.write_text(text)
        return path

    return write


def place(mission, label):
    return pytest.approx(mission.graph.nodes[label]["pos"], abs=1e-9)


def test_by_hand(building):
    with pytest.warns(UserWarning, match="^Left out") as said:
        mission = load_mission(building(), reward=3, **GIVEN)
    assert mission.name == "depot"
    assert mission.nodes == ("dock", "L1/3", "L1/4", "L1/5", "L2/0", "ward")
    assert (mission.base, mission.robots) == ("dock", 2)
    assert mission.rewards.tolist() == [0, 3, 3, 3, 3, 3]
    assert mission.graph.nodes["dock"] == {
        "reward": 0.0, "is_charger": True, "spawn_robot_name": "tiny", "zone": "L1", "pos": [0, -10]
    }  # fmt: skip
    assert mission.graph.nodes["L1/3"]["name"] == "hall"
    assert place(mission, "L1/3") == [3, -6]
    # From west, the origin, one goes 10 pixels down and 60 to the left for 7 and 6 metres.
    assert mission.graph.nodes["L2/0"]["zone"] == "L2"
    assert place(mission, "L2/0") == [7, -6]
    assert place(mission, "ward") == [9, -6]
    lengths = {(tail, head): arc["length"] for tail, head, arc in mission.graph.edges(data=True)}
    expected = {
        ("dock", "L1/3"): 5,
        ("L1/3", "dock"): 5,
        ("L1/3", "L1/4"): 4,
        ("L1/4", "L1/3"): 4,
        ("L1/4", "L1/5"): 4,
        ("L1/5", "dock"): 7,
        ("L2/0", "ward"): 2,
        ("ward", "L2/0"): 2,
        ("L1/4", "L2/0"): 4.5,
        ("L2/0", "L1/4"): 4.5,
    }
    assert lengths == pytest.approx(expected)
    survival = mission.graph.edges["L1/4", "L2/0"]["survival"]
    assert survival == pytest.approx(math.exp(-0.045))
    assert [str(each.message) for each in said] == [
        "Left out lanes of graph 1: line 15 (1 in all); named waypoints that none of the lanes "
        "touches: 'charger', 'closet' (2 in all); lifts that join no levels: Hoist (1 in all)."
    ]


@pytest.mark.filterwarnings("ignore:Left out")
@pytest.mark.parametrize("suffix", [".json", ".geojson", ".graphml"])
def test_comes_back_as_it_was(building, tmp_path, suffix):
    mission = load_mission(building(), **GIVEN)
    save_mission(mission, tmp_path / f"again{suffix}")
    assert load_mission(tmp_path / f"again{suffix}") == mission


@pytest.mark.filterwarnings("ignore:Left out")
def test_another_base_and_other_graphs(building):
    path = building()
    other = load_mission(path, base="charger", **GIVEN)
    assert (other.nodes, other.base) == (("dock", "charger"), "charger")
    assert load_mission(path, base="L1/6", **GIVEN) == other
    assert load_mission(path, base="charger", graph=1, **GIVEN) == other
    every = load_mission(path, base="ward", graph="all", **GIVEN)
    assert len(every.nodes) == 7
    # The name of a vertex that is not the only one of this name.
    assert load_mission(path, base="L1/5", **GIVEN).base == "L1/5"
    with pytest.raises(
        MissionError, match="expected the label of one waypoint as base, found L1/3, L1/5"
    ):
        load_mission(path, base="hall", **GIVEN)


def test_which_of_several_chargers_is_the_base(building):
    path = building(("hall]", "hall, {is_charger: [4, true]}]"))
    with pytest.warns(UserWarning, match=r"The base is 'dock', the first of 3 chargers\.$"):
        assert load_mission(path, **GIVEN).base == "dock"


def test_what_lanes_there_are(building):
    """Also ways that lead nowhere."""
    path = building(
        ("      - [5, 2,", "      - [5, 5, {}]\n      - [2, 3, {}]\n      - [5, 7]\n      - [5, 2,")
    )
    with pytest.warns(UserWarning, match="Left out") as said:
        mission = load_mission(path, **GIVEN)
    assert "closet" not in mission.nodes
    message = str(said[0].message)
    assert "lanes from a waypoint to itself: line 14 (1 in all)" in message
    assert "lanes parallel to one that is at least as safe: line 15 (1 in all)" in message
    assert message.endswith("no way back: 'closet' (1 in all).")


@pytest.mark.filterwarnings("ignore:Left out")
def test_a_lift_holds_what_is_within_its_cabin(building):
    """Turned by 0.5, it reaches 1.05 m along its width: to (70 + 9.2, 60 - 5)."""
    unmarked = (", {lift_cabin: [1, Lift]}", "")
    joined = load_mission(building(unmarked), **GIVEN)
    assert joined.graph.has_edge("L1/4", "L2/0")
    assert load_mission(building(unmarked, ("x: 70", "x: 60.9")), **GIVEN).nodes == joined.nodes
    # Half of the width, and half of the diagonal: outside of the one, within the other.
    moved = (("x: 70", "x: 59"), ("y: 60", "y: 66"))
    assert len(load_mission(building(unmarked, ("x: 70", "x: 58")), **GIVEN).nodes) == 4
    assert len(load_mission(building(unmarked, *moved), **GIVEN).nodes) == 4
    closed = load_mission(building(("      L2: [door]\n", "")), **GIVEN)
    assert closed.nodes == ("dock", "L1/3", "L1/4", "L1/5")


def test_levels_without_fiducials_lie_as_drawn(building):
    marked = '[80, 140, 0, "", {lift_cabin: [1, Lift]}]'
    path = building(("[200, 0, west]", "[200, 0, north]"), ('[80, 140, 0, ""]', marked))
    said = r"keep the frame of their drawing: L2 without two fiducials of L1\.$"
    with pytest.warns(UserWarning, match=said):
        mission = load_mission(path, **GIVEN)
    assert place(mission, "L2/0") == [8, -14]


def test_a_drawing_without_measurements(building):
    path = building(("      - [0, 1, {distance: [3, 10]}]\n", ""))
    with pytest.warns(UserWarning, match="Level L1 has no measurements: its pixels count as met"):
        mission = load_mission(path, **GIVEN)
    assert place(mission, "L1/3") == [30, -60]
    assert mission.graph.edges["dock", "L1/3"]["length"] == pytest.approx(50)


def test_the_scale_is_the_mean_of_measurements(building):
    path = building(
        (
            "    measurements:\n",
            "    measurements:\n      - [0, 7, {distance: [3, 2.1213203435596424]}]\n",
        )
    )
    with pytest.warns(UserWarning, match="Left out"):
        mission = load_mission(path, **GIVEN)
    assert mission.graph.edges["dock", "L1/3"]["length"] == pytest.approx(50 * (0.1 + 0.3) / 2)


SMALL = """\
coordinate_system: {system}
levels:
  ground:
    lanes: [[0, 1, {{bidirectional: [4, true]}}]]
    vertices:
      - [{first}, 0, gate, {{is_charger: [4, true]}}]
      - [{second}, 0, ""]
lifts: {{}}
"""


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
    path = building(text=SMALL.format(system=system, first=first, second=second))
    mission = load_mission(path, **GIVEN)
    assert mission.nodes == ("gate", "ground/1")
    assert mission.graph.nodes["ground/1"]["pos"] == pytest.approx(place, rel=1e-4)
    assert mission.graph.edges["gate", "ground/1"]["length"] == pytest.approx(length, rel=1e-4)


@pytest.mark.parametrize(
    ("old", "new", "fault"),
    [
        ("[2, 3, {", "[2, 30, {", "line 11: there is no vertex 30 on level L1"),
        ("[2, 3, {", "[2, x, {", r"line 11: expected lanes\[0\]\[1\] to be an integer, got 'x'"),
        ("[30, 60, 0, hall]", "[30, x]", r"line 22: expected vertices\[3\]\[1\] to be a number"),
        ("[30, 60, 0, hall]", "7", r"line 22: expected vertices\[3\] to be a list, got 7"),
        (
            "60, 0, hall]",
            "60, 0, hall, 7]",
            r"line 22: expected vertices\[3\]\[4\] to be",
        ),
        ("graph_idx: [2, 1]", "graph_idx: [1, a]", "line 15: expected graph_idx to be an integer"),
        ("distance: [3, 10]", "distance: [3, -1]", "line 17: expected distance > 0, got "),
        ("[0, 1, {distance", "[0, 0, {distance", "line 17: expected a measurement between two"),
        ("elevation: 4.5", "elevation: up", "line 30: expected elevation to be a number, got 'up'"),
        ("reference_floor_name: L1", "reference_floor_name: L9", "line 45: expected reference_fl"),
        ("graphs: {}", "reference_level_name: L9", "line 2: expected reference_level_name to be "),
        ("reference_image", "web_mercator", "line 1: expected coordinate_system to be 'ref"),
        (
            "    lanes:\n      - [0, 1",
            "    lanes: 3\n    doors:\n      - [0, 1",
            "line 34: expected",
        ),
        ("name: depot", "name: [", "52: not valid YAML"),
    ],
)
def test_what_is_wrong_is_named_by_its_line(building, old, new, fault):
    with pytest.raises(MissionError, match=rf"depot\.building\.yaml.*{fault}"):
        load_mission(building((old, new)), **GIVEN)


@pytest.mark.parametrize(
    ("given", "fault"),
    [
        ({"robots": 2}, "expected danger, the rate of loss for a metre, found none: give danger"),
        ({"graph": 7, **GIVEN}, "expected lanes of graph 7, found 0, 1$"),
        ({"base": "lab", **GIVEN}, "base 'lab': there is no such node"),
        ({"danger": 0.1}, "expected robots, an integer >= 1, found none: give robots"),
        ({"graph": "any", **GIVEN}, "Expected graph "),
        ({"hazard": "map.yaml", **GIVEN}, "no parameter 'hazard'"),
    ],
)
@pytest.mark.filterwarnings("ignore:Left out")
def test_options(building, given, fault):
    with pytest.raises(ValueError, match=fault):
        load_mission(building(), **given)


def test_without_a_charger(building):
    path = building(("is_charger: [4, true]", "is_charger: [4, false]"))
    with pytest.raises(MissionError, match="expected base, found no vertex with is_charger"):
        load_mission(path, **GIVEN)


@pytest.mark.parametrize("text", ["[]", "levels: {}", "levels: [1]", "levels: {L1: }", ""])
def test_what_is_not_a_building(building, text):
    with pytest.raises(MissionError, match=r"depot\.building\.yaml"):
        load_mission(building(text=text), **GIVEN)


def test_a_map_is_not_a_building(building):
    with pytest.raises(MissionError, match="botohe missions from-map makes a mission of a map"):
        load_mission(building(text="image: map.pgm\n"), **GIVEN)


# Numbers and names, and parameters.
VALUE = re.compile(rb"(?<=[ \[])[\w.]+|\{[^}]*\}")


@pytest.mark.fuzz
@examples(200)
@given(data=changed(TEXT.encode(), value=VALUE))
@pytest.mark.filterwarnings("ignore")
def test_changed_buildings(tmp_path_factory, data):
    path = tmp_path_factory.getbasetemp() / "changed.building.yaml"
    read_and_saved(path, data, **GIVEN)
