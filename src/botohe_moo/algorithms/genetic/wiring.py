"""Operators by name, or names with weights, as algorithms and study files give them."""

import contextlib
import inspect
import warnings
from collections.abc import Callable, Iterator, Mapping
from typing import Any, TypeAlias

from pymoo.core.crossover import Crossover
from pymoo.core.mutation import Mutation
from pymoo.core.repair import Repair
from pymoo.core.sampling import Sampling

from botohe_moo._base.checks import ParameterError, check_weights, nearest_first, quoted
from botohe_moo._plugins.entry_points import (
    PluginError,
    PluginGroup,
    declared_factory,
    is_path,
    says_it_makes,
)
from botohe_moo.algorithms.genetic.sampling import (
    CornerSampling,
    GivenSampling,
    GuidedTrailSampling,
    MixedSampling,
    PlanSampling,
)
from botohe_moo.operators.repair import PlanRepair
from botohe_moo.operators.variation import MixedCrossover, MixedMutation, TrailSplice

Factory: TypeAlias = Callable[..., Any]
# The name of one operator, or of several with their weights.
Named: TypeAlias = str | Mapping[str, float]

# Chosen from the ablation that `make bench` prints (results/operators/ablation.csv).
DEFAULT_CROSSOVER = "splice"
DEFAULT_MUTATION: Mapping[str, float] = {"ruin": 1.0, "share": 0.2}

# The kinds of operators, by the parameters of algorithms that take them.
KINDS: Mapping[str, type] = {
    "sampling": Sampling,
    "crossover": Crossover,
    "mutation": Mutation,
    "repair": Repair,
}
_PLUGINS = PluginGroup("botohe_moo.operators", "operator")


def find_operator(kind: str, name: Any) -> Factory:
    """Import what makes an operator of a kind: ``sampling``, ``crossover``, ...

    ``name`` is a registered one or ``module:Class``. A ParameterError says what keeps it from being
    used.
    """
    if not isinstance(name, str) or not (is_path(name) or name in _PLUGINS.claims()):
        raise _unknown(kind, name)
    try:
        if not is_path(name):
            factory = _PLUGINS.load(name)
        elif name.partition(".")[0] == "pymoo":
            raise PluginError("pymoo's own operators do not work on trail plans")
        else:
            factory = declared_factory(name, _PLUGINS, KINDS[kind])
    except PluginError as error:
        raise _fault(kind, name, str(error)) from error
    if isinstance(factory, type) and not says_it_makes(factory, KINDS[kind]):
        why = f", which is not derived from pymoo's {KINDS[kind].__name__}"
        raise _unknown(kind, name, why)
    return factory


def _unknown(kind: str, name: object, why: str = "") -> ParameterError:
    """Return the error for what is not an operator of a kind; it lists those that are."""
    among = ", ".join(nearest_first(str(name), _registered(kind)))
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
                path = name if is_path(name) else _PLUGINS.entry(name).value
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
        found = f"{type(error).__name__}: {error}"
        raise _fault(kind, name, f"cannot be made ({found})") from error
    if not isinstance(made, wanted):
        found = f"expected an object of type {wanted.__name__}, got {type(made).__qualname__}"
        raise _fault(kind, name, found)
    return made


def _fault(kind: str, name: str, found: str) -> ParameterError:
    return ParameterError(f"{kind.capitalize()} {quoted(name)}: {found}.", kind)


def _registered(kind: str) -> Iterator[str]:
    """List the names of registered operators that state that they are of a kind."""
    for name in _PLUGINS.claims():
        with contextlib.suppress(PluginError), warnings.catch_warnings(action="ignore"):
            if says_it_makes(_PLUGINS.load(name), KINDS[kind]):
                yield name


def _taken_options(factory: Factory, offered: Mapping[str, Any]) -> dict[str, Any]:
    """Return the offered parameters that a factory's signature names, or all if it takes any.

    Classes that derive from pymoo's only take other parameters under such names: they get ``prob``.
    """
    parameters = inspect.signature(factory).parameters
    names = set(parameters)
    if any(p.kind is p.VAR_KEYWORD for p in parameters.values()):
        bases = getattr(factory, "__mro__", ())
        pymoos = bases and not any(base.__module__.startswith("botohe_moo.") for base in bases)
        names |= {"prob"} if pymoos else offered.keys()
    return {name: value for name, value in offered.items() if name in names}


def _weights(kind: str, given: Any, *, needed: str = "") -> dict[str, float]:
    """Return the weights above 0 of operators, given one name or a mapping from names."""
    if isinstance(given, str):
        return {given: 1.0}
    weights = check_weights(kind, given, given, needed=needed)
    for name in weights:  # also of weight 0
        find_operator(kind, name)
    return {name: weight for name, weight in weights.items() if weight}


def make_repair(given: str | PlanRepair) -> PlanRepair:
    """Make a repair: ``safest-path``, ``truncate``, ``penalty`` or that of another package."""
    if isinstance(given, PlanRepair):
        return given
    return make_operator("repair", given, PlanRepair)  # type: ignore[no-any-return]


def make_sampling(given: Named | Sampling | Any, *, corners: bool = True) -> Sampling:
    """Make a sampling of ``guided``, ``random`` and others, from one name or names with weights.

    A pymoo sampling is returned as it is. Where trail plans are given but too few, guided ones are
    added. With ``corners`` the corners of the front are among the plans.
    """
    if isinstance(given, Sampling):
        return given
    if not isinstance(given, str | Mapping):
        rest = GuidedTrailSampling()
        return GivenSampling(given, CornerSampling(rest) if corners else rest)
    weights = _weights("sampling", given, needed="sampling")
    wanted = PlanSampling if len(weights) > 1 else Sampling  # pymoo's only by itself
    parts = {make_operator("sampling", name, wanted): w for name, w in weights.items()}
    if not all(isinstance(part, PlanSampling) for part in parts):
        return next(iter(parts))
    sampling = MixedSampling(parts)
    return CornerSampling(sampling) if corners else sampling


def make_crossover(
    given: Named | Crossover, *, prob: float, repair: PlanRepair, n_offsprings: int = 2
) -> Crossover:
    """Make a crossover of ``splice`` and others; return a pymoo crossover as it is.

    Without any weight above 0, no pair is crossed.
    """
    if isinstance(given, Crossover):
        return given
    if not (weights := _weights("crossover", given)):
        return TrailSplice(prob=0.0, n_offsprings=n_offsprings)
    offered = {"repair": repair, "n_offsprings": n_offsprings}
    return MixedCrossover(_parts("crossover", weights, prob=prob, **offered), prob=prob)


def make_mutation(given: Named | Mutation, *, prob: float, repair: PlanRepair) -> Mutation:
    """Make a mutation of ``ruin``, ``share`` and others; return a pymoo one as it is."""
    if isinstance(given, Mutation):
        return given
    weights = _weights("mutation", given, needed="mutation")
    return MixedMutation(_parts("mutation", weights, prob=prob, repair=repair), prob=prob)


def _parts(kind: str, weights: Mapping[str, float], **offered: Any) -> dict[Any, float]:
    """Make operators of names with weights."""
    return {make_operator(kind, k, KINDS[kind], **offered): w for k, w in weights.items()}
