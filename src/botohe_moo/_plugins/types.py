"""What types say of values: their range, their name, and what a text file can hold."""

import collections.abc
import enum
import os
import types
from collections.abc import Iterable, Mapping, Sequence
from numbers import Integral, Number, Real
from typing import Annotated, Any, Literal, TypeAlias, Union, get_args, get_origin

import numpy as np
from pydantic import Field
from pydantic.fields import FieldInfo

# Ranges that several algorithms, operators and missions declare.
Count: TypeAlias = Annotated[int, Field(ge=1, le=1_000_000)]
Probability: TypeAlias = Annotated[float, Field(ge=0, le=1)]
Positive: TypeAlias = Annotated[float, Field(gt=0, allow_inf_nan=False)]
NotNegative: TypeAlias = Annotated[float, Field(ge=0, allow_inf_nan=False)]
TravelBudget: TypeAlias = Annotated[float, Field(ge=0)]  # infinite: no limit
Robots: TypeAlias = Annotated[int, Field(ge=1, description="Team size.")]

UNIONS = (Union, types.UnionType)
# What lists and mappings of a text file can stand for.
_LISTS = (list, Sequence, Iterable, collections.abc.Collection)
_MAPPINGS = (dict, Mapping, collections.abc.MutableMapping)
_SCALARS = (int, float, bool, str, type(None))
_ABSTRACT = (object, Any, Number, Real, Integral)
_COMPARED = {"gt": ">", "ge": ">=", "lt": "<", "le": "<="}
_OTHERS = {
    "multiple_of": "a multiple of",
    "min_length": "of length >=",
    "max_length": "of length <=",
    "pattern": "like",
}


class SameResult:
    """Marks a parameter that no result depends on, only the time: a number of threads.

    Runs of a study that differ in such parameters only are one run, where no seconds limit them.

    Examples
    --------
    >>> from typing import Annotated
    >>> from botohe_moo.algorithms import SameResult
    >>> def search(*, workers: Annotated[int, SameResult()] = 1): ...
    """


def changes_nothing(hint: Any) -> bool:
    """Whether a type is marked by :class:`SameResult`."""
    marks = getattr(hint, "__metadata__", ())
    return any(mark is SameResult or isinstance(mark, SameResult) for mark in marks) or (
        get_origin(hint) in (Annotated, *UNIONS) and any(map(changes_nothing, get_args(hint)))
    )


def range_text(hint: Any) -> str:
    """Give the range that an ``Annotated`` type states: ``in (0, 1)``, ``>= 1``; may be empty."""
    if get_origin(hint) in UNIONS:
        return " or ".join(filter(None, map(range_text, get_args(hint))))
    if get_origin(hint) is not Annotated:
        return ""
    inner, *metadata = get_args(hint)
    return _constraints_text(metadata) or range_text(inner)


def _constraints_text(metadata: Iterable[Any]) -> str:
    """Give the range that constraints state, such as ``Ge(1)`` or a pydantic ``Field``."""
    bounds: dict[str, str] = {}
    for constraint in metadata:
        parts = constraint.metadata if isinstance(constraint, FieldInfo) else [constraint]
        for name in (*_COMPARED, *_OTHERS):
            for bound in (getattr(part, name, None) for part in parts):
                if bound is not None and not callable(bound) and (bound or name in _COMPARED):
                    bounds[name] = bound_text(bound)
    texts = []
    low = next((name for name in ("ge", "gt") if name in bounds), "")
    high = next((name for name in ("le", "lt") if name in bounds), "")
    if low and high:
        opening, closing = "[" if low == "ge" else "(", "]" if high == "le" else ")"
        texts.append(f"in {opening}{bounds[low]}, {bounds[high]}{closing}")
    elif name := low or high:
        texts.append(f"{_COMPARED[name]} {bounds[name]}")
    texts += [f"{words} {bounds[name]}" for name, words in _OTHERS.items() if name in bounds]
    return ", ".join(texts)


def bound_text(bound: Any) -> str:
    """Write a bound; an integer that pydantic has made a float as an integer."""
    return str(int(bound)) if isinstance(bound, float) and bound.is_integer() else str(bound)


def type_text(hint: Any) -> str:
    """Write a type as in source, without its ``Annotated`` constraints."""
    origin, args = get_origin(hint), get_args(hint)
    if origin is Annotated:
        return type_text(args[0])
    if origin in UNIONS:
        return " | ".join(map(type_text, args))
    if origin is Literal:
        return f"Literal[{', '.join(map(repr, args))}]"
    if isinstance(hint, type) and issubclass(hint, enum.Enum):
        return f"Literal[{', '.join(repr(member.value) for member in hint)}]"
    if hint in (None, type(None)):
        return "None"
    if hint is Ellipsis:
        return "..."
    if isinstance(hint, list):  # the arguments of a Callable
        return f"[{', '.join(map(type_text, hint))}]"
    name = getattr(origin or hint, "__name__", None) or str(hint)
    return f"{name}[{', '.join(map(type_text, args))}]" if args else name


def is_scalar(hint: Any) -> bool:
    """Whether all values of this type are numbers, flags, texts or None."""
    origin, args = get_origin(hint), get_args(hint)
    if origin is Annotated:
        return is_scalar(args[0])
    return all(map(is_scalar, args)) if origin in UNIONS else origin is Literal or hint in _SCALARS


def is_plain(hint: Any) -> bool:
    """Whether numbers, flags, texts, or lists and mappings of them can be of this type."""
    origin, args = get_origin(hint), get_args(hint)
    if origin is Annotated:
        return is_plain(args[0])
    if origin in UNIONS:
        return any(map(is_plain, args))
    if origin in _LISTS or origin in _MAPPINGS:
        return all(map(is_plain, args))
    none = hint is type(None)  # alone it tells nothing
    return origin is Literal or (hint in (*_SCALARS, *_ABSTRACT, *_LISTS, *_MAPPINGS) and not none)


def plain_number(value: Any) -> Any:
    """Give numpy's numbers, and other kinds of numbers, as Python's; anything else unchanged."""
    if isinstance(value, np.generic):
        return value.item()
    if isinstance(value, Integral):
        return value if isinstance(value, bool) else int(value)
    if isinstance(value, Real):
        try:
            return float(value)
        except OverflowError:
            return value
    return value


def plain_value(value: Any) -> Any:
    """Write a value as a text file would hold it; ``NotImplemented`` for what none can hold."""
    if isinstance(value, enum.Enum):
        value = value.value
    elif isinstance(value, os.PathLike):
        value = os.fspath(value)
    elif isinstance(value, Number | np.generic):
        value = plain_number(value)
    if type(value) in _SCALARS:
        return value
    if isinstance(value, list | tuple):
        items = [plain_value(item) for item in value]
        return NotImplemented if any(item is NotImplemented for item in items) else items
    if isinstance(value, dict) and all(isinstance(key, str) for key in value):
        pairs = {key: plain_value(item) for key, item in value.items()}
        return NotImplemented if any(v is NotImplemented for v in pairs.values()) else pairs
    return NotImplemented
