"""Syntax errors of YAML, explained to the author of a study file."""

import re
from typing import Any

_LINE_BREAK = r"\r\n|[\n\r\x85\u2028\u2029]"
_LONG = 80
# PyYAML's messages and their meanings; the culprit is where what they are about began.
_BEGAN = {
    r"could not find expected ':'": "expected 'key: value', found no ':' after it",
    r"(?:an (?:alias|anchor)).*expected alphabetic": "expected a name after '*' or '&'; a text "
    "that begins with one has to be in quotes",
    r"directive": "a text that begins with '%' has to be in quotes",
    r"a block scalar": "'|' and '>' begin a text of several lines, and nothing follows them in "
    "theirs; a text that begins with one has to be in quotes",
    r"a quoted scalar": "these quotes are never closed",
    r"tag": "a text that begins with '!' has to be in quotes",
}
# The same; the culprit is where it ended.
_ENDED = {
    r"mapping values are not allowed here": "no ':' can stand here; keys of one mapping begin in "
    "the same column, and a text that contains ': ' has to be in quotes",
    r"sequence entries are not allowed here": "no list item can stand here; '- ' begins a line of "
    "its own, below its key",
    r"mapping keys are not allowed here": "no '? ' can stand here",
    r"found character '\\t'": "expected spaces, found a tab",
    r"found character": "no value begins like this; put it in quotes",
    r"found unknown escape|expected escape sequence": "this escape is not valid in double quotes; "
    "use single ones, or write \\\\",
    r"expected <block end>": "this does not fit what began in line {began}; keys of one mapping, "
    "and items of one list, begin in the same column",
    r"expected ',' or ']'": "expected ',' or ']' for the list that line {began} opens",
    r"expected ',' or '}'": "expected ',' or '}}' for the mapping that line {began} opens",
    r"expected the node content": "expected a value",
    r"expected a single document|expected '<document start>'": "expected a single document, found "
    "more after its end",
    r"found undefined alias '(.*)'": "undefined alias: nothing before it is named &{0}",
    r"found duplicate anchor '(.*)'": "the anchor &{0} stands twice, first in line {began}",
}


def syntax_fault(error: Any, text: str) -> tuple[int, str]:
    """Give the line of an error that PyYAML has raised, from 1, and explain it in a sentence."""
    ended = getattr(error, "problem_mark", None) or getattr(error, "context_mark", None)
    if ended is None:  # a character that YAML does not allow
        at = getattr(error, "position", len(text))
        return _placed("this character cannot stand in YAML", at, text)
    began = error.context_mark or ended
    said = " ".join(part for part in (error.context, error.problem) if part)
    for mark, meanings in ((began, _BEGAN), (ended, _ENDED)):
        for pattern, meaning in meanings.items():
            if found := re.search(pattern, said):
                names = (name[:_LONG] + "..." * (len(name) > _LONG) for name in found.groups())
                words = meaning.format(*names, began=began.line + 1)
                return _placed(words, mark.index, text)
    return _placed("this cannot be read", ended.index, text)


def _placed(words: str, at: int, text: str) -> tuple[int, str]:
    """Give the line, and add column and text to what is wrong there."""
    before = re.split(_LINE_BREAK, text[:at])
    line = before[-1] + re.split(_LINE_BREAK, text[at:], maxsplit=1)[0]
    if not text[at:].strip():
        where = "at the end of the file"
    elif len(line) <= _LONG:
        where = f"column {len(before[-1]) + 1} of {line.rstrip()!r}"
    else:
        where = f"column {len(before[-1]) + 1}, {text[at : at + _LONG]!r}"
    return len(before), f"not valid YAML: {words} ({where})."
