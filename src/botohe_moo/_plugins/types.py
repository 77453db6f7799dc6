"""What types say of values, what a text file can hold, and what pydantic finds wrong."""

import enum
import os
import types
import typing
from collections.abc import Iterable, Mapping, Sequence
from numbers import Integral, Number, Real
from typing import Annotated, Any, Literal, TypeAlias, Union, get_args, get_origin

import numpy as np
from pydantic import Field
from pydantic.fields import FieldInfo

from botohe_moo._base.checks import quoted

# Ranges that several algorithms, operators and missions declare.
Count: TypeAlias = Annotated[int, Field(ge=1, le=1_000_000)]
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

    def holder() -> None: ...

    holder.__annotations__ = {"it": annotation}
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
    inner, *metadata = get_args(hint)
    bounds = _bounds(metadata)
    low = next((name for name in ("ge", "gt") if name in bounds), "")
    high = next((name for name in ("le", "lt") if name in bounds), "")
    if low and high:
        opening, closing = "[" if low == "ge" else "(", "]" if high == "le" else ")"
        return f"in {opening}{bounds[low]}, {bounds[high]}{closing}"
    if name := low or high:
        return f"{_COMPARED[name]} {bounds[name]}"
    return range_text(inner)


def _bounds(metadata: Iterable[Any]) -> dict[str, str]:
    """Collect the bounds that constraints state, such as ``Ge(1)`` or a pydantic ``Field``."""
    parts = [
        part
        for constraint in metadata
        for part in (constraint.metadata if isinstance(constraint, FieldInfo) else [constraint])
    ]
    return {
        name: bound_text(bound)
        for part in parts
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


Error: TypeAlias = Mapping[str, Any]

_EXPECTED = {
    "int_type": "to be an integer",
    "float_type": "to be a number",
    "bool_type": "to be true or false",
    "string_type": "to be a text",
    "none_required": "to be null",
    "list_type": "to be a list",
    "tuple_type": "to be a tuple",
    "dict_type": "to be a mapping",
    "mapping_type": "to be a mapping",
    "model_type": "to be a mapping",
    "literal_error": "to be {expected}",
    "enum": "to be {expected}",
    "is_instance_of": "to be of type {class}",
    "finite_number": "to be a finite number",
    "multiple_of": "to be a multiple of {multiple_of}",
    "greater_than": "> {gt}",
    "greater_than_equal": ">= {ge}",
    "less_than": "< {lt}",
    "less_than_equal": "<= {le}",
    "too_short": "to have {min_length} or more entries",
    "too_long": "to have at most {max_length} entries",
    "string_too_short": "to have {min_length} or more characters",
    "string_too_long": "to have at most {max_length} characters",
}
# A text that means a number is not a number, and 1.5 is not an integer: the same as another type.
_ALIKE = {"int_parsing": "int_type", "int_from_float": "int_type", "float_parsing": "float_type"}
_ALIKE |= {"bool_parsing": "bool_type", "int_parsing_size": "int_type"}
_BOUNDS = frozenset({"greater_than", "greater_than_equal", "less_than", "less_than_equal"})
_NUMBERS = frozenset({"int_type", "float_type", "finite_number"})


def fault_messages(name: str, value: Any, errors: Iterable[Error], bounds: str = "") -> list[str]:
    """Describe what is wrong with a value that is called ``name``, a message for each of its parts.

    ``bounds`` is the range that it has to be in, as :func:`range_text` gives it.
    """
    found: dict[tuple[Any, ...], list[Error]] = {}
    for error in errors:
        found.setdefault(way_into(value, error["loc"]), []).append(error)
    # Of a union, the branch that got furthest is the one that was meant.
    depth = max(map(len, found), default=0)
    messages = []
    for way, those in found.items():
        if len(way) == depth:
            part = "".join(f"[{key!r}]" for key in way)
            messages.append(wrong_value(name + part, *those, bounds="" if way else bounds))
    return messages


def way_into(value: Any, location: Sequence[Any]) -> tuple[Any, ...]:
    """Leave out of a location what names types rather than parts of the value."""
    way = []
    for key in location:
        try:
            value = value[key]
        except (TypeError, LookupError):
            continue
        way.append(key)
    return tuple(way)


def own_message(error: Error) -> str:
    """Return what a validator raised, or else what pydantic says."""
    return str((error.get("ctx") or {}).get("error", error["msg"]))


def wrong_value(name: str, *errors: Error, bounds: str = "") -> str:
    """Describe what is wrong with one value, given an error for each type that it may have."""
    got = f"got {quoted(errors[0]['input'])}."
    kinds = [_ALIKE.get(error["type"], error["type"]) for error in errors]
    ranged = sum(kind in _BOUNDS or kind in _NUMBERS for kind in kinds) == 1  # else: whose range?
    phrases = []
    for kind, error in zip(kinds, errors, strict=True):
        details = error.get("ctx") or {}
        if kind == "missing":
            return f"Expected {name} to have {error['loc'][-1]!r}, {got}"
        if kind not in _EXPECTED:
            return f"{name}: {own_message(error).rstrip('.')}, {got}"
        phrase = _EXPECTED[kind].format(**{key: bound_text(d) for key, d in details.items()})
        if bounds and ranged and kind in _BOUNDS:
            phrase = bounds
        elif bounds and ranged and kind in _NUMBERS:
            phrase = f"{phrase} {bounds}"
        phrases.append(phrase)
    first, *rest = dict.fromkeys(phrases)
    expected = " or ".join([first, *(phrase.removeprefix("to be ") for phrase in rest)])
    return f"Expected {name} {expected}, {got}"
