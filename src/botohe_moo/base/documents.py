"""YAML texts as plain values, with the line of each value."""

import math
import re
from collections.abc import Sequence
from typing import Any, ClassVar

import yaml
from yaml.constructor import ConstructorError, SafeConstructor
from yaml.nodes import MappingNode, ScalarNode, SequenceNode

_MOST_VALUES = 10_000_000
_TAG = "tag:yaml.org,2002:"
# Plain scalars of the core schema of YAML 1.2; digits may have underscores between them.
_CORE = {
    "null": r"~|null|Null|NULL|",
    "bool": r"true|True|TRUE|false|False|FALSE",
    "int": r"[-+]?[0-9][0-9_]*|0o[0-7][0-7_]*|0x[0-9a-fA-F][0-9a-fA-F_]*",
    "float": r"[-+]?([0-9][0-9_]*(\.[0-9_]*)?|\.[0-9][0-9_]*)([eE][-+]?[0-9]+)?"
    r"|[-+]?\.(inf|Inf|INF)|\.(nan|NaN|NAN)",
    "merge": r"<<",
}


class _Loader(yaml.composer.Composer, yaml.CSafeLoader):  # type: ignore[misc]
    """Makes the types of JSON only, of events of the parser in C, which is fast.

    They are composed in Python: in C, a text that is nested too deep would end the interpreter.
    """

    yaml_implicit_resolvers: ClassVar[dict[str, Any]] = {}
    yaml_constructors: ClassVar[dict[str | None, Any]] = {
        tag: SafeConstructor.yaml_constructors[tag]
        for tag in (None, *(_TAG + kind for kind in ("null", "bool", "float", "str", "seq", "map")))
    }
    yaml_constructors[f"{_TAG}timestamp"] = SafeConstructor.construct_yaml_str  # of YAML 1.1

    def __init__(self, text: str) -> None:
        yaml.CSafeLoader.__init__(self, text)
        yaml.composer.Composer.__init__(self)
        self._flat: set[Any] = set()

    def flatten_mapping(self, node: Any) -> None:
        """Merge the mappings that ``<<`` names; make keys texts, as labels may be 2 or true."""
        if node in self._flat:  # as another one merges it, too
            return
        self._flat.add(node)
        seen = set()
        for key, _ in node.value:
            if not isinstance(key, ScalarNode):
                problem = "expected a text as a key of a mapping, found a list or a mapping"
                raise ConstructorError(None, None, problem, key.start_mark)
            name = (key.value, key.tag == f"{_TAG}merge")
            if name in seen:
                problem = f'found duplicate key "{key.value}"'
                context = "while constructing a mapping"
                raise ConstructorError(context, node.start_mark, problem, key.start_mark)
            seen.add(name)
        super().flatten_mapping(node)
        for key, _ in node.value:
            key.tag = f"{_TAG}str"

    def _integer(self, node: Any) -> int:
        text = self.construct_scalar(node).replace("_", "")
        return int(text, 0 if text[:2] in ("0o", "0x") else 10)


_Loader.add_constructor(f"{_TAG}int", _Loader._integer)
for _kind, _pattern in _CORE.items():
    _Loader.add_implicit_resolver(f"{_TAG}{_kind}", re.compile(f"({_pattern})\\Z"), None)


class DocumentError(ValueError):
    """A text cannot be read as YAML; says in which line, and why."""

    def __init__(self, line: int, why: str) -> None:
        super().__init__(f"{line}: not valid YAML: {' '.join(why.split())}.")


class Document:
    """The content of a YAML text, and the line of every value.

    Plain scalars are those of the core schema of YAML 1.2: ``yes``, dates and ``1:30`` are texts.
    Nothing in the text is executed.

    Raises
    ------
    DocumentError
        If the text is not valid YAML, repeats a key, or has a tag that is not plain YAML.
    """

    def __init__(self, text: str) -> None:
        try:
            loader = _Loader(text)
            self._root = loader.get_single_node()
            if self._root and _expanded(self._root, {}) > _MOST_VALUES:
                raise ValueError(f"aliases expand to more than {_MOST_VALUES:,} values")
            self.content: Any = self._root and loader.construct_document(self._root)
        except yaml.reader.ReaderError as error:  # a character that YAML does not allow
            line = text.encode()[: error.position].count(b"\n") + 1  # the position is in bytes
            raise DocumentError(line, f"{error.reason} (#x{error.character:04x})") from None
        except yaml.error.MarkedYAMLError as error:  # without its excerpts of the text
            mark, why = error.problem_mark or error.context_mark, error.problem or ""
            if error.context and error.context_mark:
                why = f"{error.context} (line {error.context_mark.line + 1}): {why}"
            raise DocumentError(mark.line + 1, why) from None
        except (ValueError, LookupError, RecursionError) as error:
            raise DocumentError(1, str(error)) from None

    def line(self, place: Sequence[int | str]) -> int:
        """Return the line of the key or item at a place, or of the nearest one above it."""
        node, line = self._root, 1
        for step in place:
            if isinstance(node, SequenceNode) and isinstance(step, int) and step < len(node.value):
                key = node = node.value[step]
            elif isinstance(node, MappingNode):
                # Keys of the mapping itself come after those that are merged into it, and win.
                pairs = [(key, value) for key, value in node.value if key.value == str(step)]
                if not pairs:
                    continue
                key, node = pairs[-1]
            else:
                continue
            line = key.start_mark.line + 1
        return line


def _expanded(node: Any, known: dict[Any, float]) -> float:
    """Return how many values a node has once its aliases are written out."""
    if node not in known:
        known[node] = math.inf  # of a node that contains itself
        parts = node.value if isinstance(node, SequenceNode) else []
        if isinstance(node, MappingNode):
            parts = [value for _, value in node.value]
        known[node] = 1 + sum(_expanded(part, known) for part in parts)
    return known[node]
