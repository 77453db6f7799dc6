"""Operators by name: those of this package and those that other packages register."""

import contextlib
import warnings
from collections.abc import Callable, Mapping
from typing import Any, TypeAlias

from pymoo.core.crossover import Crossover
from pymoo.core.mutation import Mutation
from pymoo.core.repair import Repair
from pymoo.core.sampling import Sampling

from botohe_moo.base.messages import ParameterError, PluginError, nearest_first, quoted
from botohe_moo.base.parameters import signature_parameters, takes_any_name
from botohe_moo.base.registry import Registry, is_path, says_it_makes

Factory: TypeAlias = Callable[..., Any]

# The kinds of operators, by the parameters of algorithms that take them.
KINDS: Mapping[str, type] = {
    "sampling": Sampling,
    "crossover": Crossover,
    "mutation": Mutation,
    "repair": Repair,
}
OPERATORS = Registry("botohe_moo.operators", "operator")


def find_operator(kind: str, name: Any) -> Factory:
    """Import what makes an operator of a kind: ``sampling``, ``crossover``, ...

    ``name`` is a registered one or ``module:Class``. A ParameterError says what keeps it from being
    used.
    """
    if not isinstance(name, str) or not (is_path(name) or name in OPERATORS):
        raise _unknown(kind, name)
    if name.startswith("pymoo."):
        raise _fault(kind, name, "pymoo's own operators do not work on trail plans")
    try:
        factory: Factory = OPERATORS.find(name, makes=KINDS[kind])
    except PluginError as error:
        raise _fault(kind, name, str(error)) from error
    if isinstance(factory, type) and not says_it_makes(factory, KINDS[kind]):
        raise _unknown(kind, name, f", which is not derived from pymoo's {KINDS[kind].__name__}")
    return factory


def _unknown(kind: str, name: object, why: str = "") -> ParameterError:
    """Return the error for what is not an operator of a kind; it lists those that are."""
    with warnings.catch_warnings(action="ignore"):
        found = OPERATORS.loaded()
    known = [one for one, factory in found.items() if says_it_makes(factory, KINDS[kind])]
    among = ", ".join(nearest_first(str(name), known))
    return ParameterError(f"Expected {kind} among {among}, got {quoted(name)}{why}.", kind)


def named_operators(parameters: Mapping[str, Any]) -> list[tuple[str, Factory]]:
    """List the path and the factory of each operator that parameters name.

    What is not the name of an operator is left out.
    """
    found: list[tuple[str, Factory]] = []
    for kind in KINDS.keys() & parameters.keys():
        given = parameters[kind]
        names = [given] if isinstance(given, str) else given if isinstance(given, Mapping) else ()
        for name in names:
            with contextlib.suppress(ParameterError):
                factory = find_operator(kind, name)
                path = name if is_path(name) else OPERATORS.entries[name].value
                found.append((path, factory))
    return sorted(found, key=lambda pair: pair[0])


def make_operator(kind: str, name: Any, wanted: type, **offered: Any) -> Any:
    """Make the operator of that name, with those offered parameters that its factory takes.

    A ParameterError is raised if it cannot be made, or is not of the class ``wanted``.
    """
    factory = find_operator(kind, name)
    try:
        made = factory(**_taken_options(factory, offered))
    except (Exception, SystemExit) as error:  # whatever another package's code may raise
        raise _fault(kind, name, f"cannot be made ({type(error).__name__}: {error})") from error
    if not isinstance(made, wanted):
        found = f"expected an object of type {wanted.__name__}, got {type(made).__qualname__}"
        raise _fault(kind, name, found)
    return made


def _fault(kind: str, name: str, found: str) -> ParameterError:
    return ParameterError(f"{kind.capitalize()} {quoted(name)}: {found}.", kind)


def _taken_options(factory: Factory, offered: Mapping[str, Any]) -> dict[str, Any]:
    """Return the offered parameters that a factory's signature names, or all if it takes any.

    Classes that derive from pymoo's only take other parameters under such names: they get ``prob``.
    """
    names = {parameter.name for parameter in signature_parameters(factory)}
    if takes_any_name(factory):
        bases = getattr(factory, "__mro__", ())
        pymoos = bases and not any(base.__module__.startswith("botohe_moo.") for base in bases)
        names |= {"prob"} if pymoos else offered.keys()
    return {name: value for name, value in offered.items() if name in names}
