"""Hazards on maps and in zones: what arcs cross of them, and what there is to see from nodes."""

import math
from itertools import pairwise

import networkx as nx
import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from scipy.integrate import quad
from scipy.spatial import ConvexHull

from botohe_moo import rewards_from_raster, survival_from_raster, survival_from_zones
from botohe_moo.mission.hazards import read_zone, survived

SQUARE = [[1, 1], [3, 1], [3, 3], [1, 3]]
HOLE = [[1.5, 1.5], [2.5, 1.5], [2.5, 2.5], [1.5, 2.5]]
HOOK = [[0, 0], [3, 0], [3, 3], [2, 3], [2, 1], [1, 1], [1, 3], [0, 3]]  # open at the top
coordinates = st.floats(-4, 4)
lines = st.tuples(coordinates, coordinates, coordinates, coordinates)
tables = arrays(float, st.tuples(st.integers(1, 5), st.integers(1, 5)), elements=st.floats(0, 1))


def one_arc(start, end):
    graph = nx.DiGraph([("a", "b")])
    nx.set_node_attributes(graph, {"a": start, "b": end}, "pos")
    return graph


def rate_at(values, resolution, origin, x, y):
    """Bilinear between the centres of cells; beyond them as on the edge."""
    n_rows, n_columns = values.shape
    column = np.clip((x - origin[0]) / resolution - 0.5, 0, n_columns - 1)
    row = np.clip(n_rows - 0.5 - (y - origin[1]) / resolution, 0, n_rows - 1)
    left, top = int(column), int(row)
    right, below = min(left + 1, n_columns - 1), min(top + 1, n_rows - 1)
    across, down = column - left, row - top
    upper = values[top, left] * (1 - across) + values[top, right] * across
    lower = values[below, left] * (1 - across) + values[below, right] * across
    return upper * (1 - down) + lower * down


@given(
    tables,
    st.sampled_from([0.05, 1.0, 2.5]),
    st.tuples(st.floats(-9, 9), st.floats(-9, 9)),
    arrays(float, (2, 2), elements=st.floats(0, 1)),
)
def test_the_integral_is_exact(values, resolution, origin, ends):
    start, end = np.array(origin) + ends * values.shape[::-1] * resolution
    found = survival_from_raster(
        one_arc(start, end), values, resolution=resolution, origin=origin, scale=0.3
    )
    way = end - start
    # Where the line crosses lines through centres, so that pieces are smooth.
    cuts = [
        (origin[axis] + (i + 0.5) * resolution - start[axis]) / way[axis]
        for axis in (0, 1)
        for i in range(values.shape[1 - axis])
        if abs(way[axis]) > 1e-12
    ]
    at = np.unique(np.clip([0.0, 1.0, *cuts], 0.0, 1.0))
    expected = sum(
        quad(lambda t: rate_at(values, resolution, origin, *(start + t * way)), *piece)[0]
        for piece in pairwise(at)
    )
    survival = math.exp(-0.3 * math.hypot(*way) * expected)
    assert found["a", "b"] == pytest.approx(survival, abs=1e-9)


@pytest.mark.parametrize(
    ("place", "given", "fault"),
    [
        ((0, 5), {}, r"expected a map that covers \[0.0, 5.0\], but it goes from .* to \[2.0, 2"),
        (None, {}, "Node 'b': expected pos .*, got None"),
        ((1, "x"), {}, "Node 'b': expected pos"),
        ((1, 1), {"values": [1, 2]}, r"a table \(n_rows, n_columns\) of .*, got \[1, 2\]"),
        ((1, 1), {"values": [[1], [2, 3]]}, r"values to be a table .*, got \[\[1\], \[2, 3"),
        ((1, 1), {"values": [[1, -2]]}, "table .* of finite numbers >= 0, got -2.0"),
        ((1, 1), {"values": [[math.inf]]}, r"table .* of finite numbers >= 0, got \[\[inf\]\]"),
        ((1, 1), {"resolution": 0}, "Expected resolution > 0, got 0"),
        ((1, 1), {"scale": -1}, "Expected scale >= 0, got -1"),
    ],
)
def test_wrong_rasters_are_named(place, given, fault):
    usual = {"values": np.ones((2, 2)), "resolution": 1}
    with pytest.raises(ValueError, match=fault):
        survival_from_raster(one_arc((1, 1), place), **{**usual, **given})


