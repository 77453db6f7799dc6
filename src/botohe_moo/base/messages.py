"""Errors, and how messages name what was expected and what was found."""

import math
from collections.abc import Collection, Iterable, Mapping
from difflib import SequenceMatcher
from numbers import Integral, Real
from reprlib import Repr
from typing import Any

_LONG = 120
_MOST_SHOWN = 100  # a file may have a million faults

_REPR = Repr()
_REPR.maxlevel, _REPR.maxdict = 2, 8
_REPR.maxstring, _REPR.maxother = 60, _LONG


class ParameterError(ValueError):
    """A value is not as expected.

    ``parameter`` is the name of the parameter, if it is one; ``faults`` lists what is wrong with
    this and other parameters, each as the parameter's name and a message. The error's own message
    begins with ``source``, such as "Mission 'toy'".
    """

    def __init__(
        self,
        message: str,
        parameter: str | None = None,
        faults: Iterable[tuple[str | None, str]] = (),
        source: str = "",
    ) -> None:
        super().__init__(f"{source}: {message}" if source else message)
        self.parameter = parameter
        self.faults = tuple(faults) or ((parameter, message),)


class FaultsError(ValueError):
    """Something that cannot be used, with everything that is wrong with it.

    Parameters
    ----------
    faults
        What is wrong. They are kept as a tuple; the message shows the first hundred.
    source
        What cannot be used, such as the path of a file; the message begins with it.
    """

    def __init__(self, faults: Iterable[str], source: str) -> None:
        self.faults = (faults,) if isinstance(faults, str) else tuple(faults)
        self.source = source
        super().__init__(self.faults, source)  # from which it is unpickled

    def __str__(self) -> str:
        if len(self.faults) == 1:
            return f"{self.source}: {self.faults[0]}"
        shown = [f"{self.source} has {len(self.faults)} faults:", *self.faults[:_MOST_SHOWN]]
        if (n_more := len(self.faults) - _MOST_SHOWN) > 0:
            shown.append(f"and {n_more} more")
        return "\n  - ".join(shown)


class PluginError(ValueError):
    """What a name stands for is not registered, or cannot be used; says why."""


def check_integer(name: str, value: Any, *, at_least: int, at_most: float = math.inf) -> int:
    """Return ``value`` as an int, or raise the ParameterError that says what was expected."""
    if isinstance(value, bool) or not isinstance(value, Integral):
        expected = f"{name} to be an integer >= {at_least}"
    elif at_least <= int(value) <= at_most:
        return int(value)
    else:
        value = int(value)
        expected = f"{name} >= {at_least}" if value < at_least else f"{name} <= {at_most}"
    raise ParameterError(f"Expected {expected}, got {quoted(value)}.", name)


def check_number(
    name: str,
    value: Any,
    *,
    above: float = -math.inf,
    at_least: float = -math.inf,
    below: float = math.inf,
    at_most: float = math.inf,
) -> float:
    """Return ``value`` as a finite float, or raise a ParameterError that says what was expected."""
    number = as_float(value)
    if math.isfinite(number) and above < number < below and at_least <= number <= at_most:
        return number
    low, high = max(above, at_least), min(below, at_most)
    expected = " to be a finite number"
    if high < math.inf:
        opening, closing = "(" if above == low else "[", ")" if below == high else "]"
        expected = f" in {opening}{low:g}, {high:g}{closing}"
    elif low > -math.inf:
        finite = " and finite" if number == math.inf else ""
        expected = f" {'>' if above == low else '>='} {low:g}{finite}"
    raise ParameterError(f"Expected {name}{expected}, got {quoted(value)}.", name)


def as_float(value: Any) -> float:
    """Convert a number; NaN for anything else."""
    number = isinstance(value, Real) and not isinstance(value, bool)
    try:
        return float(value) if number else math.nan
    except OverflowError:
        return math.inf if value > 0 else -math.inf


def check_frame(name: str, frame: Any) -> None:
    """Refuse, with a TypeError, what is not a pandas.DataFrame; pandas need not be loaded."""
    if not hasattr(frame, "columns"):
        raise TypeError(f"Expected {name} to be a pandas.DataFrame, got {quoted(frame)}.")


def check_choice(parameter: str, name: Any, known: Collection[str]) -> None:
    """Refuse a name that is not known; the ParameterError lists the known ones, nearest first."""
    if not isinstance(name, str) or name not in known:
        among = ", ".join(nearest_first(str(name), known))
        raise ParameterError(f"Expected {parameter} among {among}, got {quoted(name)}.", parameter)


def check_weights(
    parameter: str, given: Any, known: Collection[str], *, needed: str = ""
) -> dict[str, float]:
    """Return a mapping from known names to weights >= 0, or raise a ParameterError.

    With ``needed``, what one of them is called, some weight has to be above 0.
    """
    if not isinstance(given, Mapping):
        expected = f"{parameter} to be a mapping from names to weights"
        raise ParameterError(f"Expected {expected}, got {quoted(given)}.", parameter)
    weights = {}
    for name, weight in given.items():
        check_choice(parameter, name, known)
        weights[name] = check_number(f"{parameter}[{name!r}]", weight, at_least=0)
    if needed and not any(weights.values()):
        expected = f"a {needed} of weight above 0"
        raise ParameterError(f"Expected {expected}, got {quoted(given)}.", parameter)
    return weights


def unknown_parameter(name: object, known: Iterable[str]) -> str:
    """Write that there is no parameter of this name, and which there are, nearest first."""
    among = ", ".join(nearest_first(str(name), known))
    remedy = f"known are {among}" if among else "it takes none"
    return f"there is no parameter {name!r}; {remedy}."


def nearest_first(word: str, words: Iterable[str]) -> list[str]:
    """Sort ``words`` by how much they look like ``word``, those alike by name."""
    word = word[:_LONG].lower()  # how long it takes grows with the square of the lengths
    return sorted(words, key=lambda w: (-SequenceMatcher(None, word, w[:_LONG].lower()).ratio(), w))


def most_alike(word: str, words: Iterable[str]) -> str:
    """Write which five words look most like ``word``; nothing if there are none."""
    near = [repr(other[:_LONG])[1:-1] for other in nearest_first(word, words)[:5]]
    return f"; most alike are {', '.join(near)}" if near else ""


def quoted(value: object) -> str:
    """Write a value as ``repr`` does; of a long one, which may be a whole file, only a part."""
    if not isinstance(value, str):
        return _REPR.repr(value)
    if len(value) <= _LONG:
        return repr(value)
    return f"{value[: _LONG - 20]!r}... ({len(value):,} characters)"


def counted(number: int, thing: str) -> str:
    """Write a number of things, with the plural in s.

    >>> counted(1, "plan"), counted(1200, "plan")
    ('1 plan', '1,200 plans')
    """
    return f"1 {thing}" if number == 1 else f"{number:,} {thing}s"


def listed(names: Iterable[str], most: int = 5) -> str:
    """Write names once each; of more than ``most``, the first ones and how many more there are.

    >>> listed("abca"), listed("abcd", most=2)
    ('a, b, c', 'a, b and 2 more')
    """
    once = list(dict.fromkeys(names))
    return ", ".join(once[:most]) + (f" and {n:,} more" if (n := len(once) - most) > 0 else "")
