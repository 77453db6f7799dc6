"""Texts and other values in a study file: which are allowed, and how they are written."""

import functools
import json
import re
from collections import Counter
from collections.abc import Sequence
from typing import Annotated, Any

from pydantic import AfterValidator, Field, StringConstraints

from botohe_moo.base.messages import quoted

_NAME = r"^[A-Za-z0-9][A-Za-z0-9._-]*$"


def value_text(value: Any) -> str:
    """Return a parameter's value as a study file has it: a text as it is, all others as JSON."""
    return value if isinstance(value, str) else json.dumps(value, ensure_ascii=False)


def canonical(value: Any) -> str:
    """Return any value of a study file as a text; equal values give equal texts."""
    return json.dumps(_whole_numbers(value), sort_keys=True, separators=(",", ":"))


def _whole_numbers(value: Any) -> Any:
    """Replace 1.0 by 1 and so on, which are the same numbers."""
    if isinstance(value, float) and value.is_integer():
        return int(value)
    if isinstance(value, dict):
        return {key: _whole_numbers(item) for key, item in value.items()}
    return [_whole_numbers(item) for item in value] if isinstance(value, list | tuple) else value


def _check_line(value: str) -> str:
    """Refuse a text that a line of a figure or table cannot show."""
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


def check_distinct(what: str, values: Sequence[Any]) -> Sequence[Any]:
    """Refuse values of which two are equal, as 1 and 1.0 are."""
    texts = [canonical(value) for value in values]
    text, count = Counter(texts).most_common(1)[0] if texts else ("", 1)
    if count > 1:
        value = quoted(values[texts.index(text)])
        raise ValueError(f"expected each {what} once; {value} is there {count} times")
    return values


def all_distinct(what: str) -> AfterValidator:
    """Return :func:`check_distinct` as a check of a type."""
    return AfterValidator(functools.partial(check_distinct, what))


Text = Annotated[str, StringConstraints(min_length=1, max_length=200), AfterValidator(_check_line)]
# matplotlib leaves labels that begin with _ out of legends.
Label = Annotated[Text, _matching("[^_].*", "a label that does not begin with _")]
Name = Annotated[
    str,
    StringConstraints(max_length=100),
    _matching(
        _NAME, "letters, digits, dots, dashes and underscores, the first a letter or a digit"
    ),
    Field(json_schema_extra={"pattern": _NAME}),
]
