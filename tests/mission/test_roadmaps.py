"""Roadmaps of small maps that are drawn here: how many nodes, and how long the ways are."""

import math
import sys

import networkx as nx
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from PIL import Image
from scipy.ndimage import distance_transform_edt

from botohe_moo import Mission, MissionError, load_mission, roadmap_from_map, save_mission
from tests.examples import examples

# Skeletons are compiled at their first use; in `make test` the guide makes a roadmap.
pytestmark = pytest.mark.slow
FREE, OCCUPIED, UNKNOWN = 254, 0, 205
ORIGIN = (-2.0, 3.0)


def drawn(folder, cells, *, resolution=0.1, more=""):
    """A map of cells; the first row is at the top."""
    Image.fromarray(np.asarray(cells, np.uint8)).save(folder / "map.png")
    text = f"image: map.png\nresolution: {resolution}\norigin: [{ORIGIN[0]}, {ORIGIN[1]}, 0]\n"
    (folder / "map.yaml").write_text(text + more)
    return folder / "map.yaml"


def hall(height, width, *rooms):
    """Free rectangles (first row, last row, first column, last column) among obstacles."""
    cells = np.full((height, width), OCCUPIED)
    for top, bottom, left, right in rooms:
        cells[top : bottom + 1, left : right + 1] = FREE
    return cells


CORRIDOR = hall(9, 60, (2, 6, 2, 57))


def lengths(graph):
    """Each way once."""
    return sorted(length for one, other, length in graph.edges(data="length") if one < other)


def test_a_corridor(tmp_path):
    """Five cells wide: those in the middle, from column 4 to 55, are 0.25 m from obstacles."""
    graph = roadmap_from_map(drawn(tmp_path, CORRIDOR), radius=0.25)
    assert dict(graph.nodes(data=True)) == {
        0: {"pos": [pytest.approx(-2 + 4.5 * 0.1), pytest.approx(3 + 4.5 * 0.1)], "reward": 0.0},
        1: {"pos": [pytest.approx(-2 + 55.5 * 0.1), pytest.approx(3 + 4.5 * 0.1)], "reward": 1.0},
    }
    assert list(graph.edges(data=True)) == [
        (0, 1, {"length": pytest.approx(5.1)}),
        (1, 0, {"length": pytest.approx(5.1)}),
    ]
    assert graph.graph == {"base": 0}


def test_dangers_on_a_map(tmp_path):
    """Black from column 30 on: half the rate at its left edge, all of it half a cell further on."""
    path = drawn(tmp_path, CORRIDOR)
    even = roadmap_from_map(path, radius=0.25, danger=0.2)
    assert even.edges[0, 1]["survival"] == pytest.approx(math.exp(-0.2 * 5.1))
    hazard = tmp_path / "hazard.yaml"
    text = path.read_text().replace("map.png", "hazard.png") + "mode: scale\n"
    hazard.write_text(text)
    cells = np.full((9, 60), 255, np.uint8)
    Image.fromarray(cells * 0).save(tmp_path / "hazard.png")
    black = roadmap_from_map(path, radius=0.25, danger=0.2, hazard=hazard)
    assert black.edges[0, 1]["survival"] == pytest.approx(even.edges[0, 1]["survival"])
    cells[:, 30:] = 0
    Image.fromarray(cells).save(tmp_path / "hazard.png")
    half = roadmap_from_map(path, radius=0.25, danger=0.2, hazard=hazard)
    for arc in ((0, 1), (1, 0)):
        assert half.edges[arc]["survival"] == pytest.approx(math.exp(-0.2 * (2.5 + 0.05)))
    hazard.write_text(text.replace("[-2.0", "[-1.0"))
    with pytest.raises(MissionError, match=r"hazard\.yaml: expected a map that covers all ways"):
        roadmap_from_map(path, radius=0.25, danger=0.2, hazard=hazard)


def test_spacing_is_a_cell_at_least(tmp_path):
    with pytest.raises(ValueError, match=r"Expected spacing >= 0\.1, the width of a cell, got 1e"):
        roadmap_from_map(drawn(tmp_path, CORRIDOR), spacing=1e-9)
    with pytest.raises(ValueError, match="Expected danger, the rate of loss where the map is"):
        roadmap_from_map(drawn(tmp_path, CORRIDOR), hazard="none.yaml")


def test_crossings_and_ends(tmp_path):
    """A corridor along row 30 from column 4 to 105, others up at column 22 and down at 72."""
    cells = hall(60, 110, (28, 32, 2, 107), (2, 32, 20, 24), (28, 57, 70, 74))
    graph = roadmap_from_map(drawn(tmp_path, cells), radius=0.25)
    assert sorted(degree for _, degree in graph.out_degree()) == [1, 1, 1, 1, 3, 3]
    # But for a cell at each crossing.
    assert lengths(graph) == pytest.approx([1.8, 2.5, 2.6, 3.3, 5.0], abs=0.15)


