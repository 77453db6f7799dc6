"""Texts and values in a study file: what they may be, and how they are written as texts."""

import functools
import json
import re
from collections import Counter
from collections.abc import Sequence
from typing import Annotated, Any

from pydantic import AfterValidator, Field, StringConstraints

from botohe_moo._base.checks import quoted

_NAME = r"^[A-Za-z0-9][A-Za-z0-9._-]*$"


def value_text(value: Any) -> str:
    """Write a parameter's value as a study file would: a text as it is, all others as JSON."""
    return value if isinstance(value, str) else json.dumps(value, ensure_ascii=False)


def canonical(value: Any) -> str:
    """Write what a study file can hold so that equal values give equal texts."""
    return json.dumps(_one_number(value), sort_keys=True, separators=(",", ":"))


def _one_number(value: Any) -> Any:
    """Write 1.0 as 1: whether a number may be one is checked before, and it is the same number."""
    if isinstance(value, float) and value.is_integer():
        return int(value)
    if isinstance(value, dict):
        return {key: _one_number(item) for key, item in value.items()}
    return [_one_number(item) for item in value] if isinstance(value, list | tuple) else value


def _text(value: str) -> str:
    """Refuse what a line of a figure or of a table cannot show."""
    if not value.isprintable() or value != value.strip():
        expected = "one line of printable characters without spaces around it"
        raise ValueError(f"expected {expected}, got {quoted(value)}")
    return value


def _matching(pattern: str, expected: str) -> AfterValidator:
    """Refuse texts that do not match a regular expression; ``expected`` says the same in words."""

    def check(value: str) -> str:
        if not re.fullmatch(pattern, value):
            raise ValueError(f"expected {expected}, got {quoted(value)}")
        return value

    return AfterValidator(check)


def different(what: str, values: Sequence[Any]) -> Sequence[Any]:
    """Refuse a list that has something twice; 1 and 1.0 are the same."""
    texts = [canonical(value) for value in values]
    text, count = Counter(texts).most_common(1)[0] if texts else ("", 1)
    if count > 1:
        value = quoted(values[texts.index(text)])
        raise ValueError(f"expected each {what} once; {value} is there {count} times")
    return values


def once(what: str) -> AfterValidator:
    """Return :func:`different` as a check of a type."""
    return AfterValidator(functools.partial(different, what))


Text = Annotated[str, StringConstraints(min_length=1, max_length=200), AfterValidator(_text)]
# Legends of matplotlib hide what begins with _.
Label = Annotated[Text, _matching("[^_].*", "a label that does not begin with _")]
Name = Annotated[
    str,
    StringConstraints(max_length=100),
    _matching(
        _NAME, "letters, digits, dots, dashes and underscores, the first a letter or a digit"
    ),
    Field(json_schema_extra={"pattern": _NAME}),
]
