"""The order of trails and of numbers against Python's own."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from numba import njit

from botohe_moo.kernels.plans import order

precedes, sort_descending = njit(order.precedes), njit(order.sort_descending)
trails = st.lists(st.integers(0, 3), max_size=6)


@given(trails, trails)
def test_trails_are_ordered_as_lists(one, other):
    items = np.array([*one, *other], np.int32)
    cut = len(one)
    assert precedes(items, 0, cut, cut, len(items)) == (one < other)


@given(st.lists(st.integers(0, 5).map(float) | st.floats(allow_nan=False), max_size=70))
def test_equal_numbers_stay_in_order(keys):
    found, spare = np.arange(len(keys)), np.empty(len(keys), np.int64)
    sort_descending(np.array(keys), found, spare, len(keys))
    assert found.tolist() == sorted(range(len(keys)), key=lambda i: -keys[i])


@given(st.lists(st.integers(0, 5).map(float), min_size=1, max_size=70), st.data())
def test_some_of_the_numbers_are_sorted(keys, data):
    chosen = data.draw(st.lists(st.integers(0, len(keys) - 1), unique=True))
    behind = [-1, -2]  # stays as it is
    found, spare = np.array([*chosen, *behind]), np.empty(len(chosen), np.int64)
    sort_descending(np.array(keys), found, spare, len(chosen))
    assert found.tolist() == sorted(chosen, key=lambda i: -keys[i]) + behind


def test_nan_is_sorted_somewhere():
    keys = np.array([1.0, np.nan, 3.0, np.nan, 2.0])
    found, spare = np.arange(5), np.empty(5, np.int64)
    sort_descending(keys, found, spare, 5)
    assert sorted(found.tolist()) == [0, 1, 2, 3, 4]
