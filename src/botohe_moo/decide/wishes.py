"""Wishes: what planners write, and how plans are judged by it."""

from __future__ import annotations

import ast
import json
import re
from collections.abc import Callable, Container, Hashable, Iterable, Iterator
from contextlib import suppress
from dataclasses import dataclass
from typing import Any, Literal, NamedTuple

from botohe_moo import outcomes as o
from botohe_moo.base import messages as checks
from botohe_moo.base.messages import counted, quoted
from botohe_moo.base.numbers import exact_text
from botohe_moo.decide.fronts import SLACK
from botohe_moo.decide.hazards import worst_losses
from botohe_moo.mission.formats.nodelink import plain_label
from botohe_moo.mission.model import Mission, check_mission
from botohe_moo.mission.rules import read_label
from botohe_moo.trails import Plans

Quantity = Literal["reward", "survivors"]
QUANTITIES = ("reward", "survivors")
MAX_OUTCOMES = 100_000  # joint outcomes; the reward of a plan with more is simulated
N_SAMPLES = 10_000  # missions of a simulation
SEED = 1

_NUMBER = r"[-+]?(?:\d+\.?\d*|\.\d+)(?:e[-+]?\d+)?"
_QUOTED = r"\"(?:[^\"\\]|\\.)*\"|'(?:[^'\\]|\\.)*'"
_KIND = rf"(?P<kind>{_QUOTED}|(?!reach\s)[\w.-]+)\s+(?=survivors)"  # not a node of that label
_LISTED = rf"[(\[](?:{_QUOTED}|[^\"'])*?[)\]]"  # texts inside may look like the end of a wish
_PLAIN_LABEL = re.compile(r"(?!(?:True|False)\Z)[^\W\d]\w*")


class _Part(NamedTuple):
    """A part of a wish: how it is written, read and written again, and a number's range."""

    pattern: str
    read: Callable[[str], Any] = float
    write: Callable[[Any], str] = exact_text
    limits: dict[str, float] | None = None


_PARTS = {
    "subject": _Part(rf"(?:{_KIND})?(?P<quantity>reward|survivors)", write=str),
    "quantity": _Part("", str.lower),
    "value": _Part(rf"(?P<value>{_NUMBER})", limits={"at_least": 0}),
    "alpha": _Part(rf"(?P<alpha>{_NUMBER})", limits={"above": 0, "at_most": 1}),
    "losses": _Part(r"(?P<losses>\d+)\s+loss(?:es)?", int, lambda n: f"{n} loss{'es' * (n != 1)}"),
    # A label without quotes ends at the first level that ends its wish.
    "node": _Part(rf"(?P<node>{_QUOTED}|{_LISTED}|\S.*?)", write=lambda label: label_text(label)),
    "at_least": _Part(rf"(?P<at_least>{_NUMBER})", limits={"at_least": 0}),
}
_FORMS = {
    "expected": "{subject} >= {at_least}",
    "chance": "P({subject} >= {value}) >= {at_least}",
    "tail mean": "CVaR({subject}, {alpha}) >= {at_least}",
    "worst case": "worst case of {losses} >= {at_least}",
    "every robot": "every robot >= {at_least}",
    "reach": "reach {node} >= {at_least}",
}
_PROBABILITIES = ("chance", "every robot", "reach")  # whose level is one
_EXAMPLE = {"subject": "reward", "value": 5, "alpha": 0.1, "losses": "1 loss", "node": "NODE"}
FORMS = tuple(
    text.format(**_EXAMPLE, at_least=0.8 if form in _PROBABILITIES else 5)
    for form, text in _FORMS.items()
)


