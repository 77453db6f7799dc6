"""Wishes as planners write them."""

import ast
import json
import re
import unicodedata
from collections.abc import Callable, Hashable, Iterable, Iterator
from contextlib import suppress
from dataclasses import replace
from difflib import get_close_matches
from typing import Any

from botohe_moo._base.checks import ParameterError, most_alike, quoted
from botohe_moo.decide.wishes import (
    Chance,
    EveryRobot,
    Expected,
    Reach,
    TailMean,
    Wish,
)
from botohe_moo.mission.formats.nodelink import read_label
from botohe_moo.mission.model import Mission

FORMS = (
    "survivors >= 2",
    "reward >= 5",
    "P(survivors >= 2) >= 0.9",
    "P(reward >= 5) >= 0.8",
    "CVaR(reward, 0.1) >= 2",
    "CVaR(survivors, 0.1) >= 1",
    "every robot >= 0.5",
    "reach NODE >= 0.9",
)

_NUMBER = r"[-+]?(?:\d+\.?\d*|\.\d+)(?:e[-+]?\d+)?"
_QUANTITY = r"(?P<quantity>reward|survivors)"
_QUOTED = r"\"(?:[^\"\\]|\\.)*\"|'(?:[^'\\]|\\.)*'"
_LISTED = rf"[(\[](?:{_QUOTED}|[^\"'])*?[)\]]"  # texts inside may look like the end of a wish
_SHAPES: dict[str, type[Wish]] = {
    _QUANTITY: Expected,
    rf"P \( {_QUANTITY} >= (?P<value>{_NUMBER}) \)": Chance,
    rf"CVaR \( {_QUANTITY} , (?P<alpha>{_NUMBER}) \)": TailMean,
    r"every\s+robot": EveryRobot,
    # A label without quotes ends at the first level that ends its wish.
    rf"reach\s+(?P<node>{_QUOTED}|{_LISTED}|.+?)": Reach,
}


# How messages name the numbers of a wish.
_SAID = {
    "at_least": "the last number",
    "value": "the number in P(...)",
    "alpha": "the share in CVaR(...)",
}


def _pattern(shape: str, end: str) -> re.Pattern[str]:
    # Blanks stand for any blanks, or none.
    text = rf"\s*{shape} {end}".replace(" ", r"\s*").replace(">=", "(?:>=|≥)")
    return re.compile(text, re.IGNORECASE | re.DOTALL)


# A wish ends with " and " or the text.
_END = rf">= (?P<at_least>{_NUMBER})(?:\s+and\s+(?=\S)|\s*\Z)"
_PATTERNS = [(_pattern(shape, _END), kind) for shape, kind in _SHAPES.items()]
_WITHOUT_NUMBER = [_pattern(shape, r"(?:>=)? \Z") for shape in _SHAPES]
_LABEL = r"\breach\s+.+?(?=>=)"  # no part of it is repaired
_FAULTS = (
    (rf"[<≤]\s*=?\s*{_NUMBER}", "; wishes are lower limits, written with '>='"),
    (r"\d,\d", "; write numbers as 2.5 and 1500, without commas"),
    (r"\d\s*%", "; write probabilities as 0.8, and other numbers without '%'"),
)

# Texts that are nearly wishes: their words are corrected, then these repairs are made one after the
# other, until the text can be read. A percentage of a reward stays: it does not say of what.
_LONGEST_REPAIRED = 500
_WORDS = ("reward", "survivors", "p", "cvar", "every", "robot", "reach", "and")
_WORD = r"\bE\s*[(\[]\s*(?P<inner>\w+)\s*[)\]]|\b[^\W\d]\w*"
_AMOUNT = r"(?:reward|survivors|CVaR\s*\([^)]*\))"
_REPAIRS: list[tuple[str, Callable[[re.Match[str]], str]]] = [
    (r"\s*(?:[=>≥≧⩾]\s*)+", lambda _: " >= "),
    (r"(?<=\d),(?=\d)(?!\d{3}\b)|(?<=\b0),(?=\d)", lambda _: "."),  # 1,000 may be a thousand
    (
        rf"(?P<kept>{_AMOUNT} >= {_NUMBER}\s*%)|(?P<number>{_NUMBER})\s*%",
        lambda found: found["kept"] or f"{float(found['number']) / 100:.12g}",
    ),
    (r"\s*;\s*(?=[\d.])", lambda _: ", "),
    (r"\s*[,;&]+\s*(?=[^\W\d])", lambda _: " and "),
]


