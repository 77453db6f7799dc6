"""What is wrong with the shape of a study file's content: keys, types, ranges, in its own words."""

import difflib
import json
import types
import typing
from collections.abc import Iterator, Mapping, Sequence
from typing import Annotated, Any, TypeAlias, get_args

from pydantic import BaseModel, ValidationError

from botohe_moo._base.checks import nearest_first, quoted
from botohe_moo._plugins.messages import wrong_value
from botohe_moo.study.file.config import NAME_PATTERN, StudyFile

Place: TypeAlias = tuple[int | str, ...]

MAX_FAULTS = 100  # to read at once
_ENTRIES = {"missions": "mission", "algorithms": "algorithm"}


class Faults:
    """What is wrong with a study file: each fault once, and at most ``MAX_FAULTS`` of them."""

    def __init__(self) -> None:
        self._found: dict[tuple[Place, str], None] = {}

    def add(self, place: Place, message: str) -> None:
        """Note a fault."""
        if not self.full:
            self._found[place, " ".join(message.split())] = None  # a fault is a line

    @property
    def full(self) -> bool:
        """Whether there are so many that no others are looked for."""
        return len(self._found) >= MAX_FAULTS

    def __iter__(self) -> Iterator[tuple[Place, str]]:
        return iter(self._found)

    def __len__(self) -> int:
        return len(self._found)


def file_faults(content: Any) -> Iterator[tuple[Place, str]]:
    """Find what is wrong with the shape of a study file's content: where, and what."""
    if not isinstance(content, dict):
        found = "nothing" if content is None else quoted(content)
        yield (), f"expected a mapping with the keys of a study, found {found}."
        return
    try:
        StudyFile.model_validate(content)
    except ValidationError as invalid:
        errors = invalid.errors(include_url=False)
        unknown: dict[Place, list[str]] = {}
        for error in errors:
            if error["type"] == "extra_forbidden":
                unknown.setdefault(error["loc"][:-1], []).append(str(error["loc"][-1]))
        for error in errors:
            others = unknown.get(error["loc"][:-1], ())
            if error["type"] == "missing" and misspelt(str(error["loc"][-1]), others):
                continue  # the misspelt key is reported, and says what it should have been
            place = _written(content, error["loc"])
            yield place, _said(place, error)


def misspelt(name: str, words: Sequence[str]) -> str | None:
    """Find the word that was probably meant to be a name; None if there is none."""
    near = difflib.get_close_matches(name, [word[:100] for word in words[:1_000]], n=1)
    return near[0] if near else None


def _written(content: Mapping[str, Any], location: Sequence[int | str]) -> Place:
    """Give the path in the file: what is written in short has no keys of its own."""
    place: list[int | str] = []
    value: Any = content
    for step in location:
        if step == "[key]":
            continue
        if not isinstance(value, dict | list) or (
            place == ["seeds"] and isinstance(step, str) and isinstance(value, list)
        ):
            continue
        place.append(step)
        if isinstance(value, list) and isinstance(step, str):  # a name in a list of names
            value = step if step in value else None
        else:
            known = dict(enumerate(value)) if isinstance(value, list) else value
            value = known.get(step, {})
    return tuple(place)


def _said(place: Place, found: Any) -> str:
    """Say in a sentence what pydantic has found."""
    kind, value = found["type"], found["input"]
    name = printable(place[-1]) if place else "the study"
    if place and isinstance(place[-1], int):
        name = f"{place[-2]}[{place[-1]}]"
    if kind == "extra_forbidden":
        known = ", ".join(nearest_first(name, _known_keys(place[:-1])))
        return f"there is no key {quoted(place[-1])}; known are {known}."
    if kind == "missing":
        return f"expected the key {name!r}, which is missing."
    if kind == "value_error":
        return f"{found['ctx']['error']}."
    if found["loc"][-1:] == ("[key]",):
        name = "a label"
        if value == "":
            return "expected a label, got an empty one."
    if expected := _expected_entry(place, kind):
        return _instead(name, expected, value)
    if kind == "string_too_short" and len(place) == 2:
        return "expected a name, got an empty one."
    if kind in ("too_short", "string_too_short"):
        return f"Expected {name} not to be empty, got {quoted(value)}."
    if kind == "string_pattern_mismatch":
        how = "in one line, without spaces around it"
        if found["ctx"]["pattern"] == NAME_PATTERN:
            how = "of letters, digits, dots, dashes and underscores"
        return f"Expected {name} {how}, got {quoted(value)}."
    if kind in ("model_type", "dict_type", "model_attributes_type"):
        seeds = place == ("seeds",)
        return _instead(name, "a count, or a list of seeds" if seeds else "a mapping", value)
    if kind == "string_too_long":
        most = found["ctx"]["max_length"]
        return f"Expected {name} of at most {most} characters, got one of {len(value)}."
    if kind == "string_unicode":
        return f"Expected {name} of characters that exist, got half of one."
    if kind == "string_type":
        return _instead(name, "a text", value)
    return wrong_value(name, found)


def _expected_entry(place: Place, kind: str) -> str | None:
    """Say what may stand for the missions and algorithms, or one of them."""
    key = _ENTRIES.get(str(place[0])) if place else None
    if key is None or kind not in ("model_type", "model_attributes_type", "dict_type"):
        return None
    if len(place) == 1:
        return f"a mapping from labels to {key}s, or a list of names"
    return f"a name, or a mapping with {key}: NAME" if len(place) == 2 else None


def _instead(name: str, expected: str, value: Any) -> str:
    """Say what was expected; a number that is meant as a text has to be in quotes."""
    if value is None:
        return f'"{name}:" has no value: expected {expected}.'
    said = f"Expected {name} to be {expected}, got {quoted(value)}"
    names = value if isinstance(value, list) and "list of names" in expected else [value]
    numbers = [name for name in names if isinstance(name, bool | int | float)]
    if numbers and (isinstance(value, list) or expected.startswith(("a text", "a name"))):
        shown = json.dumps(numbers[0])
        said += f'; put it in quotes: "{shown}"' if len(shown) < 50 else "; put it in quotes"
    return f"{said}."


def printable(step: int | str) -> str:
    """Write a key so that it stays in its line, and can be seen."""
    text = str(step)
    return text if text and text.isprintable() and len(text) <= 100 else quoted(text)


def _known_keys(place: Place) -> list[str]:
    """List the keys that may stand where a path leads to."""
    known: Any = StudyFile
    for step in place:
        if isinstance(known, type) and issubclass(known, BaseModel):
            known = known.model_fields[str(step)].annotation
        else:  # a mapping from labels to entries
            known = get_args(known)[1]
        while typing.get_origin(known) in (Annotated, typing.Union, types.UnionType):
            known = get_args(known)[0]
    return list(known.model_fields)
