"""Numbers as the page shows them: rounded here, so that its script only has to look them up."""

import math
from collections.abc import Iterable

import numpy as np
from numpy.typing import ArrayLike

from botohe_moo._base.types import FloatArray
from botohe_moo.outcomes import Distribution

_SIGNIFICANT = 5
_MAX_BINS = 12
LITTLE, NEARLY = 1001, 1002  # codes of probabilities that would round to 0 and to 1


def decimals(scale: float) -> int:
    """Return the decimals that show five digits of a scale.

    >>> decimals(13.07), decimals(3), decimals(25_000), decimals(0)
    (3, 4, 0, 4)
    """
    size = math.floor(math.log10(scale)) if scale > 0 else 0
    return min(max(_SIGNIFICANT - 1 - size, 0), 12)


def texts(values: Iterable[float], scale: float) -> list[str]:
    """Write numbers with the decimals of their scale."""
    digits = decimals(scale)
    return [f"{value:.{digits}f}" for value in values]


def probability_codes(values: ArrayLike) -> list[int]:
    """Round probabilities to thousandths; 1001 is above 0 but rounds to it, 1002 the same below 1.

    >>> probability_codes([0, 0.0001, 0.0625, 0.5, 0.99999, 1])
    [0, 1001, 62, 500, 1002, 1000]
    """
    codes = []
    for value in np.asarray(values, float).tolist():
        code = round(round(value, 3) * 1000)  # of the decimal number, as texts are rounded
        if code <= 0 < value:
            code = LITTLE
        elif code >= 1000 and value < 1 - 1e-12:
            code = NEARLY
        codes.append(max(code, 0))
    return codes


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