def _pattern(text: str) -> re.Pattern[str]:
    """Compile a form; blanks may stand between its tokens. A wish ends with ``and`` or the text."""
    pattern = r"\s*"
    for token in re.findall(r"{\w+}|\w+|>=|\S", text):
        if token in ("(", ",", ")", ">="):
            token = "(?:>=|≥)" if token == ">=" else re.escape(token)
        else:
            token = rf"{token}\b" if token.isalpha() else _PARTS[token[1:-1]].pattern
        pattern += rf"{token}\s*"
    return re.compile(rf"{pattern}(?:(?<=\s)and\s+(?=\S)|\Z)", re.IGNORECASE | re.DOTALL)


_PATTERNS = {form: _pattern(text) for form, text in _FORMS.items()}


@dataclass(frozen=True, repr=False)
class Wish:
    """A lower limit on a quantity of a plan; ``str`` writes it as planners do.

    Most are written as texts, which :func:`parse_wishes` reads.

    Parameters
    ----------
    form
        ``"expected"``, ``"chance"``, ``"tail mean"``, ``"worst case"``, ``"every robot"`` or
        ``"reach"``: see :func:`parse_wishes`.
    at_least
        The least value that meets the wish, at least 0; a probability is in [0, 1].
    quantity
        ``"reward"`` or ``"survivors"``, of the first three forms.
    kind
        The kind of robots whose survivors count, by its name; default: all.
    value
        What the quantity has to reach, at least 0, of a ``"chance"``.
    alpha
        Share of the outcomes, in (0, 1], of a ``"tail mean"``, as for :meth:`Distribution.cvar`.
    losses
        How many robots never leave, at least 0, of a ``"worst case"``.
    node
        The label of the node to ``"reach"``.

    Raises
    ------
    ValueError
        If a part of the form is missing or out of its range.

    Examples
    --------
    >>> from botohe_moo.decide import Wish
    >>> print(Wish("chance", quantity="reward", value=5, at_least=0.8))
    P(reward >= 5) >= 0.8
    >>> Wish("reach", node="north hall", at_least=0.9)
    <Wish: reach "north hall" >= 0.9>
    """

    form: str
    at_least: float
    quantity: Quantity | None = None
    kind: str | None = None
    value: Any = None
    alpha: Any = None
    losses: Any = None
    node: Hashable = None

    def __post_init__(self) -> None:
        checks.check_choice("form", self.form, _FORMS)
        parts = _PATTERNS[self.form].groupindex
        if "quantity" in parts:
            checks.check_choice("quantity", self.quantity, QUANTITIES)
        if self.kind is not None and self.quantity != "survivors":
            expected = "no kind of robots for the reward"
            raise checks.ParameterError(f"Expected {expected}, got {quoted(self.kind)}.", "kind")
        if "losses" in parts:
            losses = checks.check_integer("losses", self.losses, at_least=0)
            object.__setattr__(self, "losses", losses)
        for name in parts:
            if name in _PARTS and (limits := _PARTS[name].limits):
                if name == "at_least" and self.is_probability:
                    limits = {**limits, "at_most": 1}
                number = checks.check_number(name, getattr(self, name), **limits)
                object.__setattr__(self, name, number)

    @property
    def is_probability(self) -> bool:
        """Whether its level is a probability."""
        return self.form in _PROBABILITIES

    @property
    def of_rewards(self) -> bool:
        """Whether it is judged by the distribution of the reward."""
        return self.form in ("chance", "tail mean") and self.quantity == "reward"

    @property
    def subject(self) -> str:
        """The quantity, with the kind of robots that count."""
        return f"{'' if self.kind is None else f'{label_text(self.kind)} '}{self.quantity}"

    def __str__(self) -> str:
        written = re.findall(r"{(\w+)}", _FORMS[self.form])
        parts = {name: _PARTS[name].write(getattr(self, name)) for name in written}
        return _FORMS[self.form].format(**parts)

    def __repr__(self) -> str:
        return f"<Wish: {self}>"


def label_text(label: Hashable) -> str:
    """Write a label as wishes have it: words as they are, other texts in quotes."""
    if isinstance(label, str):
        return label if _PLAIN_LABEL.fullmatch(label) else json.dumps(label, ensure_ascii=False)
    with suppress(ValueError):  # labels that JSON cannot hold
        label = read_label(plain_label(label))  # with Python's numbers instead of numpy's
    return repr(label)


