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
    found, spare = np.empty((2, len(keys)), np.int64)
    sort_descending(np.array(keys), found, spare)
    assert found.tolist() == sorted(range(len(keys)), key=lambda i: -keys[i])


def test_nan_is_sorted_somewhere():
    keys = np.array([1.0, np.nan, 3.0, np.nan, 2.0])
    found, spare = np.empty((2, 5), np.int64)
    sort_descending(keys, found, spare)
    assert sorted(found.tolist()) == [0, 1, 2, 3, 4]
