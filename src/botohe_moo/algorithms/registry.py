"""Algorithms by name: those of this package and those that other packages register."""

from __future__ import annotations

import functools
import hashlib
import inspect
import sys
from collections.abc import Callable, Mapping
from importlib import metadata
from pathlib import Path
from typing import Any

from pymoo.core.algorithm import Algorithm

from botohe_moo._parameters import (
    Accepted,
    Fault,
    Parameter,
    accepted_parameters,
    call_factory,
    check_values,
    docstring_of,
    raised_fault,
)
from botohe_moo._plugins import PluginError, PluginGroup
from botohe_moo.algorithms.wired import wired_class

__all__ = [
    "AlgorithmParameter",
    "algorithm_names",
    "algorithm_origin",
    "algorithm_parameters",
    "check_algorithm",
    "describe_algorithm",
    "make_algorithm",
]

AlgorithmParameter = Parameter

_PLUGINS = PluginGroup("botohe_moo.algorithms", "algorithm")
# Who runs an algorithm decides on these, through ``minimize``.
_PYMOOS_OWN = frozenset(inspect.signature(Algorithm).parameters)
# Their versions say what they are; of all else, the file does.
_VERSIONED = frozenset({"botohe_moo", "pymoo"})


def make_algorithm(name: str, /, **parameters: Any) -> Algorithm:
    """Make the algorithm of that name.

    Parameters
    ----------
    name
        One of :func:`algorithm_names`, or ``module:Class``.
    **parameters
        Its parameters; :func:`algorithm_parameters` lists them. pymoo's own options, such as
        ``callback`` and ``verbose``, are for ``minimize``.

    Returns
    -------
    pymoo.core.algorithm.Algorithm
        Ready for pymoo's ``minimize``.

    Raises
    ------
    ValueError
        If there is no such algorithm (lists the known ones, nearest first), it cannot be imported,
        or a parameter is unknown, missing, or out of its range.

    Notes
    -----
    Packages register algorithms in the entry-point group ``botohe_moo.algorithms``: callables
    that return a pymoo algorithm. They state their parameters by a typed signature, with ranges as
    in ``Annotated[float, Field(gt=0)]``, or by a pydantic model, their attribute ``Parameters``,
    which checks and converts values before these are handed over as keywords. Only parameters that
    are stated can be given: what pymoo's algorithms take as ``**kwargs`` would swallow every
    misspelt name.

    ``module:Class`` names one that nobody has registered; classes of pymoo's own are wired with
    this package's operators and an archive of all non-dominated plans, as ``nsga2`` is
    (:class:`PopulationAlgorithm`).

    Examples
    --------
    >>> make_algorithm("bo-aco", n_ants=50).n_ants
    50
    >>> make_algorithm("pymoo.algorithms.moo.age:AGEMOEA", pop_size=60).pop_size
    60
    """
    factory = _load(name)
    return _made(name, factory, _accepted(factory), parameters)


def check_algorithm(
    name: str, parameters: Mapping[str, Any] | None = None, *, plain: bool = False
) -> list[Fault]:
    """Say everything that keeps :func:`make_algorithm` from making an algorithm.

    Where names and types are right, the algorithm is made, to hear what its constructor says.

    Parameters
    ----------
    name
        One of :func:`algorithm_names`, or ``module:Class``.
    parameters
        Its parameters, by name.
    plain
        Whether they are from a text file: what only Python objects can be is refused.

    Returns
    -------
    list
        Pairs of a parameter's name, None for the whole, and what is wrong; empty if nothing is.

    Examples
    --------
    >>> check_algorithm("bo-aco", {"n_ants": "100", "evaporation": 0.5})
    [('n_ants', "Expected n_ants to be an integer, got '100'.")]
    >>> check_algorithm("bo-aco", {"evaporation": 1.3})
    [('evaporation', 'Expected evaporation in (0, 1), got 1.3.')]
    """
    given = {} if parameters is None else parameters
    if not isinstance(given, Mapping):
        return [(None, f"Expected parameters to be a mapping from names to values, got {given!r}.")]
    try:
        factory = _load(name)
    except ValueError as error:
        return [(None, str(error).removeprefix(f"{_source(name)}: "))]
    accepted = _accepted(factory)
    if faults := check_values(accepted, given, plain=plain):
        return faults
    try:
        _made(name, factory, accepted, given)
    except (Exception, SystemExit) as error:  # whatever another package's code may raise
        return [raised_fault(error, given, source=_source(name))]
    return []


