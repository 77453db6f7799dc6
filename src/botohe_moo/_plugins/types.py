"""What types say of values, in this package's words: ranges, faults, and what texts can hold.

pydantic checks; its strict rules hold: "100" is no integer, 1.5 and True are none either, but an
integer is a number.
"""

from __future__ import annotations

import collections.abc
import enum
import types
from collections.abc import Iterable, Mapping, Sequence
from numbers import Integral, Number, Real
from typing import Annotated, Any, Literal, TypeAlias, Union, get_args, get_origin

import numpy as np
from pydantic import ConfigDict, PydanticUserError, TypeAdapter, ValidationError
from pydantic.fields import FieldInfo

from botohe_moo._base.checks import quoted

__all__ = [
    "UNIONS",
    "bounds_text",
    "fault_messages",
    "is_plain",
    "plain_number",
    "range_text",
    "type_text",
    "value_faults",
    "wrong_value",
]

Error: TypeAlias = Mapping[str, Any]

UNIONS = (Union, types.UnionType)
# What lists and mappings of a text file can stand for.
_LISTS = (list, Sequence, Iterable, collections.abc.Collection)
_MAPPINGS = (dict, Mapping, collections.abc.MutableMapping)
_SCALARS = (int, float, bool, str, object, Any, Number, Real, Integral)

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
    "literal_error": "to be {expected}",
    "enum": "to be {expected}",
    "is_instance_of": "to be of type {class}",
    "finite_number": "to be a finite number",
    "multiple_of": "to be a multiple of {multiple_of}",
    "greater_than": "> {gt}",
    "greater_than_equal": ">= {ge}",
    "less_than": "< {lt}",
    "less_than_equal": "<= {le}",
}
# Texts that mean numbers are no numbers, and 1.5 is no integer: the same as another type.
_ALIKE = {"int_parsing": "int_type", "int_from_float": "int_type", "float_parsing": "float_type"}
_ALIKE |= {"bool_parsing": "bool_type", "int_parsing_size": "int_type"}
_BOUNDS = frozenset({"greater_than", "greater_than_equal", "less_than", "less_than_equal"})


def value_faults(name: str, value: Any, hint: Any) -> list[str]:
    """Say what keeps a value from being of a type; what pydantic cannot check is in order.

    Parameters
    ----------
    name
        What to call the value.
    value
        What is checked; iterators are not consumed.
    hint
        A type, with ``Annotated`` constraints where it has a range.
    """
    if hint is Any:
        return []
    value = plain_number(value)
    try:
        adapter = _adapter(hint)
    except Exception:  # whatever another package's type does when it is looked at
        return []
    try:
        adapter.validate_python(value, strict=True)
    except ValidationError as error:
        return fault_messages(name, value, error.errors(include_url=False), range_text(hint))
    except Exception as error:  # whatever another package's validator raises
        return [f"{name}: {type(error).__name__}: {error}"]
    return []


def _adapter(hint: Any) -> TypeAdapter[Any]:
    try:
        return TypeAdapter(hint, config=ConfigDict(arbitrary_types_allowed=True))
    except PydanticUserError:  # pydantic's own models bring their configuration
        return TypeAdapter(hint)


def fault_messages(name: str, value: Any, errors: Iterable[Error], bounds: str = "") -> list[str]:
    """Put what pydantic found wrong with a value into this package's words.

    Parameters
    ----------
    name, value
        What the errors are about.
    errors
        From pydantic; their locations begin in ``value``.
    bounds
        The range that the value has to be in, as :func:`range_text` gives it.
    """
    found: dict[tuple[Any, ...], list[Error]] = {}
    for error in errors:
        found.setdefault(_way_into(value, error["loc"]), []).append(error)
    # Of a union, the branch that got furthest is the one that was meant.
    depth = max(map(len, found), default=0)
    messages = []
    for way, those in found.items():
        if len(way) == depth:
            part = "".join(f"[{key!r}]" for key in way)
            messages.append(wrong_value(name + part, *those, bounds="" if way else bounds))
    return messages


