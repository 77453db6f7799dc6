"""Wishes: what planners write, and how plans are judged by it."""

from __future__ import annotations

import ast
import json
import re
from collections.abc import Callable, Hashable, Iterable, Iterator, Mapping
from contextlib import suppress
from dataclasses import dataclass
from typing import Any, Literal

from botohe_moo import outcomes as o
from botohe_moo.base import messages as checks
from botohe_moo.base import parameters as p
from botohe_moo.base.messages import quoted
from botohe_moo.base.types import FloatArray
from botohe_moo.decide.fronts import SLACK
from botohe_moo.decide.hazards import worst_loss
from botohe_moo.mission.formats.graphs import plain_label
from botohe_moo.mission.formats.reading import find_label
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
_SUBJECT = rf"(?:(?P<kind>{_QUOTED}|[\w.-]+) (?=survivors))?(?P<quantity>reward|survivors)\b"
_PLAIN_LABEL = re.compile(r"(?!(?:True|False)\Z)[^\W\d]\w*")

# How each form is written, before its level. A label without quotes ends where its wish does.
_PATTERNS = {
    "every robot": r"every robot",
    "reach": rf"reach (?P<node>{_QUOTED}|\S.*?)",
    "worst case": r"worst case of (?P<losses>\d+) loss(?:es)?",
    "worst scenario": rf"worst scenario {_SUBJECT}",
    "chance": rf"P_\(_{_SUBJECT}_>=_(?P<value>{_NUMBER})_\)",
    "tail mean": rf"CVaR_\(_{_SUBJECT}_,_(?P<alpha>{_NUMBER})_\)",
    "expected": rf"(?:expected )?{_SUBJECT}",
}
_TEXTS = {
    "expected": "{subject} >= {at_least}",
    "chance": "P({subject} >= {value}) >= {at_least}",
    "tail mean": "CVaR({subject}, {alpha}) >= {at_least}",
    "worst case": "worst case of {losses} >= {at_least}",
    "worst scenario": "worst scenario {subject} >= {at_least}",
    "every robot": "every robot >= {at_least}",
    "reach": "reach {node} >= {at_least}",
}
_READERS: dict[str, Callable[[str], Any]] = {"quantity": str.lower, "losses": int}  # else floats
_PROBABILITIES = ("chance", "every robot", "reach")  # whose level is one
_EXAMPLE = {"subject": "reward", "value": 5, "alpha": 0.1, "losses": "1 loss", "node": "NODE"}
FORMS = tuple(
    text.format(**_EXAMPLE, at_least=0.8 if form in _PROBABILITIES else 5)
    for form, text in _TEXTS.items()
)


def _compiled(pattern: str) -> re.Pattern[str]:
    """Compile a form, with ``_`` for blanks that may be there, and its level.

    A wish ends with the text, or with ``and`` and more.
    """
    whole = rf"_{pattern}_>=_(?P<at_least>{_NUMBER})_(?:(?<=\s)and\s+(?=\S)|\Z)"
    whole = re.sub("_(?!least)", r"\\s*", whole).replace(" ", r"\s+").replace(">=", "(?:>=|≥)")
    return re.compile(whole, re.IGNORECASE | re.DOTALL)


_COMPILED = {form: _compiled(pattern) for form, pattern in _PATTERNS.items()}


@dataclass(frozen=True, repr=False)
class Wish:
    """A lower limit on a quantity of a plan; ``str`` writes it as planners do.

    Most are written as texts, which :func:`parse_wishes` reads. It also checks their parts.

    Parameters
    ----------
    form
        ``"expected"``, ``"chance"``, ``"tail mean"``, ``"worst case"``, ``"worst scenario"``,
        ``"every robot"`` or ``"reach"``: see :func:`parse_wishes`.
    at_least
        The least value that meets the wish, at least 0; a probability is in [0, 1].
    quantity
        ``"reward"`` or ``"survivors"``, of the first three forms and a ``"worst scenario"``.
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

    def __str__(self) -> str:
        kind = "" if self.kind is None else f"{label_text(self.kind)} "
        losses = "1 loss" if self.losses == 1 else f"{self.losses} losses"
        numbers = {name: getattr(self, name) for name in ("value", "alpha", "at_least")}
        texts = {name: str(of).removesuffix(".0") for name, of in numbers.items() if of is not None}
        texts |= {"subject": f"{kind}{self.quantity}", "losses": losses}
        return _TEXTS[self.form].format(**texts, node=label_text(self.node))

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

    There are seven forms, in upper or lower case, ``≥`` for ``>=`` if preferred, where ``Q`` is
    ``reward``, ``survivors``, or ``KIND survivors`` with the name of a kind of robots; ``and``
    joins several::

        Q >= x                 expected reward, expected number of survivors
        P(Q >= x) >= p         chance: probability that it is x or more
        CVaR(Q, a) >= x        tail mean: mean of the lowest share a of the outcomes
        worst case of n losses >= x    expected reward if the worst n robots never leave
        worst scenario Q >= x          what is expected in the scenario in which that is least
        every robot >= p       survival of each robot
        reach NODE >= p        probability that a robot reaches the node

    A node is written as its label or its name: a word or a number as it is, any other text in
    quotes, and a tuple as in Python or, as in mission files, as a list. So is the name of a kind.
    ``expected`` may stand before a plain ``Q``.

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
            raise _not_a_wish(wish)
    if not found:
        raise _not_a_wish("")
    return tuple(found)


def _parsed(mission: Mission, text: str) -> Iterator[Wish]:
    kinds: dict[Any, Any] = {kind.name: {} for kind in mission.kinds}
    nodes = mission.graph.nodes
    readers = _READERS | {"kind": lambda t: _meant(t, kinds), "node": lambda t: _meant(t, nodes)}
    start = 0
    while start < len(text) or not start:
        matches = ((form, pattern.match(text, start)) for form, pattern in _COMPILED.items())
        form, found = next((pair for pair in matches if pair[1]), ("", None))
        if found is None:
            raise _not_a_wish(text[start:])
        parts = ((name, part) for name, part in found.groupdict().items() if part)
        given = {name: readers.get(name, float)(part) for name, part in parts}
        try:
            yield _known(mission, Wish(form, **given))
        except ValueError as error:
            raise ValueError(f"Wish {quoted(text)}: {error}") from None
        start = found.end()


def _meant(text: str, known: Mapping[Any, Any]) -> Hashable:
    """Return the label that a text means: the value that it writes, itself, or a node's name."""
    label: Hashable = text
    with suppress(ValueError, SyntaxError):
        value = ast.literal_eval(text)
        label = read_label(list(value) if isinstance(value, tuple) else value)
    return next((each for each in (label, text) if each in known), find_label(label, known))