def parse_wishes(mission: Mission, wishes: Iterable[str | Wish]) -> tuple[Wish, ...]:
    """Read wishes as planners write them.

    The forms, in upper or lower case, ``≥`` for ``>=`` if preferred, where ``Q`` is ``reward`` or
    ``survivors``::

        Q >= x                 expected reward, expected number of survivors
        P(Q >= x) >= p         probability that it is x or more
        CVaR(Q, a) >= x        mean of the lowest share a of the outcomes
        every robot >= p       survival of each robot
        reach NODE >= p        probability that a robot reaches the node
        WISH and WISH          both

    A node is written as its label: a word or a number as it is, any other text in quotes, and a
    tuple as in Python or, as in mission files, as a list. If no node has exactly this label, blanks
    at its ends and the encoding of its accents are ignored, provided that only one node fits.

    Parameters
    ----------
    mission
        The mission, which knows the nodes.
    wishes
        Texts, each of one wish or more, and wishes that are made already.

    Raises
    ------
    ValueError
        If there is no wish, a text does not have one of the forms, a number is out of its range, or
        the mission has no such node.

    Examples
    --------
    >>> from botohe_moo import load_mission
    >>> from botohe_moo.decide import parse_wishes
    >>> [wish] = parse_wishes(load_mission("toy"), ["P(survivors >= 2) >= 0.9"])
    >>> wish
    Chance(at_least=0.9, quantity='survivors', value=2.0)
    >>> print(wish)
    P(survivors >= 2) >= 0.9
    """
    found: list[Wish] = []
    for wish in wishes:
        if isinstance(wish, Wish):
            found.append(wish)
        elif isinstance(wish, str):
            found += _parse(mission, wish)
        else:
            raise ValueError(f"Expected a wish, a text such as {FORMS[0]!r}, got {quoted(wish)}.")
    if not found:
        raise ValueError(f"Expected at least one wish, got none. {_forms()}")
    return tuple(
        replace(wish, node=_node(mission, wish.node, (wish.node,)))
        if isinstance(wish, Reach)
        else wish
        for wish in found
    )


def _parse(mission: Mission, text: str, *, offer: bool = True) -> list[Wish]:
    wishes: list[Wish] = []
    start = 0
    while start < len(text) or not wishes:
        matches = ((pattern.match(text, start), kind) for pattern, kind in _PATTERNS)
        found, kind = next((pair for pair in matches if pair[0]), (None, Wish))
        if found is None:
            where = f" at {quoted(text[start:])}" if start else ""
            fault = (offer and _meant(mission, text)) or f"{_fault(text[start:])}."
            raise ValueError(f"Expected a wish, got {quoted(text)}{where}{fault} {_forms()}")
        try:
            wishes.append(_make(mission, kind, found.groupdict()))
        except ParameterError as error:
            said = str(error).replace(str(error.parameter), _SAID[str(error.parameter)], 1)
            raise ValueError(f"Wish {quoted(text)}: {said}") from None
        except ValueError as error:
            raise ValueError(f"Wish {quoted(text)}: {error}") from None
        start = found.end()
    return wishes


