"""Labels and numbers as the page shows them, written here so that its script need not round."""

import math
import re
from collections import Counter
from collections.abc import Callable, Hashable, Iterable, Sequence
from itertools import pairwise
from unicodedata import bidirectional

import numpy as np
from numpy.typing import ArrayLike

from botohe_moo.base.types import FloatArray
from botohe_moo.decide.wishes import label_text
from botohe_moo.outcomes import Distribution

DIGITS = 3  # of the largest number of a kind; the same number of decimals for probabilities
_MAX_BINS = 12
# Not in a wish, which says what someone asked for.
_NUMBER = re.compile(r'"(?:[^"\\]|\\.)*"|(?<![\w.])(?<!= )(?P<number>\d+\.\d+(?:e[+-]\d+)?)(?!\w)')
LITTLE, NEARLY = 1001, 1002  # codes of probabilities that would round to 0 and to 1


def shown_names(nodes: Sequence[Hashable]) -> list[str]:
    """Return names to show: texts as they are, in quotes where 1 and "1" are both there."""
    names = [str(node) for node in nodes]
    counts = Counter(names)
    return [
        label_text(node) if counts[name] > 1 or not name.strip() else name
        for node, name in zip(nodes, names, strict=True)
    ]


def sentence_writer(nodes: Sequence[Hashable]) -> Callable[[str], str]:
    """Return a function that writes a sentence as the page shows it.

    Its numbers have three digits, except in wishes, and labels written from right to left are
    isolated.
    """
    labels = [
        label
        for label in map(label_text, nodes)
        if any(bidirectional(letter) in ("R", "AL") for letter in label)
    ]
    longest_first = sorted(map(re.escape, labels), key=len, reverse=True)
    pattern = re.compile("|".join(longest_first) or "(?!)")
    return lambda text: pattern.sub("\u2068\\g<0>\u2069", _NUMBER.sub(_shortened, text))


def _shortened(found: re.Match[str]) -> str:
    """Write a number with three digits; labels in quotes stay as they are."""
    if found["number"] is None:
        return found[0]
    value = float(found["number"])
    return f"{value:.{DIGITS}g}" if value < 10**DIGITS - 0.5 else f"{value:.0f}"


def number_texts(values: Iterable[float], digits: int = DIGITS) -> list[str]:
    """Write numbers with as many decimals as show some digits of the largest, if they need them.

    >>> number_texts([1.5, 13.07]), number_texts([1 / 3, 1, 2]), number_texts([2, 3, 1250.4])
    (['1.5', '13.1'], ['0.33', '1.00', '2.00'], ['2', '3', '1250'])
    """
    listed = [float(value) for value in values]
    largest = max(map(abs, listed), default=0.0)
    size = math.floor(math.log10(largest)) if largest > 0 else 0
    texts = [f"{value:.{min(max(digits - 1 - size, 0), 12)}f}" for value in listed]
    ends = [text.partition(".")[2].rstrip("0") for text in texts]
    decimals = max(map(len, ends), default=0)
    return [f"{float(text):.{decimals}f}" for text in texts]


def objective_texts(objectives: FloatArray) -> list[list[str]]:
    """Write objectives (n, 2) of a front as columns: with a fourth digit if neighbours need it.

    >>> objective_texts(np.array([[1.0, 2.0], [2.001, 1.5]]))
    [['1', '2'], ['2.0', '1.5']]
    """
    for digits in (DIGITS, DIGITS + 1):
        columns = [number_texts(column.tolist(), digits) for column in objectives.T]
        if all(one != other for one, other in pairwise(zip(*columns, strict=True))):
            break
    return columns


def probability_codes(values: ArrayLike) -> list[int]:
    """Round probabilities to thousandths; 1001 is above 0 but rounds to it, 1002 the same below 1.

    >>> probability_codes([0, 0.0001, 0.0625, 0.5, 0.99999, 1])
    [0, 1001, 62, 500, 1002, 1000]
    """
    return list(map(_probability_code, np.asarray(values, float).tolist()))


def _probability_code(value: float) -> int:
    code = round(round(value, 3) * 1000)  # of the decimal number, as texts are rounded
    if code <= 0 < value:
        return LITTLE
    if code >= 1000 and value < 1 - 1e-12:
        return NEARLY
    return max(code, 0)


def bin_edges(largest: float) -> FloatArray:
    """Cut rewards from 0 to beyond the largest into at most 12 bins of a round width.

    >>> bin_edges(13.07).tolist()
    [0.0, 2.0, 4.0, 6.0, 8.0, 10.0, 12.0, 14.0]
    """
    if largest <= 0:
        return np.array([0.0, 1.0])
    power = math.floor(math.log10(largest)) - 1
    widths = (factor * 10.0**power for factor in (1, 2, 5, 10, 20))
    width = next(w for w in widths if largest < w * _MAX_BINS * (1 - 1e-9))
    n_bins = math.floor(largest / width * (1 + 1e-9)) + 1
    # Rounded, so that edges are the decimal numbers that they are written as.
    return np.array([round(i * width, max(0, 2 - power)) for i in range(n_bins + 1)])


def bin_codes(distribution: Distribution, edges: FloatArray) -> list[int]:
    """Return the probabilities that a reward is in each bin, its lower edge included, as codes."""
    beyond = distribution.at_least(edges)
    return probability_codes(np.clip(beyond[:-1] - beyond[1:], 0, 1))