def parse_wishes(mission: Mission, wishes: Iterable[str | Wish]) -> tuple[Wish, ...]:
    """Read wishes as planners write them.

    There are six forms, in upper or lower case, ``≥`` for ``>=`` if preferred, where ``Q`` is
    ``reward``, ``survivors``, or ``KIND survivors`` with the name of a kind of robots; ``and``
    joins several::

        Q >= x                 expected reward, expected number of survivors
        P(Q >= x) >= p         chance: probability that it is x or more
        CVaR(Q, a) >= x        tail mean: mean of the lowest share a of the outcomes
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
    >>> wish, wish.form, wish.value
    (<Wish: P(survivors >= 2) >= 0.9>, 'chance', 2.0)
    """
    found: list[Wish] = []
    for wish in wishes:
        if isinstance(wish, str):
            found += _parsed(mission, wish)
        elif isinstance(wish, Wish):
            found.append(_known(mission, wish))
        else:
            raise _not_a_wish(mission, wish)
    if not found:
        raise _not_a_wish(mission, "")
    return tuple(found)


def _parsed(mission: Mission, text: str) -> Iterator[Wish]:
    known = {"kind": [kind.name for kind in mission.kinds], "node": mission.graph}
    start = 0
    while start < len(text) or not start:
        matches = ((form, pattern.match(text, start)) for form, pattern in _PATTERNS.items())
        form, found = next((pair for pair in matches if pair[1]), ("", None))
        if found is None:
            raise _not_a_wish(mission, text[start:])
        given: dict[str, Any] = {name: part for name, part in found.groupdict().items() if part}
        for name, part in given.items():
            meant = _meant(part, known[name]) if name in known else _PARTS[name].read(part)
            given[name] = meant
        try:
            yield _known(mission, Wish(form, **given))
        except ValueError as error:
            raise ValueError(f"Wish {quoted(text)}: {error}") from None
        start = found.end()


def _meant(text: str, known: Container[Any]) -> Hashable:
    """Return the label that a text means: the value that it writes if that is known, or itself."""
    with suppress(ValueError, SyntaxError):
        value = ast.literal_eval(text)
        label = read_label(list(value) if isinstance(value, tuple) else value)
        if label in known:
            return label
    return text


def _known(mission: Mission, wish: Wish) -> Wish:
    """Return a wish of which the mission has the node, the kind, and so many robots."""
    kinds = [kind.name for kind in mission.kinds]
    if wish.form == "reach" and wish.node not in mission.graph:
        raise _unknown(mission, "node", wish.node, mission.nodes)
    if wish.kind is not None and wish.kind not in kinds:
        raise _unknown(mission, "kind of robots", wish.kind, kinds)
    if wish.form == "worst case":
        checks.check_integer("losses", wish.losses, at_least=0, at_most=mission.robots)
    return wish


def node_of(mission: Mission, text: str) -> Hashable:
    """Return the node that a text names, as in a wish; a ValueError names one that is unknown."""
    node = _meant(text, mission.graph)
    if node not in mission.graph:
        raise _unknown(mission, "node", node, mission.nodes)
    return node


def _unknown(mission: Mission, what: str, label: object, known: Iterable[object]) -> ValueError:
    near = checks.most_alike(str(label), map(str, known))
    return ValueError(f"mission {mission.name!r} has no {what} {quoted(label)}{near}.")


def _not_a_wish(mission: Mission, found: object) -> ValueError:
    hint = " Write 80 % as 0.8." if "%" in str(found) else ""
    kind = label_text(mission.kinds[0].name)
    of_kind = f", or {kind} survivors," if len(mission.kinds) > 1 else ""
    return ValueError(
        f"Expected a wish, got {quoted(found)}. Wishes are {'; '.join(FORMS)}; the first three "
        f"may have survivors{of_kind} in place of reward. Join several by ' and '.{hint}"
    )


