"""The checks as tests of the author's own package, by pytest."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from botohe_moo._base.checks import nearest_first, quoted
from botohe_moo.testing.checking import Kind, kind_of, rules_and_subject
from botohe_moo.testing.rules import BrokenRuleError, Rule, Subject, fault_of

if TYPE_CHECKING:
    import pytest


@dataclass(frozen=True)
class Check:
    """One rule on one algorithm or mission, to be called in a test."""

    rule: Rule
    subject: Subject

    def __call__(self) -> None:
        """Check; a BrokenRuleError says what happened, and what to do."""
        if (fault := fault_of(self.rule, self.subject)) is not None:
            raise BrokenRuleError(
                f"{self.subject.name}, {self.rule.name}: {fault}.\n"
                f"The rule: {self.rule.promise}\nTo keep it: {self.rule.remedy}"
            )


def parametrize_with_checks(
    factories: Iterable[str | Callable[..., Any]],
    *,
    expected_failed_checks: Mapping[str, str] | None = None,
    kind: Kind | None = None,
) -> pytest.MarkDecorator:
    """Make a test of each rule for each algorithm or mission; a decorator for a pytest test.

    The test takes ``check``, and calls it.

    Parameters
    ----------
    factories
        Classes, functions or names, as for :func:`check_algorithm`.
    expected_failed_checks
        Rules that are known to be broken, and why: these tests are expected to fail, and fail if
        they pass. They are rules of all factories that have them.
    kind
        ``"algorithm"`` or ``"mission"``; by default what each says that it makes, by its class or
        the annotation of what it returns, or else an algorithm.

    Raises
    ------
    TypeError
        If ``factories`` is not a list.
    ValueError
        If there is no rule of a name in ``expected_failed_checks``.
    ImportError
        Without pytest.

    Examples
    --------
    >>> from botohe_moo import RandomTrails
    >>> from botohe_moo.testing import parametrize_with_checks
    >>> @parametrize_with_checks([RandomTrails], expected_failed_checks={"one_robot": "no"})
    ... def test_conforms(check):
    ...     check()
    """
    import pytest

    if isinstance(factories, str) or not isinstance(factories, Iterable):
        raise TypeError(f"Expected factories to be a list, got {quoted(factories)}.")
    expected = dict(expected_failed_checks or {})
    made = [rules_and_subject(factory, None, kind or kind_of(factory)) for factory in factories]
    known = {rule.name for rules, _ in made for rule in rules}
    for name in expected.keys() - known if made else ():
        near = ", ".join(nearest_first(str(name), sorted(known)))
        raise ValueError(f"There is no rule {name!r}; known are {near}.")
    cases = []
    for rules, subject in made:
        for rule in rules:
            marks: list[Any] = []
            if rule.name in expected:
                reason = expected[rule.name]
                marks.append(pytest.mark.xfail(reason=reason, strict=True, raises=BrokenRuleError))
            label = f"{subject.name}-{rule.name}"
            cases.append(pytest.param(Check(rule, subject), id=label, marks=marks))
    return pytest.mark.parametrize("check", cases)
