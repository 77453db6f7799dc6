"""What counts as equal."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from botohe_moo._base.types import FloatArray
from botohe_moo.indicators import TIE

__all__ = ["merge_ties"]


def merge_ties(values: ArrayLike) -> FloatArray:
    """Give values of which those that differ by at most 1e-12 are equal.

    Rounding would not do: two neighbouring numbers can lie on both sides of where it turns.

    Parameters
    ----------
    values
        Shape (n,), finite, in any order.

    Returns
    -------
    numpy.ndarray
        Shape (n,), in the order given: in place of each value the largest that a chain of such
        steps leads to. Again given, they stay as they are.

    Examples
    --------
    >>> merge_ties([0.3, 0.1 + 0.2, 0.2]).tolist()
    [0.30000000000000004, 0.30000000000000004, 0.2]
    """
    given = np.asarray(values, np.float64)
    order = np.argsort(given, kind="stable")
    ordered = given[order]
    last = np.append(np.diff(ordered) > TIE, True)[: len(given)]
    ends = np.flatnonzero(last)
    merged = np.empty_like(given)
    merged[order] = ordered[ends[np.searchsorted(ends, np.arange(len(given)))]]
    return merged
