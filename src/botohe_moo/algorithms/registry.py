"""Algorithms by name: those of this package and those that other packages register."""

import functools
import inspect
from collections.abc import Callable
from typing import Any

from pymoo.core.algorithm import Algorithm

from botohe_moo.base import parameters as p
from botohe_moo.base.messages import ParameterError, PluginError
from botohe_moo.base.registry import Registry, is_path
from botohe_moo.mission.loading import load_mission

ALGORITHMS = Registry("botohe_moo.algorithms", "algorithm")
# Options of a run: the caller of ``minimize`` sets them.
_PYMOOS_OWN = frozenset(inspect.signature(Algorithm).parameters)


def make_algorithm(name: str, /, **parameters: Any) -> Algorithm:
    """Make the algorithm of that name.

    Parameters
    ----------
    name
        One of :func:`algorithm_names`, or ``module:Class``.
    **parameters
        Its parameters; ``botohe algorithms NAME`` lists them. pymoo's own options, such as
        ``callback`` and ``verbose``, are for ``minimize``.

    Raises
    ------
    ValueError
        If there is no such algorithm (lists the known ones, nearest first), it cannot be imported,
        or a parameter is unknown, missing, or out of its range.

    Notes
    -----
    Packages register algorithms in the entry-point group ``botohe_moo.algorithms``: callables
    that return a pymoo algorithm. They state their parameters by a typed signature, with ranges as
    in ``Annotated[float, Field(gt=0)]``. Only parameters that are stated can be given:
    ``**kwargs`` would swallow every misspelt name.

    ``module:Class`` names one that is not registered: a class derived from pymoo's ``Algorithm``,
    or a function whose annotation says that it returns one. Nothing else is called, but importing
    the module runs it. Classes of pymoo's are wired as ``nsga2`` is (:class:`PopulationAlgorithm`).

    Examples
    --------
    >>> from botohe_moo import make_algorithm
    >>> make_algorithm("bo-aco", n_ants=50).n_ants
    50
    >>> make_algorithm("pymoo.algorithms.moo.age:AGEMOEA", pop_size=60).pop_size
    60
    """
    factory = find_algorithm(name)
    source, accepted = ALGORITHMS.source(name), accepted_by(factory)
    made: Algorithm = p.call_factory(source, factory, accepted, parameters, wanted=Algorithm)
    return made


def algorithm_names() -> tuple[str, ...]:
    """Return the names that :func:`make_algorithm` knows, with warnings for what cannot be loaded.

    Examples
    --------
    >>> from botohe_moo import algorithm_names
    >>> "pareto-local-search" in algorithm_names()
    True
    """
    return tuple(ALGORITHMS.loaded())


def algorithm_parameters(name: str) -> tuple[p.Parameter, ...]:
    """Return the parameters that an algorithm states, in the order of its signature."""
    return accepted_by(find_algorithm(name))


def describe_algorithm(name: str) -> str:
    """Return the summary at the beginning of an algorithm's docstring, which may be empty."""
    return p.summary_of(find_algorithm(name))


def plans_for_kinds(name: str) -> bool:
    """Return whether an algorithm supports missions with kinds of robots and rewards on return.

    Algorithms that do not say are taken to do so.

    Examples
    --------
    >>> plans_for_kinds("bo-aco"), plans_for_kinds("exact")
    (True, False)
    """
    supports = getattr(find_algorithm(name), "supports", None)
    return supports is None or supports(load_mission("drones_and_rovers"))


def find_algorithm(name: str) -> Callable[..., Any]:
    """Import the factory of an algorithm; a ValueError says why it cannot be loaded or called."""
    if not isinstance(name, str):
        raise ValueError(f"Expected the name of an algorithm, got {name!r}.")
    try:
        found: Callable[..., Any] = ALGORITHMS.find(name, makes=Algorithm)
    except PluginError as error:
        raise ParameterError(f"{error}.", source=ALGORITHMS.source(name)) from error
    if is_path(name):
        from botohe_moo.algorithms.genetic.algorithms import wired  # loads all operators

        return wired(name, found)
    return found


@functools.lru_cache(maxsize=64)  # a grid asks for every combination
def accepted_by(factory: Callable[..., Any]) -> tuple[p.Parameter, ...]:
    """Return the parameters that a factory states, without pymoo's own options."""
    return p.accepted_parameters(factory, hidden=_PYMOOS_OWN)
