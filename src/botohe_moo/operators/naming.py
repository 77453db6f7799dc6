"""Operators by name: those of this package, and those that other packages register."""

import contextlib
import inspect
import warnings
from collections.abc import Callable, Iterator, Mapping
from typing import Any, TypeAlias

from pymoo.core.crossover import Crossover
from pymoo.core.mutation import Mutation
from pymoo.core.repair import Repair
from pymoo.core.sampling import Sampling

from botohe_moo._base.checks import ParameterError, nearest_first, quoted
from botohe_moo._plugins.entry_points import (
    PluginError,
    PluginGroup,
    declared_factory,
    is_path,
    says_it_makes,
)
from botohe_moo.operators.crossover import TrailExchange, TrailSplice
from botohe_moo.operators.mutation import RuinRecreate, SendHome, ShareTrails, TrailMoves
from botohe_moo.operators.repair import PenaltyOnly, SafestPathRepair, TruncateRepair
from botohe_moo.operators.sampling import GuidedTrailSampling, RandomTrailSampling

Factory: TypeAlias = Callable[..., Any]

# What each kind is derived from, and this package's own of that kind. The kinds are called as the
# parameters of algorithms that take them.
KINDS: Mapping[str, type] = {
    "sampling": Sampling,
    "crossover": Crossover,
    "mutation": Mutation,
    "repair": Repair,
}
BUILT_IN: Mapping[str, Mapping[str, Factory]] = {
    "sampling": {"guided": GuidedTrailSampling, "random": RandomTrailSampling},
    "crossover": {"exchange": TrailExchange, "splice": TrailSplice},
    "mutation": {
        "home": SendHome,
        "moves": TrailMoves,
        "ruin": RuinRecreate,
        "share": ShareTrails,
    },
    "repair": {
        "penalty": PenaltyOnly,
        "safest-path": SafestPathRepair,
        "truncate": TruncateRepair,
    },
}
_PLUGINS = PluginGroup("botohe_moo.operators", "operator")


def find_operator(kind: str, name: Any) -> Factory:
    """Import what makes an operator of a kind: ``sampling``, ``crossover``, ...

    ``name`` is one of this package's, one that another package registers, or ``module:Class``. A
    ParameterError says why it cannot be had.
    """
    if isinstance(name, str) and name in BUILT_IN[kind]:
        return BUILT_IN[kind][name]
    if not isinstance(name, str) or not (is_path(name) or name in _PLUGINS.claims()):
        known = nearest_first(str(name), {*BUILT_IN[kind], *_registered(kind)})
        raise ParameterError(f"Expected {kind} among {', '.join(known)}, got {quoted(name)}.", kind)
    try:
        if not is_path(name):
            factory = _PLUGINS.load(name)
        elif name.partition(".")[0] == "pymoo":
            raise PluginError("pymoo's own operators do not work on trail plans")
        else:
            factory = declared_factory(name, _PLUGINS, KINDS[kind])
        if isinstance(factory, type) and not says_it_makes(factory, KINDS[kind]):
            raise PluginError(f"expected a class derived from pymoo's {KINDS[kind].__name__}")
    except PluginError as error:
        raise ParameterError(f"{_source(kind, name)}: {error}.", kind) from error
    return factory


def named_operators(parameters: Mapping[str, Any]) -> list[tuple[str, Factory]]:
    """List ``module:Class`` and what it leads to, of the operators that parameters name.

    Without those of this package; what is not an operator's name is left out.
    """
    found: list[tuple[str, Factory]] = []
    for kind in KINDS.keys() & parameters.keys():
        given = parameters[kind]
        names = [given] if isinstance(given, str) else given if isinstance(given, Mapping) else ()
        for name in [name for name in names if name not in BUILT_IN[kind]]:
            with contextlib.suppress(ParameterError):
                factory = find_operator(kind, name)
                path = name if is_path(name) else _PLUGINS.entry(name).value
                found.append((path, factory))
    return sorted(found, key=lambda pair: pair[0])


def make_operator(kind: str, name: Any, **offered: Any) -> Any:
    """Make the operator of that name, and give it what its constructor takes of what is offered."""
    factory = find_operator(kind, name)
    try:
        made = factory(**_taken(factory, offered))
    except (Exception, SystemExit) as error:  # whatever another package's code may raise
        found = f"{type(error).__name__}: {error}"
        raise ParameterError(f"{_source(kind, name)}: cannot be made ({found}).", kind) from error
    check_operator(kind, name, made, KINDS[kind])
    return made


def check_operator(kind: str, name: str, made: Any, wanted: type) -> None:
    """Refuse, by a ParameterError, what is not of the class that is wanted."""
    if not isinstance(made, wanted):
        expected = f"an object of type {wanted.__name__}"
        got = type(made).__qualname__
        raise ParameterError(f"{_source(kind, name)}: expected {expected}, got {got}.", kind)


def _source(kind: str, name: str) -> str:
    return f"{kind.capitalize()} {quoted(name)}"


def _registered(kind: str) -> Iterator[str]:
    """List the names of other packages' operators that state that they are of a kind."""
    for name in _PLUGINS.claims():
        with contextlib.suppress(PluginError), warnings.catch_warnings(action="ignore"):
            if says_it_makes(_PLUGINS.load(name), KINDS[kind]):
                yield name


def _taken(factory: Factory, offered: Mapping[str, Any]) -> dict[str, Any]:
    """Choose what a factory takes: what its signature names, or all where it takes any name.

    Classes that are derived from pymoo's own only, which take other names for other things, are
    given ``prob`` alone.
    """
    parameters = inspect.signature(factory).parameters
    names = set(parameters)
    if any(p.kind is p.VAR_KEYWORD for p in parameters.values()):
        bases = getattr(factory, "__mro__", ())
        pymoos = bases and not any(base.__module__.startswith("botohe_moo.") for base in bases)
        names |= {"prob"} if pymoos else offered.keys()
    return {name: value for name, value in offered.items() if name in names}
