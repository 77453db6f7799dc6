"""Checks of parameters at the boundary, with one way to say what was expected."""

from __future__ import annotations

import inspect
import math
from collections.abc import Callable, Iterable
from difflib import SequenceMatcher
from numbers import Integral, Real
from typing import Any

import numpy as np

_LONG = 120


def check_integer(name: str, value: Any, *, at_least: int, at_most: int | None = None) -> int:
    """Give ``value`` as an int, or raise the ValueError that says what was expected."""
    if isinstance(value, bool | np.bool_) or not isinstance(value, Integral):
        raise ValueError(f"Expected {name} to be an integer >= {at_least}, got {value!r}.")
    number = int(value)
    if number < at_least:
        raise ValueError(f"Expected {name} >= {at_least}, got {value}.")
    if at_most is not None and number > at_most:
        raise ValueError(f"Expected {name} <= {at_most}, got {value}.")
    return number


def check_number(
    name: str,
    value: Any,
    *,
    above: float = -math.inf,
    at_least: float = -math.inf,
    below: float = math.inf,
    at_most: float = math.inf,
    other: str = "",
) -> float:
    """Give ``value`` as a finite float, or raise the ValueError that says what was expected."""
    number = _as_float(value)
    if math.isfinite(number) and above < number < below and at_least <= number <= at_most:
        return number
    open_low = above >= at_least
    low = above if open_low else at_least
    if min(below, at_most) < math.inf:
        high = f"{below:g})" if below <= at_most else f"{at_most:g}]"
        expected = f"{name} in {'(' if open_low else '['}{low:g}, {high}"
    elif low == -math.inf:
        expected = f"{name} to be a finite number"
    else:
        expected = f"{name} {'>' if open_low else '>='} {low:g}"
        if number == math.inf:
            expected += " and finite"
    raise ValueError(f"Expected {expected}{f' or {other}' if other else ''}, got {value!r}.")


def _as_float(value: Any) -> float:
    """Convert a number; NaN for what is none."""
    number = isinstance(value, Real) and not isinstance(value, bool | np.bool_)
    try:
        return float(value) if number else math.nan
    except OverflowError:
        return math.inf if value > 0 else -math.inf


def check_flag(name: str, value: Any) -> bool:
    """Give ``value`` as a bool, or raise the ValueError that says what was expected."""
    if not isinstance(value, bool | np.bool_):
        raise ValueError(f"Expected {name} to be true or false, got {value!r}.")
    return bool(value)


def check_parameters(
    owner: str, given: Iterable[str], accepted: Iterable[str] | None, *, also: Iterable[str] = ()
) -> None:
    """Refuse parameters that are not known.

    Parameters
    ----------
    owner
        Whom the parameters are for, as the message calls it.
    given
        Names of the parameters.
    accepted
        Names of those that are known; None for a function that takes any.
    also
        Further names that are known.

    Raises
    ------
    ValueError
        Names every unknown parameter, and the known ones, nearest first.
    """
    if accepted is None:
        return
    known = sorted({*accepted, *also})
    unknown = [name for name in given if name not in known]
    if unknown:
        named = " or ".join(repr(name) for name in unknown)
        among = ", ".join(nearest_first(unknown[0], known))
        remedy = f"known are {among}" if known else "it takes none"
        raise ValueError(f"{owner}: there is no parameter {named}; {remedy}.")


def keyword_names(function: Callable[..., object]) -> tuple[str, ...] | None:
    """Give the names that ``function`` takes as keywords, or None if it takes any."""
    try:
        parameters = inspect.signature(function).parameters.values()
    except (TypeError, ValueError):  # some compiled callables do not tell
        return None
    if any(parameter.kind is parameter.VAR_KEYWORD for parameter in parameters):
        return None
    named = (inspect.Parameter.KEYWORD_ONLY, inspect.Parameter.POSITIONAL_OR_KEYWORD)
    return tuple(parameter.name for parameter in parameters if parameter.kind in named)


def nearest_first(word: str, words: Iterable[str]) -> list[str]:
    """Sort ``words`` by how much they look like ``word``, those alike by name."""
    word = word[:_LONG].lower()  # how long it takes grows with the square of the lengths
    return sorted(words, key=lambda w: (-SequenceMatcher(None, word, w[:_LONG].lower()).ratio(), w))


def quoted(value: object) -> str:
    """Write a value as ``repr`` does, but of a long one only the beginning."""
    text = repr(value)
    return text if len(text) <= _LONG else f"{text[: _LONG - 20]}... ({len(text):,} characters)"