def _way_into(value: Any, location: Sequence[Any]) -> tuple[Any, ...]:
    """Leave out of a location what names types rather than parts of the value."""
    way = []
    for key in location:
        try:
            value = value[key]
        except (TypeError, LookupError):
            continue
        way.append(key)
    return tuple(way)


def wrong_value(name: str, *errors: Error, bounds: str = "") -> str:
    """Put what pydantic found wrong with one value into a sentence.

    Parameters
    ----------
    name
        What to call the value.
    *errors
        From pydantic, one for each type that the value may have.
    bounds
        The range that the value has to be in, as :func:`range_text` gives it.
    """
    got = f"got {quoted(errors[0]['input'])}."
    phrases = []
    for error in errors:
        kind = _ALIKE.get(error["type"], error["type"])
        details = error.get("ctx") or {}
        if kind == "missing":
            return f"Expected {name} to have {error['loc'][-1]!r}, {got}"
        if kind not in _EXPECTED:
            return f"{name}: {str(details.get('error', error['msg'])).rstrip('.')}, {got}"
        details = {key: _bound_text(detail) for key, detail in details.items()}
        phrase = _EXPECTED[kind].format(**details)
        if bounds and len(errors) == 1:
            if kind in _BOUNDS:
                phrase = bounds
            elif kind in ("int_type", "float_type"):
                phrase = f"{phrase} {bounds}"
        phrases.append(phrase)
    first, *rest = dict.fromkeys(phrases)
    expected = " or ".join([first, *(phrase.removeprefix("to be ") for phrase in rest)])
    return f"Expected {name} {expected}, {got}"


def plain_number(value: Any) -> Any:
    """Give numpy's numbers, and other kinds of numbers, as Python's; all else as it is.

    Parameters
    ----------
    value
        Anything.
    """
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


def range_text(hint: Any) -> str:
    """Give the range that an ``Annotated`` type states: ``in (0, 1)``, ``>= 1``; may be empty."""
    if get_origin(hint) in UNIONS:
        return " or ".join(filter(None, map(range_text, get_args(hint))))
    if get_origin(hint) is not Annotated:
        return ""
    inner, *metadata = get_args(hint)
    return bounds_text(metadata) or range_text(inner)


def bounds_text(metadata: Iterable[Any]) -> str:
    """Give the range that constraints state, such as ``Ge(1)`` or a pydantic ``Field``."""
    bounds: dict[str, str] = {}
    names = ("gt", "ge", "lt", "le", "multiple_of", "min_length", "max_length", "pattern")
    for constraint in metadata:
        inner = constraint.metadata if isinstance(constraint, FieldInfo) else [constraint]
        for part in inner:
            bounds |= {
                name: _bound_text(bound)
                for name in names
                if (bound := getattr(part, name, None)) is not None and not callable(bound)
            }
    low = bounds.get("ge", bounds.get("gt"))
    high = bounds.get("le", bounds.get("lt"))
    texts = []
    if low is not None and high is not None:
        opening, closing = "[" if "ge" in bounds else "(", "]" if "le" in bounds else ")"
        texts.append(f"in {opening}{low}, {high}{closing}")
    elif low is not None:
        texts.append(f"{'>=' if 'ge' in bounds else '>'} {low}")
    elif high is not None:
        texts.append(f"{'<=' if 'le' in bounds else '<'} {high}")
    for name, words in (
        ("multiple_of", "a multiple of"),
        ("min_length", "of length >="),
        ("max_length", "of length <="),
        ("pattern", "like"),
    ):
        if bounds.get(name, "0") != "0":
            texts.append(f"{words} {bounds[name]}")
    return ", ".join(texts)


def _bound_text(bound: Any) -> str:
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


def is_plain(hint: Any) -> bool:
    """Whether numbers, flags, texts, or lists and mappings of them can be of this type."""
    origin, args = get_origin(hint), get_args(hint)
    if origin is Annotated:
        return is_plain(args[0])
    if origin in UNIONS:
        return any(map(is_plain, args))
    if origin in _LISTS or origin in _MAPPINGS:
        return all(map(is_plain, args))
    return origin is Literal or hint in (*_SCALARS, *_LISTS, *_MAPPINGS)
