"""A YAML document as plain values, and the line that each of them stands in."""

from __future__ import annotations

import re
from collections.abc import Hashable, Sequence
from dataclasses import dataclass, field
from typing import Any

import yaml
from yaml.nodes import MappingNode, Node, ScalarNode, SequenceNode

__all__ = ["Document", "Fault"]

_MAX_NODES = 100_000  # aliases of aliases can make a small file huge
_MAX_DEPTH = 50
_PLAIN_TAGS = ("tag:yaml.org,2002:map", "tag:yaml.org,2002:seq")


class _Loader(yaml.SafeLoader):
    """Reads numbers and flags as YAML 1.2 does.

    YAML 1.1 takes 1e-2 for text, 1:30 for ninety, 010 for eight, and ``no`` and ``on`` for flags.
    """


_Loader.yaml_implicit_resolvers = {}
for _tag, _pattern, _first in (
    ("null", r"~|null|Null|NULL|", ["~", "n", "N", ""]),
    ("bool", r"true|True|TRUE|false|False|FALSE", list("tTfF")),
    ("int", r"[-+]?[0-9](?:_?[0-9])*", list("-+0123456789")),
    (
        "float",
        r"[-+]?(?:[0-9](?:_?[0-9])*\.?[0-9]*|\.[0-9]+)(?:[eE][-+]?[0-9]+)?"
        r"|[-+]?\.(?:inf|Inf|INF)|\.(?:nan|NaN|NAN)",
        list("-+.0123456789"),
    ),
    ("merge", r"<<", ["<"]),
):
    _Loader.add_implicit_resolver(
        f"tag:yaml.org,2002:{_tag}", re.compile(f"^(?:{_pattern})$"), _first
    )


def _read_integer(_: _Loader, node: ScalarNode) -> int:
    return int(node.value)


def _read_number(loader: _Loader, node: ScalarNode) -> float:
    text = node.value.lower()
    special = text.lstrip("+-") in (".inf", ".nan")
    return loader.construct_yaml_float(node) if special else float(text)


_Loader.add_constructor("tag:yaml.org,2002:int", _read_integer)
_Loader.add_constructor("tag:yaml.org,2002:float", _read_number)


@dataclass(frozen=True, order=True)
class Fault:
    """Something wrong at a line of a document.

    Attributes
    ----------
    line
        Counted from 1.
    message
        What is wrong.
    """

    line: int
    message: str


@dataclass
class Document:
    """What a YAML text says, and where.

    Attributes
    ----------
    content
        Mappings, lists, texts, numbers, flags and None.
    faults
        What no value can be made of: broken syntax, keys that stand twice, tags.
    """

    content: Any = None
    faults: list[Fault] = field(default_factory=list)
    _root: Node | None = None
    _n_nodes: int = 0

    @classmethod
    def parse(cls, text: str) -> Document:
        """Read a YAML text; nothing in it is executed.

        Parameters
        ----------
        text
            The text; what is wrong with it is in ``faults``.
        """
        document = cls()
        loader = None
        try:
            loader = _Loader(text)
            document._root = loader.get_single_node()
            if document._root is not None:
                document.content = document._value(loader, document._root, ())
        except yaml.MarkedYAMLError as error:
            mark = error.problem_mark or error.context_mark
            said = ", ".join(part for part in (error.context, error.problem) if part)
            document.faults.append(Fault(mark.line + 1 if mark else 1, f"not valid YAML: {said}."))
        except yaml.YAMLError as error:  # characters that YAML does not allow
            before = text[: getattr(error, "position", 0)]
            said = " ".join(str(error).split())
            document.faults.append(Fault(before.count("\n") + 1, f"not valid YAML: {said}."))
        except RecursionError:
            document.faults.append(Fault(1, "expected a study file, found thousands of levels."))
        finally:
            if loader is not None:
                loader.dispose()
        return document

    def line(self, path: Sequence[int | str]) -> int:
        """Give the line of the value, or of its key, that a path of keys and positions leads to.

        Parameters
        ----------
        path
            Keys and positions from the top; where the document has no such thing, the line of
            the last thing on the way that it has.
        """
        node, line = self._root, 1
        for step in path:
            found = _child(node, step)
            if found is not None:
                line, node = found
        return line

    def _value(self, loader: _Loader, node: Node, above: tuple[Node, ...]) -> Any:
        self._n_nodes += 1
        line = node.start_mark.line + 1
        if node in above:
            raise _fault(node, "an alias stands inside of what it stands for")
        if self._n_nodes > _MAX_NODES or len(above) > _MAX_DEPTH:
            raise _fault(node, "too large for a study file")
        if not isinstance(node, ScalarNode) and node.tag not in _PLAIN_TAGS:
            self.faults.append(Fault(line, f"expected plain YAML: found the tag {node.tag!r}."))
        if isinstance(node, MappingNode):
            self._note_repeated(node)
            loader.flatten_mapping(node)
            return {
                self._key(key): self._value(loader, value, (*above, node))
                for key, value in node.value
            }
        if isinstance(node, SequenceNode):
            return [self._value(loader, item, (*above, node)) for item in node.value]
        try:
            return loader.construct_object(node)
        except yaml.YAMLError as error:
            problem = getattr(error, "problem", error)
            self.faults.append(Fault(line, f"expected plain YAML: {problem}."))
        except ValueError:  # an integer of thousands of digits
            self.faults.append(Fault(line, "expected a number of less than 4 300 digits."))
        return None

    def _key(self, node: Node) -> Hashable:
        # Labels and names are texts, whatever YAML takes them for: 2, true, null.
        if isinstance(node, ScalarNode):
            return str(node.value)
        raise _fault(node, "expected a text as a key, found a list or mapping")

    def _note_repeated(self, node: MappingNode) -> None:
        seen: dict[str, int] = {}
        for key, _ in node.value:
            if not isinstance(key, ScalarNode) or key.tag.endswith(":merge"):
                continue
            line = key.start_mark.line + 1
            if key.value in seen:
                before = seen[key.value]
                self.faults.append(
                    Fault(line, f"{key.value!r} stands twice, first in line {before}.")
                )
            seen[key.value] = line


def _fault(node: Node, problem: str) -> yaml.MarkedYAMLError:
    return yaml.MarkedYAMLError(problem=problem, problem_mark=node.start_mark)


def _child(node: Node | None, step: int | str) -> tuple[int, Node] | None:
    """Find an item of a list, or the value of a key, and its line."""
    if isinstance(node, SequenceNode) and isinstance(step, int) and step < len(node.value):
        item = node.value[step]
        return item.start_mark.line + 1, item
    if isinstance(node, MappingNode):
        for key, value in reversed(node.value):  # what a merge brings along stands first
            if isinstance(key, ScalarNode) and key.value == str(step):
                return key.start_mark.line + 1, value
    return None
