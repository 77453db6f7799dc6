"""A YAML document as plain values, with the line of each of them."""

import re
from collections.abc import Hashable, Iterator, Sequence
from dataclasses import dataclass, field
from typing import Any, Self

import yaml
from yaml.nodes import MappingNode, Node, ScalarNode, SequenceNode

from botohe_moo._base.checks import quoted
from botohe_moo.study.file.syntax import syntax_fault

_MAX_NODES = 20_000  # counting those that aliases and merged mappings repeat
_MAX_DEPTH = 50
_MAX_DIGITS = 10_000  # a longer scalar is a text
_TOO_MANY = f"too large for a study file, which has at most {_MAX_NODES:,} values"
_TOO_DEEP = f"expected a study file, found more than {_MAX_DEPTH} levels"
_PLAIN = "tag:yaml.org,2002:"
_PATTERNS = {
    "null": r"~|null|Null|NULL|",
    "bool": r"true|True|TRUE|false|False|FALSE",
    "int": r"[-+]?[0-9](?:_?[0-9])*",
    "float": (
        r"[-+]?(?:[0-9](?:_?[0-9])*(?:\.[0-9]*)?|\.[0-9]+)(?:[eE][-+]?[0-9]+)?"
        r"|[-+]?\.(?:inf|Inf|INF)|\.(?:nan|NaN|NAN)"
    ),
    "merge": r"<<",
}


class _Loader(yaml.SafeLoader):
    """Reads numbers and flags as YAML 1.2 does, and refuses documents that are too large.

    YAML 1.1 reads 1e-2 as text, 1:30 as ninety, 010 as eight, and ``no`` and ``on`` as flags.
    """

    n_nodes = 0
    depth = 0

    def compose_node(self, parent: Node | None, index: int) -> Node | None:
        self.n_nodes += 1
        self.depth += 1
        if self.n_nodes > _MAX_NODES:
            raise _refused(self.peek_event(), _TOO_MANY)  # type: ignore[no-untyped-call]
        if self.depth > _MAX_DEPTH:
            raise _refused(self.peek_event(), _TOO_DEEP)  # type: ignore[no-untyped-call]
        node = super().compose_node(parent, index)
        self.depth -= 1
        return node

    def resolve(self, kind: type[Node], value: Any, implicit: Any) -> Any:
        if kind is ScalarNode and len(value) > _MAX_DIGITS:
            return f"{_PLAIN}str"
        return super().resolve(kind, value, implicit)  # type: ignore[no-untyped-call]


_Loader.yaml_implicit_resolvers = {}
for _tag, _first in (
    ("null", ["~", "n", "N", ""]),
    ("bool", list("tTfF")),
    ("int", list("-+0123456789")),
    ("float", list("-+.0123456789")),
    ("merge", ["<"]),
):
    _Loader.add_implicit_resolver(f"{_PLAIN}{_tag}", re.compile(f"^(?:{_PATTERNS[_tag]})$"), _first)


class _RefusedError(yaml.MarkedYAMLError):
    """Valid YAML that no study file may contain."""


def _refused(node: Any, problem: str) -> _RefusedError:
    return _RefusedError(problem=problem, problem_mark=node.start_mark)


@dataclass(frozen=True, order=True)
class Fault:
    """Something wrong in a line of a document."""

    line: int  # from 1
    message: str


