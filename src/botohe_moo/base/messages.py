"""Errors, how messages name what was expected and what was found, and numbers as texts."""

import math
from collections.abc import Collection, Iterable
from difflib import SequenceMatcher
from numbers import Real
from reprlib import Repr
from typing import Any, TypeAlias

# The parameter that is wrong, or None for all together, and what is wrong with it.
Fault: TypeAlias = tuple[str | None, str]

_MOST_SHOWN = 100  # a file may have a million faults

_REPR = Repr()
_REPR.maxlevel, _REPR.maxdict, _REPR.maxstring, _REPR.maxother = 2, 8, 122, 120


class ParameterError(ValueError):
    """A value is not as expected.

    ``parameter`` is the name of the parameter, if it is one; ``faults`` lists what is wrong with
    this and other parameters, each as the parameter's name and a message. The error's own message
    begins with ``source``, such as "Mission 'toy'".
    """

    def __init__(
        self, message: str, name: str | None = None, faults: Iterable[Fault] = (), source: str = ""
    ) -> None:
        super().__init__(f"{source}: {message}" if source else message)
        self.parameter = name
        self.faults = tuple(faults) or ((name, message),)


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


def as_float(value: Any) -> float:
    """Convert a number; NaN for anything else."""
    try:
        return float(value) if isinstance(value, Real) and not isinstance(value, bool) else math.nan
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


def unknown_parameter(name: object, known: Iterable[str]) -> str:
    """Write that there is no parameter of this name, and which there are, nearest first."""
    among = ", ".join(nearest_first(str(name), known)) or "none"
    return f"there is no parameter {name!r}; known are {among}."


def nearest_first(word: str, words: Iterable[str]) -> list[str]:
    """Sort ``words`` by how much they look like ``word``, those alike by name."""
    word = word[:100].lower()  # how long it takes grows with the length
    return sorted(words, key=lambda w: (-SequenceMatcher(None, word, w.lower()).ratio(), w))


def most_alike(word: str, words: Iterable[str]) -> str:
    """Write which five words look most like ``word``; nothing if there are none."""
    near = ", ".join(nearest_first(word, words)[:5])
    return f"; most alike are {near}" if near else ""


def quoted(value: object) -> str:
    """Write a value as ``repr`` does; of a long one, which may be a whole file, only a part."""
    return _REPR.repr(value)


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


def probability_text(probability: float, decimals: int) -> str:
    """Write a probability; only 0 and 1 themselves are written as such.

    >>> [probability_text(p, 2) for p in (0.25, 0.9996, 1e-9, 1)]
    ['0.25', '>0.99', '<0.01', '1.00']
    """
    text = f"{probability:.{decimals}f}"
    if float(text) == 0 < probability:
        return f"<{10**-decimals:.{decimals}f}"
    if float(text) == 1 and probability < 1 - 1e-12:
        return f">{1 - 10**-decimals:.{decimals}f}"
    return text


def short_text(value: float) -> str:
    """Write a number with four significant digits."""
    return f"{value:.4g}"


def difference_text(value: float, what: str) -> str:
    """Write how much more or less reward, or how many more or fewer survivors, a plan has.

    >>> difference_text(0.5, "reward"), difference_text(-1, "survivors"), difference_text(0, "x")
    ('0.5 more reward', '1 fewer survivors', 'the same x')
    """
    if abs(value) < 1e-9:
        return f"the same {what}"
    less = "fewer" if what == "survivors" else "less"
    return f"{short_text(abs(value))} {'more' if value > 0 else less} {what}"


def price_text(price: float) -> str:
    """Write the price of a survivor, as reward.

    >>> price_text(3.2)
    'one more survivor costs 3.2 reward'
    """
    return f"one more survivor costs {short_text(price)} reward"