def placed(*places):
    graph = nx.DiGraph()
    graph.add_nodes_from((i, {"pos": place}) for i, place in enumerate(places))
    return graph


def test_what_there_is_to_see_by_hand():
    values = [[8, 0, 0, 0], [1, 2, 4, 0.5]]  # cells of 2 x 2
    near = rewards_from_raster(placed((1, 1), (5, 1)), values, resolution=2, radius=1)
    assert near == {0: 4 * 1, 1: 4 * 4}
    # The cell between both is at the same distance from them: the reach of both ends at it.
    far = rewards_from_raster(placed((1, 1), (6, 1)), values, resolution=2, radius=2, scale=0.5)
    assert far == {0: 2 * (8 + 1 + 2), 1: 2 * (4 + 0.5)}
    moved = placed((11, -4), (99, 9))
    found = rewards_from_raster(moved, values, resolution=2, radius=1, origin=(10, -5))
    assert found == {0: 4 * 1, 1: 0.0}


@given(
    tables, st.lists(st.tuples(st.floats(-1, 6), st.floats(-1, 6)), max_size=6), st.floats(0.3, 9)
)
def test_each_cell_is_seen_once(values, places, radius):
    found = rewards_from_raster(placed(*places), values, resolution=1, radius=radius)
    expected = 0.0
    for (row, column), value in np.ndenumerate(values):
        centre = (column + 0.5, values.shape[0] - row - 0.5)
        if any(math.dist(centre, place) <= radius for place in places):
            expected += value
    assert sum(found.values()) == pytest.approx(expected)
    assert list(found) == list(range(len(places)))


def within(start, end, **zone):
    """How long a line is within a zone."""
    found = survival_from_zones(one_arc(start, end), [{"rate": 0.1, **zone}])
    return -math.log(found["a", "b"]) / 0.1


@pytest.mark.parametrize(
    ("zone", "start", "end", "length"),
    [
        ({"polygon": SQUARE}, (0, 2), (4, 2), 2),
        ({"polygon": SQUARE}, (0, 0), (4, 4), math.sqrt(8)),  # through two corners
        ({"polygon": [*SQUARE, SQUARE[0]]}, (0, 2), (4, 2), 2),
        ({"polygon": [SQUARE, HOLE]}, (0, 2), (4, 2), 1),
        ({"polygon": [SQUARE[::-1], HOLE]}, (2, 0), (2, 9), 1),
        ({"polygon": HOOK}, (-1, 2), (9, 2), 2),
        ({"polygon": HOOK}, (-1, 0.5), (9, 0.5), 3),
        ({"polygon": [[*corner, 7.5] for corner in SQUARE]}, (0, 2), (4, 2), 2),
        ({"circle": [2, 2, 1]}, (0, 2), (4, 2), 2),
        ({"circle": [2, 2, 1]}, (2.1, 2), (2.6, 2), 0.5),
        ({"circle": [2, 2, 1]}, (0, 2.6), (4, 2.6), 1.6),
    ],
)
def test_zones_by_hand(zone, start, end, length):
    assert within(start, end, **zone) == pytest.approx(length, abs=1e-12)
    assert within(end, start, **zone) == pytest.approx(length, abs=1e-12)


def in_convex(corners, start, end):
    """A line cut by the half-plane on the left of each side, one after another."""
    way, low, high = end - start, 0.0, 1.0
    for corner, other in zip(corners, np.roll(corners, -1, axis=0), strict=True):
        normal = np.array([corner[1] - other[1], other[0] - corner[0]])
        from_start, along = normal @ (start - corner), normal @ way
        if along > 0:
            low = max(low, -from_start / along)
        elif along < 0:
            high = min(high, -from_start / along)
        elif from_start < 0:
            return 0.0
    return max(0.0, high - low) * math.hypot(*way)


@given(st.lists(st.tuples(coordinates, coordinates), min_size=3, max_size=8), lines)
def test_convex_polygons(corners, ends):
    points = np.array(corners)
    assume(np.linalg.matrix_rank(points - points[0], tol=1e-3) == 2)
    hull = points[ConvexHull(points).vertices]
    start, end = np.reshape(ends, (2, 2))
    assert within(start, end, polygon=hull.tolist()) == pytest.approx(
        in_convex(hull, start, end), abs=1e-9
    )