def _known(mission: Mission, wish: Wish) -> Wish:
    """Return a wish whose numbers are in range, and whose node or kind the mission has."""
    checks.check_choice("form", wish.form, _TEXTS)
    most = p.Probability if wish.form in _PROBABILITIES else p.NotNegative
    p.check("the wanted value", wish.at_least, most)
    match wish.form:
        case "chance":
            p.check("the value in P( )", wish.value, p.NotNegative)
        case "tail mean":
            p.check("the share in CVaR( )", wish.alpha, float, gt=0, le=1)
        case "worst case":
            p.check("losses", wish.losses, int, ge=0, le=mission.robots)
        case "reach" if wish.node not in mission.graph:
            raise _unknown(mission, "node", wish.node, mission.nodes)
    kinds = [kind.name for kind in mission.kinds]
    if wish.kind is not None and (wish.kind not in kinds or wish.quantity != "survivors"):
        raise _unknown(mission, f"{wish.quantity} of kind", wish.kind, kinds)
    return wish


def node_of(mission: Mission, text: str) -> Hashable:
    """Return the node that a text names, as in a wish; a ValueError names one that is unknown."""
    node = _meant(text, mission.graph.nodes)
    if node not in mission.graph:
        raise _unknown(mission, "node", node, mission.nodes)
    return node


def _unknown(mission: Mission, what: str, label: object, known: Iterable[object]) -> ValueError:
    near = checks.most_alike(str(label), map(str, known))
    return ValueError(f"mission {mission.name!r} has no {what} {quoted(label)}{near}.")


def _not_a_wish(found: object) -> ValueError:
    return ValueError(
        f"Expected a wish, got {quoted(found)}. Wishes are {'; '.join(FORMS)}; the first three "
        "and worst scenario may have survivors, or survivors of a kind, in place of reward. Join "
        "several by ' and '. Write 80 % as 0.8."
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
            case "expected":
                return self._expected(wish, self.objectives[i], self._survival[i])
            case "worst scenario":
                cases = [one for _, one in mission.in_scenarios]
                found = ((one.evaluate([plan])[0], one.robot_survival([plan])[0]) for one in cases)
                return min(self._expected(wish, *each) for each in found)
            case "chance":
                return self.distribution(wish.quantity, i, wish.kind).at_least(float(wish.value))
            case "tail mean":
                return self.distribution(wish.quantity, i, wish.kind).cvar(wish.alpha)
            case "worst case":
                return worst_loss(mission, plan, wish.losses)
            case "every robot":
                return float(self._survival[i].min())
        reached = o.team_chances(o.reach_probabilities, mission, plan)
        return float(reached[mission.index(wish.node)])

    def _expected(self, wish: Wish, objectives: FloatArray, survival: FloatArray) -> float:
        """Return what is expected, given a plan's objectives and the survival of each robot."""
        if wish.kind is None:
            return float(objectives[QUANTITIES.index(wish.quantity)])
        return float(survival[[of.name == wish.kind for of in self.mission.kind_of]].sum())

    def missing(self, wish: Wish, i: int) -> float:
        """Compute the shortfall of plan ``i``; 0 if it meets the wish."""
        lacking = wish.at_least - self.value(wish, i)
        return lacking if lacking > SLACK * self.span(wish) else 0.0

    def span(self, wish: Wish) -> float:
        """Return the range of what a plan can have, by which shortfalls are scaled."""
        if wish.form in _PROBABILITIES:
            return 1.0
        if wish.quantity != "survivors":
            return self.mission.total_reward or 1.0
        return float(sum(k.robots for k in self.mission.kinds if wish.kind in (None, k.name)))

    def simulation_note(self) -> str:
        """Write a sentence if some rewards had to be simulated."""
        if all(found.exact for found in self._rewards.values()):
            return ""
        how = f"were simulated with {N_SAMPLES:,} missions"
        return f" Some rewards {how}, because their exact distributions take too long."

    def distribution(self, quantity: str | None, i: int, kind: str | None = None) -> o.Distribution:
        """Compute the distribution of the reward or the survivors, of a kind, of plan ``i``."""
        if quantity == "survivors":
            return o.survivors_distribution(self.mission, self.plans[i], kind=kind)
        if i not in self._rewards:
            how = {"max_outcomes": MAX_OUTCOMES, "n_samples": N_SAMPLES, "random_state": SEED}
            self._rewards[i] = o.reward_distribution(self.mission, self.plans[i], **how)
        return self._rewards[i]
