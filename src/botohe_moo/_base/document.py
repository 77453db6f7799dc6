"""YAML texts as plain values, with the line of each value."""

from collections.abc import Sequence
from typing import Any

from ruamel.yaml import YAML
from ruamel.yaml.constructor import ConstructorError, DuplicateKeyError, SafeConstructor
from ruamel.yaml.error import MarkedYAMLError, YAMLError
from ruamel.yaml.nodes import MappingNode, ScalarNode, SequenceNode
from ruamel.yaml.reader import ReaderError

_TAG = "tag:yaml.org,2002:"
_PLAIN = ("null", "bool", "int", "float", "str", "seq", "map")


class _Constructor(SafeConstructor):
    """Constructs the types of JSON only; any other tag is an error, which knows its line."""

    yaml_constructors = {  # noqa: RUF012 (as the class that it replaces)
        tag: SafeConstructor.yaml_constructors[tag]
        for tag in (None, *(_TAG + kind for kind in _PLAIN))
    }

    def flatten_mapping(self, node: Any) -> None:
        """Merge the mappings that ``<<`` names; make keys texts, as labels may be 2 or true."""
        super().flatten_mapping(node)
        for key, _ in node.value:
            if not isinstance(key, ScalarNode):
                problem = "expected a text as a key of a mapping, found a list or a mapping"
                raise ConstructorError(problem=problem, problem_mark=key.start_mark)
            key.tag = f"{_TAG}str"


# YAML 1.2 has no dates: they are texts.
_Constructor.add_constructor(f"{_TAG}timestamp", _Constructor.construct_yaml_str)


class DocumentError(ValueError):
    """A text cannot be read as YAML; says in which line, and why."""

    def __init__(self, line: int, why: str) -> None:
        super().__init__(f"{line}: not valid YAML: {' '.join(why.split())}.")


class Document:
    """The content of a YAML text, and the line of every value.

    Nothing in the text is executed.

    Raises
    ------
    DocumentError
        If the text is not valid YAML, repeats a key, or has a tag that is not plain YAML.
    """

    def __init__(self, text: str) -> None:
        loader = YAML(typ="safe", pure=True)
        loader.Constructor = _Constructor
        try:
            self._root = loader.compose(text)
            self.content: Any = self._root and loader.constructor.construct_document(self._root)
        except ReaderError as error:  # a character that YAML does not allow
            line = text.count("\n", 0, error.position) + 1
            raise DocumentError(line, f"{error.reason} (#x{error.character:04x})") from None
        except MarkedYAMLError as error:
            raise DocumentError(*_explained(error)) from None
        except (YAMLError, ValueError, ArithmeticError, LookupError, RecursionError) as error:
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


def _explained(error: Any) -> tuple[int, str]:
    """Return the line of an error of ruamel.yaml, and its words without excerpts of the text."""
    problem = error.problem or ""
    if isinstance(error, DuplicateKeyError):
        problem = problem.partition(" with value ")[0]
    mark = error.problem_mark or error.context_mark
    if error.context and error.context_mark:
        problem = f"{error.context} (line {error.context_mark.line + 1}): {problem}"
    return mark.line + 1, problem