def algorithm_names() -> tuple[str, ...]:
    """Give the names that :func:`make_algorithm` knows, sorted.

    What cannot be imported, or has the name of another package's algorithm, is left out with a
    warning that names it.
    """
    return _PLUGINS.names()


def algorithm_parameters(name: str) -> tuple[AlgorithmParameter, ...]:
    """List the parameters that an algorithm states, in the order of its signature.

    A factory such as :meth:`BOACO.journal` states what it changes, and its class the rest.

    Raises
    ------
    ValueError
        If there is no such algorithm, or it cannot be imported.
    """
    return _accepted(_load(name)).parameters


def describe_algorithm(name: str) -> str:
    """Give the summary that an algorithm's docstring begins with; may be empty.

    Raises
    ------
    ValueError
        If there is no such algorithm, or it cannot be imported.
    """
    summary = docstring_of(_load(name)).partition("\n\n")[0]
    return " ".join(summary.split())


def _source(name: str) -> str:
    """Say in a message whom it is about."""
    return f"Algorithm {name!r}"


def _is_path(name: str) -> bool:
    return ":" in name or "." in name


def _load(name: str) -> Callable[..., Any]:
    if not isinstance(name, str):
        raise ValueError(f"Expected the name of an algorithm, got {name!r}.")
    if _is_path(name):
        return wired_class(name)
    try:
        return _PLUGINS.load(name)
    except PluginError as error:
        raise ValueError(f"{_source(name)}: {error}.") from error


def _accepted(factory: Callable[..., Any]) -> Accepted:
    return accepted_parameters(factory, hidden=_PYMOOS_OWN, closed=True)


def _made(
    name: str, factory: Callable[..., Any], accepted: Accepted, parameters: Mapping[str, Any]
) -> Algorithm:
    algorithm = call_factory(_source(name), factory, accepted, parameters)
    if not isinstance(algorithm, Algorithm):
        raise ValueError(f"{_source(name)}: expected a pymoo Algorithm, got {algorithm!r}.")
    return algorithm


def algorithm_origin(name: str) -> dict[str, str | None]:
    """Say where an algorithm's code is from, to tell results of other code apart.

    Parameters
    ----------
    name
        One of :func:`algorithm_names`, or ``module:Class``.

    Returns
    -------
    dict
        ``package`` and ``version`` of the distribution that registers it, or of the one that owns
        its module; None where there is none. ``source`` is the SHA-256 of its module's file, and
        None for modules of this package and pymoo's, which their versions tell. Other modules that
        it imports are not looked at.

    Raises
    ------
    ValueError
        If there is no such algorithm, or it cannot be imported.
    """
    factory = _load(name)
    if _is_path(name):
        module = _module_of(name)
        owner = _distribution_of(module.partition(".")[0])
    else:
        entry = _PLUGINS.entry(name)
        module, owner = entry.module, entry.dist
    return {
        "package": owner.name if owner else None,
        "version": owner.version if owner else None,
        "source": _source_digest(module, factory),
    }


def _module_of(path: str) -> str:
    """Give the module's part of ``module:Class`` or ``module.Class``, which is imported already."""
    module, colon, _ = path.partition(":")
    while not colon and "." in module and module not in sys.modules:
        module = module.rpartition(".")[0]
    return module


@functools.cache
def _distribution_of(package: str) -> metadata.Distribution | None:
    """Find who has installed a top-level package; one that only lies on the path has nobody."""
    # What is installed for editing lists none of its modules, but often has its package's name.
    for owner in (*metadata.packages_distributions().get(package, ()), package):
        try:
            return metadata.distribution(owner)
        except metadata.PackageNotFoundError:
            pass
    return None


def _source_digest(module: str, factory: Any) -> str | None:
    """Digest the file that names a factory, and the one that defines it."""
    while isinstance(factory, functools.partial):
        factory = factory.func
    digest = None
    for name in dict.fromkeys([module, getattr(factory, "__module__", None) or module]):
        file = getattr(sys.modules.get(name), "__file__", None)
        if name.partition(".")[0] not in _VERSIONED and file and Path(file).is_file():
            digest = digest or hashlib.sha256()
            digest.update(Path(file).read_bytes())
    return digest.hexdigest() if digest else None
