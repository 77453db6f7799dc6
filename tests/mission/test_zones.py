"""Zones in which it is dangerous: how much of a line is in a circle or in a polygon."""

import math

import networkx as nx
import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st
from scipy.spatial import ConvexHull

from botohe_moo import survival_from_raster, survival_from_zones
from tests.examples import examples
from tests.mission.test_hazards import one_arc

SQUARE = [[1, 1], [3, 1], [3, 3], [1, 3]]
HOLE = [[1.5, 1.5], [2.5, 1.5], [2.5, 2.5], [1.5, 2.5]]
HOOK = [[0, 0], [3, 0], [3, 3], [2, 3], [2, 1], [1, 1], [1, 3], [0, 3]]  # open at the top
coordinates = st.floats(-4, 4)


def within(start, end, **zone):
    """How long a line is within a zone."""
    found = survival_from_zones(one_arc(start, end), [{"rate": 0.1, **zone}])
    return -math.log(found["a", "b"]) / 0.1


@pytest.mark.parametrize(
    ("zone", "start", "end", "length"),
    [
        ({"polygon": SQUARE}, (0, 2), (4, 2), 2),
        ({"polygon": SQUARE}, (0, 2), (2, 2), 1),
        ({"polygon": SQUARE}, (0, 0), (4, 4), math.sqrt(8)),  # through two corners
        ({"polygon": SQUARE}, (1.5, 2), (2, 2), 0.5),
        ({"polygon": SQUARE}, (0, 0), (4, 0), 0),
        ({"polygon": [*SQUARE, SQUARE[0]]}, (0, 2), (4, 2), 2),
        ({"polygon": [SQUARE, HOLE]}, (0, 2), (4, 2), 1),
        ({"polygon": [SQUARE[::-1], HOLE]}, (2, 0), (2, 9), 1),
        ({"polygon": HOOK}, (-1, 2), (9, 2), 2),
        ({"polygon": HOOK}, (-1, 0.5), (9, 0.5), 3),
        ({"polygon": [[*corner, 7.5] for corner in SQUARE]}, (0, 2), (4, 2), 2),
        ({"circle": [2, 2, 1]}, (0, 2), (4, 2), 2),
        ({"circle": [2, 2, 1]}, (2, 2), (4, 2), 1),
        ({"circle": [2, 2, 1]}, (2.1, 2), (2.6, 2), 0.5),
        ({"circle": [2, 2, 1]}, (0, 2.6), (4, 2.6), 1.6),
        ({"circle": [2, 2, 1]}, (0, 0), (4, 0), 0),
        ({"circle": [2, 2, 1]}, (2, 2), (2, 2), 0),
    ],
)
def test_by_hand(zone, start, end, length):
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


@given(
    st.lists(st.tuples(coordinates, coordinates), min_size=3, max_size=8),
    st.tuples(coordinates, coordinates, coordinates, coordinates),
)
def test_convex_polygons(corners, ends):
    points = np.array(corners)
    assume(np.linalg.matrix_rank(points - points[0], tol=1e-3) == 2)
    hull = points[ConvexHull(points).vertices]
    start, end = np.reshape(ends, (2, 2))
    assert within(start, end, polygon=hull.tolist()) == pytest.approx(
        in_convex(hull, start, end), abs=1e-9
    )


@given(
    st.tuples(coordinates, coordinates, st.floats(0.1, 3)),
    st.tuples(coordinates, coordinates, coordinates, coordinates),
)
def test_circles_against_distances(circle, ends):
    start, end = np.reshape(ends, (2, 2))
    way = end - start
    shares = (np.arange(20_000) + 0.5) / 20_000
    away = np.hypot(*(start + np.outer(shares, way) - circle[:2]).T)
    length = math.hypot(*way)
    expected = (away < circle[2]).mean() * length
    assert within(start, end, circle=list(circle)) == pytest.approx(
        expected, abs=2e-4 * length + 1e-12
    )


@examples(50)
@given(st.tuples(coordinates, coordinates, coordinates, coordinates))
def test_a_polygon_is_its_raster_in_the_limit(ends):
    """Within half a cell of an edge the raster is in between: apart by half that much in all.

    A line crosses at most eight edges; one that runs along an edge is left out.
    """
    start, end = np.reshape(ends, (2, 2))
    assume(min(abs(end - start)) > 0.1 * max(abs(end - start)) > 0)
    exactly = within(start, end, polygon=HOOK)
    for n in (8, 64):
        centres = (np.arange(10 * n) + 0.5) / n - 5
        x, y = np.meshgrid(centres, centres[::-1])
        values = ((x > 0) & (x < 3) & (y > 0) & (y < 3) & ((x < 1) | (x > 2) | (y < 1))) * 1.0
        found = survival_from_raster(
            one_arc(start, end), values, resolution=1 / n, origin=(-5, -5), scale=0.1
        )
        assert -math.log(found["a", "b"]) / 0.1 == pytest.approx(exactly, abs=8 * 10 / n / 2)


def test_rates_add_up():
    zones = [{"polygon": SQUARE, "rate": 0.1}, {"circle": [2, 2, 1], "rate": 0.3}]
    found = survival_from_zones(one_arc((0, 2), (4, 2)), zones, danger=0.01)
    assert found["a", "b"] == pytest.approx(math.exp(-0.01 * 4 - 0.1 * 2 - 0.3 * 2))


@pytest.mark.parametrize(
    ("zone", "fault"),
    [
        (7, r"zones\[0\]: expected an object with rate, and circle or polygon, got 7"),
        ({"rate": 1}, "expected an object with rate, and circle or polygon"),
        ({"rate": 1, "circle": [0, 0, 1], "polygon": SQUARE}, "circle or polygon"),
        ({"circle": [0, 0, 1]}, "expected a rate >= 0, got None"),
        ({"circle": [0, 0, 1], "rate": -1}, "expected a rate >= 0, got -1"),
        ({"circle": [0, 0, 1], "rate": math.inf}, "expected a rate >= 0, got inf"),
        ({"circle": [0, 0], "rate": 1}, r"expected a circle \[x, y, radius\], radius > 0, got"),
        ({"circle": [0, 0, math.nan], "rate": 1}, "expected a circle"),
        ({"circle": "wide", "rate": 1}, "expected a circle"),
        ({"polygon": SQUARE[:2], "rate": 1}, "expected a polygon of at least three corners"),
        ({"polygon": 7, "rate": 1}, "expected a polygon of at least three corners"),
        ({"polygon": [], "rate": 1}, "expected a polygon of at least three corners"),
        ({"polygon": [SQUARE, [[0, 0]]], "rate": 1}, "expected a polygon of at least three"),
        ({"polygon": [[1], [2], [3]], "rate": 1}, "expected a polygon of at least three"),
        ({"polygon": [[0, 0], [1, "x"], [1, 1]], "rate": 1}, "expected a polygon"),
    ],
)
def test_what_is_wrong_is_named(zone, fault):
    with pytest.raises(ValueError, match=fault):
        survival_from_zones(one_arc((0, 0), (1, 1)), [zone])


def test_nodes_need_places():
    graph = nx.DiGraph([("a", "b")])
    with pytest.raises(ValueError, match=r"Node 'a': expected pos \(x, y\), got None"):
        survival_from_zones(graph, [])
    with pytest.raises(ValueError, match="Expected danger >= 0, got -1"):
        survival_from_zones(one_arc((0, 0), (1, 1)), [], danger=-1)
