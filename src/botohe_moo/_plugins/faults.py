"""What pydantic finds wrong with a value, in the words of this package."""

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, TypeAlias, TypeVar

from pydantic import BaseModel, ValidationError

from botohe_moo._base.checks import FaultsError, nearest_first, quoted
from botohe_moo._plugins.types import bound_text

M = TypeVar("M", bound=BaseModel)
Error: TypeAlias = Mapping[str, Any]  # one of pydantic's `ErrorDetails`
Place: TypeAlias = tuple[Any, ...]  # the keys and indices that lead to a value

_EXPECTED = {
    "int_type": "to be an integer",
    "float_type": "to be a number",
    "bool_type": "to be true or false",
    "string_type": "to be a text",
    "none_required": "to be null",
    "list_type": "to be a list",
    "tuple_type": "to be a list",
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
# A text that could be read as a number, and 1.5 for an integer, are values of another type.
_ALIKE = {"int_parsing": "int_type", "int_from_float": "int_type", "float_parsing": "float_type"}
_ALIKE |= {"bool_parsing": "bool_type", "int_parsing_size": "int_type"}
_BOUNDS = frozenset({"greater_than", "greater_than_equal", "less_than", "less_than_equal"})
_NUMBERS = frozenset({"int_type", "float_type", "finite_number"})


def fault_messages(name: str, value: Any, errors: Iterable[Error], bounds: str = "") -> list[str]:
    """Describe what is wrong with a value that is called ``name``, a message for each of its parts.

    ``bounds`` is the range that it has to be in, as :func:`range_text` gives it.
    """
    found: dict[Place, list[Error]] = {}
    for error in errors:
        found.setdefault(way_into(value, error["loc"]), []).append(error)
    # Of a union, the type that fits the deepest part was meant.
    depth = max(map(len, found), default=0)
    messages = []
    for way, those in found.items():
        if len(way) == depth:
            part = "".join(f"[{key!r}]" for key in way)
            messages.append(wrong_value(name + part, *those, bounds="" if way else bounds))
    return messages


def way_into(value: Any, location: Sequence[Any]) -> Place:
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
    # Of two numeric types, nothing says which one the range belongs to.
    ranged = sum(kind in _BOUNDS or kind in _NUMBERS for kind in kinds) == 1
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


def content_faults(
    content: Any,
    invalid: ValidationError,
    known_keys: Callable[[Place], Sequence[str]] = lambda _: (),
) -> Iterator[tuple[Place, str]]:
    """Yield each place of a file's content at which something is wrong, and a sentence about it.

    ``known_keys`` returns the keys that the mapping at a place may have.
    """
    found: dict[Place, list[Error]] = {}
    for error in invalid.errors(include_url=False):
        place = way_into(content, error["loc"])
        if not place or error["type"] == "missing":
            place += error["loc"][-1:]  # a key that is not there
        found.setdefault(place, []).append(error)
    for place, errors in found.items():
        kind, name = errors[0]["type"], "the file"
        for key in place:
            name = key if isinstance(key, str) else f"{name}[{key}]"
        if kind == "missing":
            said = f"expected the key {name!r}, which is missing."
        elif kind == "extra_forbidden":
            known = ", ".join(nearest_first(name, known_keys(place[:-1])))
            said = f"there is no key {quoted(name)}{f'; known are {known}' if known else ''}."
        elif kind == "value_error":
            said = f"{own_message(errors[0]).rstrip('.')}."
        else:
            said = wrong_value(name, *errors).removeprefix(f"{name}: ")
        yield place, said


def validated(content: Any, model: type[M], line: Callable[[Place], int] | None = None) -> M:
    """Return the content of a file as a model; a FaultsError lists all faults.

    They begin with the line that ``line`` returns for the place of a fault.
    """
    try:
        return model.model_validate(content)
    except ValidationError as invalid:
        faults = []
        for place, said in content_faults(content, invalid):
            where = f"line {line(place)}: " if line else ""
            faults.append(f"{where}{said[0].lower()}{said[1:].rstrip('.')}")
        raise FaultsError(faults, "The file") from None


def json_record(path: Path, data: bytes, model: type[M]) -> M:
    """Return the content of a JSON file that this package wrote; a ValueError names one fault."""
    try:
        return model.model_validate_json(data)
    except ValidationError as error:
        first = error.errors()[0]
    if first["type"] == "json_invalid":
        raise ValueError(f"{path}: {first['msg']}.")
    way = first["loc"][:-1] if first["type"] == "missing" else first["loc"]
    name = ".".join(map(str, way)) or "its content"
    raise ValueError(f"{path}: {wrong_value(name, first)}")
