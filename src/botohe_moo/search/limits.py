"""Survival floor and travel budget, checked at the boundary."""

from __future__ import annotations

import math

from botohe_moo._base.checks import as_float, check_number
from botohe_moo.kernels.graph.graph import Limits

MOST_MEMORY = 1e9  # MiB that a search may be allowed


def check_limits(min_survival: float, max_length: float | None) -> Limits:
    """Return both limits; a ParameterError says what was expected.

    The survival floor is in [0, 1]; the travel budget is at least 0, None or inf for none.
    """
    least = check_number("min_survival", min_survival, at_least=0, at_most=1)
    if max_length is None or as_float(max_length) == math.inf:
        return Limits(least)
    return Limits(least, check_number("max_length", max_length, at_least=0))
