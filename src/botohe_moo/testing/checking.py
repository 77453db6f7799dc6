"""Checks of algorithms and missions of other packages, one by one or as tests of pytest."""

from __future__ import annotations

import functools
import time
from collections.abc import Callable, Iterable, Mapping
from typing import TYPE_CHECKING, Any, Literal, TypeAlias

from pymoo.core.algorithm import Algorithm

from botohe_moo.algorithms.registry import ALGORITHMS, find_algorithm, make_algorithm
from botohe_moo.base.messages import PluginError, nearest_first, quoted
from botohe_moo.base.registry import is_path, says_it_makes
from botohe_moo.mission.loading import MISSIONS, find_factory, load_mission
from botohe_moo.mission.model import Mission
from botohe_moo.testing import algorithms, missions
from botohe_moo.testing.rules import BrokenRuleError, Check, CheckResult, rules_of, said_by

if TYPE_CHECKING:
    import pytest

Kind: TypeAlias = Literal["algorithm", "mission"]
# The rules for each kind, how a factory is found by its name, and how it is called by it.
_KINDS: dict[Kind, tuple[Any, Any, Any]] = {
    "algorithm": (algorithms, find_algorithm, make_algorithm),
    "mission": (missions, find_factory, load_mission),
}


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
    return _results(factory, parameters, "algorithm")


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
    return _results(factory, parameters, "mission")


def _results(factory: Any, parameters: Mapping[str, Any] | None, kind: Kind) -> list[CheckResult]:
    results: list[CheckResult] = []
    broken = remedy = ""
    for check in _checks(factory, parameters, kind):
        began = time.perf_counter()
        if broken:
            results.append(CheckResult(check.rule, "not run", 0.0, f"{broken} failed", remedy))
        elif message := check.fault():
            seconds, remedy = time.perf_counter() - began, said_by(check.function)[1]
            results.append(CheckResult(check.rule, "failed", seconds, message, remedy))
            broken = check.rule if check.rule in ("can_be_made", "runs_end") else ""
        else:
            results.append(CheckResult(check.rule, "passed", time.perf_counter() - began))
    return results


def kind_of(factory: str | Callable[..., Any]) -> Kind:
    """Return what a factory, or the factory of a name, says that it makes.

    It is taken for an algorithm where it does not say, and where both have the name.
    """
    if isinstance(factory, str) and not is_path(factory):
        return "mission" if factory in MISSIONS and factory not in ALGORITHMS else "algorithm"
    try:
        found = MISSIONS.find(factory) if isinstance(factory, str) else factory
    except PluginError:  # making it says why
        return "algorithm"
    return "mission" if says_it_makes(found, Mission) else "algorithm"


def _checks(factory: Any, parameters: Mapping[str, Any] | None, kind: Kind) -> list[Check]:
    """Return the checks of an algorithm or a mission, a rule each."""
    rules, find, by_name = _KINDS[kind]
    is_name = isinstance(factory, str)
    found = find(factory) if is_name else factory
    if not callable(found):
        expected = f"a class or function that makes {'an' if kind[0] == 'a' else 'a'} {kind}"
        raise TypeError(f"Expected {expected}, or its name, got {quoted(factory)}.")
    make = functools.partial(by_name, factory) if is_name else factory
    make = functools.partial(make, **(parameters or {}))
    return [Check(rule, found, make) for rule in rules_of(rules)]


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
    cases, known = [], set()
    for factory in factories:
        for check in _checks(factory, None, kind or kind_of(factory)):
            known.add(check.rule)
            marks: list[Any] = []
            if check.rule in expected:
                reason = expected[check.rule]
                marks.append(pytest.mark.xfail(reason=reason, strict=True, raises=BrokenRuleError))
            name = factory if isinstance(factory, str) else check.factory.__qualname__
            cases.append(pytest.param(check, id=f"{name}-{check.rule}", marks=marks))
    for rule in expected.keys() - known if known else ():
        near = ", ".join(nearest_first(str(rule), sorted(known)))
        raise ValueError(f"There is no rule {rule!r}; known are {near}.")
    return pytest.mark.parametrize("check", cases)