def test_rooms_with_doors(tmp_path):
    """Two rooms above a corridor, and one below."""
    cells = hall(48, 110, (20, 28, 2, 107), (2, 17, 10, 40), (2, 17, 60, 90), (31, 45, 60, 90))
    for top, left in ((18, 20), (18, 70), (29, 70)):
        cells[top : top + 2, left : left + 11] = FREE
    graph = roadmap_from_map(drawn(tmp_path, cells), radius=0.3)
    assert nx.is_strongly_connected(graph)
    in_rooms = [(round(x), round(y)) for _, (x, y) in graph.nodes(data="pos") if not 5 < y < 5.8]
    for place in ((0, 7), (5, 7), (5, 4)):
        assert place in in_rooms


def test_a_loop(tmp_path):
    """A way that has neither ends nor crossings gets three nodes, equally far apart."""
    cells = hall(60, 80, (5, 54, 5, 74))
    cells[15:45, 15:65] = OCCUPIED
    graph = roadmap_from_map(drawn(tmp_path, cells), radius=0.3)
    assert len(graph) == 3
    assert len(set(lengths(graph))) == 1
    # Between the middles of its sides, 6 and 4 metres apart, but for the corners.
    assert sum(lengths(graph)) == pytest.approx(2 * (6 + 4), rel=0.04)


def test_two_ways_around(tmp_path):
    """Ways beside another one get a node in between."""
    cells = hall(60, 100, (5, 54, 5, 74), (27, 33, 75, 97))
    cells[15:45, 15:65] = OCCUPIED
    graph = roadmap_from_map(drawn(tmp_path, cells), radius=0.3)
    # The end, the crossing, and two nodes on the loop.
    assert sorted(degree for _, degree in graph.out_degree()) == [1, 2, 2, 3]
    cells[15:45, 35:45] = FREE  # a way across: two crossings, of which the loop has three ways
    graph = roadmap_from_map(drawn(tmp_path, cells), radius=0.3)
    assert sorted(degree for _, degree in graph.out_degree()) == [1, 2, 3, 3, 3]


@pytest.mark.parametrize(("depth", "n_nodes"), [(2, 2), (20, 4)])
def test_dead_ends(tmp_path, depth, n_nodes):
    """One that is shorter than a robot's radius disappears; a longer one is a node."""
    cells = hall(50, 120, (30, 38, 2, 117), (30 - depth, 30, 55, 63))
    graph = roadmap_from_map(drawn(tmp_path, cells), radius=0.3)
    assert len(graph) == n_nodes


def test_spacing(tmp_path):
    path = drawn(tmp_path, CORRIDOR)
    graph = roadmap_from_map(path, radius=0.25, spacing=1.0, danger=0.02)
    assert lengths(graph) == [pytest.approx(0.85)] * 6
    for _, _, survival in graph.edges(data="survival"):
        assert survival == pytest.approx(math.exp(-0.02 * 0.85))


def test_the_base(tmp_path):
    path = drawn(tmp_path, CORRIDOR)
    given = {"radius": 0.25, "spacing": 1.0}
    assert roadmap_from_map(path, base=4, **given).graph["base"] == 4
    at = roadmap_from_map(path, base=(0.4, 9), **given)
    assert at.graph["base"] == 2
    assert at.nodes(data="reward")[2] == 0
    for wrong in (7, -1, "a", (1,), (math.nan, 0)):
        with pytest.raises(ValueError, match="Expected base to be a node, 0 to 6, or a place"):
            roadmap_from_map(path, base=wrong, **given)


def test_unknown_cells_are_not_free(tmp_path):
    """Also with the threshold that map savers write, by which their grey would be free."""
    cells = np.where(CORRIDOR == OCCUPIED, UNKNOWN, FREE)
    expected = roadmap_from_map(drawn(tmp_path, CORRIDOR), radius=0.25)
    for threshold in (0.25, 0.196):
        path = drawn(tmp_path, cells, more=f"free_thresh: {threshold}\nmode: trinary\n")
        assert nx.utils.graphs_equal(roadmap_from_map(path, radius=0.25), expected)


def test_what_does_not_join_the_largest_part_is_left_out(tmp_path):
    cells = hall(30, 60, (2, 6, 2, 57), (15, 19, 2, 30))
    said = r"Left out parts of the map that do not join the largest one: 1, with 3\d\.\d% of where"
    with pytest.warns(UserWarning, match=said):
        graph = roadmap_from_map(drawn(tmp_path, cells), radius=0.25)
    assert [place[1] for _, place in graph.nodes(data="pos")] == [pytest.approx(3 + 25.5 * 0.1)] * 2


