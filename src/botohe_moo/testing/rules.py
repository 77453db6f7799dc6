"""Rules: a promise each, how it is checked, and how to keep it."""

from __future__ import annotations

import inspect
import os
import time
import traceback
from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Literal, TypeAlias

from botohe_moo.base.messages import quoted
from botohe_moo.base.parameters import summary_of

_OURS = str(Path(__file__).parents[1]) + os.sep
_LONGEST = 500  # characters of another package's message


class BrokenRuleError(AssertionError):
    """Says which promise is not kept, what happened, and what to do.

    Examples
    --------
    >>> from botohe_moo.testing import BrokenRuleError
    >>> issubclass(BrokenRuleError, AssertionError)  # which pytest shows as a failed test
    True
    """


@dataclass(frozen=True)
class Subject:
    """What is checked: what makes it, and what it states of its parameters."""

    name: str
    factory: Callable[..., Any]  # the class or function itself
    make: Callable[[], Any]


_Check: TypeAlias = Callable[[Subject], None]


@dataclass(frozen=True)
class Rule:
    """A promise, and how it is checked."""

    name: str
    promise: str
    remedy: str
    check: _Check  # raises whatever shows that the promise is not kept
    comes_first: bool = False  # whether without it there is nothing to check the others on


@dataclass(frozen=True)
class CheckResult:
    """What a check of one rule has found.

    Attributes
    ----------
    rule
        The name of the rule.
    status
        ``"passed"``, ``"failed"``, or ``"not run"`` where nothing could be made to check it on.
    seconds
        How long it took.
    message
        What happened; empty where it passed.
    remedy
        How to keep the promise; empty where it passed.

    Examples
    --------
    >>> from botohe_moo.testing import CheckResult, check_algorithm
    >>> check_algorithm("random")[0].status
    'passed'
    >>> CheckResult("one_robot", "failed", 0.1, "a single robot collects nothing").rule
    'one_robot'
    """

    rule: str
    status: Literal["passed", "failed", "not run"]
    seconds: float
    message: str = ""
    remedy: str = ""


class Rules(list[Rule]):
    """Rules in the order in which they are best fixed."""

    def add(self, remedy: str, *, comes_first: bool = False) -> Callable[[_Check], _Check]:
        """Add a function as a rule: its name is the rule's, and its docstring the promise."""

        def add(check: _Check) -> _Check:
            promise = summary_of(check)
            self.append(Rule(check.__name__, promise, remedy, check, comes_first))
            return check

        return add


def expect(kept: object, message: str) -> None:
    """Raise a BrokenRuleError with this message where a promise is not kept."""
    if not kept:
        raise BrokenRuleError(message)


def run_rules(rules: Iterable[Rule], subject: Subject) -> list[CheckResult]:
    """Check all rules, up to one that comes first and fails: then the others are not run."""
    results: list[CheckResult] = []
    broken: CheckResult | None = None
    for each in rules:
        if broken is not None:
            reason = f"{broken.rule} failed"
            results.append(CheckResult(each.name, "not run", 0.0, reason, broken.remedy))
            continue
        started = time.perf_counter()
        message = fault_of(each, subject)
        result = CheckResult(each.name, "passed", time.perf_counter() - started)
        if message is not None:
            result = replace(result, status="failed", message=message, remedy=each.remedy)
            broken = result if each.comes_first else None
        results.append(result)
    return results


def fault_of(each: Rule, subject: Subject) -> str | None:
    """Return how a rule is broken; None where it is kept."""
    try:
        each.check(subject)
    except BrokenRuleError as error:
        return str(error)
    except (Exception, SystemExit) as error:  # whatever another package's code may raise
        return _raised(error)
    return None


def _raised(error: BaseException) -> str:
    """Write what was raised, and where in code of other packages."""
    text = f"{type(error).__name__}: {error}".rstrip(": ")
    text = " ".join(text.split())
    frames = traceback.extract_tb(error.__traceback__)
    theirs = [frame for frame in frames if not frame.filename.startswith(_OURS)]
    where = f" ({Path(theirs[-1].filename).name}, line {theirs[-1].lineno})" if theirs else ""
    return f"{text[:_LONGEST].rstrip('.')}{where}"


def name_of(factory: Any) -> str:
    """Return the name of a function or class, for messages."""
    if isinstance(factory, str):
        return factory
    named = inspect.isroutine(factory) or isinstance(factory, type)
    return str(factory.__qualname__) if named else quoted(factory)
