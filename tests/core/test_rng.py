"""Random numbers of the kernels: xoroshiro128+ by the book, evenly spread, seeded by numpy."""

import math
from collections import Counter

import numpy as np
import pytest

from botohe_moo.core.compile import kernel
from botohe_moo.core.rng import draw_weighted, hash_keys, log_uniform, mixed, seed_states, uniform
from tests.twins import assert_frequencies

MASK = 2**64 - 1


def twin(low, high, n):
    """The authors' reference algorithm in Python's unbounded integers."""

    def rotated(word, by):
        return ((word << by) | (word >> (64 - by))) & MASK

    for _ in range(n):
        yield (((low + high) & MASK) >> 11) * 2.0**-53
        high ^= low
        low = rotated(low, 24) ^ high ^ ((high << 16) & MASK)
        high = rotated(high, 37)


@kernel
def draw(states, which, n):
    drawn = np.empty(n)
    for i in range(n):
        drawn[i] = uniform(states, which)
    return drawn


def test_numbers_are_those_of_the_twin_and_evenly_spread():
    states = seed_states(np.random.default_rng(3), 4)
    words = states.tolist()
    drawn = draw(states, 2, 100_000)
    assert drawn[:1000].tolist() == list(twin(*words[2], 1000))
    assert states[[0, 1, 3]].tolist() == [words[0], words[1], words[3]]
    counts = np.histogram(drawn, bins=100, range=(0, 1))[0]
    assert counts.sum() == len(drawn)
    chi_squared = ((counts - 1_000) ** 2 / 1_000).sum()
    assert 99 - 5 * 198**0.5 < chi_squared < 99 + 5 * 198**0.5


def test_states_differ_and_repeat_with_the_seed():
    states, other = (seed_states(np.random.default_rng(seed), 10_000) for seed in (1, 2))
    assert len({tuple(state) for state in states.tolist()}) == 10_000
    assert states.any(axis=1).all()
    assert not np.array_equal(states, other)
    assert np.array_equal(states[:7], seed_states(np.random.default_rng(1), 7))


def test_hash_keys_are_what_splitmix64_draws():
    """As its authors' reference program prints from seed 0."""
    expected = [0xE220A8397B1DCDAF, 0x6E789E6AA1B965F4, 0x06C45D188009454F]
    assert (hash_keys(3).tolist(), hash_keys(0).tolist()) == (expected, [])
    words = [(i * 0x9E3779B97F4A7C15) & MASK for i in (1, 2, 3)]
    assert mixed(np.array(words, np.uint64)).tolist() == expected


@pytest.mark.parametrize("n", [1, 2, 7])
def test_logarithms_are_uniform(n):
    states = seed_states(np.random.default_rng(4), 1)
    with np.errstate(all="ignore"):
        counted = Counter(log_uniform(states, n) for _ in range(20_000))
    assert_frequencies(counted, {k: math.log((k + 1) / k, n + 1) for k in range(1, n + 1)})


def test_indices_are_drawn_by_weight():
    weights, n = np.array([0.0, 2.0, 0.0, 1.0, 5.0, 0.0]), 20_000
    states = seed_states(np.random.default_rng(4), 1)
    with np.errstate(all="ignore"):
        drawn = [draw_weighted(np.cumsum(weights), states) for _ in range(n)]
    counts = np.bincount(drawn, minlength=len(weights))
    assert counts == pytest.approx(n * weights / weights.sum(), abs=5 * np.sqrt(n) / 2)
    assert not counts[weights == 0].any()
