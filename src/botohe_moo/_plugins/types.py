"""What types say of values, and what a text file can hold."""

import enum
import os
import types
import typing
from collections.abc import Mapping
from numbers import Integral, Number, Real
from typing import Annotated, Any, Literal, TypeAlias, Union, get_args, get_origin

import numpy as np
from pydantic import Field
from pydantic.fields import FieldInfo

# Ranges that several algorithms, operators and missions declare.
Count: TypeAlias = Annotated[int, Field(ge=1, le=1_000_000)]
Size: TypeAlias = Annotated[int, Field(ge=1)]
Probability: TypeAlias = Annotated[float, Field(ge=0, le=1)]
Positive: TypeAlias = Annotated[float, Field(gt=0, allow_inf_nan=False)]
NotNegative: TypeAlias = Annotated[float, Field(ge=0, allow_inf_nan=False)]
TravelBudget: TypeAlias = Annotated[float, Field(ge=0)]  # infinite: no limit
Robots: TypeAlias = Annotated[int, Field(ge=1, description="Team size.")]

UNIONS = (Union, types.UnionType)
_SCALARS = (int, float, bool, str, type(None))
_COMPARED = {"gt": ">", "ge": ">=", "lt": "<", "le": "<="}


class SameResult:
    """Marks a parameter that changes no result, only the time: a number of threads.

    Runs of a study that differ in such parameters only are one run, where no seconds limit them.

    Examples
    --------
    >>> from typing import Annotated
    >>> from botohe_moo.algorithms import SameResult
    >>> def search(*, workers: Annotated[int, SameResult()] = 1): ...
    """


def resolved(annotation: Any, scope: Mapping[str, Any]) -> Any:
    """Evaluate an annotation that may be a text; ``Any`` where its names lead nowhere."""
    holder: Any = types.SimpleNamespace(__annotations__={"it": annotation})
    try:
        return typing.get_type_hints(holder, globalns=dict(scope), include_extras=True)["it"]
    except Exception:  # names that are for type checkers only, and whatever else a name may do
        return Any


def changes_nothing(hint: Any) -> bool:
    """Return whether a type is marked by :class:`SameResult`."""
    marks = getattr(hint, "__metadata__", ())
    return any(mark is SameResult or isinstance(mark, SameResult) for mark in marks) or (
        get_origin(hint) in (Annotated, *UNIONS) and any(map(changes_nothing, get_args(hint)))
    )


def range_text(hint: Any) -> str:
    """Return the range that an ``Annotated`` type states, such as ``in (0, 1)`` or ``>= 1``.

    It is empty where the type states none.
    """
    if get_origin(hint) in UNIONS:
        return " or ".join(filter(None, map(range_text, get_args(hint))))
    if get_origin(hint) is not Annotated:
        return ""
    bounds = _bounds(hint)
    low = next((name for name in ("ge", "gt") if name in bounds), "")
    high = next((name for name in ("le", "lt") if name in bounds), "")
    if low and high:
        opening, closing = "[" if low == "ge" else "(", "]" if high == "le" else ")"
        return f"in {opening}{bounds[low]}, {bounds[high]}{closing}"
    if name := low or high:
        return f"{_COMPARED[name]} {bounds[name]}"
    return range_text(get_args(hint)[0])


def _bounds(hint: Any) -> dict[str, str]:
    """Collect the bounds that constraints state, such as ``Ge(1)`` or a pydantic ``Field``."""
    return {
        name: bound_text(bound)
        for part in FieldInfo.from_annotation(hint).metadata
        for name in _COMPARED
        if (bound := getattr(part, name, None)) is not None
    }


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
    """Return whether all values of a type are numbers, flags, texts or None."""
    origin, args = get_origin(hint), get_args(hint)
    if origin is Annotated:
        return is_scalar(args[0])
    return all(map(is_scalar, args)) if origin in UNIONS else origin is Literal or hint in _SCALARS


def plain_number(value: Any) -> Any:
    """Return numpy's numbers, and other kinds of numbers, as Python's; anything else unchanged."""
    if isinstance(value, np.generic):
        return value.item()
    if isinstance(value, Integral):
        return value if isinstance(value, bool) else int(value)
    return float(value) if isinstance(value, Real) else value


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
