"""A rule is a promise: how it is checked, and how to keep it."""

import inspect
import traceback
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from types import ModuleType
from typing import Any, Literal

_OURS = str(Path(__file__).parents[1])


@dataclass(frozen=True)
class CheckResult:
    """What a check of one rule has found.

    Attributes
    ----------
    rule
        The name of the rule.
    status
        ``"passed"`` or ``"failed"``.
    message
        What happened; empty where it passed.
    remedy
        How to keep the promise; empty where it passed.

    Examples
    --------
    >>> from botohe_moo.testing import CheckResult, check_plugin
    >>> check_plugin("random")[0].status
    'passed'
    >>> CheckResult("one_robot", "failed", "a single robot collects nothing").rule
    'one_robot'
    """

    rule: str
    status: Literal["passed", "failed"]
    message: str = ""
    remedy: str = ""


@dataclass(frozen=True)
class Check:
    """One rule on one algorithm or mission, to be called in a test.

    A rule is a function that takes what is checked, as ``make``, and asserts the promise. Its
    docstring begins with the promise, and the next paragraph says how to keep it.
    """

    function: Callable[[Any], None]
    factory: Callable[..., Any]  # the class or function itself
    make: Any  # makes what is checked

    @property
    def rule(self) -> str:
        """The name of the rule."""
        return self.function.__name__

    def __call__(self) -> None:
        """Check; an AssertionError says what happened."""
        self.function(self)

    def result(self) -> CheckResult:
        """Check, and return what was found."""
        try:
            self()
        except (Exception, SystemExit) as error:  # whatever another package's code may raise
            message = " ".join(str(error).split())
            frames = traceback.extract_tb(error.__traceback__)
            if theirs := [each for each in frames if not each.filename.startswith(_OURS)]:
                where = f"{Path(theirs[-1].filename).name}, line {theirs[-1].lineno}"
                message = f"{type(error).__name__}: {message.rstrip('.')} ({where})"
            return CheckResult(self.rule, "failed", message, said_by(self.function)[1])
        return CheckResult(self.rule, "passed")


def said_by(rule: Callable[..., None]) -> tuple[str, str]:
    """Return the promise of a rule, and how to keep it, as its docstring has them."""
    promise, remedy, *_ = (inspect.getdoc(rule) or "").split("\n\n")
    return " ".join(promise.split()), " ".join(remedy.split())


def rules_of(module: ModuleType) -> list[Callable[[Any], None]]:
    """Return the rules of a module: its public functions, in their order."""
    return [
        found
        for name, found in vars(module).items()
        if getattr(found, "__module__", "") == module.__name__ and not name.startswith("_")
    ]
