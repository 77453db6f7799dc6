"""Algorithms by their dotted path; pymoo's own classes get this package's operators."""

from __future__ import annotations

import copy
import functools
import inspect
from collections.abc import Callable
from typing import Any

import numpy as np
from pymoo.algorithms.base.genetic import GeneticAlgorithm

from botohe_moo._plugins.checks import checked
from botohe_moo._plugins.factories import named
from botohe_moo._plugins.types import Count
from botohe_moo.algorithms.population import (
    PopulationAlgorithm,
    PopulationSize,
    even_weights,
    genetic_sizes,
    keyword_only,
)

# What the wiring, or the caller of ``minimize``, gives to every class of pymoo's.
_TAKEN_CARE_OF = frozenset(
    {"sampling", "crossover", "mutation", "repair", "eliminate_duplicates", "output", "mating"}
    | {"pop_size", "n_offsprings"}
)
# Objects that belong to the algorithm: passed on as pymoo has them, not for users to give.
_INNER = frozenset({"selection", "survival"})

# Classes that cannot keep what is promised of all, by the module they stand in.
_REFUSED = {
    "pymoo.algorithms.soo": "it minimises one objective",
    "pymoo.algorithms.moo.dnsga2": "it evaluates plans beside any budget, for problems that change",
    "pymoo.algorithms.moo.kgb": "it evaluates plans beside any budget, for problems that change",
    "pymoo.algorithms.moo.moead": "it is wired already, as 'moead'",
    "pymoo.algorithms.moo.omni": "it measures distances between real vectors",
    "pymoo.algorithms.moo.pinsga2": "it asks for answers at the keyboard",
}

_DOCSTRING = """{0} of pymoo's, with operators for trail plans.

Parameters
----------
pop_size
    Plans in the population; where there are ``ref_dirs``, their number.
n_offsprings
    Plans that a generation adds; default: as pymoo has it.
"""
_DIRECTIONS = """ref_dirs
    Directions, shape (n, 2); default: ``pop_size`` of them, spread evenly.
"""


def wired(path: str, found: Callable[..., Any]) -> Callable[..., Any]:
    """Wire a class of pymoo's with this package's operators; give others back as they are.

    A ValueError is raised for a class of pymoo's that is not population-based or cannot be wired.
    """
    if getattr(found, "__module__", "").partition(".")[0] != "pymoo":
        return found
    if not (isinstance(found, type) and issubclass(found, GeneticAlgorithm)):
        raise ValueError(
            f"Algorithm {path!r}: expected a population-based class of pymoo's, derived from "
            f"GeneticAlgorithm, got {found!r}."
        )
    for module, reason in _REFUSED.items():
        if f"{found.__module__}.".startswith(f"{module}."):
            raise ValueError(f"Algorithm {path!r}: cannot be wired; {reason}.")
    return _wire(path, found)


@functools.cache
def _wire(path: str, wrapped: type[GeneticAlgorithm]) -> type[PopulationAlgorithm]:
    """Derive a class from one of pymoo's, whose own parameters it states."""
    stated = inspect.signature(wrapped).parameters
    own = {
        name: parameter.replace(
            kind=inspect.Parameter.KEYWORD_ONLY, annotation=_annotation(parameter)
        )
        for name, parameter in stated.items()
        if name not in _TAKEN_CARE_OF and parameter.kind is parameter.POSITIONAL_OR_KEYWORD
    }
    directed = "ref_dirs" in own
    if directed:
        own["ref_dirs"] = own["ref_dirs"].replace(default=None, annotation=np.ndarray | None)

    @checked
    def __init__(  # noqa: N807
        self: PopulationAlgorithm,
        *,
        pop_size: PopulationSize = 100,
        n_offsprings: Count | None = None,
        **parameters: Any,
    ) -> None:
        sizes = genetic_sizes(pop_size, n_offsprings)
        # Copies: the objects that pymoo's signatures hold remember the fronts of other runs.
        arguments = {
            name: copy.deepcopy(parameters.pop(name, parameter.default))
            for name, parameter in own.items()
            if name in parameters or parameter.default is not parameter.empty
        }
        if directed and arguments["ref_dirs"] is None:
            arguments["ref_dirs"] = even_weights(sizes["pop_size"])
        if directed:
            del sizes["pop_size"]  # there are as many plans as directions
        PopulationAlgorithm.__init__(self, {**arguments, **sizes}, **parameters)

    def __reduce_ex__(self: PopulationAlgorithm, _: object) -> tuple[object, ...]:  # noqa: N807
        return _revive, (path,), self.__dict__

    shown = [parameter for name, parameter in own.items() if name not in _INNER]
    parameters = [*keyword_only(__init__), *shown, *keyword_only(PopulationAlgorithm)]
    return type(
        wrapped.__name__,
        (PopulationAlgorithm, wrapped),
        {
            "__init__": __init__,
            "__reduce_ex__": __reduce_ex__,
            "__signature__": inspect.Signature(parameters),
            "__doc__": _DOCSTRING.format(wrapped.__name__) + _DIRECTIONS * directed,
        },
    )


def _annotation(parameter: inspect.Parameter) -> Any:
    """Give the type of a parameter; where pymoo states none, its default may show it."""
    shown = type(parameter.default)
    if parameter.annotation is parameter.empty and shown in (int, float, bool, str):
        return shown
    return parameter.annotation


def _revive(path: str) -> PopulationAlgorithm:
    """Make an empty instance for unpickling: classes made here have no name to be found by."""
    found = _wire(path, named(path))
    return found.__new__(found)
