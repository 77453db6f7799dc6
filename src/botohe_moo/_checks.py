"""Checks of parameters at the boundary, with one way to say what was expected."""

from __future__ import annotations

import math
from numbers import Real
from operator import index
from typing import Any

import numpy as np


def check_integer(name: str, value: Any, *, at_least: int) -> int:
    """Give ``value`` as an int, or raise the ValueError that says what was expected."""
    try:
        if isinstance(value, bool | np.bool_) or index(value) < at_least:
            raise TypeError
    except TypeError:
        raise ValueError(f"Expected {name} >= {at_least} (an integer), got {value!r}.") from None
    return index(value)


def check_number(
    name: str,
    value: Any,
    *,
    above: float = -math.inf,
    at_least: float = -math.inf,
    below: float = math.inf,
    other: str = "",
) -> float:
    """Give ``value`` as a finite float, or raise the ValueError that says what was expected."""
    number = isinstance(value, Real) and not isinstance(value, bool | np.bool_)
    if not number or not (above < value < below and value >= at_least and math.isfinite(value)):
        low = f"({above:g}" if above > at_least else f"[{at_least:g}"
        expected = (
            f"{name} in {low}, {below:g})"
            if below < math.inf
            else f"{name} > {above:g}"
            if above > at_least
            else f"{name} >= {at_least:g}"
        )
        raise ValueError(f"Expected {expected}{f' or {other}' if other else ''}, got {value!r}.")
    return float(value)


def check_flag(name: str, value: Any) -> bool:
    """Give ``value`` as a bool, or raise the ValueError that says what was expected."""
    if not isinstance(value, bool | np.bool_):
        raise ValueError(f"Expected {name} to be true or false, got {value!r}.")
    return bool(value)
