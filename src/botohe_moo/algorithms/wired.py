"""pymoo's population-based classes by their dotted path, with operators for trail plans."""

import copy
import functools
import inspect
from collections.abc import Callable
from pkgutil import resolve_name
from typing import Any

import numpy as np
from pymoo.algorithms.base.genetic import GeneticAlgorithm

from botohe_moo._plugins.checks import checked
from botohe_moo._plugins.types import Count
from botohe_moo.algorithms.population import (
    PopulationAlgorithm,
    PopulationSize,
    even_weights,
    genetic_sizes,
)

# What the wiring, or the caller of ``minimize``, gives to every class of pymoo's.
_TAKEN_CARE_OF = frozenset(
    {"sampling", "crossover", "mutation", "repair", "eliminate_duplicates", "output", "mating"}
    | {"pop_size", "n_offsprings"}
)
# Objects that belong to the algorithm: passed on as pymoo has them, not for users to give.
_INNER = frozenset({"selection", "survival"})

# Classes that cannot keep what is promised of all, by the module that defines them.
_REFUSED = {
    "pymoo.algorithms.soo": "it minimises one objective",
    "pymoo.algorithms.moo.ctaea": (
        "it never ends where there are fewer plans than directions, which is what leaving out "
        "duplicates does"
    ),
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
    """Wire a class of pymoo's with this package's operators; return others as they are.

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
    own = {
        name: parameter
        for name, parameter in inspect.signature(wrapped).parameters.items()
        if name not in _TAKEN_CARE_OF and parameter.kind is parameter.POSITIONAL_OR_KEYWORD
    }
    directed = "ref_dirs" in own
    if directed:
        own["ref_dirs"] = own["ref_dirs"].replace(default=None, annotation=np.ndarray | None)

    class Wired(PopulationAlgorithm, wrapped):
        __doc__ = _DOCSTRING.format(wrapped.__name__) + _DIRECTIONS * directed

        @checked
        def __init__(
            self,
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
            if directed:  # there are as many plans as directions
                size = sizes.pop("pop_size")
                if arguments["ref_dirs"] is None:
                    arguments["ref_dirs"] = even_weights(size)
            super().__init__({**arguments, **sizes}, **parameters)

        def __reduce_ex__(self, _: object) -> tuple[object, ...]:
            return _revive, (path,), self.__dict__

    Wired.__name__ = Wired.__qualname__ = wrapped.__name__
    pop_size, n_offsprings, *operators, _ = inspect.signature(Wired).parameters.values()
    shown = [_stated(parameter) for name, parameter in own.items() if name not in _INNER]
    Wired.__signature__ = inspect.Signature([pop_size, n_offsprings, *shown, *operators])
    return Wired


def _stated(parameter: inspect.Parameter) -> inspect.Parameter:
    """Return a parameter by name; where pymoo states no type, its default may show it."""
    shown = type(parameter.default)
    annotation = parameter.annotation
    if annotation is parameter.empty and shown in (int, float, bool, str):
        annotation = shown
    return parameter.replace(kind=parameter.KEYWORD_ONLY, annotation=annotation)


def _revive(path: str) -> PopulationAlgorithm:
    """Make an empty instance for unpickling: classes made here have no name to be found by."""
    found = _wire(path, resolve_name(path))
    return found.__new__(found)
