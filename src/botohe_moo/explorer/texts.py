"""Labels and numbers as the page shows them, written here so that its script need not round."""

import math
import re
from collections import Counter
from collections.abc import Callable, Hashable, Iterable, Sequence
from unicodedata import bidirectional

import numpy as np
from numpy.typing import ArrayLike

from botohe_moo._base.types import FloatArray
from botohe_moo.decide.wishes import label_text
from botohe_moo.outcomes import Distribution

_SIGNIFICANT = 5  # digits of the largest number of a kind
_MAX_BINS = 12
LITTLE, NEARLY = 1001, 1002  # codes of probabilities that would round to 0 and to 1


def shown_names(nodes: Sequence[Hashable]) -> list[str]:
    """Return names to show: texts as they are, in quotes where 1 and "1" are both there."""
    names = [str(node) for node in nodes]
    counts = Counter(names)
    return [
        label_text(node) if counts[name] > 1 or not name.strip() else name
        for node, name in zip(nodes, names, strict=True)
    ]


def isolating(nodes: Sequence[Hashable]) -> Callable[[str], str]:
    """Return a function that isolates labels written from right to left in a sentence."""
    labels = [
        label
        for label in map(label_text, nodes)
        if any(bidirectional(letter) in ("R", "AL") for letter in label)
    ]
    longest_first = sorted(map(re.escape, labels), key=len, reverse=True)
    pattern = re.compile("|".join(longest_first) or "(?!)")
    return lambda text: pattern.sub("\u2068\\g<0>\u2069", text)


def number_texts(values: Iterable[float], scale: float) -> list[str]:
    """Write numbers with the decimals that show five digits of their scale.

    >>> number_texts([1.5], 13.07), number_texts([1.5], 3), number_texts([0], 0)
    (['1.500'], ['1.5000'], ['0.0000'])
    """
    size = math.floor(math.log10(scale)) if scale > 0 else 0
    decimals = min(max(_SIGNIFICANT - 1 - size, 0), 12)
    return [f"{value:.{decimals}f}" for value in values]


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
