"""Algorithms by name: those of this package and those that other packages register."""

from __future__ import annotations

import inspect
import re
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from pymoo.core.algorithm import Algorithm

from botohe_moo._checks import check_parameters
from botohe_moo._plugins import PluginError, PluginGroup

__all__ = [
    "AlgorithmParameter",
    "algorithm_names",
    "algorithm_parameters",
    "describe_algorithm",
    "make_algorithm",
]

_PLUGINS = PluginGroup("botohe_moo.algorithms", "algorithm")


@dataclass(frozen=True)
class AlgorithmParameter:
    """One parameter of an algorithm, as its signature and docstring state it.

    Attributes
    ----------
    name, default, annotation
        From the signature; ``default`` is ``inspect.Parameter.empty`` where one must be given,
        ``annotation`` is text.
    description
        From the docstring; may be empty.
    """

    name: str
    default: Any
    annotation: str
    description: str


def make_algorithm(name: str, **parameters: Any) -> Algorithm:
    """Make the algorithm of that name.

    Parameters
    ----------
    name
        One of :func:`algorithm_names`.
    **parameters
        Its parameters; :func:`algorithm_parameters` lists them.

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
    that take keyword parameters and return a pymoo algorithm.

    Examples
    --------
    >>> make_algorithm("bo-aco", n_ants=50).n_ants
    50
    """
    factory = _load(name)
    source = _PLUGINS.source(name)
    check_parameters(source, parameters, [known.name for known in algorithm_parameters(name)])
    try:
        inspect.signature(factory).bind(**parameters)
    except TypeError as error:
        raise ValueError(f"{source}: {error}.") from None
    try:
        algorithm = factory(**parameters)
    except ValueError as error:
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
    """List the parameters that an algorithm states.

    Raises
    ------
    ValueError
        If there is no such algorithm, or it cannot be imported.
    """
    factory = _load(name)
    stated: dict[str, AlgorithmParameter] = {}
    # A factory such as BOACO.journal states what it changes and hands the rest to its class.
    for function in (factory, getattr(factory, "__self__", None)):
        if callable(function):
            described = _described(function)
            for parameter in inspect.signature(function).parameters.values():
                if parameter.kind in (parameter.VAR_KEYWORD, parameter.VAR_POSITIONAL):
                    continue
                known = AlgorithmParameter(
                    parameter.name,
                    parameter.default,
                    str(parameter.annotation),
                    described.get(parameter.name, ""),
                )
                stated.setdefault(parameter.name, known)
    return tuple(stated.values())


def describe_algorithm(name: str) -> str:
    """Give the first line of what an algorithm says of itself.

    Raises
    ------
    ValueError
        If there is no such algorithm, or it cannot be imported.
    """
    return (inspect.getdoc(_load(name)) or "").partition("\n")[0]


def _load(name: str) -> Callable[..., Any]:
    try:
        return _PLUGINS.load(name)
    except PluginError as error:
        raise ValueError(f"{_PLUGINS.source(name)}: {error}.") from error


def _described(function: Callable[..., Any]) -> dict[str, str]:
    """Read the Parameters section of a numpydoc docstring."""
    section = re.search(
        r"^Parameters\n-+\n(.*?)(?=^\S[^\n]*\n-+\n|\Z)", inspect.getdoc(function) or "", re.M | re.S
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
