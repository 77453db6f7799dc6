"""YAML texts as plain values, with the line of each value."""

from __future__ import annotations

import math
import re
from collections.abc import Iterator, Sequence
from typing import Any, NamedTuple

import yaml

# The parser in C takes a thirtieth of the time. The other one tells more of what it found.
_PARSERS: tuple[Any, ...] = (getattr(yaml, "CSafeLoader", yaml.SafeLoader), yaml.SafeLoader)
_UNPRINTABLE = re.compile(r"[^\t\n\r -~\x85\xa0-\ud7ff\ue000-\ufffd\U00010000-\U0010ffff]")
# What plain scalars are in the core schema of YAML 1.2; digits may have underscores between them.
_WORDS: dict[str, Any] = {
    **dict.fromkeys(("", "~", "null", "Null", "NULL")),
    **dict.fromkeys(("true", "True", "TRUE"), True),
    **dict.fromkeys(("false", "False", "FALSE"), False),
    **dict.fromkeys((".inf", ".Inf", ".INF", "+.inf", "+.Inf", "+.INF"), math.inf),
    **dict.fromkeys(("-.inf", "-.Inf", "-.INF"), -math.inf),
    **dict.fromkeys((".nan", ".NaN", ".NAN"), math.nan),
}
_INTEGER = re.compile(r"[-+]?\d[\d_]*|0o[0-7][0-7_]*|0x[\da-fA-F][\da-fA-F_]*", re.ASCII)
_FLOAT = re.compile(r"[-+]?(?:\d[\d_]*(?:\.[\d_]*)?|\.\d[\d_]*)(?:[eE][-+]?\d+)?", re.ASCII)
_NUMERIC = frozenset("0123456789+-.")


class DocumentError(ValueError):
    """A text cannot be read as YAML; says in which line, and why."""

    def __init__(self, line: int, why: str) -> None:
        super().__init__(f"{line}: not valid YAML: {' '.join(why.split())}.")


class _Node(NamedTuple):
    """A value, and its items or entries: of each the line and the node, by its index or key."""

    content: Any
    parts: list[tuple[int, Any]] | dict[str, tuple[int, Any]] = {}  # noqa: RUF012
    text: str | None = None  # of a scalar, as it is written


class Document:
    """The content of a YAML text, and the line of every value.

    Plain scalars are what they are in the core schema of YAML 1.2: ``yes``, dates and ``1:30`` are
    texts. Keys are texts, too, and ``<<`` merges mappings. Nothing in the text is executed.

    Raises
    ------
    DocumentError
        If the text is not valid YAML, repeats a key, or has a tag that is not plain YAML.
    """

    def __init__(self, text: str) -> None:
        if found := _UNPRINTABLE.search(text):
            line = text.count("\n", 0, found.start()) + 1
            raise DocumentError(line, f"special characters are not allowed (#x{ord(found[0]):04x})")
        in_c, in_python = _PARSERS
        try:
            try:
                self._root = _Composer(in_c(text)).root()
            except yaml.MarkedYAMLError:
                self._root = _Composer(in_python(text)).root()
        except yaml.MarkedYAMLError as error:
            raise DocumentError(*_explained(error)) from None
        except RecursionError as error:
            raise DocumentError(1, str(error)) from None
        self.content: Any = self._root.content

    def line(self, place: Sequence[int | str]) -> int:
        """Return the line of the key or item at a place, or of the nearest one above it."""
        node, line = self._root, 1
        for step in place:
            parts = node.parts
            if isinstance(parts, dict) and str(step) in parts:
                line, node = parts[str(step)]
            elif isinstance(parts, list) and isinstance(step, int) and step < len(parts):
                line, node = parts[step]
        return line


