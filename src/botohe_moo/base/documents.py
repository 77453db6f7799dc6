"""YAML texts as plain values, with the line of each value."""

import re
from collections.abc import Sequence
from typing import Any, ClassVar

import yaml
from yaml.composer import Composer, ComposerError
from yaml.nodes import MappingNode, ScalarNode, SequenceNode

_TAG = "tag:yaml.org,2002:"
# Plain scalars of the core schema of YAML 1.2; digits may have underscores between them.
_CORE = {
    "null": r"~|null|Null|NULL|",
    "bool": r"true|True|TRUE|false|False|FALSE",
    "int": r"[-+]?(0|[1-9][0-9_]*)|0o[0-7][0-7_]*|0x[0-9a-fA-F][0-9a-fA-F_]*",
    "float": r"[-+]?([0-9][0-9_]*(\.[0-9_]*)?|\.[0-9][0-9_]*)([eE][-+]?[0-9]+)?"
    r"|[-+]?\.(inf|Inf|INF)|\.(nan|NaN|NAN)",
    "merge": r"<<",
}


class _Loader(Composer, yaml.CSafeLoader):  # type: ignore[misc]
    """Makes plain values of events of the parser in C, which is fast.

    They are composed in Python: in C, a text that is nested too deep would end the interpreter.
    """

    yaml_implicit_resolvers: ClassVar[dict[str, Any]] = {}

    def __init__(self, text: str) -> None:
        yaml.CSafeLoader.__init__(self, text)
        Composer.__init__(self)

    def compose_mapping_node(self, anchor: Any) -> Any:
        """Compose a mapping of different keys, which become texts, as labels may be 2 or true."""
        node = super().compose_mapping_node(anchor)
        seen = set()
        for key, _ in node.value:
            if key.tag != f"{_TAG}merge" and isinstance(key, ScalarNode):
                key.tag = f"{_TAG}str"
            name = (str(key.value), key.tag)
            if name in seen:
                problem = f'found duplicate key "{key.value}"'
                raise ComposerError("in a mapping", node.start_mark, problem, key.start_mark)
            seen.add(name)
        return node


for _kind, _pattern in _CORE.items():
    _Loader.add_implicit_resolver(f"{_TAG}{_kind}", re.compile(f"({_pattern})\\Z"), None)


class Document:
    """The content of a YAML text, and the line of every value.

    Plain scalars are those of the core schema of YAML 1.2: ``yes``, dates and ``1:30`` are texts.
    Nothing in the text is executed.

    Raises
    ------
    ValueError
        If the text is not valid YAML, repeats a key, or has a tag that is not plain YAML. The
        message begins with the line, if it is one.
    """

    def __init__(self, text: str) -> None:
        try:
            loader = _Loader(text)
            self._root = loader.get_single_node()
            self.content: Any = self._root and loader.construct_object(self._root, deep=True)
        except (yaml.YAMLError, ValueError, LookupError, RecursionError) as error:
            mark = getattr(error, "problem_mark", None)
            where = f"line {mark.line + 1}: " if mark else ""
            why = getattr(error, "problem", None) or str(error)
            if start := getattr(error, "context_mark", None):
                why = f"{getattr(error, 'context', '')} (line {start.line + 1}): {why}"
            raise ValueError(f"{where}not valid YAML: {' '.join(why.split())}.") from None

    def line(self, place: Sequence[int | str]) -> int:
        """Return the line of the key or item at a place, or of the nearest one above it."""
        node, line = self._root, 1
        for step in map(str, place):
            parts: dict[str, Any] = {}
            if isinstance(node, MappingNode):
                # Keys of the mapping itself come after those that are merged into it, and win.
                parts = {key.value: (key, value) for key, value in node.value}
            elif isinstance(node, SequenceNode):
                parts = {str(i): (item, item) for i, item in enumerate(node.value)}
            if step in parts:
                key, node = parts[step]
                line = key.start_mark.line + 1
        return line
