"""Algorithms by name: those of this package and those that other packages register."""

from __future__ import annotations

import functools
import inspect
import re
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from pymoo.core.algorithm import Algorithm

from botohe_moo._checks import check_parameters
from botohe_moo._plugins import PluginError, PluginGroup
from botohe_moo.algorithms.wired import wired_class

__all__ = [
    "AlgorithmParameter",
    "algorithm_names",
    "algorithm_parameters",
    "describe_algorithm",
    "make_algorithm",
]

_PLUGINS = PluginGroup("botohe_moo.algorithms", "algorithm")
_BY_KEYWORD = (inspect.Parameter.KEYWORD_ONLY, inspect.Parameter.POSITIONAL_OR_KEYWORD)
# Who runs an algorithm decides on these, through ``minimize``.
_PYMOOS_OWN = frozenset(inspect.signature(Algorithm).parameters)


@dataclass(frozen=True)
class AlgorithmParameter:
    """One parameter of an algorithm, as its signature and docstring state it.

    Attributes
    ----------
    name, default
        From the signature; ``default`` is ``inspect.Parameter.empty`` where one must be given.
    annotation
        From the signature, as text; empty where there is none.
    description
        From the docstring; may be empty.
    """

    name: str
    default: Any
    annotation: str
    description: str

    @property
    def required(self) -> bool:
        """Whether there is no default."""
        return self.default is inspect.Parameter.empty

    @property
    def plain(self) -> bool:
        """Whether numbers, flags or texts can be its value, as far as the annotation tells."""
        words = r"\b(int|float|bool|str|Any|object|Literal|Real|Integral)\b"
        return not self.annotation or re.search(words, self.annotation) is not None


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
    that return a pymoo algorithm. ``module:Class`` names one that nobody has registered; classes
    of pymoo's own are wired with this package's operators and an archive of all non-dominated
    plans, as ``nsga2`` is (:class:`PopulationAlgorithm`). Only parameters that a signature states
    can be given: what pymoo's algorithms take as ``**kwargs`` would swallow every misspelt name.

    Examples
    --------
    >>> make_algorithm("bo-aco", n_ants=50).n_ants
    50
    >>> make_algorithm("pymoo.algorithms.moo.age:AGEMOEA", pop_size=60).pop_size
    60
    """
    factory = _load(name)
    source = _source(name)
    check_parameters(source, parameters, [known.name for known in algorithm_parameters(name)])
    if signature := _signature(factory):
        try:
            signature.bind(**parameters)
        except TypeError as error:
            raise ValueError(f"{source}: {error}.") from None
    try:
        algorithm = factory(**parameters)
    except (TypeError, ValueError) as error:  # whatever a package says to a value of another type
        raise ValueError(f"{source}: {error}") from error
    if not isinstance(algorithm, Algorithm):
        raise ValueError(f"{source}: expected a pymoo Algorithm, got {algorithm!r}.")
    return algorithm


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
    stated: dict[str, AlgorithmParameter] = {}
    factory = _load(name)
    owner = getattr(factory, "__self__", None)
    functions = [factory]
    if isinstance(owner, type) and _takes_any(factory):
        functions.append(owner)
    for function in functions:
        described = _described(function)
        for parameter in (_signature(function) or inspect.Signature()).parameters.values():
            if parameter.kind not in _BY_KEYWORD or parameter.name in _PYMOOS_OWN:
                continue
            known = stated.get(parameter.name)
            stated[parameter.name] = AlgorithmParameter(
                parameter.name,
                known.default if known else parameter.default,
                known.annotation if known else _annotation(parameter),
                # A factory often only refers to its class, which tells the meaning and the range.
                described.get(parameter.name, known.description if known else ""),
            )
    return tuple(stated.values())


def describe_algorithm(name: str) -> str:
    """Give the summary that an algorithm's docstring begins with; may be empty.

    Raises
    ------
    ValueError
        If there is no such algorithm, or it cannot be imported.
    """
    summary = _docstring(_load(name)).partition("\n\n")[0]
    return " ".join(summary.split())


def _source(name: str) -> str:
    """Say in a message whom it is about."""
    return f"Algorithm {name!r}" if ":" in name or "." in name else _PLUGINS.source(name)


def _load(name: str) -> Callable[..., Any]:
    if not isinstance(name, str):
        raise ValueError(f"Expected the name of an algorithm, got {name!r}.")
    if ":" in name or "." in name:
        return wired_class(name)
    try:
        return _PLUGINS.load(name)
    except PluginError as error:
        raise ValueError(f"{_PLUGINS.source(name)}: {error}.") from error


def _signature(function: Callable[..., Any]) -> inspect.Signature | None:
    try:
        return inspect.signature(function)
    except (TypeError, ValueError):  # some compiled callables do not tell
        return None


def _takes_any(function: Callable[..., Any]) -> bool:
    signature = _signature(function) or inspect.Signature()
    return any(p.kind is p.VAR_KEYWORD for p in signature.parameters.values())


def _annotation(parameter: inspect.Parameter) -> str:
    if parameter.annotation is parameter.empty:
        return ""
    if isinstance(parameter.annotation, str):
        return parameter.annotation
    return inspect.formatannotation(parameter.annotation)


def _docstring(function: Callable[..., Any]) -> str:
    # A partial would answer with what partials are.
    documented = function.func if isinstance(function, functools.partial) else function
    return inspect.getdoc(documented) or ""


def _described(function: Callable[..., Any]) -> dict[str, str]:
    """Read the Parameters section of a numpydoc docstring, and those of a class's bases."""
    if isinstance(function, type):
        described: dict[str, str] = {}
        for base in reversed(function.__mro__[:-1]):
            described |= _described_by(base)
        return described
    return _described_by(function)


def _described_by(function: Callable[..., Any]) -> dict[str, str]:
    section = re.search(
        r"^Parameters\n-+\n(.*?)(?=^\S[^\n]*\n-+\n|\Z)", _docstring(function), re.M | re.S
    )
    described: dict[str, str] = {}
    names: list[str] = []
    for line in section[1].splitlines() if section else []:
        if line[:1].strip():
            names = [name.strip(" *") for name in line.partition(":")[0].split(",")]
        elif line.strip():
            for parameter in names:
                described[parameter] = f"{described.get(parameter, '')} {line.strip()}".strip()
    return described
