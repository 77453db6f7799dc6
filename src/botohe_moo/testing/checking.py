"""Checks of algorithms and missions of other packages, one by one or as tests of pytest."""

from __future__ import annotations

import functools
from collections.abc import Callable, Iterable, Mapping
from typing import TYPE_CHECKING, Any

from botohe_moo.algorithms.registry import ALGORITHMS, find_algorithm, make_algorithm
from botohe_moo.base.messages import PluginError, quoted
from botohe_moo.base.registry import is_path, says_it_makes
from botohe_moo.mission.loading import MISSIONS, find_factory, load_mission
from botohe_moo.mission.model import Mission
from botohe_moo.testing import algorithms, missions
from botohe_moo.testing.rules import Check, CheckResult, rules_of

if TYPE_CHECKING:
    import pytest


def check_plugin(
    factory: str | Callable[..., Any], parameters: Mapping[str, Any] | None = None
) -> list[CheckResult]:
    """Check whether an algorithm or a mission keeps all that studies rest on.

    A function is taken for a mission if it says so, by the annotation of what it returns.

    Parameters
    ----------
    factory
        A class, or a function without arguments, that makes the algorithm or mission; or its name,
        as for :func:`~botohe_moo.make_algorithm` and :func:`~botohe_moo.load_mission`: a registered
        one, or ``module:name``.
    parameters
        What the factory is called with; by default nothing.

    Returns
    -------
    list of CheckResult
        One for each rule, in the order in which they are best fixed. They end with the first
        failure of ``can_be_made`` or ``runs_end``, since nothing else can be checked then.

    Raises
    ------
    ValueError
        If nothing has that name, or it cannot be imported.
    TypeError
        If ``factory`` is neither a name nor can be called.

    Notes
    -----
    All runs take small missions, a few hundred evaluations and fixed seeds. What an algorithm
    raises breaks the rule that was checked. An algorithm that never returns is not noticed: in
    tests, ``pytest-timeout`` ends it.

    Examples
    --------
    >>> from botohe_moo.testing import check_plugin
    >>> results = check_plugin("bo-aco", {"n_ants": 20})
    >>> {result.status for result in results}
    {'passed'}
    >>> [result.rule for result in check_plugin("terrain", {"nodes": 20})][:3]
    ['can_be_made', 'parameters_stated', 'same_twice']
    """
    results: list[CheckResult] = []
    for check in _checks(factory, parameters or {}):
        results.append(check.result())
        if results[-1].status == "failed" and check.rule in ("can_be_made", "runs_end"):
            break
    return results


def _makes_mission(factory: str | Callable[..., Any]) -> bool:
    """Return whether a factory, or the factory of a name, says that it makes a mission."""
    if isinstance(factory, str) and not is_path(factory):
        return factory in MISSIONS and factory not in ALGORITHMS
    try:
        found = MISSIONS.find(factory) if isinstance(factory, str) else factory
    except PluginError:  # making it says why
        return False
    return says_it_makes(found, Mission)


def _checks(factory: Any, parameters: Mapping[str, Any]) -> list[Check]:
    """Return the checks of an algorithm or a mission, a rule each."""
    is_mission = _makes_mission(factory)
    make = factory
    if isinstance(factory, str):
        make = functools.partial(load_mission if is_mission else make_algorithm, factory)
        factory = find_factory(factory) if is_mission else find_algorithm(factory)
    elif not callable(factory):
        raise TypeError(f"Expected a class, a function or a name, got {quoted(factory)}.")
    make = functools.partial(make, **parameters)
    return [Check(rule, factory, make) for rule in rules_of(missions if is_mission else algorithms)]


def parametrize_with_checks(factories: Iterable[str | Callable[..., Any]]) -> pytest.MarkDecorator:
    """Make a test of each rule for each algorithm or mission; a decorator for a pytest test.

    The test takes ``check``, and calls it. ``check.rule`` is the rule's name.

    Parameters
    ----------
    factories
        Classes, functions or names, as for :func:`check_plugin`.

    Raises
    ------
    ImportError
        Without pytest.

    Examples
    --------
    >>> from botohe_moo import RandomTrails
    >>> from botohe_moo.testing import parametrize_with_checks
    >>> @parametrize_with_checks([RandomTrails])
    ... def test_conforms(check):
    ...     check()
    """
    import pytest

    checks = [check for factory in factories for check in _checks(factory, {})]
    ids = [f"{getattr(check.factory, '__qualname__', '')}-{check.rule}" for check in checks]
    return pytest.mark.parametrize("check", checks, ids=ids)
