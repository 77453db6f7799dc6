"""Wishes as planners write them."""

import ast
import re
from collections.abc import Hashable, Iterable, Iterator
from contextlib import suppress
from typing import Any

from botohe_moo.base.messages import check_integer, most_alike, quoted
from botohe_moo.decide.wishes import (
    Chance,
    EveryRobot,
    Expected,
    Reach,
    TailMean,
    Wish,
    WorstCase,
    label_text,
)
from botohe_moo.mission.model import Mission
from botohe_moo.mission.rules import read_label

FORMS = (
    "reward >= 5",
    "P(reward >= 5) >= 0.8",
    "CVaR(reward, 0.1) >= 2",
    "worst case of 1 loss >= 5",
    "every robot >= 0.5",
    "reach NODE >= 0.9",
)

_NUMBER = r"[-+]?(?:\d+\.?\d*|\.\d+)(?:e[-+]?\d+)?"
_LEVELS = ("at_least", "value", "alpha")
_QUOTED = r"\"(?:[^\"\\]|\\.)*\"|'(?:[^'\\]|\\.)*'"
_KIND = rf"(?P<kind>{_QUOTED}|(?!reach\s)[\w.-]+)\s+(?=survivors)"  # not a node of that label
_QUANTITY = rf"(?:{_KIND})?(?P<quantity>reward|survivors)"
_LISTED = rf"[(\[](?:{_QUOTED}|[^\"'])*?[)\]]"  # texts inside may look like the end of a wish
_SHAPES: dict[str, type[Wish]] = {
    _QUANTITY: Expected,
    rf"P \( {_QUANTITY} >= (?P<value>{_NUMBER}) \)": Chance,
    rf"CVaR \( {_QUANTITY} , (?P<alpha>{_NUMBER}) \)": TailMean,
    r"worst\s+case\s+of\s+(?P<losses>\d+)\s+loss(?:es)?": WorstCase,
    r"every\s+robot": EveryRobot,
    # A label without quotes ends at the first level that ends its wish.
    rf"reach\s+(?P<node>{_QUOTED}|{_LISTED}|.+?)": Reach,
}


def _pattern(shape: str) -> re.Pattern[str]:
    """Compile a form: a blank matches any blanks, or none; a wish ends with ``and`` or the text."""
    text = rf"\s*{shape} >= (?P<at_least>{_NUMBER})(?:\s+and\s+(?=\S)|\s*\Z)"
    text = text.replace(" ", r"\s*").replace(">=", "(?:>=|≥)")
    return re.compile(text, re.IGNORECASE | re.DOTALL)


_PATTERNS = [(_pattern(shape), kind) for shape, kind in _SHAPES.items()]


def parse_wishes(mission: Mission, wishes: Iterable[str | Wish]) -> tuple[Wish, ...]:
    """Read wishes as planners write them.

    There are six forms, in upper or lower case, ``≥`` for ``>=`` if preferred, where ``Q`` is
    ``reward``, ``survivors``, or ``KIND survivors`` with the name of a kind of robots; ``and``
    joins several::

        Q >= x                 expected reward, expected number of survivors
        P(Q >= x) >= p         probability that it is x or more
        CVaR(Q, a) >= x        mean of the lowest share a of the outcomes
        worst case of n losses >= x    expected reward if the worst n robots never leave
        every robot >= p       survival of each robot
        reach NODE >= p        probability that a robot reaches the node

    A node is written as its label: a word or a number as it is, any other text in quotes, and a
    tuple as in Python or, as in mission files, as a list. So is the name of a kind.

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
        the mission has no such node or kind of robots.

    Examples
    --------
    >>> from botohe_moo import load_mission
    >>> from botohe_moo.decide import parse_wishes
    >>> [wish] = parse_wishes(load_mission("toy"), ["P(survivors >= 2) >= 0.9"])
    >>> wish
    Chance(at_least=0.9, quantity='survivors', value=2.0, kind=None)
    >>> print(wish)
    P(survivors >= 2) >= 0.9
    """
    found: list[Wish] = []
    for wish in wishes:
        if isinstance(wish, str):
            found += _parse(mission, wish)
        elif not isinstance(wish, Wish):
            raise _not_a_wish(mission, wish)
        else:
            if isinstance(wish, Reach):
                _node(mission, wish.node, [wish.node])
            elif isinstance(wish, WorstCase):
                _losses(mission, wish.losses)
            elif (kind := getattr(wish, "kind", None)) is not None:
                _kind(mission, kind, [kind])
            found.append(wish)
    if not found:
        raise _not_a_wish(mission, "")
    return tuple(found)


def _parse(mission: Mission, text: str) -> Iterator[Wish]:
    start = 0
    while start < len(text) or not start:
        matches = ((pattern.match(text, start), kind) for pattern, kind in _PATTERNS)
        found, kind = next((pair for pair in matches if pair[0]), (None, Wish))
        if found is None:
            raise _not_a_wish(mission, text[start:])
        try:
            yield _make(mission, kind, found.groupdict())
        except ValueError as error:
            raise ValueError(f"Wish {quoted(text)}: {error}") from None
        start = found.end()


def _not_a_wish(mission: Mission, found: object) -> ValueError:
    hint = " Write 80 % as 0.8." if "%" in str(found) else ""
    kind = label_text(mission.kinds[0].name)
    of_kind = f", or {kind} survivors," if len(mission.kinds) > 1 else ""
    return ValueError(
        f"Expected a wish, got {quoted(found)}. Wishes are {'; '.join(FORMS)}; the first three "
        f"may have survivors{of_kind} in place of reward. Join several by ' and '.{hint}"
    )


def _make(mission: Mission, kind: Any, parts: dict[str, str]) -> Wish:
    given: dict[str, Any] = {key: float(value) for key, value in parts.items() if key in _LEVELS}
    if "quantity" in parts:
        given["quantity"] = parts["quantity"].lower()
    if parts.get("kind"):
        given["kind"] = _kind(mission, parts["kind"], _labels(parts["kind"]))
    if "losses" in parts:
        given["losses"] = _losses(mission, int(parts["losses"]))
    if "node" in parts:
        given["node"] = node_of(mission, parts["node"])
    made: Wish = kind(**given)
    return made


def _losses(mission: Mission, losses: int) -> int:
    return check_integer("losses", losses, at_least=0, at_most=mission.robots)


def node_of(mission: Mission, text: str) -> Hashable:
    """Return the node that a text names, as in a wish; a ValueError names one that is unknown."""
    return _node(mission, text, _labels(text))


def _labels(text: str) -> Iterator[Hashable]:
    """List the labels, or names of kinds, that a text may represent, the likelier one first."""
    with suppress(ValueError, SyntaxError):
        value = ast.literal_eval(text)
        yield read_label(list(value) if isinstance(value, tuple) else value)
    yield text


def _node(mission: Mission, given: object, labels: Iterable[Hashable]) -> Hashable:
    """Return the first of some labels that the mission has."""
    for label in labels:
        with suppress(KeyError, TypeError):
            mission.index(label)
            return label
    near = most_alike(str(given), map(str, mission.nodes))
    raise ValueError(f"mission {mission.name!r} has no node {quoted(given)}{near}.")


def _kind(mission: Mission, given: object, names: Iterable[Hashable]) -> str:
    """Return the first of some names that a kind of the mission has."""
    known = [kind.name for kind in mission.kinds]
    for name in names:
        if name in known:
            return str(name)
    near = most_alike(str(given), known) if len(known) > 1 else "; all its robots are alike"
    raise ValueError(f"mission {mission.name!r} has no kind of robots {quoted(given)}{near}.")
