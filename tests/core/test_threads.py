"""Arrays with cache lines of their own."""

from typing import NamedTuple

import numpy as np
import pytest

from botohe_moo.core.threads import apart

LINE = 128
RECORD = np.dtype([("n", np.int64), ("x", np.float64)])


class Parts(NamedTuple):
    """Arrays and others."""

    n: np.record
    items: np.ndarray
    name: str


@pytest.mark.parametrize("shape", [0, 1, 7, (3, 5), (0, 4), 8_000])
@pytest.mark.parametrize("dtype", [np.int32, np.float64, RECORD])
def test_copies_are_equal_and_begin_a_line(shape, dtype):
    n_bytes = np.prod(shape) * np.dtype(dtype).itemsize
    raw = np.random.default_rng(1).integers(0, 100, n_bytes, np.uint8)
    given = raw.view(dtype).reshape(shape)
    found = apart(given)
    assert (found.dtype, found.shape) == (given.dtype, given.shape)
    assert found.tobytes() == given.tobytes()
    if given.nbytes > 65_536:
        assert found is given
    elif given.size:
        assert not np.shares_memory(found, given)
        assert found.ctypes.data % LINE == 0


def test_no_two_share_a_line():
    moved = apart(tuple(np.full(1, i) for i in range(200)))
    assert len({array.ctypes.data // LINE for array in moved}) == 200
    assert [int(array[0]) for array in moved] == list(range(200))


def test_records_and_tuples_within_tuples():
    record = np.array([(1, 0.5)], RECORD).view(np.recarray)[0]
    records = np.zeros(3, RECORD).view(np.recarray)
    parts, alone = apart((Parts(record, np.arange(3), "name"), records))
    parts.n.n += 1  # still a place in memory, not a copy
    assert (parts.n.n, parts.n.x, record.n) == (2, 0.5, 1)
    assert (parts.items.tolist(), parts.name, type(parts)) == ([0, 1, 2], "name", Parts)
    assert type(alone) is np.recarray
    alone[1].x = 3.0
    assert alone.x.tolist() == [0.0, 3.0, 0.0]
