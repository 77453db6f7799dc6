"""Dangers on a map, what arcs cross of them, and what there is to see from nodes."""

import math
from itertools import pairwise

import networkx as nx
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from scipy.integrate import quad

from botohe_moo import rewards_from_raster, survival_from_raster


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


shares = st.floats(0, 1)


@given(
    arrays(float, st.tuples(st.integers(1, 4), st.integers(1, 4)), elements=st.floats(0, 1)),
    st.sampled_from([0.05, 1.0, 2.5]),
    st.tuples(st.floats(-9, 9), st.floats(-9, 9)),
    st.tuples(shares, shares, shares, shares),
)
def test_the_integral_is_exact(values, resolution, origin, ends):
    size = np.array(values.shape[::-1]) * resolution
    start, end = np.array(origin) + np.array(ends).reshape(2, 2) * size
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


def test_rows_are_those_of_an_image_by_hand():
    """A danger in the upper left cell of 2 x 2; lines through the middle of cells."""
    values = [[1, 0], [0, 0]]
    # Along the upper cells: 1 for half a cell, then falling to 0 over a cell.
    upper = survival_from_raster(one_arc((0, 3), (4, 3)), values, resolution=2, scale=0.1)
    assert upper["a", "b"] == pytest.approx(math.exp(-0.1 * (1 + 1)))
    lower = survival_from_raster(one_arc((0, 1), (4, 1)), values, resolution=2, scale=0.1)
    assert lower["a", "b"] == 1.0


def test_a_constant_map_is_a_danger_everywhere():
    graph = one_arc((0.0, 0.0), (3.0, 4.0))
    found = survival_from_raster(graph, np.ones((50, 40)), resolution=0.1, scale=0.02)
    assert found["a", "b"] == pytest.approx(math.exp(-0.02 * 5), rel=1e-12)


@pytest.mark.parametrize(
    ("place", "given", "fault"),
    [
        ((0, 5), {}, r"Node 'b': expected pos \(x, y\) on the map, from \[0.0, 0.0\] to \[2.0, 2"),
        (None, {}, "Node 'b': expected pos .*, got None"),
        ((1, "x"), {}, "Node 'b': expected pos"),
        ((1, math.nan), {}, "Node 'b': expected pos"),
        ((1, 1, 1), {}, "Node 'b': expected pos"),
        ((1, 1), {"values": [1, 2]}, r"Expected values \(n_rows, n_columns\), got an array \(2,\)"),
        ((1, 1), {"values": [[1], [2, 3]]}, "Expected values to be a table of numbers, got"),
        ((1, 1), {"values": [[1, -2]]}, "Expected finite values >= 0, got -2.0"),
        ((1, 1), {"values": [[math.inf]]}, "Expected finite values >= 0, got inf"),
        ((1, 1), {"resolution": 0}, "Expected resolution > 0, got 0"),
        ((1, 1), {"scale": -1}, "Expected scale >= 0, got -1"),
    ],
)
def test_what_is_wrong_is_named(place, given, fault):
    usual = {"values": np.ones((2, 2)), "resolution": 1}
    with pytest.raises(ValueError, match=fault):
        survival_from_raster(one_arc((1, 1), place), **{**usual, **given})


def test_only_graphs_have_arcs():
    with pytest.raises(TypeError, match=r"Expected graph to be an nx\.DiGraph, got 7"):
        survival_from_raster(7, [[1]], resolution=1)


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
    moved = rewards_from_raster(
        placed((11, -4), (99, 9)), values, resolution=2, radius=1, origin=(10, -5)
    )
    assert moved == {0: 4 * 1, 1: 0.0}


@given(
    arrays(float, st.tuples(st.integers(1, 5), st.integers(1, 5)), elements=st.floats(0, 1)),
    st.lists(st.tuples(st.floats(-1, 6), st.floats(-1, 6)), max_size=6),
    st.floats(0.3, 9),
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
