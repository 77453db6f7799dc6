"""Operators by name: those of this package, and those that other packages register."""

import contextlib
import functools
import inspect
import warnings
from collections.abc import Callable, Iterator, Mapping
from typing import Any, TypeAlias

from pymoo.core.crossover import Crossover
from pymoo.core.mutation import Mutation
from pymoo.core.repair import Repair
from pymoo.core.sampling import Sampling

from botohe_moo._base.checks import ParameterError, nearest_first, quoted
from botohe_moo._plugins.entry_points import PluginError, PluginGroup
from botohe_moo._plugins.factories import declared_factory, is_path, says_it_makes
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
        if name in _PLUGINS.claims():
            warnings.warn(
                f"{_PLUGINS.source(name)} of another package is left out as a {kind}: botohe-moo "
                "has it.",
                stacklevel=2,
            )
        return BUILT_IN[kind][name]
    if not isinstance(name, str) or not (is_path(name) or name in _PLUGINS.claims()):
        raise ParameterError(_unknown(kind, name), kind)
    try:
        if not is_path(name):
            factory = _PLUGINS.load(name)
        elif name.partition(".")[0] == "pymoo":
            raise PluginError("pymoo's own operators do not work on trail plans")
        else:
            factory = declared_factory(name, _PLUGINS, KINDS[kind])
        if other := _other_kind(kind, factory):
            raise PluginError(f"expected {_a(kind)}, got {_a(other)}")
    except PluginError as error:
        raise ParameterError(f"{_source(kind, name)}: {error}.", kind) from error
    return factory


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
        got = f"an object of type {type(made).__qualname__}"
        raise ParameterError(
            f"{_source(kind, name)}: expected {_a(wanted.__name__)}, got {got}.", kind
        )


def _source(kind: str, name: str) -> str:
    return f"{kind.capitalize()} {quoted(name)}"


def _a(noun: str) -> str:
    return f"{'an' if noun[0] in 'AEIOUaeiou' else 'a'} {noun}"


def _unknown(kind: str, name: Any) -> str:
    """Say that there is no operator of that name, and which there are, nearest first."""
    known = {*BUILT_IN[kind], *_registered(kind)}
    got = quoted(name)
    for other, built_in in BUILT_IN.items():
        if isinstance(name, str) and name in built_in:
            got = f"the {other} {got}"
    among = ", ".join(nearest_first(str(name), known))
    return f"Expected {kind} among {among}, got {got}."


def _registered(kind: str) -> Iterator[str]:
    """Give the names of other packages' operators that can be loaded and may be of a kind."""
    for name in _PLUGINS.claims():
        with contextlib.suppress(PluginError), warnings.catch_warnings(action="ignore"):
            if not _other_kind(kind, _PLUGINS.load(name)):
                yield name


def _other_kind(kind: str, factory: Factory) -> str | None:
    """Give the kind, if any, that a factory says it makes; None where it may be the wanted one."""
    if says_it_makes(factory, KINDS[kind]):
        return None
    said = [other for other, wanted in KINDS.items() if says_it_makes(factory, wanted)]
    if not said and isinstance(factory, type):
        return (
            f"class {factory.__qualname__} that is not derived from pymoo's {KINDS[kind].__name__}"
        )
    return said[0] if said else None


def _taken(factory: Factory, offered: Mapping[str, Any]) -> dict[str, Any]:
    """Choose what a factory takes: what its signature states, or a base that ``**options`` go to.

    Of pymoo's own constructors only ``prob``: a class hands over the number of children itself.
    """
    while isinstance(factory, functools.partial):
        factory = factory.func
    if not isinstance(factory, type):
        return _stated(factory, offered)[0]
    taken: dict[str, Any] = {}
    for base in factory.__mro__:
        if "__init__" in vars(base):
            theirs, going_on = _stated(vars(base)["__init__"], offered, closed=True)
            pymoos = base.__module__.partition(".")[0] == "pymoo"
            taken |= {name: v for name, v in theirs.items() if not pymoos or name == "prob"}
            if not going_on:
                break
    return taken


def _stated(
    function: Factory, offered: Mapping[str, Any], *, closed: bool = False
) -> tuple[dict[str, Any], bool]:
    """Choose what a signature names, or anything if it has ``**``; and tell whether it has."""
    parameters = inspect.signature(function).parameters
    takes_any = any(p.kind is p.VAR_KEYWORD for p in parameters.values())
    names = offered if takes_any and not closed else parameters
    return {name: value for name, value in offered.items() if name in names}, takes_any
