"""Checks of algorithms and missions of other packages, one by one or as tests of pytest."""

from __future__ import annotations

import functools
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from pkgutil import resolve_name
from typing import TYPE_CHECKING, Any, Literal, TypeAlias

from botohe_moo.base.messages import nearest_first, quoted
from botohe_moo.testing.rules import (
    BrokenRuleError,
    CheckResult,
    Rule,
    Subject,
    fault_of,
    name_of,
    run_rules,
)

if TYPE_CHECKING:
    import pytest
    from pymoo.core.algorithm import Algorithm

    from botohe_moo.mission.model import Mission

Kind: TypeAlias = Literal["algorithm", "mission"]


def check_algorithm(
    factory: str | Callable[..., Algorithm],
    parameters: Mapping[str, Any] | None = None,
) -> list[CheckResult]:
    """Check whether an algorithm keeps all that studies rest on.

    Parameters
    ----------
    factory
        A class, or a function without arguments, that makes the algorithm; or its name, as for
        :func:`~botohe_moo.make_algorithm`: a registered one, or ``module:Class``.
    parameters
        What the factory is called with; by default nothing.

    Returns
    -------
    list of CheckResult
        One for each rule, in the order in which they are best fixed. If nothing can be made, the
        first has failed, and the others are not run.

    Raises
    ------
    ValueError
        If there is no algorithm of that name, or it cannot be imported.
    TypeError
        If ``factory`` is neither a name nor can be called.

    Notes
    -----
    All runs take small missions, a few hundred evaluations and fixed seeds. What an algorithm
    raises breaks the rule that was checked. An algorithm that never returns is not noticed: in
    tests, ``pytest-timeout`` ends it.

    Examples
    --------
    >>> from botohe_moo.testing import check_algorithm
    >>> results = check_algorithm("bo-aco", {"n_ants": 20})
    >>> {result.status for result in results}
    {'passed'}
    """
    return run_rules(*rules_and_subject(factory, parameters, "algorithm"))


def check_mission(
    factory: str | Callable[..., Mission],
    parameters: Mapping[str, Any] | None = None,
) -> list[CheckResult]:
    """Check whether a mission keeps all that studies rest on.

    As :func:`check_algorithm`, for functions that make a mission, and for the names that
    :func:`~botohe_moo.load_mission` knows.

    Parameters
    ----------
    factory
        A function that makes the mission, or its name, or ``module:function``.
    parameters
        What the factory is called with; by default nothing.

    Examples
    --------
    >>> from botohe_moo.testing import check_mission
    >>> [result.rule for result in check_mission("terrain", {"nodes": 20})][:3]
    ['can_be_made', 'parameters_stated', 'same_twice']
    """
    return run_rules(*rules_and_subject(factory, parameters, "mission"))


def kind_of(factory: str | Callable[..., Any]) -> Kind:
    """Return what a factory, or the factory of a name, says that it makes.

    It is taken for an algorithm where it does not say, and where both have the name.
    """
    # Imported when they are needed, as below: pymoo takes long to load, and missions do without.
    from botohe_moo.algorithms.registry import PLUGINS
    from botohe_moo.base.registry import is_path, says_it_makes
    from botohe_moo.mission.loading import mission_names
    from botohe_moo.mission.model import Mission

    found: Any = factory
    if isinstance(factory, str):
        if not is_path(factory):
            is_mission = factory not in PLUGINS.claims() and factory in mission_names()
            return "mission" if is_mission else "algorithm"
        try:
            found = resolve_name(factory)
        except Exception:  # of another package's code: making it says which
            return "algorithm"
    return "mission" if says_it_makes(found, Mission) else "algorithm"


def rules_and_subject(
    factory: str | Callable[..., Any],
    parameters: Mapping[str, Any] | None,
    kind: Kind,
) -> tuple[list[Rule], Subject]:
    """Return the rules for algorithms or missions, and what they are checked on."""
    if kind == "algorithm":
        from botohe_moo.algorithms.registry import find_algorithm, make_algorithm
        from botohe_moo.testing.algorithms import RULES

        found: Any = find_algorithm(factory) if isinstance(factory, str) else factory
        by_name: Callable[..., Any] = make_algorithm
    else:
        from botohe_moo.mission.loading import find_factory, load_mission
        from botohe_moo.testing.missions import RULES

        found = find_factory(factory) if isinstance(factory, str) else factory
        by_name = load_mission
    if not callable(found):
        expected = f"a class or function that makes {'an' if kind[0] == 'a' else 'a'} {kind}"
        raise TypeError(f"Expected {expected}, or its name, got {quoted(factory)}.")
    make: Any = functools.partial(by_name, factory) if isinstance(factory, str) else factory
    return RULES, Subject(name_of(factory), found, functools.partial(make, **(parameters or {})))


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
