"""Random numbers inside kernels: one xoroshiro128+ state per ant.

Blackman and Vigna, "Scrambled linear pseudorandom number generators", ACM Transactions on
Mathematical Software 47(4), 2021. A state is two 64-bit words, not both zero.
"""

import math
from typing import TypeVar

import numpy as np

from botohe_moo.base.types import FloatArray, SeedArray
from botohe_moo.core.compile import helper, inlined

Words = TypeVar("Words", np.uint64, SeedArray)

_A, _B, _C = np.uint64(24), np.uint64(16), np.uint64(37)
_WORD = np.uint64(64)
_DROP = np.uint64(11)
_SCALE = 2.0**-53

# 2⁶⁴ over the golden ratio: the increment of SplitMix64.
GOLDEN = np.uint64(0x9E3779B97F4A7C15)


def seed_states(random_state: np.random.Generator, n: int) -> SeedArray:
    """Derive ``n`` independent states, shape (n, 2), from one draw of numpy's generator."""
    entropy = int(random_state.integers(2**63))
    children = np.random.SeedSequence(entropy).spawn(n)
    words = [child.generate_state(2, np.uint64) for child in children]
    return np.array(words, np.uint64).reshape(n, 2)


def draw_state(random_state: np.random.Generator) -> SeedArray:
    """Draw one state, shape (1, 2), for a kernel that works through a batch in order.

    Where only one state is drawn, two words of numpy's generator will do. This takes a third of the
    time of ``seed_states``.
    """
    return random_state.integers(0, 2**64, (1, 2), np.uint64)


@helper
def mixed(word: Words) -> Words:
    """Mix the bits of a number by the last step of SplitMix64 (Steele, Lea and Flood, 2014)."""
    word = (word ^ (word >> np.uint64(30))) * np.uint64(0xBF58476D1CE4E5B9)
    word = (word ^ (word >> np.uint64(27))) * np.uint64(0x94D049BB133111EB)
    return word ^ (word >> np.uint64(31))


@inlined
def hash_step(bits: np.uint64, item: int | np.integer) -> np.uint64:
    """Add an item to the hash of a sequence, which ends with ``mixed``."""
    bits = (bits ^ np.uint64(item)) * np.uint64(0xBF58476D1CE4E5B9)
    return bits ^ (bits >> np.uint64(29))


def hash_keys(n: int) -> SeedArray:
    """Return a key of 64 bits for each of ``n`` indices; the xor of its keys is a set's hash."""
    return mixed(np.arange(1, n + 1, dtype=np.uint64) * GOLDEN)


@helper
def uniform(states: SeedArray, which: int) -> float:
    """Draw a float in [0, 1) and advance state ``which``."""
    low, high = states[which, 0], states[which, 1]
    drawn = low + high
    high ^= low
    states[which, 0] = ((low << _A) | (low >> (_WORD - _A))) ^ high ^ (high << _B)
    states[which, 1] = (high << _C) | (high >> (_WORD - _C))
    return float(drawn >> _DROP) * _SCALE


@helper
def below(states: SeedArray, n: int) -> int:
    """Draw an integer from 0 to n − 1 by the first state."""
    return int(uniform(states, 0) * n)


@helper
def log_uniform(states: SeedArray, n: int) -> int:
    """Draw an integer from 1 to n by the first state, small ones more often.

    It is k with probability log((k + 1) / k) / log(n + 1).
    """
    return min(n, int(math.pow(n + 1, uniform(states, 0))))


@helper
def draw_weighted(cumulated: FloatArray, states: SeedArray) -> int:
    """Draw an index by weights, given their cumulated sums, by the first state."""
    drawn = uniform(states, 0) * cumulated[cumulated.shape[0] - 1]
    index = 0
    while cumulated[index] <= drawn and index < cumulated.shape[0] - 1:
        index += 1
    return index