@given(st.tuples(coordinates, coordinates, st.floats(0.1, 3)), lines)
def test_circles_are_polygons_of_many_corners(circle, ends):
    angles, (x, y, radius) = np.linspace(0, 2 * math.pi, 2000, endpoint=False), circle
    corners = np.column_stack([x + radius * np.cos(angles), y + radius * np.sin(angles)])
    start, end = np.reshape(ends, (2, 2))
    found = within(start, end, circle=[*circle])
    assert found == pytest.approx(in_convex(corners, start, end), abs=0.02)


def test_a_lift_is_in_a_zone_or_not():
    """Its line is a point on the map; what it is long is an attribute."""
    for zone in ({"circle": [2, 2, 1]}, {"polygon": SQUARE}):
        share = read_zone({"rate": 1, **zone}).share
        assert [share(*np.array([place, place])) for place in ([2.5, 2.5], [3.5, 2.5])] == [1, 0]


def test_rates_add_up():
    zones = [{"polygon": SQUARE, "rate": 0.1}, {"circle": [2, 2, 1], "rate": 0.3}]
    found = survival_from_zones(one_arc((0, 2), (4, 2)), zones, danger=0.01)
    assert found["a", "b"] == pytest.approx(math.exp(-0.01 * 4 - 0.1 * 2 - 0.3 * 2))


@pytest.mark.parametrize(
    ("zone", "fault"),
    [
        (7, r"zones\[0\]: expected an object with rate, and circle or polygon, got 7"),
        ({"rate": 1, "circle": [0, 0, 1], "polygon": SQUARE}, "circle or polygon"),
        ({"circle": [0, 0, 1], "rate": -1}, "expected a rate >= 0, got -1"),
        ({"circle": [0, 0, 1], "rate": math.inf}, "expected a rate >= 0, got inf"),
        ({"circle": [0, 0], "rate": 1}, r"expected a circle \[x, y, radius\], radius > 0, got"),
        ({"circle": "wide", "rate": 1}, "expected a circle"),
        ({"polygon": SQUARE[:2], "rate": 1}, "expected a polygon of at least three corners"),
        ({"polygon": [SQUARE, [[0, 0]]], "rate": 1}, "expected a polygon of at least three"),
        ({"polygon": [[0, 0], [1, "x"], [1, 1]], "rate": 1}, "expected a polygon"),
    ],
)
def test_wrong_zones_are_named(zone, fault):
    with pytest.raises(ValueError, match=fault):
        survival_from_zones(one_arc((0, 0), (1, 1)), [zone])


def test_graphs_and_places_are_needed():
    arc = one_arc((0, 0), (1, 1))
    with pytest.raises(TypeError, match=r"Expected graph to be an nx\.DiGraph, got 7"):
        survival_from_raster(7, [[1]], resolution=1)
    for graph, zones, options, fault in (
        (nx.DiGraph([("a", "b")]), [], {}, r"Node 'a': expected pos \(x, y\), got None"),
        (arc, [], {"danger": -1}, "Expected danger >= 0, got -1"),
        (arc, 7, {}, "Expected zones to be a list, got 7"),
    ):
        with pytest.raises(ValueError, match=fault):
            survival_from_zones(graph, zones, **options)


SMALL = r"expected survival >= 5e-324, so danger \* length <= 744, got 5 \* 200 = 1000\."


def test_survivals_are_above_0():
    """By math.exp, a loss of 745 leaves the least positive float, and one of 746 leaves 0."""
    assert [survived(loss, "", length=1) for loss in (0, 2.5, 745)] == [1, math.exp(-2.5), 5e-324]
    # A length that is wrong is reported as such.
    assert [survived(loss, "", length=loss) for loss in (-1000, math.nan)] == [1, 1]
    with pytest.raises(ValueError, match=f"^line 7: {SMALL}$"):
        survived(1000, "line 7", length=200)
    arc = one_arc((0, 1), (200, 1))
    for compute in (
        lambda: survival_from_raster(arc, np.ones((1, 100)), resolution=2, scale=5),
        lambda: survival_from_zones(arc, [], danger=5),
        lambda: survival_from_zones(arc, [{"circle": [100, 0, 999], "rate": 4}], danger=1),
    ):
        with pytest.raises(ValueError, match=f"^Arc 'a' -> 'b': {SMALL}$"):
            compute()
