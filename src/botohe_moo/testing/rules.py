"""A rule is a promise: how it is checked, and how to keep it."""

import inspect
import os
import traceback
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from types import ModuleType
from typing import Any, Literal

from botohe_moo.base.messages import quoted

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


@dataclass(frozen=True)
class Check:
    """One rule on one algorithm or mission, to be called in a test.

    A rule is a function that takes what is checked, as ``make``, and raises an error if the promise
    is not kept. Its docstring begins with the promise, and the next paragraph says how to keep it.
    """

    function: Callable[[Any], None]
    factory: Callable[..., Any]  # the class or function itself
    make: Any  # makes what is checked

    @property
    def rule(self) -> str:
        """The name of the rule."""
        return self.function.__name__

    def __call__(self) -> None:
        """Check; a BrokenRuleError says what happened, and what to do."""
        if message := self.fault():
            promise, remedy = said_by(self.function)
            name = getattr(self.factory, "__qualname__", quoted(self.factory))
            raise BrokenRuleError(
                f"{name}, {self.rule}: {message}.\nThe rule: {promise}\nTo keep it: {remedy}"
            )

    def fault(self) -> str:
        """Return how the rule is broken; nothing where it is kept."""
        try:
            self.function(self)
        except BrokenRuleError as error:
            return str(error)
        except (Exception, SystemExit) as error:  # whatever another package's code may raise
            text = " ".join(f"{type(error).__name__}: {error}".split()).rstrip(": ")
            frames = traceback.extract_tb(error.__traceback__)
            theirs = [frame for frame in frames if not frame.filename.startswith(_OURS)]
            where = [f" ({Path(f.filename).name}, line {f.lineno})" for f in theirs[-1:]]
            return text[:_LONGEST].rstrip(".") + "".join(where)
        return ""


def said_by(rule: Callable[..., None]) -> tuple[str, str]:
    """Return the promise of a rule, and how to keep it, as its docstring has them."""
    promise, remedy, *_ = (inspect.getdoc(rule) or "").split("\n\n")
    return " ".join(promise.split()), " ".join(remedy.split())


def expect(kept: object, message: str) -> None:
    """Raise a BrokenRuleError with this message where a promise is not kept."""
    if not kept:
        raise BrokenRuleError(message)


def rules_of(module: ModuleType) -> list[Callable[[Any], None]]:
    """Return the rules of a module: its public functions, in their order."""
    return [
        found
        for name, found in vars(module).items()
        if getattr(found, "__module__", "") == module.__name__ and not name.startswith("_")
    ]