class _Composer:
    """Makes nodes of the events of a parser."""

    def __init__(self, parser: Any) -> None:
        self._next = parser.get_event
        self._anchors: dict[str, _Node] = {}

    def root(self) -> _Node:
        """Return the node of the only document; one of nothing if there is none."""
        self._next()  # the stream starts
        if not isinstance(self._next(), yaml.DocumentStartEvent):
            return _Node(None)
        root = self._node(self._next())
        self._next()  # the document ends
        if not isinstance(event := self._next(), yaml.StreamEndEvent):
            raise _error(event, "expected one document, found another")
        return root

    def _node(self, event: Any) -> _Node:
        """Return the node that starts with an event."""
        if isinstance(event, yaml.ScalarEvent):
            node = _Node(_scalar(event), text=event.value)
        elif isinstance(event, yaml.SequenceStartEvent):
            _check_tag(event, "seq")
            items = [(_line(first), self._node(first)) for first in self._starts()]
            node = _Node([item.content for _, item in items], items)
        elif isinstance(event, yaml.MappingStartEvent):
            _check_tag(event, "map")
            entries = self._entries(event)
            node = _Node({key: value.content for key, (_, value) in entries.items()}, entries)
        elif event.anchor in self._anchors:
            return self._anchors[event.anchor]
        else:
            raise _error(event, f"expected an alias of a value before it, found *{event.anchor}")
        if event.anchor:
            self._anchors[event.anchor] = node
        return node

    def _starts(self) -> Iterator[Any]:
        """Yield the first event of each node until their sequence or mapping ends."""
        while not isinstance(event := self._next(), yaml.CollectionEndEvent):
            yield event

    def _entries(self, start: Any) -> dict[str, tuple[int, _Node]]:
        """Return the entries of a mapping, first those that are merged into it."""
        where = f"while constructing a mapping (line {_line(start)})"
        own: dict[str, tuple[int, _Node]] = {}
        merged: dict[str, tuple[int, _Node]] | None = None
        for event in self._starts():
            is_scalar = isinstance(event, yaml.ScalarEvent)
            key = event.value if is_scalar and not event.anchor else self._node(event).text
            if key is None:
                problem = "expected a text as a key of a mapping, found a list or a mapping"
                raise _error(event, problem)
            is_merge = is_scalar and key == "<<" and event.implicit[0]
            if (is_merge and merged is not None) or (not is_merge and key in own):
                raise _error(event, f'{where}: found duplicate key "{key}"')
            value = self._node(self._next())
            if is_merge:
                merged = _merged(value)
                if merged is None:
                    raise _error(event, f"{where}: expected a mapping or list of mappings to merge")
            else:
                own[key] = _line(event), value
        return {**(merged or {}), **own}


def _merged(value: _Node) -> dict[str, tuple[int, _Node]] | None:
    """Return the entries of a mapping, or of a list of mappings: those of the first one count."""
    mappings = [node for _, node in value.parts] if isinstance(value.parts, list) else [value]
    entries: dict[str, tuple[int, _Node]] = {}
    for mapping in reversed(mappings):
        if not isinstance(mapping.content, dict):
            return None
        entries.update(mapping.parts)
    return entries


def _scalar(event: Any) -> Any:
    """Return the value of a scalar: what its tag says, or what it looks like if it is plain."""
    if event.tag is None:
        read = _plain if event.implicit[0] else str
    elif event.tag in _BY_TAG:
        read = _BY_TAG[event.tag]
    else:
        raise _error(event, f"could not determine a constructor for the tag {event.tag!r}")
    try:
        return read(event.value)
    except ValueError as error:
        raise _error(event, str(error)) from None


def _plain(text: str) -> Any:
    if text in _WORDS:
        return _WORDS[text]
    if text[0] in _NUMERIC:
        if _INTEGER.fullmatch(text):
            return _integer(text)
        if _FLOAT.fullmatch(text):
            return _float(text)
    return text


def _float(text: str) -> float:
    word = _WORDS.get(text)
    return word if isinstance(word, float) else float(text.replace("_", ""))


def _integer(text: str) -> int:
    return int(text.replace("_", ""), 0 if text[:2] in ("0o", "0x") else 10)


def _boolean(text: str) -> bool:
    if text.lower() not in ("true", "false"):
        raise ValueError(f"expected true or false, found {text!r}")
    return text.lower() == "true"


def _null(_: str) -> None:
    return None


_TAG = "tag:yaml.org,2002:"
_BY_TAG: dict[str, Any] = {
    "!": str,
    f"{_TAG}null": _null,
    f"{_TAG}bool": _boolean,
    f"{_TAG}int": _integer,
    f"{_TAG}float": _float,
    f"{_TAG}str": str,
    f"{_TAG}timestamp": str,  # YAML 1.2 has no dates
}


def _check_tag(event: Any, kind: str) -> None:
    if event.tag not in (None, "!", f"{_TAG}{kind}"):
        raise _error(event, f"could not determine a constructor for the tag {event.tag!r}")


def _line(event: Any) -> int:
    line: int = event.start_mark.line + 1
    return line


def _error(event: Any, problem: str) -> DocumentError:
    return DocumentError(_line(event), problem)


def _explained(error: Any) -> tuple[int, str]:
    """Return the line of an error of the parser, and its words without excerpts of the text."""
    problem, mark = error.problem or "", error.problem_mark or error.context_mark
    if error.context and error.context_mark:
        problem = f"{error.context} (line {error.context_mark.line + 1}): {problem}"
    return mark.line + 1, problem