def test_narrow_doors_are_for_small_robots(tmp_path):
    cells = hall(30, 60, (5, 24, 5, 25), (5, 24, 28, 55), (12, 16, 26, 27))
    path = drawn(tmp_path, cells)
    # Half a metre wide.
    small = roadmap_from_map(path, radius=0.25)
    with pytest.warns(UserWarning, match="Left out parts"):
        large = roadmap_from_map(path, radius=0.3)
    assert min(x for _, (x, _) in small.nodes(data="pos")) < 0.5
    assert min(x for _, (x, _) in large.nodes(data="pos")) > 0.5


@pytest.mark.parametrize(
    "cells",
    [
        np.full((50, 50), OCCUPIED),
        np.full((50, 50), UNKNOWN),
        hall(9, 9, (4, 4, 4, 4)),
        [[FREE]],
        np.full((1, 5000), FREE),
        np.full((50, 50), FREE),  # which has a middle, and no way
    ],
)
def test_no_way_at_all(tmp_path, cells):
    with pytest.raises(MissionError, match=r"map\.yaml: expected ways .* radius 0\.3, found none"):
        roadmap_from_map(drawn(tmp_path, cells))


def test_a_long_line(tmp_path):
    graph = roadmap_from_map(drawn(tmp_path, np.full((1, 5000), FREE)), radius=0.05)
    assert lengths(graph) == [pytest.approx(499.9)]


@pytest.mark.parametrize(
    ("given", "fault"),
    [
        ({"radius": 0}, "Expected radius > 0, got 0"),
        ({"spacing": -1}, "Expected spacing > 0, got -1"),
        ({"danger": -1}, "Expected danger >= 0, got -1"),
    ],
)
def test_options_are_checked(tmp_path, given, fault):
    with pytest.raises(ValueError, match=fault):
        roadmap_from_map(drawn(tmp_path, CORRIDOR), **given)


@pytest.mark.parametrize("package", ["skan", "skimage.morphology"])
def test_what_to_install_is_said(tmp_path, monkeypatch, package):
    monkeypatch.setitem(sys.modules, package, None)
    with pytest.raises(MissionError, match=r"scikit-image and skan: pip install 'botohe-moo\[maps"):
        roadmap_from_map(drawn(tmp_path, CORRIDOR))


@examples(200)
@given(
    coarse=arrays(bool, st.tuples(st.integers(1, 9), st.integers(1, 9))),
    size=st.integers(1, 9),
    radius=st.sampled_from([0.01, 0.1, 0.25, 0.5]),
    spacing=st.sampled_from([None, 0.7]),
)
@pytest.mark.filterwarnings("ignore:Left out parts")
def test_any_map_is_a_mission_or_refused(tmp_path_factory, coarse, size, radius, spacing):
    folder = tmp_path_factory.getbasetemp() / "roadmaps"
    folder.mkdir(exist_ok=True)
    cells = np.kron(coarse, np.ones((size, size), int)) * FREE
    path = drawn(folder, cells)
    given = {"radius": radius, "spacing": spacing, "danger": 0.1}
    try:
        graph = roadmap_from_map(path, **given)
    except MissionError as error:
        assert "found none" in str(error)  # noqa: PT017
        return
    mission = Mission(graph, robots=2)  # all of whose nodes the base reaches
    save_mission(mission, folder / "site.json")
    assert load_mission(folder / "site.json") == mission
    room = distance_transform_edt(np.pad(cells > 0, 1))[1:-1, 1:-1]
    for _, (x, y) in graph.nodes(data="pos"):
        row = len(cells) - 1 - math.floor((y - ORIGIN[1]) / 0.1 + 1e-6)
        column = math.floor((x - ORIGIN[0]) / 0.1 + 1e-6)
        if radius > 0.05:  # with less, ways pass between corners
            # Nodes between others lie on a line through cells, which may cut a corner.
            least = radius if spacing is None else radius - 0.15
            assert (room[row, column] - 0.5) * 0.1 >= least * (1 - 1e-6)
    for one, other, length in graph.edges(data="length"):
        apart = math.dist(graph.nodes[one]["pos"], graph.nodes[other]["pos"])
        assert length >= apart - 1e-5
        assert graph.edges[other, one]["length"] == length
        assert spacing is None or length <= spacing + 1e-5
    assert nx.utils.graphs_equal(graph, roadmap_from_map(path, **given))
