"""What planners may wish of a plan: each wish is a lower limit on a quantity."""

import json
import math
import re
from collections.abc import Hashable
from contextlib import suppress
from dataclasses import dataclass
from typing import ClassVar, Literal

from botohe_moo.base.messages import (
    ParameterError,
    check_choice,
    check_integer,
    check_number,
    quoted,
)
from botohe_moo.mission.formats.nodelink import plain_label
from botohe_moo.mission.rules import read_label

Quantity = Literal["reward", "survivors"]
QUANTITIES = ("reward", "survivors")

_PLAIN_LABEL = re.compile(r"(?!(?:True|False)\Z)[^\W\d]\w*")


@dataclass(frozen=True, kw_only=True)
class Wish:
    """A lower limit on a quantity of a plan; ``str`` writes it as planners do.

    One of `Expected`, `Chance`, `TailMean`, `WorstCase`, `EveryRobot` and `Reach`.

    Parameters
    ----------
    at_least
        The least value that meets the wish.

    Examples
    --------
    >>> from botohe_moo.decide import Reach, Wish
    >>> isinstance(Reach(node="vault", at_least=0.9), Wish)
    True
    """

    at_least: float

    is_probability: ClassVar[bool] = False

    def __post_init__(self) -> None:
        if hasattr(self, "quantity"):
            check_choice("quantity", self.quantity, QUANTITIES)
        if vars(self).get("kind") is not None and vars(self)["quantity"] != "survivors":
            found = quoted(vars(self)["kind"])
            raise ParameterError(f"Expected no kind of robots for the reward, got {found}.", "kind")
        limits: dict[str, dict[str, float]] = {
            "value": {"at_least": 0},
            "alpha": {"above": 0, "at_most": 1},
            "at_least": {"at_least": 0, "at_most": 1 if self.is_probability else math.inf},
        }
        if "losses" in vars(self):
            losses = check_integer("losses", vars(self)["losses"], at_least=0)
            object.__setattr__(self, "losses", losses)
        for name in limits:
            if name in vars(self):
                number = check_number(name, vars(self)[name], **limits[name])
                object.__setattr__(self, name, number)


@dataclass(frozen=True, kw_only=True)
class Expected(Wish):
    """An expectation: ``reward >= 5`` is E[R] >= 5, ``survivors >= 2`` is E[S] >= 2.

    Parameters
    ----------
    at_least
        Expected reward or number of survivors, at least 0.
    quantity
        ``"reward"`` or ``"survivors"``.
    kind
        The kind of robots whose survivors count, by its name; default: all.

    Examples
    --------
    >>> from botohe_moo.decide import Expected
    >>> print(Expected(quantity="survivors", at_least=2))
    survivors >= 2
    """

    quantity: Quantity
    kind: str | None = None

    def __str__(self) -> str:
        return f"{_subject(self)} >= {exact_text(self.at_least)}"


@dataclass(frozen=True, kw_only=True)
class Chance(Wish):
    """A probability: ``P(reward >= 5) >= 0.8``, ``P(survivors >= 2) >= 0.9``.

    Parameters
    ----------
    at_least
        Probability, in [0, 1].
    quantity
        ``"reward"`` or ``"survivors"``.
    value
        What the quantity is to reach, at least 0.
    kind
        The kind of robots whose survivors count, by its name; default: all.

    Examples
    --------
    >>> from botohe_moo.decide import Chance
    >>> print(Chance(quantity="reward", value=5, at_least=0.8))
    P(reward >= 5) >= 0.8
    """

    quantity: Quantity
    value: float
    kind: str | None = None

    is_probability = True

    def __str__(self) -> str:
        return f"P({_subject(self)} >= {exact_text(self.value)}) >= {exact_text(self.at_least)}"


@dataclass(frozen=True, kw_only=True)
class TailMean(Wish):
    """A conditional value at risk: ``CVaR(reward, 0.1) >= 3``, the mean of the lowest tenth.

    Parameters
    ----------
    at_least
        Mean reward or number of survivors of that share, at least 0.
    quantity
        ``"reward"`` or ``"survivors"``.
    alpha
        Share of the outcomes, in (0, 1], as for :meth:`Distribution.cvar`.
    kind
        The kind of robots whose survivors count, by its name; default: all.

    Examples
    --------
    >>> from botohe_moo.decide import TailMean
    >>> print(TailMean(quantity="reward", alpha=0.1, at_least=3))
    CVaR(reward, 0.1) >= 3
    """

    quantity: Quantity
    alpha: float
    kind: str | None = None

    def __str__(self) -> str:
        return f"CVaR({_subject(self)}, {exact_text(self.alpha)}) >= {exact_text(self.at_least)}"


@dataclass(frozen=True, kw_only=True)
class WorstCase(Wish):
    """The least E[R] if some robots never leave: ``worst case of 1 loss >= 5``.

    Parameters
    ----------
    at_least
        Expected reward, at least 0, as :func:`botohe_moo.worst_case` computes it.
    losses
        How many robots never leave, at least 0.

    Examples
    --------
    >>> from botohe_moo.decide import WorstCase
    >>> print(WorstCase(losses=2, at_least=3))
    worst case of 2 losses >= 3
    """

    losses: int

    quantity: ClassVar[Quantity] = "reward"
    kind: ClassVar[None] = None

    def __str__(self) -> str:
        losses = "loss" if self.losses == 1 else "losses"
        return f"worst case of {self.losses} {losses} >= {exact_text(self.at_least)}"


@dataclass(frozen=True, kw_only=True)
class EveryRobot(Wish):
    """Every robot's own survival: ``every robot >= 0.5``.

    Parameters
    ----------
    at_least
        Probability, in [0, 1].

    Examples
    --------
    >>> from botohe_moo.decide import EveryRobot
    >>> print(EveryRobot(at_least=0.5))
    every robot >= 0.5
    """

    is_probability = True

    def __str__(self) -> str:
        return f"every robot >= {exact_text(self.at_least)}"


@dataclass(frozen=True, kw_only=True)
class Reach(Wish):
    """The probability that at least one robot reaches a node: ``reach vault >= 0.9``.

    Parameters
    ----------
    at_least
        Probability, in [0, 1].
    node
        The node's label.

    Examples
    --------
    >>> from botohe_moo.decide import Reach
    >>> print(Reach(node="north hall", at_least=0.9))
    reach "north hall" >= 0.9
    """

    node: Hashable

    is_probability = True

    def __str__(self) -> str:
        return f"reach {label_text(self.node)} >= {exact_text(self.at_least)}"


def _subject(wish: Expected | Chance | TailMean) -> str:
    return wish.quantity if wish.kind is None else f"{label_text(wish.kind)} {wish.quantity}"


def exact_text(value: float) -> str:
    """Write a number with all the digits that it takes to read the same number again."""
    text = f"{value:g}"
    return text if float(text) == value else repr(value)


def label_text(label: Hashable) -> str:
    """Write a label as wishes have it: words as they are, other texts in quotes."""
    if isinstance(label, str):
        return label if _PLAIN_LABEL.fullmatch(label) else json.dumps(label, ensure_ascii=False)
    with suppress(ValueError):  # labels that JSON cannot hold
        label = read_label(plain_label(label))  # with Python's numbers instead of numpy's
    return repr(label)