def _fault(rest: str) -> str:
    """Say what is wrong with a text that is not a wish, if that is plain."""
    ends = re.search(rf"{_NUMBER}\s*%?\s*\Z", rest)
    if not ends and any(pattern.match(rest) for pattern in _WITHOUT_NUMBER):
        return ", which lacks '>=' and a number at its end"
    bare = re.sub(_QUOTED, "", rest)
    return next((words for pattern, words in _FAULTS if re.search(pattern, bare)), "")


def _meant(mission: Mission, text: str) -> str:
    """Offer the first repaired text that can be read."""
    if len(text) > _LONGEST_REPAIRED:
        return ""
    for repaired in _repaired(mission, text):
        with suppress(ValueError):
            _parse(mission, repaired, offer=False)
            return f"; did you mean {repaired!r}?"
    return ""


def _repaired(mission: Mission, text: str) -> Iterator[str]:
    labels = {word for node in mission.nodes for word in re.findall(r"\w+", str(node))}

    def correct(found: re.Match[str]) -> str:
        word = found["inner"] or found[0]
        if word.lower() in _WORDS or (word in labels and not found["inner"]):
            return word
        longer = [known for known in _WORDS if known.startswith(word.lower())]  # the S of E[S]
        return next(iter(longer or get_close_matches(word.lower(), _WORDS, 1)), word)

    text = _repair(_QUOTED, _WORD, correct, text)
    yield text.strip()
    (sign, write), *others = _REPAIRS
    text = _repair(_QUOTED, sign, write, text)
    yield text.strip()
    for pattern, repair in others:
        text = _repair(rf"{_QUOTED}|{_LABEL}", pattern, repair, text)
        yield text.strip()


def _repair(kept: str, pattern: str, repair: Callable[[re.Match[str]], str], text: str) -> str:
    return re.sub(
        rf"(?P<as_it_is>{kept})|{pattern}",
        lambda found: found["as_it_is"] or repair(found),
        text,
        flags=re.IGNORECASE,
    )


def _make(mission: Mission, kind: Callable[..., Wish], parts: dict[str, str]) -> Wish:
    given: dict[str, Any] = dict(parts)
    for name in given.keys() & {"at_least", "value", "alpha"}:
        given[name] = float(given[name])
    if "quantity" in given:
        given["quantity"] = given["quantity"].lower()
    if "node" in given:
        given["node"] = _node(mission, given["node"], _labels(given["node"]))
    return kind(**given)


def _labels(text: str) -> list[Hashable]:
    """List the labels that a text may stand for."""
    if re.fullmatch(_QUOTED, text, re.DOTALL):
        if text.startswith('"'):
            with suppress(ValueError):  # JSON knows few letters after a backslash
                return [str(json.loads(text, strict=False))]
        return [re.sub(r"\\(.)", r"\1", text[1:-1], flags=re.DOTALL)]
    labels: list[Hashable] = [text]
    if re.match(r"[-+.\d(\[]|(?:True|False)\Z", text):
        with suppress(ValueError, SyntaxError, MemoryError, RecursionError):
            labels.insert(0, read_label(ast.literal_eval(text)))
    return labels


def _node(mission: Mission, given: object, labels: Iterable[Hashable]) -> Hashable:
    for label in labels:
        try:
            mission.index(label)
        except (KeyError, TypeError):
            continue
        return label
    looks = {_look(label) for label in labels if isinstance(label, str)}
    alike = [node for node in mission.nodes if isinstance(node, str) and _look(node) in looks]
    if len(alike) == 1:
        return alike[0]
    if re.match(r"[\"']", text := str(given)) and not re.fullmatch(_QUOTED, text, re.DOTALL):
        raise ValueError(f"the quote before {quoted(text[1:])} is not closed.")
    near = most_alike(text, map(str, mission.nodes))
    raise ValueError(f"mission {mission.name!r} has no node {quoted(given)}{near}.")


def _look(label: str) -> str:
    return unicodedata.normalize("NFC", label.strip())


def _forms() -> str:
    return f"Wishes are {'; '.join(FORMS)}; join several by ' and '."