@dataclass
class Document:
    """The content of a YAML text, and the line of every value."""

    content: Any = None  # mappings, lists, texts, numbers, flags and None
    faults: list[Fault] = field(default_factory=list)  # such as broken syntax and repeated keys
    _root: Node | None = None
    _n_nodes: int = 0

    @classmethod
    def parse(cls, text: str) -> Self:
        """Read a YAML text; nothing in it is executed. Errors are among the faults."""
        document = cls()
        loader = None
        try:
            loader = _Loader(text)
            document._root = loader.get_single_node()
            if document._root is not None:
                document.content = document._value(document._root, ())
        except _RefusedError as error:
            mark = error.problem_mark
            document._note(mark.line + 1 if mark else 1, f"{error.problem}.")
        except yaml.YAMLError as error:
            document._note(*syntax_fault(error, text))
        except RecursionError:
            document._note(1, "expected a study file, found thousands of levels.")
        except (ValueError, OverflowError):  # such as "\UFFFFFFFF"
            line = loader.get_mark().line + 1 if loader else 1
            document._note(line, "not valid YAML: expected characters and numbers that exist.")
        finally:
            if loader is not None:
                loader.dispose()
        document.faults = list(dict.fromkeys(document.faults))
        return document

    def _note(self, line: int, message: str) -> None:
        self.faults.append(Fault(line, message))

    def line(self, path: Sequence[int | str]) -> int:
        """Give the line of the key or item at a path, or of the last one on the way that exists."""
        node, line = self._root, 1
        for step in path:
            found = _child(node, step)
            if found is not None:
                line, node = found
        return line

    def _value(self, node: Node, above: tuple[Node, ...]) -> Any:
        self._count(node)
        if node in above:
            raise _refused(node, "an alias stands inside of what it stands for")
        if len(above) > _MAX_DEPTH:
            raise _refused(node, _TOO_DEEP)
        if isinstance(node, ScalarNode):
            return self._scalar(node)
        if node.tag not in (f"{_PLAIN}map", f"{_PLAIN}seq"):
            self._note(_line(node), f"expected plain YAML, found the tag {_tag_of(node)}.")
        if isinstance(node, MappingNode):
            self._note_repeated(node)
            self._merge(node, above)
            return {self._key(key): self._value(value, (*above, node)) for key, value in node.value}
        return [self._value(item, (*above, node)) for item in node.value]

    def _count(self, node: Node) -> None:
        self._n_nodes += 1
        if self._n_nodes > _MAX_NODES:
            raise _refused(node, _TOO_MANY)

    def _merge(self, node: MappingNode, above: tuple[Node, ...]) -> None:
        """Replace ``<<`` by the keys that it merges, before the mapping's own keys."""
        if not any(_merges(key) for key, _ in node.value):
            return
        merged: dict[Any, tuple[Node, Node]] = {}
        for pair in (*self._merged(node, (*above, node)), *node.value):
            if not _merges(pair[0]):
                self._count(pair[0])
                merged[pair[0].value if isinstance(pair[0], ScalarNode) else id(pair[0])] = pair
        node.value = list(merged.values())

    def _merged(self, node: MappingNode, above: tuple[Node, ...]) -> Iterator[tuple[Node, Node]]:
        """Give the keys that the ``<<`` of a mapping merge, in order of rising precedence."""
        for key, value in node.value:
            if not _merges(key):
                continue
            for source in reversed(value.value) if isinstance(value, SequenceNode) else [value]:
                if not isinstance(source, MappingNode):
                    raise _refused(source, "expected a mapping, or a list of mappings, after <<")
                if source in above:
                    raise _refused(source, "an alias stands inside of what it stands for")
                if len(above) > _MAX_DEPTH:
                    raise _refused(source, _TOO_DEEP)
                self._note_repeated(source)
                self._merge(source, above)
                yield from source.value

    def _scalar(self, node: ScalarNode) -> Any:
        kind, text = node.tag.removeprefix(_PLAIN), node.value
        if kind in ("str", "merge"):
            if any("\ud800" <= character <= "\udfff" for character in text):
                self._note(_line(node), "expected characters, found half of one.")
            return text
        known = kind in _PATTERNS and len(text) <= _MAX_DIGITS
        if not known or not re.fullmatch(_PATTERNS[kind], text):
            self._note(_line(node), f"expected plain YAML, found the tag {_tag_of(node)}.")
            return None
        if kind == "null":
            return None
        if kind == "bool":
            return text.lower() == "true"
        if kind == "float":
            return float(text.lower().replace(".inf", "inf").replace(".nan", "nan"))
        try:
            return int(text)
        except ValueError:
            self._note(_line(node), "expected a number of less than 4 300 digits.")
            return None

    def _key(self, node: Node) -> Hashable:
        # Labels are texts, even where YAML reads 2, true or null.
        if isinstance(node, ScalarNode):
            return str(node.value)
        raise _refused(node, "expected a text as a key, found a list or mapping")

    def _note_repeated(self, node: MappingNode) -> None:
        seen: dict[str, int] = {}
        for key, _ in node.value:
            if not isinstance(key, ScalarNode) or _merges(key):
                continue
            line = _line(key)
            if key.value in seen:
                before = seen[key.value]
                self._note(line, f"{quoted(key.value)} stands twice, first in line {before}.")
            seen[key.value] = line


def _line(node: Node) -> int:
    return int(node.start_mark.line) + 1


def _merges(key: Node) -> bool:
    return key.tag == f"{_PLAIN}merge"


def _tag_of(node: Node) -> str:
    tag = node.tag
    return quoted(f"!!{tag.removeprefix(_PLAIN)}" if tag.startswith(_PLAIN) else tag)


def _child(node: Node | None, step: int | str) -> tuple[int, Node] | None:
    """Find an item of a list, or the value of a key, and its line."""
    if isinstance(node, SequenceNode) and isinstance(step, int) and step < len(node.value):
        item = node.value[step]
        return _line(item), item
    if isinstance(node, MappingNode):
        for key, value in reversed(node.value):  # merged keys stand first
            if isinstance(key, ScalarNode) and key.value == str(step):
                return _line(key), value
    return None