class Candidates:
    """Plans of one mission, judged by wishes; distributions of rewards are computed when needed."""

    def __init__(self, mission: Mission, plans: Plans) -> None:
        self.mission = mission
        self.batch = check_mission(mission).batch(plans)
        self.plans = tuple(self.batch)
        if not self.plans:
            raise ValueError("Expected at least one plan to choose from, got none.")
        self.objectives = mission.evaluate(self.batch)
        self._survival = mission.robot_survival(self.batch)
        self._rewards: dict[int, o.Distribution] = {}

    def __len__(self) -> int:
        return len(self.plans)

    def value(self, wish: Wish, i: int) -> float:
        """Compute the value of plan ``i`` that a wish limits."""
        mission, plan = self.mission, self.plans[i]
        match wish.form:
            case "expected" if wish.kind is None:
                return float(self.objectives[i, QUANTITIES.index(wish.subject)])
            case "expected":
                counts = [of.name == wish.kind for of in mission.kind_of]
                return float(self._survival[i, counts].sum())
            case "chance":
                found = self.distribution(wish.quantity, i, wish.kind)
                return found.at_least(float(wish.value))
            case "tail mean":
                return self.distribution(wish.quantity, i, wish.kind).cvar(wish.alpha)
            case "worst case":
                return worst_losses(mission, plan, wish.losses)[0]
            case "every robot":
                return float(self._survival[i].min())
        reached = o.team_reach(o.reach_probabilities(mission, plan))
        return float(reached[mission.index(wish.node)])

    def missing(self, wish: Wish, i: int) -> float:
        """Compute the shortfall of plan ``i``; 0 if it meets the wish."""
        lacking = wish.at_least - self.value(wish, i)
        return lacking if lacking > SLACK * self.span(wish) else 0.0

    def span(self, wish: Wish) -> float:
        """Return the range of what a plan can have, by which shortfalls are scaled."""
        return 1.0 if wish.is_probability else self._most(wish) or 1.0

    def beyond(self, wish: Wish) -> str | None:
        """Write what the mission has, if a wish needs more than any plan can have; else None."""
        needed, most = wish.value if wish.form == "chance" else wish.at_least, self._most(wish)
        can_be_met = wish.form in ("every robot", "reach") or wish.at_least <= SLACK
        if can_be_met or needed <= most + SLACK * (most or 1.0):
            return None
        if wish.quantity != "survivors":
            return f"a total reward of {exact_text(most)}"
        of_kind = "" if wish.kind is None else f" of kind {quoted(wish.kind)}"
        return counted(int(most), "robot") + of_kind

    def _most(self, wish: Wish) -> float:
        if wish.quantity != "survivors":
            return self.mission.total_reward
        return float(sum(k.robots for k in self.mission.kinds if wish.kind in (None, k.name)))

    def simulation_note(self, wishes: Iterable[Wish]) -> str:
        """Write a sentence if rewards by which these wishes are judged had to be simulated."""
        exact = all(found.exact for found in self._rewards.values())
        if exact or not any(wish.of_rewards for wish in wishes):
            return ""
        how = f"were simulated with {N_SAMPLES:,} missions"
        return f" Some rewards {how}, because their exact distributions take too long."

    def distribution(self, quantity: str | None, i: int, kind: str | None = None) -> o.Distribution:
        """Compute the distribution of the reward or the survivors, of a kind, of plan ``i``."""
        if quantity == "survivors":
            return o.survivors_distribution(self.mission, self.plans[i], kind=kind)
        if i not in self._rewards:
            limits = {"max_outcomes": MAX_OUTCOMES, "n_samples": N_SAMPLES}
            self._rewards[i] = o.reward_distribution(
                self.mission, self.plans[i], **limits, random_state=SEED
            )
        return self._rewards[i]
